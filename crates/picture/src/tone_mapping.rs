//! The curves that bring linear colours of any brightness into the range of a display.

use glam::{Mat3, Vec3};
use organza_basis::Rgb;
use serde::Deserialize;
use std::sync::LazyLock;

/// How bright colours are compressed for a display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ToneMapping {
    /// Linear up to 0.8; brighter colours are compressed below 1, all channels alike.
    #[default]
    Plain,
    /// AgX with its base contrast [Sobotka2022]: a sigmoid over 16.5 stops; bright colours
    /// fade to white.
    Agx,
    /// The fit to the reference rendering of ACES 1 for sRGB displays [Hill2016]: more
    /// contrast than AgX. Middle grey, 0.18, keeps its value.
    Aces,
}

impl ToneMapping {
    /// The names in files and flags.
    pub const NAMES: [(&str, ToneMapping); 3] = [
        ("plain", ToneMapping::Plain),
        ("agx", ToneMapping::Agx),
        ("aces", ToneMapping::Aces),
    ];

    /// The name in files and flags.
    pub fn name(self) -> &'static str {
        match self {
            ToneMapping::Plain => "plain",
            ToneMapping::Agx => "agx",
            ToneMapping::Aces => "aces",
        }
    }

    /// Linear display values of a linear colour, from 0 to 1 for any valid colour. The plain
    /// curve passes on channels below 0 as they are.
    pub fn apply(self, colour: Rgb) -> [f32; 3] {
        match self {
            ToneMapping::Plain => plain(colour),
            ToneMapping::Agx => agx(colour),
            ToneMapping::Aces => aces(colour),
        }
    }
}

/// Highlights above this value are compressed by the plain curve; all below keep theirs.
pub(crate) const SHOULDER: f32 = 0.8;

/// Linear below the shoulder, then bent so that any brightness stays below
/// one; all channels are scaled alike, which keeps the hue.
fn plain(c: Rgb) -> [f32; 3] {
    let y = c.max_component();
    if y <= SHOULDER {
        return c.into();
    }
    // A ratio beyond the largest number would give no number below.
    let over = ((y - SHOULDER) / (1.0 - SHOULDER)).min(f32::MAX);
    let bent = SHOULDER + (1.0 - SHOULDER) * over / (1.0 + over);
    (c * (bent / y)).into()
}

/// The inset of AgX, linear Rec.709: each primary moves towards white, so that bright
/// saturated colours lose their saturation [Sobotka2022], [Wrensch2023]. Columns are red,
/// green, blue.
const AGX_INSET: Mat3 = Mat3::from_cols(
    Vec3::new(0.842_479_06, 0.042_328_24, 0.042_375_654),
    Vec3::new(0.078_433_6, 0.878_468_64, 0.078_433_6),
    Vec3::new(0.079_223_745, 0.079_166_13, 0.879_143),
);
/// The value in the middle of the exposure range.
const MIDDLE_GREY: f32 = 0.18;
/// Stops below and above middle grey that the sigmoid covers.
const AGX_STOPS: [f32; 2] = [10.0, 6.5];
/// Display value of middle grey, encoded.
const AGX_PIVOT: f32 = 0.5;
/// Slope of the sigmoid at middle grey, as display value over share of the range.
const AGX_SLOPE: f32 = 2.0;
/// Powers of toe and shoulder: the larger, the longer the straight part.
const AGX_POWERS: [f32; 2] = [3.0, 3.25];
/// The power with which displays of AgX decode.
const AGX_GAMMA: f32 = 2.2;

/// The inset with rows that sum to 1, which the published digits miss by 1e-4, and its
/// inverse: greys stay grey.
static AGX_MATRICES: LazyLock<[Mat3; 2]> = LazyLock::new(|| {
    let inset = Mat3::from_diagonal((AGX_INSET * Vec3::ONE).recip()) * AGX_INSET;
    [inset, inset.inverse()]
});

fn agx(colour: Rgb) -> [f32; 3] {
    let [inset, outset] = &*AGX_MATRICES;
    let mixed = *inset * colour.0.max(Vec3::ZERO);
    let encoded = Vec3::from(mixed.to_array().map(agx_curve));
    let displayed = *outset * encoded;
    displayed
        .to_array()
        .map(|v| v.clamp(0.0, 1.0).powf(AGX_GAMMA))
}

/// The encoded display value of one channel, from 0 to 1.
fn agx_curve(linear: f32) -> f32 {
    let [below, above] = AGX_STOPS;
    let stops = (linear / MIDDLE_GREY).log2().clamp(-below, above);
    agx_sigmoid((stops + below) / (below + above))
}

/// The sigmoid over the share of the range of stops: two branches that meet at middle grey
/// with one slope and reach 0 and 1 at the ends [Sobotka2022].
fn agx_sigmoid(share: f32) -> f32 {
    let [below, above] = AGX_STOPS;
    let pivot = below / (below + above);
    // Both branches as one that rises from 0 over the distance to the pivot.
    let (distance, reach, height, power, sign) = if share < pivot {
        (pivot - share, pivot, AGX_PIVOT, AGX_POWERS[0], -1.0)
    } else {
        let (reach, height) = (1.0 - pivot, 1.0 - AGX_PIVOT);
        (share - pivot, reach, height, AGX_POWERS[1], 1.0)
    };
    // The asymptote for which the branch ends at `height`.
    let end = (AGX_SLOPE * reach).powf(-power);
    let asymptote = (end * ((AGX_SLOPE * reach / height).powf(power) - 1.0)).powf(-1.0 / power);
    let straight = AGX_SLOPE * distance / asymptote;
    let bent = asymptote * straight / (1.0 + straight.powf(power)).powf(1.0 / power);
    (AGX_PIVOT + sign * bent).clamp(0.0, 1.0)
}

/// Linear Rec.709 to the space in which the curve of ACES is applied [Hill2016]. Columns
/// are red, green, blue.
const ACES_INPUT: Mat3 = Mat3::from_cols(
    Vec3::new(0.597_19, 0.076_00, 0.028_40),
    Vec3::new(0.354_58, 0.908_34, 0.133_83),
    Vec3::new(0.048_23, 0.015_66, 0.837_77),
);
/// From there back to linear Rec.709 [Hill2016].
const ACES_OUTPUT: Mat3 = Mat3::from_cols(
    Vec3::new(1.604_75, -0.102_08, -0.003_27),
    Vec3::new(-0.531_08, 1.108_13, -0.072_76),
    Vec3::new(-0.073_67, -0.006_05, 1.076_02),
);
/// Gain before the fit, which alone shows middle grey as 0.106: with it, 0.18 stays 0.18.
const ACES_GAIN: f32 = 1.4619;
/// Beyond this value the curve is flat; squares of larger values could overflow.
const ACES_MAX: f32 = 1e6;

fn aces(colour: Rgb) -> [f32; 3] {
    aces_fit(colour * ACES_GAIN)
}

/// The fit as published.
fn aces_fit(colour: Rgb) -> [f32; 3] {
    let bounded = colour.0.clamp(Vec3::ZERO, Vec3::splat(ACES_MAX));
    let curved = (ACES_INPUT * bounded).to_array().map(aces_curve);
    let displayed = ACES_OUTPUT * Vec3::from(curved);
    displayed.to_array().map(|v| v.clamp(0.0, 1.0))
}

/// The rational fit of [Hill2016] to both transforms of ACES, of one channel.
fn aces_curve(v: f32) -> f32 {
    (v * (v + 0.024_578_6) - 0.000_090_537) / (v * (0.983_729 * v + 0.432_951) + 0.238_081)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_keeps_the_dark_and_bounds_the_bright() {
        assert_eq!(plain(Rgb::new(0.1, 0.5, 0.8)), [0.1, 0.5, 0.8]);
        let mut last = 0.8;
        for i in 1..200 {
            let [r, g, _] = plain(Rgb::new(0.8 + i as f32, 0.4 + 0.5 * i as f32, 0.0));
            assert!(r > last && r < 1.0, "monotone and below one");
            assert!((g / r - 0.5).abs() < 4.0 * f32::EPSILON, "hue kept");
            last = r;
        }
    }

    /// The polynomial that [Wrensch2023] fits to the table of AgX.
    fn polynomial(x: f32) -> f32 {
        let factors = [-0.002_32, 0.119_1, 0.429_8, -6.868, 31.96, -40.14, 15.5];
        factors.iter().rev().fold(0.0, |sum, k| sum * x + k)
    }

    #[test]
    fn the_sigmoid_of_agx_is_the_published_one() {
        // The fit's own root mean square error is 0.0019.
        let error = |curve: &dyn Fn(f32) -> f32| {
            let points = (0..=1000).map(|i| i as f32 / 1000.0);
            points
                .map(|x| (curve(x) - polynomial(x)).abs())
                .fold(0.0, f32::max)
        };
        let ours = error(&agx_sigmoid);
        assert!(ours < 0.006, "{ours}");
        // Known bad: a smooth step.
        let other = error(&|x| x * x * (3.0 - 2.0 * x));
        assert!(other > 0.05, "{other}");
        for (share, value) in [(0.0, 0.0), (10.0 / 16.5, 0.5), (1.0, 1.0)] {
            assert!(
                (agx_sigmoid(share) - value).abs() < 4.0 * f32::EPSILON,
                "{share}"
            );
        }
    }

    #[test]
    fn aces_gives_the_values_of_its_fit() {
        // Values of the published formula, computed apart in double precision.
        for (grey, shown) in ACES_GREYS {
            for channel in aces_fit(Rgb::splat(grey)) {
                assert!((channel - shown).abs() < 2e-4, "{grey}: {channel}, {shown}");
            }
        }
        let [_, middle, _] = aces(Rgb::splat(MIDDLE_GREY));
        assert!((middle - MIDDLE_GREY).abs() < 2e-4, "{middle}");
    }

    const ACES_GREYS: [(f32, f32); 4] = [
        (0.05, 0.013877),
        (0.18, 0.105591),
        (1.0, 0.619115),
        (8.0, 0.963039),
    ];

    #[test]
    fn curves_rise_stay_in_range_and_keep_greys_grey() {
        for (name, curve) in ToneMapping::NAMES {
            assert_eq!(curve.name(), name);
            let mut last = -1.0;
            for stop in -60..=60 {
                let value = MIDDLE_GREY * (0.25 * stop as f32).exp2();
                let [r, g, b] = curve.apply(Rgb::splat(value));
                assert!(
                    (r - g).abs() < 2e-4 && (g - b).abs() < 2e-4,
                    "{name} {r} {g} {b}"
                );
                assert!(
                    r >= last - 1e-6 && (0.0..=1.0).contains(&r),
                    "{name}: {r} at {value}"
                );
                last = r;
            }
            for extreme in [0.0, f32::MIN_POSITIVE, f32::MAX, f32::INFINITY] {
                for colour in [Rgb::splat(extreme), Rgb::new(extreme, 0.0, 0.5)] {
                    if name == "plain" && extreme.is_infinite() {
                        continue; // no film holds an infinite radiance
                    }
                    let shown = curve.apply(colour);
                    let good = shown.iter().all(|v| (0.0..=1.00001).contains(v));
                    assert!(good, "{name}: {shown:?} of {colour:?}");
                }
            }
        }
        // A saturated light fades to white with brightness, except by the plain curve.
        let spread = |curve: ToneMapping| {
            let [r, _, b] = curve.apply(Rgb::new(60.0, 6.0, 1.0));
            r - b
        };
        assert!(spread(ToneMapping::Agx) < 0.5 && spread(ToneMapping::Plain) > 0.9);
    }
}
