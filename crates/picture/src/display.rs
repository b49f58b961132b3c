//! How linear colours become display values: white balance, exposure, tone mapping, bits.

use crate::tone_mapping::SHOULDER;
use crate::{Picture, ToneMapping, WhiteBalance};
use glam::Mat3;
use organza_basis::Rgb;
use serde::Deserialize;
use std::fmt;

/// How a picture is shown by formats that hold display values; linear formats ignore it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Display {
    /// Brightening.
    pub exposure: Exposure,
    /// Compression of bright colours.
    pub tone_mapping: ToneMapping,
    /// Which light looks white.
    pub white_balance: WhiteBalance,
    /// Bits of a channel in PNG files.
    pub png_bits: PngBits,
}

/// Brightening of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(from = "Key")]
pub enum Exposure {
    /// By so many stops: factors of 2.
    Stops(f32),
    /// So that 98 % of the pixels that are not black have a luminance of at most 0.8.
    Auto,
}

/// What files hold.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number of stops or \"auto\"")]
enum Key {
    Stops(f32),
    Name(Name),
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Name {
    Auto,
}

impl From<Key> for Exposure {
    fn from(key: Key) -> Exposure {
        match key {
            Key::Stops(stops) => Exposure::Stops(stops),
            Key::Name(Name::Auto) => Exposure::Auto,
        }
    }
}

impl Default for Exposure {
    fn default() -> Exposure {
        Exposure::Stops(0.0)
    }
}

impl fmt::Display for Exposure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Exposure::Stops(stops) => write!(f, "{stops}"),
            Exposure::Auto => f.write_str("auto"),
        }
    }
}

/// Bits of a channel in a PNG file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(try_from = "u8")]
pub enum PngBits {
    /// 8 bits.
    #[default]
    Eight,
    /// 16 bits, for pictures that are processed further.
    Sixteen,
}

impl TryFrom<u8> for PngBits {
    type Error = String;

    fn try_from(bits: u8) -> Result<PngBits, String> {
        match bits {
            8 => Ok(PngBits::Eight),
            16 => Ok(PngBits::Sixteen),
            _ => Err(format!("expected 8 or 16, found {bits}")),
        }
    }
}

/// Stops that the factor of exposure can have: 2 to this power is the largest power
/// of two that `f32` holds with its inverse.
const MAX_STOPS: f32 = 126.0;
/// Share of the pixels that automatic exposure keeps at or below [`SHOULDER`].
const EXPOSED_SHARE: f64 = 0.98;

impl Exposure {
    /// Checks the number.
    ///
    /// # Errors
    /// What was expected, to be read after the name of the key.
    pub fn check(self) -> Result<(), String> {
        match self {
            Exposure::Stops(stops) if !stops.is_finite() => {
                Err(format!("expected a finite number, found {stops}"))
            }
            Exposure::Stops(stops) if stops.abs() > MAX_STOPS => Err(format!(
                "expected a number from -{MAX_STOPS} to {MAX_STOPS}, found {stops}"
            )),
            _ => Ok(()),
        }
    }

    /// The stops of a picture whose colours have this luminance each; those of `Auto` are
    /// rounded to hundredths, so that the printed number gives the same picture.
    fn resolve(self, luminances: impl Iterator<Item = f32>) -> Exposure {
        if self != Exposure::Auto {
            return self;
        }
        let mut lit: Vec<f32> = luminances.filter(|&y| y > 0.0 && y.is_finite()).collect();
        let rank = (EXPOSED_SHARE * lit.len() as f64).ceil() as usize;
        let Some(index) = rank.checked_sub(1) else {
            return Exposure::default();
        };
        let (_, &mut bright, _) = lit.select_nth_unstable_by(index, f32::total_cmp);
        let stops = (f64::from(SHOULDER) / f64::from(bright)).log2();
        let rounded = ((stops * 100.0).round() / 100.0) as f32;
        Exposure::Stops(rounded.clamp(-MAX_STOPS, MAX_STOPS))
    }
}

impl Display {
    /// The keys of a scene's `[render]` that hold these settings. They decide nothing of a
    /// sample.
    pub const KEYS: [&str; 4] = ["exposure", "tone_mapping", "white_balance", "png_bits"];

    /// Checks the numbers.
    ///
    /// # Errors
    /// `key: what was expected`.
    pub fn check(&self) -> Result<(), String> {
        let exposure = self.exposure.check().map_err(|e| format!("exposure: {e}"));
        exposure?;
        let white = self.white_balance.check();
        white.map_err(|e| format!("white_balance: {e}"))
    }

    /// Whether something depends on the picture.
    pub fn is_auto(&self) -> bool {
        self.exposure == Exposure::Auto || self.white_balance == WhiteBalance::Auto
    }

    /// The settings with the numbers that a picture gets where they say `auto`: they give the
    /// same picture again. The white balance comes first, the exposure is of its result.
    pub fn resolve(&self, picture: &Picture) -> Display {
        let white_balance = self.white_balance.resolve(picture);
        let adaptation = white_balance.adaptation();
        let pixels = picture.pixels.iter();
        let luminances = pixels.map(|&p| balanced(p, adaptation.as_ref()).luminance());
        Display {
            exposure: self.exposure.resolve(luminances),
            white_balance,
            ..*self
        }
    }

    /// Linear display values of a picture, most of them from 0 to 1, in rows from the top.
    pub fn apply(&self, picture: &Picture) -> impl Iterator<Item = [f32; 3]> {
        let settled = self.resolve(picture);
        let gain = match settled.exposure {
            Exposure::Stops(stops) => stops.exp2(),
            Exposure::Auto => 1.0, // `resolve` leaves none
        };
        let adaptation = settled.white_balance.adaptation();
        let tone_mapping = settled.tone_mapping;
        let pixels = picture.pixels.iter();
        pixels.map(move |&p| tone_mapping.apply(balanced(p, adaptation.as_ref()) * gain))
    }
}

fn balanced(colour: Rgb, adaptation: Option<&Mat3>) -> Rgb {
    adaptation.map_or(colour, |m| Rgb(*m * colour.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec2;

    fn picture(pixels: Vec<Rgb>) -> Picture {
        Picture::new(UVec2::new(pixels.len() as u32, 1), pixels)
    }

    const AUTO: Display = Display {
        exposure: Exposure::Auto,
        tone_mapping: ToneMapping::Plain,
        white_balance: WhiteBalance::Off,
        png_bits: PngBits::Eight,
    };

    #[test]
    fn automatic_exposure_brings_the_98th_percentile_to_0_8() {
        // Greys from 1/100 to 1, in an order that is not theirs, among black pixels, a
        // firefly-free tail of two, and values that no screen shows.
        let mut pixels: Vec<Rgb> = (0..100)
            .map(|i| Rgb::splat(((i * 37) % 100 + 1) as f32 / 100.0))
            .collect();
        pixels.extend([Rgb::BLACK; 400]);
        let exposure = AUTO.resolve(&picture(pixels.clone())).exposure;
        // log2(0.8 / 0.98) = -0.293.
        assert_eq!(exposure, Exposure::Stops(-0.29));
        // Fireflies and broken values do not move it; four times the light is two stops.
        for p in pixels.iter_mut().filter(|p| p.0.x > 0.985) {
            *p = Rgb::splat(1e9);
        }
        pixels.push(Rgb::splat(f32::NAN));
        pixels.push(Rgb::splat(f32::INFINITY));
        assert_eq!(AUTO.resolve(&picture(pixels.clone())).exposure, exposure);
        let bright = picture(pixels.iter().map(|&p| p * 4.0).collect());
        assert_eq!(AUTO.resolve(&bright).exposure, Exposure::Stops(-2.29));
        // Known bad: the mean moves with the fireflies.
        assert_eq!(
            AUTO.resolve(&picture(vec![])).exposure,
            Exposure::Stops(0.0)
        );
        let black = picture(vec![Rgb::BLACK; 9]);
        assert_eq!(AUTO.resolve(&black).exposure, Exposure::Stops(0.0));
        let faint = picture(vec![Rgb::splat(f32::MIN_POSITIVE); 9]);
        let Exposure::Stops(stops) = AUTO.resolve(&faint).exposure else {
            panic!("not resolved")
        };
        assert!((125.0..=126.0).contains(&stops), "{stops}");
    }

    #[test]
    fn resolved_settings_give_the_same_picture_from_their_printed_numbers() {
        let pixels = (0..500).map(|i| Rgb::new(0.02, 0.015, 0.008) * (i as f32).sqrt());
        let picture = picture(pixels.collect());
        let auto = Display {
            white_balance: WhiteBalance::Auto,
            tone_mapping: ToneMapping::Agx,
            ..AUTO
        };
        let settled = auto.resolve(&picture);
        assert!(auto.is_auto() && !settled.is_auto());
        let shown: Vec<[f32; 3]> = auto.apply(&picture).collect();
        assert!(settled.apply(&picture).eq(shown.iter().copied()));
        let printed = Display {
            exposure: Exposure::Stops(settled.exposure.to_string().parse().unwrap()),
            ..settled
        };
        assert_eq!(printed, settled);
        // Known bad: a hundredth of a stop more.
        let Exposure::Stops(stops) = settled.exposure else {
            panic!("not resolved")
        };
        let other = Display {
            exposure: Exposure::Stops(stops + 0.01),
            ..settled
        };
        assert!(!other.apply(&picture).eq(shown.iter().copied()));
    }
}
