//! White balance: the light that shall look white, and the adaptation to it.

use crate::Picture;
use glam::{DMat3, DVec3, Mat3};
use serde::Deserialize;
use std::fmt;

/// Which light looks white in a displayed picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(from = "Key")]
pub enum WhiteBalance {
    /// The white of sRGB, D65: colours stay as they are.
    #[default]
    Off,
    /// Light of this correlated colour temperature, K: daylight from 4000 K
    /// [CIE2018], a black body below.
    Temperature(f32),
    /// Light of these CIE 1931 chromaticity coordinates x and y.
    Chromaticity([f32; 2]),
    /// The mean colour of the picture (grey world) [Buchsbaum1980].
    Auto,
}

/// What files hold.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected \"off\", \"auto\", a colour temperature in kelvin or a chromaticity [x, y]"
)]
enum Key {
    Temperature(f32),
    Chromaticity([f32; 2]),
    Name(Name),
}

#[derive(Deserialize)]
#[serde(rename_all = "lowercase")]
enum Name {
    Off,
    Auto,
}

impl From<Key> for WhiteBalance {
    fn from(key: Key) -> WhiteBalance {
        match key {
            Key::Temperature(kelvin) => WhiteBalance::Temperature(kelvin),
            Key::Chromaticity(xy) => WhiteBalance::Chromaticity(xy),
            Key::Name(Name::Off) => WhiteBalance::Off,
            Key::Name(Name::Auto) => WhiteBalance::Auto,
        }
    }
}

impl fmt::Display for WhiteBalance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WhiteBalance::Off => f.write_str("off"),
            WhiteBalance::Temperature(kelvin) => write!(f, "{kelvin}"),
            WhiteBalance::Chromaticity([x, y]) => write!(f, "{x},{y}"),
            WhiteBalance::Auto => f.write_str("auto"),
        }
    }
}

/// Colour temperatures that white can have, K.
const TEMPERATURES: [f32; 2] = [1000.0, 25_000.0];
/// Lowest temperature of the daylight locus, K [CIE2018].
const DAYLIGHT_K: f64 = 4000.0;
/// The most a cone response is multiplied by; light that needs more has no such cones' share.
const MAX_GAIN: f64 = 100.0;

/// Linear Rec.709 to CIE XYZ [IEC1999]; columns are red, green, blue.
const XYZ_FROM_RGB: DMat3 = DMat3::from_cols(
    DVec3::new(0.412_456_4, 0.212_672_9, 0.019_333_9),
    DVec3::new(0.357_576_1, 0.715_152_2, 0.119_192_0),
    DVec3::new(0.180_437_5, 0.072_175_0, 0.950_304_1),
);
/// CIE XYZ to the sharpened cone responses of the Bradford transform [Lam1985].
const CONES_FROM_XYZ: DMat3 = DMat3::from_cols(
    DVec3::new(0.8951, -0.7502, 0.0389),
    DVec3::new(0.2664, 1.7135, -0.0685),
    DVec3::new(-0.1614, 0.0367, 1.0296),
);

impl WhiteBalance {
    /// Checks the numbers.
    ///
    /// # Errors
    /// What was expected, to be read after the name of the key.
    pub fn check(self) -> Result<(), String> {
        let [least, most] = TEMPERATURES;
        match self {
            WhiteBalance::Temperature(kelvin) if !(least..=most).contains(&kelvin) => {
                let range = format!("from {least} to {most} K");
                Err(format!(
                    "expected a colour temperature {range}, found {kelvin}"
                ))
            }
            WhiteBalance::Chromaticity([x, y]) if self.adaptation().is_none() => Err(format!(
                "expected the chromaticity [x, y] of a light near white, such as [0.45, 0.41], \
                 found [{x}, {y}]"
            )),
            _ => Ok(()),
        }
    }

    /// The white that gives a picture the same adaptation: the one that `Auto` finds, rounded
    /// to four decimals, `Off` where the picture has no such mean; all others as they are.
    pub fn resolve(self, picture: &Picture) -> WhiteBalance {
        if self != WhiteBalance::Auto {
            return self;
        }
        let valid = picture.pixels.iter().filter(|p| p.is_valid());
        let sum: DVec3 = valid.map(|p| p.0.as_dvec3()).sum();
        let xyz = XYZ_FROM_RGB * sum;
        let total = xyz.element_sum();
        if !(total > 0.0 && total.is_finite()) {
            return WhiteBalance::Off;
        }
        let rounded = |v: f64| (v / total * 1e4).round() as f32 / 1e4;
        let white = WhiteBalance::Chromaticity([rounded(xyz.x), rounded(xyz.y)]);
        match white.adaptation() {
            Some(_) => white,
            None => WhiteBalance::Off,
        }
    }

    /// The factors of linear Rec.709 that turn this white into that of sRGB, by the Bradford
    /// transform with complete adaptation [Lam1985]; `None` if there is nothing to change:
    /// for `Off`, for `Auto` that is not resolved, and for what is not near white.
    pub fn adaptation(self) -> Option<Mat3> {
        let [x, y] = match self {
            WhiteBalance::Off | WhiteBalance::Auto => return None,
            WhiteBalance::Temperature(kelvin) => chromaticity_of_temperature(f64::from(kelvin)),
            WhiteBalance::Chromaticity(xy) => xy.map(f64::from),
        };
        let is_light = x >= 0.0 && y > 0.0 && x + y <= 1.0;
        let from = DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
        let cones = CONES_FROM_XYZ * from;
        let gains = CONES_FROM_XYZ * XYZ_FROM_RGB * DVec3::ONE / cones;
        let is_white = is_light && cones.min_element() > 0.0 && gains.max_element() < MAX_GAIN;
        is_white.then(|| {
            let cones_from_rgb = CONES_FROM_XYZ * XYZ_FROM_RGB;
            let m = cones_from_rgb.inverse() * DMat3::from_diagonal(gains) * cones_from_rgb;
            m.as_mat3()
        })
    }
}

/// CIE 1931 x and y of the light of a colour temperature, K: the daylight locus [CIE2018], and
/// below it the Planckian locus in its rational approximation [Krystek1985].
fn chromaticity_of_temperature(t: f64) -> [f64; 2] {
    if t < DAYLIGHT_K {
        let u = (0.860_117_757 + 1.541_182_54e-4 * t + 1.286_412_12e-7 * t * t)
            / (1.0 + 8.424_202_35e-4 * t + 7.081_451_63e-7 * t * t);
        let v = (0.317_398_726 + 4.228_062_45e-5 * t + 4.204_816_91e-8 * t * t)
            / (1.0 - 2.897_418_16e-5 * t + 1.614_560_53e-7 * t * t);
        let scale = 2.0 * u - 8.0 * v + 4.0;
        return [3.0 * u / scale, 2.0 * v / scale];
    }
    let k = 1000.0 / t;
    let x = if t <= 7000.0 {
        0.244_063 + k * (0.099_11 + k * (2.967_8 - k * 4.607_0))
    } else {
        0.237_040 + k * (0.247_48 + k * (1.901_8 - k * 2.006_4))
    };
    [x, -3.0 * x * x + 2.870 * x - 0.275]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{UVec2, Vec3};
    use organza_basis::Rgb;

    fn rgb_of(xy: [f64; 2]) -> Vec3 {
        let [x, y] = xy;
        let xyz = DVec3::new(x / y, 1.0, (1.0 - x - y) / y);
        (XYZ_FROM_RGB.inverse() * xyz).as_vec3()
    }

    #[test]
    fn temperatures_have_the_published_chromaticities() {
        // D50, D65 and D75 of CIE 15, and black bodies from integrals of Planck's law.
        for (kelvin, [x, y], error) in [
            (5002.8, [0.3457, 0.3585], 2e-4),
            (6503.6, [0.3127, 0.3290], 2e-4),
            (7504.2, [0.2990, 0.3149], 2e-4),
            (2855.5, [0.4476, 0.4074], 5e-4),
            (2000.0, [0.5267, 0.4133], 5e-4),
        ] {
            let found = chromaticity_of_temperature(kelvin);
            let off = (found[0] - x).abs().max((found[1] - y).abs());
            assert!(off < error, "{kelvin} K: {found:?}");
        }
    }

    #[test]
    fn the_chosen_light_becomes_white_and_its_luminance_stays() {
        for white in [
            WhiteBalance::Temperature(2000.0),
            WhiteBalance::Temperature(3200.0),
            WhiteBalance::Temperature(5000.0),
            WhiteBalance::Temperature(12_000.0),
            WhiteBalance::Chromaticity([0.38, 0.33]),
        ] {
            let xy = match white {
                WhiteBalance::Chromaticity(xy) => xy.map(f64::from),
                WhiteBalance::Temperature(t) => chromaticity_of_temperature(f64::from(t)),
                _ => unreachable!("only these two"),
            };
            let light = rgb_of(xy);
            let shown = white.adaptation().unwrap() * light;
            assert!(
                (shown - Vec3::ONE).abs().max_element() < 4.0 * f32::EPSILON,
                "{white}: {shown}"
            );
            assert!(
                (light - Vec3::ONE).abs().max_element() > 0.05,
                "{white}: {light}"
            );
        }
        // The white of sRGB needs no adaptation.
        let identity = WhiteBalance::Chromaticity([0.312_73, 0.329_02]).adaptation();
        assert!(identity.unwrap().abs_diff_eq(Mat3::IDENTITY, 1e-4));
        assert_eq!(WhiteBalance::Off.adaptation(), None);
    }

    #[test]
    fn the_adaptation_is_the_published_matrix() {
        // D50 to D65 in XYZ, as Bruce Lindbloom tabulates it [Lindbloom2017].
        let published = DMat3::from_cols(
            DVec3::new(0.955_576_6, -0.028_289_5, 0.012_298_2),
            DVec3::new(-0.023_039_3, 1.009_941_6, -0.020_483_0),
            DVec3::new(0.063_163_6, 0.021_007_7, 1.329_909_8),
        );
        let expected = XYZ_FROM_RGB.inverse() * published * XYZ_FROM_RGB;
        let d50 = WhiteBalance::Chromaticity([0.345_667, 0.358_496]);
        let found = d50.adaptation().unwrap();
        assert!(
            found.abs_diff_eq(expected.as_mat3(), 5e-5),
            "{found} {expected}"
        );
        // Known bad: factors of XYZ itself.
        let von_kries =
            DMat3::from_diagonal(DVec3::new(0.950_47 / 0.964_22, 1.0, 1.088_83 / 0.825_21));
        let other = XYZ_FROM_RGB.inverse() * von_kries * XYZ_FROM_RGB;
        assert!(!found.abs_diff_eq(other.as_mat3(), 5e-3));
    }

    #[test]
    fn grey_world_finds_the_light_on_grey_and_can_be_repeated() {
        let light = Rgb(rgb_of(chromaticity_of_temperature(3200.0)));
        let mut pixels: Vec<Rgb> = (0..60).map(|i| light * (0.01 * i as f32)).collect();
        pixels.push(Rgb::new(f32::NAN, 0.0, 0.0));
        let picture = Picture::new(UVec2::new(61, 1), pixels);
        let found = WhiteBalance::Auto.resolve(&picture);
        let shown = found.adaptation().unwrap() * light.0;
        assert!(
            (shown - Vec3::ONE).abs().max_element() < 2e-3,
            "{found}: {shown}"
        );
        // What it prints gives the same again.
        let WhiteBalance::Chromaticity(xy) = found else {
            panic!("{found}")
        };
        let text = found.to_string();
        let (x, y) = text.split_once(',').unwrap();
        let read: [f32; 2] = [x, y].map(|v| v.parse().unwrap());
        assert_eq!(read, xy);
        let black = Picture::new(UVec2::ONE, vec![Rgb::BLACK]);
        assert_eq!(WhiteBalance::Auto.resolve(&black), WhiteBalance::Off);
    }

    #[test]
    fn lights_that_cannot_be_white_are_refused() {
        for white in [
            WhiteBalance::Temperature(999.0),
            WhiteBalance::Temperature(25_001.0),
            WhiteBalance::Temperature(f32::NAN),
            WhiteBalance::Chromaticity([0.3, 0.0]),
            WhiteBalance::Chromaticity([0.9, 0.3]),
            WhiteBalance::Chromaticity([-0.1, 0.5]),
            WhiteBalance::Chromaticity([f32::NAN, 0.3]),
            WhiteBalance::Chromaticity([0.735, 0.265]),
        ] {
            assert!(white.check().is_err(), "{white}");
        }
        for kelvin in [1000.0, 3999.0, 4000.0, 6504.0, 25_000.0] {
            let white = WhiteBalance::Temperature(kelvin);
            assert_eq!(white.check(), Ok(()), "{white}");
            assert!(white.adaptation().is_some(), "{white}");
        }
    }
}
