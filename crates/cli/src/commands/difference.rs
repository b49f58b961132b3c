//! `organza difference`

use super::Command;
use crate::flags::MemoryArgs;
use crate::terminal;
use anyhow::Result;
use clap::Args;
use glam::UVec2;
use nv_flip::{DEFAULT_PIXELS_PER_DEGREE, FlipImageRgb8, FlipPool};
use organza_basis::Rgb;
use organza_picture::{Attributes, Picture, PictureError, exr};
use organza_scene::memory::free_memory_bytes;
use organza_scene::read;
use organza_work::{of_file, output, picture};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// `organza difference`
#[derive(Debug, Args)]
#[command(
    about = "Compare two pictures pixel by pixel: differences, their significance, and FLIP",
    after_help = "Example:\n  organza render scenes/first_light.toml -o a.exr --seed 1\n  organza render scenes/first_light.toml -o b.exr --seed 2 --engine walk\n  organza difference a.exr b.exr -o difference.exr\n\nTwo renders of one expectation with independent noise have a root mean square z of 1,\nand 0.27 % of their values differ by more than three standard errors."
)]
pub struct DifferenceArgs {
    /// The picture to compare with, in any format that can be read
    pub reference: PathBuf,
    /// The picture that is compared
    pub picture: PathBuf,
    /// Write the picture less the reference, in linear values (.exr)
    #[arg(short, long)]
    pub outfile: Option<PathBuf>,
    /// Print the figures as JSON
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub memory: MemoryArgs,
}

impl Command for DifferenceArgs {
    const NAME: &'static str = "difference";

    fn run(&self) -> Result<()> {
        if let Some(path) = &self.outfile {
            picture::format_of_parts(path)?;
            output::check_writable(path)?;
            output::check_not_an_input(path, [&self.reference, &self.picture])?;
        }
        let allowed = self.memory.max_memory.unwrap_or_else(free_memory_bytes);
        let of_reference = read::bytes(&self.reference)?;
        let of_picture = read::bytes(&self.picture)?;
        // From the headers: a small file can state a size that takes long to decode.
        let stated = [stated_size(&of_reference), stated_size(&of_picture)];
        if let [Some(a), Some(b)] = stated {
            self.check_sizes(a, b)?;
        }
        let reference = Measured::read(&self.reference, &of_reference, allowed)?;
        let compared = Measured::read(&self.picture, &of_picture, allowed)?;
        let (a, b) = (&reference.picture, &compared.picture);
        self.check_sizes(a.size, b.size)?;
        if let Some(path) = &self.outfile {
            let pairs = b.pixels.iter().zip(&a.pixels);
            let difference: Vec<Rgb> = pairs.map(|(b, a)| Rgb(b.0 - a.0)).collect();
            picture::write_plain(path, a.size, &difference)?;
        }
        let report = Report::new(&reference, &compared);
        match self.json {
            true => terminal::print_json(&report),
            false => terminal::print(&report.description()),
        }
    }
}

impl DifferenceArgs {
    fn check_sizes(&self, a: UVec2, b: UVec2) -> Result<()> {
        if a == b {
            return Ok(());
        }
        Err(of_file(
            &self.picture,
            format!(
                "has {} x {} pixels; {} has {} x {}",
                b.x,
                b.y,
                self.reference.display(),
                a.x,
                a.y
            ),
        ))
    }
}

/// The size that [`Measured::read`] will find, if the header is one.
fn stated_size(bytes: &[u8]) -> Option<UVec2> {
    match exr::stated_film(bytes) {
        Ok((size, attributes)) if attributes.get(exr::DENOISED).is_none() => Some(size),
        _ => organza_picture::stated_size(bytes).ok(),
    }
}

/// A picture, and the variance of its values where the file holds it.
struct Measured {
    picture: Picture,
    variance: Option<Vec<Rgb>>,
    attributes: Attributes,
}

impl Measured {
    fn read(path: &Path, bytes: &[u8], max_memory_bytes: u64) -> Result<Measured> {
        let fail = |e: PictureError| of_file(path, e);
        match exr::read_film(bytes, max_memory_bytes) {
            // Its own colours are no means of samples.
            Ok((_, attributes)) if attributes.get(exr::DENOISED).is_some() => Ok(Measured {
                picture: organza_picture::decode(bytes, max_memory_bytes)
                    .map_err(fail)?
                    .0,
                variance: None,
                attributes,
            }),
            Ok((film, attributes)) => {
                let pixels = film.pixels();
                let is_known = pixels.iter().all(|p| p.count() > 1);
                Ok(Measured {
                    picture: Picture::new(film.size(), pixels.iter().map(|p| p.mean()).collect()),
                    variance: is_known
                        .then(|| pixels.iter().map(|p| p.variance_of_mean()).collect()),
                    attributes,
                })
            }
            Err(e @ PictureError::Memory { .. }) => Err(fail(e)),
            // A picture of another kind or another program.
            Err(_) => Ok(Measured {
                picture: organza_picture::decode(bytes, max_memory_bytes)
                    .map_err(fail)?
                    .0,
                variance: None,
                attributes: Attributes::default(),
            }),
        }
    }
}

/// How two pictures differ.
#[derive(Debug, Serialize)]
struct Report {
    resolution: [u32; 2],
    /// Whether all values are the same, bit for bit.
    is_equal: bool,
    /// Values that are not finite, in either picture; they are left out.
    not_finite: u64,
    red: Channel,
    green: Channel,
    blue: Channel,
    /// Mean FLIP error of both as seen on a screen, under one exposure that brings
    /// the reference's brightest values to white [Andersson2020].
    flip: f32,
    /// Whether both were rendered with one seed: their noise is then not
    /// independent, and z says little.
    has_one_seed: bool,
}

/// One channel of two pictures.
#[derive(Debug, Default, Serialize)]
struct Channel {
    reference_mean: f64,
    mean: f64,
    /// Root mean square of the differences.
    rms: f64,
    largest: f64,
    /// Where that is: column and row from the upper left.
    largest_at: [u32; 2],
    significance: Option<Significance>,
}

/// Differences over their standard errors, from the variances of both pictures.
#[derive(Debug, Serialize)]
struct Significance {
    /// Of the means of the pictures.
    mean_z: f64,
    /// Root mean square over pixels; 1 is expected of noise alone.
    rms_z: f64,
    /// Share of pixels beyond three standard errors; 0.0027 is expected.
    beyond_three: f64,
    /// Pixels that have a variance.
    pixels: u64,
}

impl Report {
    fn new(reference: &Measured, compared: &Measured) -> Report {
        let (a, b) = (&reference.picture, &compared.picture);
        let bits = |p: &Picture| -> Vec<[u32; 3]> {
            let pixels = p.pixels.iter();
            pixels.map(|c| c.0.to_array().map(f32::to_bits)).collect()
        };
        let both = a.pixels.iter().zip(&b.pixels);
        let not_finite = both.filter(|(a, b)| !(a.0.is_finite() && b.0.is_finite()));
        let seed = |m: &Measured| m.attributes.get("seed").map(str::to_owned);
        Report {
            resolution: a.size.to_array(),
            is_equal: bits(a) == bits(b),
            not_finite: not_finite.count() as u64,
            red: Channel::new(0, reference, compared),
            green: Channel::new(1, reference, compared),
            blue: Channel::new(2, reference, compared),
            flip: flip(a, b),
            has_one_seed: seed(reference).is_some() && seed(reference) == seed(compared),
        }
    }

    fn description(&self) -> String {
        let [width, height] = self.resolution;
        let mut text = format!("resolution    {width} x {height}\n");
        if self.is_equal {
            return text + "equal         bit for bit\n";
        }
        if self.not_finite > 0 {
            let _ = writeln!(
                text,
                "left out      {} pixels that are not finite",
                self.not_finite
            );
        }
        for (name, c) in [
            ("red", &self.red),
            ("green", &self.green),
            ("blue", &self.blue),
        ] {
            let [x, y] = c.largest_at;
            let _ = writeln!(
                text,
                "{name:<12}  mean {:.6} against {:.6}; difference rms {:.6}, largest {:.6} at {x},{y}",
                c.mean, c.reference_mean, c.rms, c.largest
            );
            if let Some(s) = &c.significance {
                let _ = writeln!(
                    text,
                    "{:<12}  z of the means {:.2}, rms over pixels {:.3}, {:.3} % beyond 3",
                    "",
                    s.mean_z,
                    s.rms_z,
                    100.0 * s.beyond_three
                );
            }
        }
        let _ = writeln!(text, "flip          {:.5}", self.flip);
        if self.has_one_seed {
            text +=
                "note          both have one seed: their noise is not independent, z says little\n";
        }
        text
    }
}

impl Channel {
    fn new(channel: usize, reference: &Measured, compared: &Measured) -> Channel {
        let (a, b) = (&reference.picture, &compared.picture);
        let value = |p: &Rgb| f64::from(p.0[channel]);
        let mut out = Channel::default();
        let (mut count, mut squares) = (0.0, 0.0);
        for (i, (p, q)) in a.pixels.iter().zip(&b.pixels).enumerate() {
            if !(p.0.is_finite() && q.0.is_finite()) {
                continue;
            }
            let difference = value(q) - value(p);
            count += 1.0;
            out.reference_mean += value(p);
            out.mean += value(q);
            squares += difference * difference;
            if difference.abs() > out.largest {
                out.largest = difference.abs();
                let at = u32::try_from(i).unwrap_or(u32::MAX);
                out.largest_at = [at % a.size.x, at / a.size.x];
            }
        }
        let count = f64::max(count, 1.0);
        out.reference_mean /= count;
        out.mean /= count;
        out.rms = f64::sqrt(squares / count);
        if let (Some(v), Some(w)) = (&reference.variance, &compared.variance) {
            let variances = v.iter().zip(w).map(|(v, w)| value(v) + value(w));
            let pairs = b.pixels.iter().zip(&a.pixels);
            let differences = pairs.map(|(q, p)| value(q) - value(p));
            out.significance = Significance::new(differences.zip(variances));
        }
        out
    }
}

impl Significance {
    /// Of differences and their variances; those without variance (the same sample
    /// everywhere, as of empty sky) are left out.
    fn new(list: impl Iterator<Item = (f64, f64)>) -> Option<Significance> {
        let (mut pixels, mut beyond) = (0u64, 0u64);
        let (mut sum, mut variance, mut squares) = (0.0, 0.0, 0.0);
        for (difference, v) in list.filter(|(d, v)| d.is_finite() && *v > 0.0) {
            let z = difference / f64::sqrt(v);
            pixels += 1;
            beyond += u64::from(z.abs() > 3.0);
            sum += difference;
            variance += v;
            squares += z * z;
        }
        (pixels > 0).then(|| Significance {
            mean_z: sum / f64::sqrt(variance),
            rms_z: f64::sqrt(squares / pixels as f64),
            beyond_three: beyond as f64 / pixels as f64,
            pixels,
        })
    }
}

/// Share of values that the exposure brings to white or beyond.
const WHITE_SHARE: usize = 20;

/// Mean FLIP error under one exposure.
fn flip(reference: &Picture, compared: &Picture) -> f32 {
    let mut values: Vec<f32> = reference
        .pixels
        .iter()
        .flat_map(|p| p.0.to_array())
        .filter(|v| v.is_finite())
        .collect();
    values.sort_by(f32::total_cmp);
    let white = values.get(values.len() - values.len().div_ceil(WHITE_SHARE).min(values.len()));
    let gain = 1.0 / white.copied().unwrap_or(1.0).max(1e-6);
    let image = |p: &Picture| {
        let shown = |v: f32| {
            Rgb::srgb8(if v.is_finite() {
                (v * gain).clamp(0.0, 1.0)
            } else {
                0.0
            })
        };
        let bytes: Vec<u8> = p
            .pixels
            .iter()
            .flat_map(|p| p.0.to_array().map(shown))
            .collect();
        let UVec2 { x, y } = p.size;
        FlipImageRgb8::with_data(x, y, &bytes)
    };
    let error = nv_flip::flip(image(reference), image(compared), DEFAULT_PIXELS_PER_DEGREE);
    FlipPool::from_image(&error).mean()
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    const SIZE: UVec2 = UVec2::new(64, 48);

    /// A grey picture with noise of a standard error of 0.1.
    fn noisy(seed: u64, mean: f32) -> Measured {
        let mut rng = PathRng::from_seed(seed);
        // Uniform over a range of width w has the variance w^2 / 12.
        let width = f32::sqrt(12.0) * 0.1;
        let mut value = || Rgb::splat(mean + width * (rng.unit() - 0.5));
        let count = SIZE.element_product() as usize;
        Measured {
            picture: Picture::new(SIZE, (0..count).map(|_| value()).collect()),
            variance: Some(vec![Rgb::splat(0.01); count]),
            attributes: Attributes::default(),
        }
    }

    #[test]
    fn noise_alone_has_a_z_of_one_and_a_difference_shows() {
        let report = Report::new(&noisy(1, 0.5), &noisy(2, 0.5));
        let s = report.red.significance.as_ref().unwrap();
        assert_eq!(s.pixels, 3072);
        // The mean of 3072 squares of z: the difference of two uniform values has a
        // kurtosis of 2.4, so its standard error is sqrt(1.4 / 3072) = 0.021.
        // Margin: five of them, here and for the mean of z.
        assert!(
            (s.rms_z.powi(2) - 1.0).abs() < 5.0 * 0.021,
            "seeds 1, 2: {s:?}"
        );
        assert!(s.mean_z.abs() < 5.0, "seeds 1, 2: {s:?}");
        assert!(!report.is_equal && report.red.rms > 0.1);
        // Known bad: a tenth of a standard error more is seen in the mean alone.
        let report = Report::new(&noisy(1, 0.5), &noisy(2, 0.53));
        let s = report.red.significance.as_ref().unwrap();
        assert!(s.mean_z > 6.0, "seeds 1, 2: {s:?}");
    }

    #[test]
    fn equal_pictures_are_equal_and_the_largest_difference_is_found() {
        let a = noisy(1, 0.5);
        let mut b = noisy(1, 0.5);
        let report = Report::new(&a, &b);
        assert!(report.is_equal && report.flip == 0.0 && report.red.rms == 0.0);
        b.picture.pixels[64 * 3 + 5] = Rgb::splat(9.0);
        b.picture.pixels[0] = Rgb::splat(f32::NAN);
        let report = Report::new(&a, &b);
        assert_eq!(report.green.largest_at, [5, 3]);
        assert_eq!(report.not_finite, 1);
        assert!(!report.is_equal && report.flip > 0.0 && report.flip.is_finite());
        assert!(report.description().contains("at 5,3"));
    }
}
