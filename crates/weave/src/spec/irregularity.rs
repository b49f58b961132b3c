//! Keys that make a yarn irregular, as real ones are; without them it is ideal.

use organza_basis::Rgb;
use serde::{Deserialize, Serialize};

/// Mass per length that varies along the yarn.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct EvennessSpec {
    /// Coefficient of variation of the mass per length over short pieces of endless yarn, per
    /// cent, 0 to 50: the `CVm` of an evenness tester.
    pub mass_cv_percent: f64,
    /// Length of the fibres, millimetres, 1 to 1e5: the mass of pieces that are farther apart
    /// varies independently [Martindale1945].
    #[serde(default = "staple_length_mm")]
    pub fibre_length_mm: f64,
}

/// The length of medium cotton.
fn staple_length_mm() -> f64 {
    28.0
}

/// Waves of the mass that drafting leaves, because it moves short fibres in groups: part of the
/// variation that `evenness` gives, about a wavelength.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct DraftingWaveSpec {
    /// Share of the variance, 0 to 1: the waves alone have the coefficient of variation of
    /// `evenness` times its root.
    pub share: f64,
    /// Their length, millimetres, 1 to 1e5; without it 2.75 times that of the fibres, the middle
    /// of the 2.5 to 3 of yarns [Furter1982].
    pub length_mm: Option<f64>,
    /// Standard deviation of the wave number over its mean, 0.01 to 0.5: drafting waves are not
    /// strictly periodic.
    #[serde(default = "quasi_periodic")]
    pub spread: f64,
}

/// Estimated from the hills in spectrograms, which are about an octave wide.
fn quasi_periodic() -> f64 {
    0.2
}

/// Short thick places, centimetres long: more fibres side by side.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct SlubSpec {
    /// Mean number per metre of yarn, 0 to 1e4.
    pub per_m: f64,
    /// Length, mean and standard deviation, millimetres.
    pub length_mm: [f64; 2],
    /// Mass per length in the middle of a slub, as a multiple of the yarn's, mean and standard
    /// deviation.
    pub mass: [f64; 2],
}

/// Neps: small clumps of entangled fibre that were spun into the yarn, on top of its own fibres.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct NepSpec {
    /// Mean number per metre of yarn, 0 to 1e4; they lie at random. All together they are no
    /// heavier than the yarn.
    pub per_m: f64,
    /// Diameter of the ball of the same volume, mean and standard deviation, millimetres.
    pub size_mm: [f64; 2],
    /// Linear colours, 0 to 1, of which each nep has one at random; those of the yarn's fibres
    /// without them.
    #[serde(
        default,
        deserialize_with = "crate::colour_list::deserialize",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub colours: Vec<Rgb>,
}

/// Fibres of one part of a blend that lie together, as tufts that carding left whole.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct BlendTuftSpec {
    /// Mean number of fibres side by side, 1 to 1e5.
    pub fibres: f64,
    /// Length along the yarn, millimetres, 0.1 to 1e5.
    pub length_mm: f64,
}

/// Fibres that wander among their neighbours at random, beside twist and migration.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct WanderSpec {
    /// Root mean square of the displacement in either direction across the ply, ply radii, 0
    /// to 1.
    pub amplitude: f64,
    /// Length along the fibre after which it wanders elsewhere, millimetres, 0.01 to 1e5.
    pub length_mm: f64,
}

/// Crimp of fibres inside their ply, in the frame of each fibre.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct CrimpSpec {
    /// Crimps per centimetre of fibre, that is waves or turns of a helix, 0.1 to 200.
    pub per_cm: f64,
    /// Half the height of the waves, or the radius of the helix, micrometres, 0 to half the
    /// room that the ply leaves.
    pub amplitude_um: f64,
    /// Waves or helices.
    #[serde(default)]
    pub shape: CrimpShape,
    /// Coefficient of variation of amplitude and length, between fibres and along them, per
    /// cent, 0 to 40.
    #[serde(default = "crimp_cv_percent")]
    pub cv_percent: f64,
}

/// Estimated: crimps are as regular as the eye takes for a wave, and no more.
fn crimp_cv_percent() -> f64 {
    20.0
}

/// The line of a crimped fibre.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum CrimpShape {
    /// A helix, as of wool and of fibres of two components; either handedness is as likely.
    #[default]
    Helical,
    /// Waves in a plane of any direction, as of fibres that were crimped in a box.
    Planar,
}

/// Fibres that protrude from the yarn as smooth random curves. They replace the straight ones
/// of [`super::HairSpec`].
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct HairinessSpec {
    /// Length of protruding fibre per length of yarn, 0 to 1000: the index `H` of a hairiness
    /// tester.
    pub index: f64,
    /// Mean length of a protruding fibre, millimetres, 0.01 to 100; lengths are exponentially
    /// distributed [Barella1983].
    pub length_mm: f64,
    /// The largest distance from the faces of the yarn, millimetres, 0.001 to 100. Fibres bend
    /// towards the cloth before they reach it.
    pub reach_mm: f64,
    /// Radius to which the fibres curl, root mean square, millimetres, 0.01 to 1000.
    #[serde(default = "one")]
    pub curl_mm: f64,
    /// Share of the fibres that return into the yarn, 0 to 1.
    #[serde(default)]
    pub returning: f64,
    /// Direction in the plane of the cloth, x and y, towards which the fibres lean; its length,
    /// 0 to 1, says how strongly. 0 for none.
    #[serde(default)]
    pub lean: [f64; 2],
    /// Whether the curves are followed in steps of at most an eighth of the yarn's radius, too,
    /// so that fibres of fine yarns turn at its surface without kinks. It takes more segments.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub smooth: bool,
}

fn one() -> f64 {
    1.0
}

/// A cross-section that changes along the thread: flat where other threads press on it, fuller
/// where they do not. Its area stays the same. Only in weaves.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct FlatteningSpec {
    /// Factor on the width, by which the height is divided, where others press at least as
    /// strongly as on average, 1 to 3. Threads become no wider than their spacing.
    pub crossing: f64,
    /// The same where nothing presses, 0.3 to 1.
    #[serde(default = "one")]
    pub float: f64,
}

/// Threads that wander sideways along their length. Only in weaves.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ThreadWanderSpec {
    /// Root mean square of the displacement, micrometres; at most 15 % of the mean spacing.
    pub amplitude_um: f64,
    /// Length along the thread after which it wanders elsewhere, millimetres, 0.01 to 1e5.
    pub length_mm: f64,
}

/// Marks of the reed: ends that pass through one dent lie closer together.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ReedSpec {
    /// Ends in each dent, 2 to 64.
    pub ends: u32,
    /// By how much the gap between dents is wider than the mean spacing, per cent of it, 0 to
    /// 100, as far as the ends of a dent have room to lie closer.
    pub gap_percent: f64,
}

/// Dye that does not reach the core of the yarn, as indigo on rope-dyed warps.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct RingDyeSpec {
    /// Linear colour of the core, 0 to 1.
    pub core_colour: Rgb,
    /// Depth of the dye, as a share of the yarn's radius, 0 to 1.
    pub depth: f64,
}

/// Fibres of one colour and material in a yarn of several.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct BlendSpec {
    /// Share of the fibres by number, 1e-6 to 1e6; shares are divided by their sum. Either this
    /// or `mass_share` in all parts.
    pub share: Option<f64>,
    /// Share of the fibres by mass, 1e-6 to 1e6; shares are divided by their sum.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_share: Option<f64>,
    /// Linear colour, 0 to 1; the thread's own without it.
    pub colour: Option<Rgb>,
    /// Material, one of [`crate::blend::names`] or any other with radius and density; the
    /// yarn's fibres without it. Tables of optics may refer to it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fibre: Option<String>,
    /// Root mean square of the radii, micrometres, 0.1 to 10000; that of the material or the
    /// yarn without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fibre_radius_um: Option<f64>,
    /// Density of the fibre substance, 0.1 to 30; that of the material or the yarn without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fibre_density_g_per_cm3: Option<f64>,
    /// Coefficient of variation of the radii, per cent, 0 to 50; that of the yarn without it,
    /// and at most 2 for fibres that are spun through nozzles.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fibre_radius_cv_percent: Option<f64>,
}
