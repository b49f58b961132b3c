//! Values of flags as they are typed: times, sizes, counts, crops.

use glam::UVec2;
use organza_transport::Crop;
use std::ops::{Range, RangeInclusive};
use std::time::Duration;

/// A crop from "X0,Y0,X1,Y1".
pub fn parse_crop(text: &str) -> Result<Crop, String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x0, y0, x1, y1]) => Ok(Crop::new(UVec2::new(x0, y0), UVec2::new(x1, y1))),
        _ => Err("expected four whole numbers of at least 0, X0,Y0,X1,Y1".into()),
    }
}

/// Two counts "A,B", each at most a thousand.
pub fn parse_counts(text: &str, least: u32) -> Result<[u32; 2], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[a, b]) if [a, b].iter().all(|n| (least..=1000).contains(n)) => Ok([a, b]),
        _ => Err(format!("expected two numbers from {least} to 1000, A,B")),
    }
}

/// Numbers of polar steps and azimuths.
pub fn parse_grid(text: &str) -> Result<[u32; 2], String> {
    parse_counts(text, 1)
}

/// Numbers of polar angles, azimuths and nodes of an adaptive table.
pub fn parse_rgl_grid(text: &str) -> Result<[u32; 3], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[polar, azimuths, side])
            if (2..=90).contains(&polar)
                && (3..=360).contains(&azimuths)
                && (4..=256).contains(&side) =>
        {
            Ok([polar, azimuths, side])
        }
        _ => Err("expected POLAR,AZIMUTHS,SIDE from 2 to 90, 3 to 360 and 4 to 256".into()),
    }
}

/// Evaluations of a scan and of a descent.
pub fn parse_patience(text: &str) -> Result<[u32; 2], String> {
    parse_counts(text, 0)
}

/// Two angles "THETA,PHI", degrees, the first not in the cloth's plane.
pub fn parse_angles(text: &str) -> Result<[f64; 2], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[theta, phi])
            if (0.0..=180.0).contains(&theta) && (theta - 90.0).abs() > 0.5 && phi.is_finite() =>
        {
            Ok([theta, phi])
        }
        _ => Err("expected two angles THETA,PHI in degrees, THETA from 0 to 180 but not 90".into()),
    }
}

/// A share of a whole, above 0 and below 1: 5 would mean percent.
pub fn parse_share(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x > 0.0 && x < 1.0 => Ok(x),
        _ => Err("expected a share above 0 and below 1: 0.05 is 5 %".into()),
    }
}

/// A positive number of something.
pub fn parse_positive(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("expected a number above 0".into()),
    }
}

/// The edge of a voxel.
pub fn parse_micrometres(text: &str) -> Result<f32, String> {
    match text.trim().parse::<f32>() {
        Ok(x) if x > 0.0 && x.is_finite() => Ok(x),
        _ => Err("expected a number of micrometres above 0, without a unit, such as 10".into()),
    }
}

/// A reader of whole numbers of a range.
pub fn whole<T: TryFrom<u64>>(
    range: RangeInclusive<u64>,
) -> impl Fn(&str) -> Result<T, String> + Clone {
    move |text| {
        let number = text.trim().parse().ok().filter(|n| range.contains(n));
        let number = number.and_then(|n| T::try_from(n).ok());
        let (least, most) = (range.start(), range.end());
        number.ok_or_else(|| format!("expected a whole number from {least} to {most}"))
    }
}

/// Rows of a table from "A..B".
pub fn parse_rows(text: &str) -> Result<Range<usize>, String> {
    let ends = text.split_once("..");
    let rows = ends.and_then(|(a, b)| Some(a.trim().parse().ok()?..b.trim().parse().ok()?));
    rows.filter(|r: &Range<usize>| r.start < r.end)
        .ok_or_else(|| "expected A..B, rows counted from 0 with A < B".into())
}

/// Samples of a pixel or paths of a pair: two at least, for an error to be known.
pub fn parse_paths(text: &str) -> Result<u64, String> {
    whole(2..=1_000_000_000_000)(text)
}

/// A level of detail; how many there are is known when the voxels are laid out.
pub fn parse_level(text: &str) -> Result<u8, String> {
    whole(0..=255)(text)
}

/// A seed.
pub fn parse_seed(text: &str) -> Result<u64, String> {
    whole(0..=u64::MAX)(text)
}

/// Bytes from "512MiB", "2GB" or a plain number.
pub fn parse_bytes(text: &str) -> Result<u64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let unit = match text[digits.len()..].to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" => 1e3,
        "mb" => 1e6,
        "gb" => 1e9,
        "kib" | "k" => 1024.0,
        "mib" | "m" => 1024.0 * 1024.0,
        "gib" | "g" => 1024.0 * 1024.0 * 1024.0,
        _ => return Err("expected a size such as 512MiB or 2GB".into()),
    };
    match digits.trim().parse::<f64>() {
        Ok(n) if n >= 0.0 && n * unit < 9e18 => Ok((n * unit) as u64),
        _ => Err("expected a size such as 512MiB or 2GB".into()),
    }
}

/// A time from "60s", "500ms", "1.5m", "2h", "30d" or a plain number of seconds.
pub fn parse_duration(text: &str) -> Result<Duration, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let seconds = match &text[digits.len()..] {
        "ms" => 1e-3,
        "" | "s" => 1.0,
        "m" | "min" => 60.0,
        "h" => 3600.0,
        "d" => 86400.0,
        _ => f64::NAN,
    };
    digits
        .trim()
        .parse()
        .ok()
        .and_then(|n: f64| Duration::try_from_secs_f64(n * seconds).ok())
        .ok_or_else(|| "expected a time such as 60s, 500ms, 5m, 2h or 30d".into())
}

/// Repeats along two axes.
pub fn parse_repeats(text: &str) -> Result<UVec2, String> {
    let number = |t: &str| t.trim().parse().ok().filter(|n| (1..=4096).contains(n));
    text.split_once(',')
        .and_then(|(x, y)| Some(UVec2::new(number(x)?, number(y)?)))
        .ok_or_else(|| "expected two whole numbers from 1 to 4096 such as 8,8".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_with_their_units() {
        assert_eq!(parse_duration("1.5m"), Ok(Duration::from_secs(90)));
        assert_eq!(parse_duration("250ms"), Ok(Duration::from_millis(250)));
        assert_eq!(parse_duration("0"), Ok(Duration::ZERO));
        for wrong in ["", "s", "-1s", "5 weeks", "infs", "1e400"] {
            assert!(parse_duration(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn shares_are_no_percentages_and_numbers_say_their_range() {
        assert_eq!(parse_share("0.05"), Ok(0.05));
        for wrong in ["5", "1", "0", "-0.1", "5%", "nan"] {
            assert!(parse_share(wrong).unwrap_err().contains("5 %"), "{wrong}");
        }
        assert_eq!(parse_micrometres("7.5"), Ok(7.5));
        for wrong in ["60um", "0", "-1", "inf"] {
            let words = parse_micrometres(wrong).unwrap_err();
            assert!(words.contains("micrometres"), "{wrong}");
        }
        assert_eq!(whole::<u8>(1..=8)("8"), Ok(8));
        for wrong in ["0", "9", "abc", "-1", "1.5", ""] {
            let words = whole::<u8>(1..=8)(wrong).unwrap_err();
            assert_eq!(words, "expected a whole number from 1 to 8");
        }
        assert_eq!(parse_seed("18446744073709551615"), Ok(u64::MAX));
        assert_eq!(parse_rows("0..32"), Ok(0..32));
        for wrong in ["", "3", "3..3", "4..3", "-1..2", "..", "1..2..3"] {
            assert!(parse_rows(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn sizes_are_read_with_their_units() {
        assert_eq!(parse_bytes("2GiB"), Ok(2 << 30));
        assert_eq!(parse_bytes("1.5k"), Ok(1536));
        assert_eq!(parse_bytes("7"), Ok(7));
        assert!(parse_bytes("-1").is_err() && parse_bytes("2 apples").is_err());
    }
}
