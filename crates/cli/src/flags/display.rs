//! Flags on how a picture is shown.

use anyhow::Result;
use clap::Args;
use organza_picture::{Display, Exposure, PngBits, ToneMapping, WhiteBalance};
use organza_work::values::whole;

/// How formats that hold display values show a picture.
#[derive(Clone, Debug, Default, Args)]
pub struct DisplayArgs {
    /// Brighten a .png by so many stops; "auto" brings the 98th percentile of its luminance to 0.8 and prints the stops [default: the scene's, or 0]
    #[arg(long, value_name = "STOPS|auto", allow_hyphen_values = true, value_parser = parse_exposure)]
    pub exposure: Option<Exposure>,
    /// Curve that compresses the bright colours of a .png: plain (linear up to 0.8), or the filmic agx or aces [default: the scene's, or plain]
    #[arg(long, value_name = "CURVE", value_parser = parse_tone_mapping)]
    pub tone_mapping: Option<ToneMapping>,
    /// Light that is white in a .png: its colour temperature in kelvin, its chromaticity x,y, "auto" (the picture's mean colour) or "off" [default: the scene's, or off]
    #[arg(long, value_name = "KELVIN|X,Y|auto|off", allow_hyphen_values = true, value_parser = parse_white_balance)]
    pub white_balance: Option<WhiteBalance>,
    /// Bits of a channel of a .png, 8 or 16 [default: the scene's, or 8]
    #[arg(long, value_name = "N", alias = "bits", value_parser = parse_png_bits)]
    pub png_bits: Option<PngBits>,
}

impl DisplayArgs {
    /// These flags where they are given, the settings of a file elsewhere.
    pub fn over(&self, file: Display) -> Display {
        Display {
            exposure: self.exposure.unwrap_or(file.exposure),
            tone_mapping: self.tone_mapping.unwrap_or(file.tone_mapping),
            white_balance: self.white_balance.unwrap_or(file.white_balance),
            png_bits: self.png_bits.unwrap_or(file.png_bits),
        }
    }
}

fn parse_exposure(text: &str) -> Result<Exposure, String> {
    let exposure = match text.trim() {
        "auto" => Exposure::Auto,
        number => Exposure::Stops(
            number
                .parse()
                .map_err(|_| "expected a number of stops or \"auto\"")?,
        ),
    };
    exposure.check().map(|()| exposure)
}

fn parse_tone_mapping(text: &str) -> Result<ToneMapping, String> {
    let found = ToneMapping::NAMES.iter().find(|(name, _)| *name == text);
    found
        .map(|(_, curve)| *curve)
        .ok_or_else(|| "expected plain, agx or aces".into())
}

fn parse_white_balance(text: &str) -> Result<WhiteBalance, String> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let white = match (text.trim(), numbers.as_deref()) {
        ("off", _) => WhiteBalance::Off,
        ("auto", _) => WhiteBalance::Auto,
        (_, Some(&[kelvin])) => WhiteBalance::Temperature(kelvin),
        (_, Some(&[x, y])) => WhiteBalance::Chromaticity([x, y]),
        _ => {
            return Err(
                "expected a colour temperature in kelvin, a chromaticity X,Y, \"auto\" or \"off\""
                    .into(),
            );
        }
    };
    white.check().map(|()| white)
}

fn parse_png_bits(text: &str) -> Result<PngBits, String> {
    let bits: Result<u8, String> = whole(8..=16)(text);
    bits.and_then(PngBits::try_from)
        .map_err(|_| "expected 8 or 16".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_read_and_stand_above_the_file() {
        assert_eq!(parse_exposure("auto"), Ok(Exposure::Auto));
        assert_eq!(parse_exposure("-1.5"), Ok(Exposure::Stops(-1.5)));
        assert_eq!(parse_tone_mapping("agx"), Ok(ToneMapping::Agx));
        let warm = WhiteBalance::Temperature(3200.0);
        assert_eq!(parse_white_balance("3200"), Ok(warm));
        let xy = WhiteBalance::Chromaticity([0.45, 0.41]);
        assert_eq!(parse_white_balance("0.45,0.41"), Ok(xy));
        assert_eq!(parse_white_balance("auto"), Ok(WhiteBalance::Auto));
        assert_eq!(parse_png_bits("16"), Ok(PngBits::Sixteen));
        let flags = DisplayArgs {
            exposure: Some(Exposure::Auto),
            ..DisplayArgs::default()
        };
        let file = Display {
            exposure: Exposure::Stops(2.0),
            png_bits: PngBits::Sixteen,
            ..Display::default()
        };
        let both = flags.over(file);
        assert_eq!(
            (both.exposure, both.png_bits),
            (Exposure::Auto, PngBits::Sixteen)
        );
    }

    #[test]
    fn wrong_flags_say_what_was_expected() {
        for wrong in ["bright", "", "nan", "inf", "127", "-200"] {
            assert!(
                parse_exposure(wrong).unwrap_err().contains("expected"),
                "{wrong}"
            );
        }
        assert_eq!(
            parse_tone_mapping("filmic"),
            Err("expected plain, agx or aces".into())
        );
        for wrong in [
            "warm", "", "300", "0.3,0", "1,2,3", "nan", "3200K", "0.9,0.3",
        ] {
            let words = parse_white_balance(wrong).unwrap_err();
            assert!(words.contains("expected"), "{wrong}: {words}");
        }
        for wrong in ["12", "0", "32", "x", "-8", "272"] {
            assert_eq!(parse_png_bits(wrong), Err("expected 8 or 16".into()));
        }
    }
}
