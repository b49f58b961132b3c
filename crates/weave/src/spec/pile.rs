//! `[pile]`: yarns that stand on a woven ground.

use organza_basis::Rgb;
use serde::{Deserialize, Serialize};

/// What the pile consists of.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum PileKind {
    /// Tufts of cut yarn around the picks: velvet, velour, plush.
    Cut,
    /// Pile ends that weave with the ground and rise in loops: terry.
    Loop,
    /// Tufts of cut weft around the ends, in ridges along the warp: corduroy.
    Wale,
}

/// Pile on a woven ground. Directions in the plane are degrees from the weft (x) toward the
/// warp (y).
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct PileSpec {
    /// Kind of pile.
    pub kind: PileKind,
    /// Name of the pile's yarn.
    pub yarn: String,
    /// Linear colours, which repeat across the ends; the yarn's own without them.
    #[serde(
        default,
        deserialize_with = "crate::colour_list::deserialize",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub colours: Vec<Rgb>,
    /// Mean height of the pile above the ground's face, millimetres, 0.05 to 30.
    pub height_mm: f64,
    /// Coefficient of variation of the height, per cent, 0 to 30; 0 without it.
    pub height_cv_percent: Option<f64>,
    /// A tuft or a column of loops at every so many ends, and at every so many picks.
    pub every: Option<[u32; 2]>,
    /// Tufts per square centimetre instead of `every`, for cut pile: 1 to 1e5.
    pub tufts_per_cm2: Option<f64>,
    /// Mean angle of the pile to the cloth's normal, degrees, 0 to 70; 0 without it.
    pub lean_deg: Option<f64>,
    /// Where the tips lean to; 90 (along the warp) without it.
    pub lean_direction_deg: Option<f64>,
    /// Root mean square of the lean's deviation, degrees, 0 to 30; 0 without it.
    pub lean_deviation_deg: Option<f64>,
    /// Root mean square of a lean that neighbouring tufts or loops have in common, in either
    /// direction, degrees, 0 to 45; 0 without it.
    pub ruffle_deg: Option<f64>,
    /// Distance over which that lean changes, millimetres, 0.2 to 100; 3 without it.
    pub ruffle_mm: Option<f64>,
    /// Whether loops, or the tufts of cut pile, push each other aside until they hardly overlap.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub collide: bool,
    /// Width of a cut tuft's tip over the room that it has, 0.05 to 4; 1.2 without it.
    pub splay: Option<f64>,
    /// Root mean square of the sideways waves of a cut fibre over its height, 0 to 0.3; 0.02
    /// without it.
    pub wave: Option<f64>,
    /// Root mean square angle by which loops turn about the cloth's normal, degrees, 0 to 90;
    /// 30 without it.
    pub turn_deg: Option<f64>,
    /// Which sides of the cloth have loops; the face without it.
    pub sides: Option<PileSides>,
    /// Ridges per centimetre, 0.5 to 30: needed by wales.
    pub wales_per_cm: Option<f64>,
    /// Width of a ridge over the distance of ridges, 0.2 to 1; 0.85 without it.
    pub wale_width: Option<f64>,
}

/// Sides of a cloth with loops.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum PileSides {
    /// The face.
    #[default]
    Face,
    /// Columns of loops alternate between face and back.
    Both,
}
