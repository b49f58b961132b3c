//! `[nonwoven]`: fibres laid at random.

use organza_basis::Rgb;
use serde::{Deserialize, Serialize};

/// A nonwoven: felt, spunbond, needle-punched web. The machine direction is y.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct NonwovenSpec {
    /// Name of the yarn whose fibres are laid: their radius, density and colours count.
    pub fibre: String,
    /// Linear colours, which repeat over the fibres; those of the yarn without them.
    #[serde(
        default,
        deserialize_with = "crate::colour_list::deserialize",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub colours: Vec<Rgb>,
    /// Mass per area, grams per square metre, 1 to 5000.
    pub areal_density_g_per_m2: f64,
    /// Distance of the faces, millimetres, 0.02 to 30. Tufts of needling may stand out.
    pub thickness_mm: f64,
    /// Length of a fibre, millimetres, 0.5 to 1000.
    pub length_mm: f64,
    /// Ratio of the orientation tensor's components along and across the machine, 0.05 to 20;
    /// 1 (isotropic in the plane) without it.
    pub anisotropy: Option<f64>,
    /// Root mean square angle of the fibres to the plane, degrees, 0 to 45; 3 without it.
    pub out_of_plane_deg: Option<f64>,
    /// Root mean square radius of the bends of a fibre in the plane, millimetres, 0.3 to 1000;
    /// straight without it.
    pub curl_mm: Option<f64>,
    /// By how much a fibre is longer than the line about which it is crimped, per cent, 0 to 60;
    /// 0 without it.
    pub crimp_percent: Option<f64>,
    /// Waves of the crimp per centimetre of fibre, 0.5 to 30; 4 without it.
    pub crimps_per_cm: Option<f64>,
    /// Width and height of the tile, millimetres, each 0.5 to 200.
    pub tile_mm: [f64; 2],
    /// Fibres that needles carried through the thickness.
    pub needling: Option<NeedlingSpec>,
    /// Points at which fibres are pressed together.
    pub bonding: Option<BondingSpec>,
}

/// `[nonwoven.needling]`: every punch carries fibres through the thickness as a tuft.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct NeedlingSpec {
    /// Punches per square centimetre, 1 to 2000.
    pub punches_per_cm2: f64,
    /// Fibres that a punch carries, 1 to 200; 15 without it.
    pub fibres_per_punch: Option<u32>,
    /// Diameter of a tuft, millimetres, 0.05 to 2; 0.3 without it.
    pub tuft_mm: Option<f64>,
    /// How far tufts stand out of the other face, millimetres, 0 to 10; 0 without it.
    pub depth_mm: Option<f64>,
    /// From which sides needles come; the face without it.
    pub sides: Option<NeedledSides>,
}

/// The sides from which needles come.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum NeedledSides {
    /// The face.
    #[default]
    Face,
    /// Both in turns.
    Both,
}

/// `[nonwoven.bonding]`: round points, as those of a heated embossing roll.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct BondingSpec {
    /// Points per square centimetre, 1 to 400.
    pub points_per_cm2: f64,
    /// Share of the area within the points, per cent, 0.5 to 50.
    pub area_percent: f64,
    /// Thickness in a point, millimetres; less than that of the cloth.
    pub thickness_mm: f64,
}
