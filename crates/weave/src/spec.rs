//! The geometry tables of a fabric file.

mod irregularity;
mod nonwoven;
mod pile;

pub use irregularity::{
    BlendSpec, BlendTuftSpec, CrimpShape, CrimpSpec, DraftingWaveSpec, EvennessSpec,
    FlatteningSpec, HairinessSpec, NepSpec, ReedSpec, RingDyeSpec, SlubSpec, ThreadWanderSpec,
    WanderSpec,
};
pub use nonwoven::{BondingSpec, NeedledSides, NeedlingSpec, NonwovenSpec};
pub use pile::{PileKind, PileSides, PileSpec};

use crate::draft::MAX_THREADS;
use crate::runs::listed;
use organza_basis::Rgb;
use serde::{Deserialize, Deserializer, Serialize};
use std::collections::BTreeMap;

/// The geometry of a fabric.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct FabricGeometry {
    /// How the threads cross; empty for a nonwoven.
    #[serde(default)]
    pub draft: DraftSpec,
    /// The warp; not used by knits.
    #[serde(default)]
    pub warp: ThreadSetSpec,
    /// The weft; of a knit, its courses.
    #[serde(default)]
    pub weft: ThreadSetSpec,
    /// Yarns by name. A name that is missing here but names a preset stands for the preset.
    #[serde(default)]
    pub yarn: BTreeMap<String, YarnSpec>,
    /// Fibres laid at random, in place of a draft.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nonwoven: Option<NonwovenSpec>,
    /// Yarns that stand on the weave, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pile: Option<PileSpec>,
    /// How the threads come to rest.
    #[serde(default)]
    pub relaxation: RelaxationSpec,
    /// How large the tile is.
    #[serde(default)]
    pub tile: TileSpec,
    /// Leaves out all irregularity: see [`FabricGeometry::without_irregularity`].
    #[serde(default)]
    pub ideal: bool,
    /// Makes yarns that the threads have no room for finer, all by the same factor, until they
    /// fit.
    #[serde(default)]
    pub fit_yarn: bool,
}

impl FabricGeometry {
    /// The same cloth of even threads at even distances: without `irregularity`, `finish`,
    /// `fulling`, `evenness`, `drafting_waves`, `slubs`, `neps`, `fibre_radius_cv_percent`,
    /// `wander`, `crimp`, `hairiness`, `flattening`, `spacing_cv_percent`, `reed_dents`,
    /// `missing` and the variation of the pile's height and lean. Hairs and loops, migration
    /// and colours stay.
    pub fn without_irregularity(&self) -> FabricGeometry {
        let mut out = self.clone();
        for yarn in out.yarn.values_mut() {
            yarn.irregularity = None;
            yarn.finish = Vec::new();
            yarn.fulling = None;
            yarn.evenness = None;
            yarn.drafting_waves = None;
            yarn.slubs = None;
            yarn.neps = None;
            yarn.fibre_radius_cv_percent = None;
            for part in &mut yarn.blend {
                part.fibre_radius_cv_percent = None;
            }
            yarn.wander = None;
            yarn.crimp = None;
            yarn.hairiness = None;
            yarn.flattening = None;
        }
        for threads in [&mut out.warp, &mut out.weft] {
            threads.spacing_cv_percent = None;
            threads.wander = None;
            threads.reed_dents = None;
            threads.missing = Vec::new();
        }
        if let Some(pile) = &mut out.pile {
            pile.height_cv_percent = None;
            pile.lean_deviation_deg = None;
            pile.ruffle_deg = None;
            pile.turn_deg = Some(0.0);
        }
        out
    }
}

/// How the yarn runs: exactly one of `weave`, `wif`, `drawdown`, `picture`, `knit`, `openwork`,
/// `curves`.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct DraftSpec {
    /// A weave by name, see [`crate::Draft::named`].
    pub weave: Option<String>,
    /// Name of a WIF file.
    pub wif: Option<String>,
    /// Rows of `X` and `.`, see [`crate::Draft::from_drawdown`].
    pub drawdown: Option<Vec<String>>,
    /// Name of a picture of two colours, one pixel a crossing. Whoever builds the cloth replaces
    /// it by `drawdown`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub picture: Option<String>,
    /// The part of a woven draft that is used, all of it if none: first end, first pick (both
    /// from 0), number of ends, number of picks. It goes on at the other side of the draft.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub part: Option<[u32; 4]>,
    /// A knit by name: `stockinette`, `garter`, `rib-1-1`, `rib-2-2`. Its
    /// courses are `[weft]`.
    pub knit: Option<String>,
    /// Loops per centimetre across a knit.
    pub wales_per_cm: Option<f64>,
    /// A net or gauze by name: `bobbinet` (rows of holes are `[weft]`), `leno`.
    pub openwork: Option<String>,
    /// Name of a file of curves, `.bcc` or text, see [`crate::curve_file`].
    /// Their yarns are those of `[weft]`, in the order of the file.
    pub curves: Option<String>,
    /// Length of the file's unit; 1 without.
    pub curve_unit_mm: Option<f64>,
    /// Sides of a tile that begins at the origin, with which the curves repeat; without, they do
    /// not.
    pub curve_tile_mm: Option<[f64; 2]>,
    /// Whether the curves are yarns, which get plies and fibres, or the
    /// fibres themselves.
    #[serde(default)]
    pub curves_are: CurveKind,
    /// Whether curves that are yarns push each other aside until they hardly overlap.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub curves_collide: bool,
}

/// What imported curves represent.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum CurveKind {
    /// Centrelines of yarns.
    #[default]
    Yarns,
    /// Fibres, with their own radii. A `.bcc` file has no radii; its fibres have the fibre
    /// radius of the yarn.
    Fibres,
}

/// The threads of one system.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ThreadSetSpec {
    /// Names of the yarns, which repeat along the system: one name, a list, or runs such as
    /// `"8 cotton, 1 slub"`.
    #[serde(
        default,
        deserialize_with = "yarn_of_threads",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub yarn: Vec<String>,
    /// Colours, which repeat along the system; without them the draft's own, if it has any. In
    /// files three linear channels from 0 to 1 each, or as weavers write them:
    /// `"8 red, 4 #ece8df"`, `"B/24 R4 K24 Y/4"`.
    #[serde(
        default,
        deserialize_with = "crate::colour_list::deserialize",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub colours: Vec<Rgb>,
    /// Threads per centimetre.
    pub per_cm: Option<f64>,
    /// Distance of thread centres, millimetres.
    pub spacing_mm: Option<f64>,
    /// Coefficient of variation of the distances, per cent, 0 to 30; 0 without it.
    pub spacing_cv_percent: Option<f64>,
    /// Threads that wander sideways along their length.
    pub wander: Option<ThreadWanderSpec>,
    /// Numbers of threads of the tile, from 0, that are not there; only of weaves.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<u32>,
    /// Groups of ends with wider gaps between them; only of the warp.
    pub reed_dents: Option<ReedSpec>,
}

/// What a yarn consists of.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum YarnKind {
    /// Short fibres held by twist, with migration and hairs.
    Staple,
    /// Endless parallel fibres, little or no twist.
    Filament,
    /// Endless parallel fibres in a flat, untwisted band.
    Ribbon,
}

/// A yarn; every key overrides the preset's value.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct YarnSpec {
    /// The preset of the values that are not given. The default is the name of the yarn if a
    /// preset has that name, otherwise `cotton`.
    pub preset: Option<String>,
    /// Kind of yarn.
    pub kind: Option<YarnKind>,
    /// Linear density of the whole yarn, grams per kilometre; gives the
    /// number of fibres unless `fibres_per_ply` does.
    pub tex: Option<f64>,
    /// Number of plies.
    pub plies: Option<u32>,
    /// Number of fibres in the cross-section of a ply.
    pub fibres_per_ply: Option<u32>,
    /// Mean fibre radius, micrometres.
    pub fibre_radius_um: Option<f64>,
    /// Density of the fibre substance.
    pub fibre_density_g_per_cm3: Option<f64>,
    /// Young's modulus of the fibres along them, 0.001 to 1000 GPa; of use for the bending of the
    /// cloth alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fibre_modulus_gpa: Option<f64>,
    /// Share of the ply's cross-section that is fibre.
    pub fibre_volume_fraction: Option<f64>,
    /// Radius of a ply, millimetres; gives the fibre volume fraction.
    pub ply_radius_mm: Option<f64>,
    /// Twist of the fibres in their ply, as it is in the finished yarn.
    pub twist: Option<TwistSpec>,
    /// Twist of the plies around each other.
    pub ply_twist: Option<TwistSpec>,
    /// Width over height of the cross-section in the cloth, before neighbours press on the
    /// yarn.
    pub aspect: Option<f64>,
    /// Resistance to crimp relative to other yarns.
    pub stiffness: Option<f64>,
    /// Distribution of the fibres over the ply's cross-section.
    pub cross_section: Option<CrossSectionSpec>,
    /// How fibres wander between core and surface.
    pub migration: Option<MigrationSpec>,
    /// Fibre ends that stand out.
    pub hairs: Option<HairSpec>,
    /// Fibres that leave the surface and come back.
    pub loops: Option<LoopSpec>,
    /// How it was spun, which gives its irregularity: see [`crate::spinning::NAMES`].
    pub irregularity: Option<String>,
    /// How it was finished, one after the other: see [`crate::spinning::FINISHES`].
    #[serde(
        default,
        deserialize_with = "one_or_many",
        skip_serializing_if = "Vec::is_empty"
    )]
    pub finish: Vec<String>,
    /// How far it was fulled in the cloth, 0 to 1: fibres leave the yarn and lie in the openings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fulling: Option<f64>,
    /// Mass that varies along the yarn.
    pub evenness: Option<EvennessSpec>,
    /// Share of that variation that recurs at a wavelength.
    pub drafting_waves: Option<DraftingWaveSpec>,
    /// Short thick places.
    pub slubs: Option<SlubSpec>,
    /// Small clumps of entangled fibre.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub neps: Option<NepSpec>,
    /// Coefficient of variation of the fibres' radii, per cent, 0 to 50. `fibre_radius_um` is
    /// then their root mean square.
    pub fibre_radius_cv_percent: Option<f64>,
    /// Fibres that wander among their neighbours.
    pub wander: Option<WanderSpec>,
    /// Waves or helices of single fibres.
    pub crimp: Option<CrimpSpec>,
    /// Fibres that protrude as random curves, in place of `hairs`.
    pub hairiness: Option<HairinessSpec>,
    /// Flat where other threads press on it.
    pub flattening: Option<FlatteningSpec>,
    /// Dye that does not reach the core.
    pub ring_dye: Option<RingDyeSpec>,
    /// Fibres of several colours and materials.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub blend: Vec<BlendSpec>,
    /// How the colours of the blend lie together; each fibre has one of its own without it.
    pub blend_tufts: Option<BlendTuftSpec>,
}

/// Twist: a direction and either turns or an angle.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct TwistSpec {
    /// `"S"` or `"Z"`.
    pub direction: TwistDirection,
    /// Turns per metre.
    pub turns_per_m: Option<f64>,
    /// Angle of the outermost fibres (or plies) to the axis, degrees.
    pub angle_deg: Option<f64>,
}

/// Which way the visible fibres run when the yarn hangs: like the middle of
/// the letter S (`\`) or Z (`/`).
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq)]
pub enum TwistDirection {
    /// Left-handed helix.
    #[serde(alias = "s")]
    S,
    /// Right-handed helix.
    #[serde(alias = "z")]
    Z,
}

/// Density of fibres against radius in the ply, 1 at its edge `[Zhao2016]`:
/// `(1 - 2 epsilon) ((e - e^R) / (e - 1))^beta + epsilon`.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct CrossSectionSpec {
    /// Density at the edge, 0 to 0.5.
    pub epsilon: f64,
    /// How fast the density falls; 0 is uniform.
    pub beta: f64,
}

/// Migration of a fibre's distance from the ply's centre `[Zhao2016]`: it swings
/// between `min_fraction` and `max_fraction` of its own radius.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct MigrationSpec {
    /// Least fraction.
    pub min_fraction: f64,
    /// Greatest fraction.
    #[serde(default = "one")]
    pub max_fraction: f64,
    /// Swings per turn of twist.
    pub cycles_per_turn: f64,
}

/// Hairs `[Zhao2016]`: each has its own start and radius, and its own extents along the ply,
/// outwards and around it. Pairs are mean and standard deviation; lengths are in ply radii. The
/// preset supplies missing keys.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct HairSpec {
    /// Hairs per millimetre of ply; 0 for none.
    pub per_mm: Option<f64>,
    /// Radius where the hair begins to stand out.
    pub start: Option<[f64; 2]>,
    /// How much further from the axis it ends.
    pub rise: Option<[f64; 2]>,
    /// How far along the yarn it goes, either way.
    pub run: Option<[f64; 2]>,
    /// How far around the ply it goes, radians.
    pub turn_rad: Option<[f64; 2]>,
}

/// Loops `[Zhao2016]`: at some outer turning points of its migration a fibre swings out beyond
/// its own radius. The pair is mean and standard deviation, in ply radii. The preset supplies
/// missing keys.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct LoopSpec {
    /// Loops per millimetre of ply; 0 for none.
    pub per_mm: Option<f64>,
    /// Radius of the loop's top.
    pub peak: Option<[f64; 2]>,
}

/// Options of the relaxation.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct RelaxationSpec {
    /// Maximum number of iterations of the minimiser.
    pub max_iterations: u64,
}

impl Default for RelaxationSpec {
    fn default() -> Self {
        RelaxationSpec {
            max_iterations: 2000,
        }
    }
}

/// Size of the tile.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct TileSpec {
    /// Copies of the smallest repeat along x and y: more copies give more variety among fibres.
    pub repeats: [u32; 2],
}

impl Default for TileSpec {
    fn default() -> Self {
        TileSpec { repeats: [1, 1] }
    }
}

fn one() -> f64 {
    1.0
}

/// The yarn of each thread: a name, a list of names, or runs.
fn yarn_of_threads<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    let names = one_or_many(deserializer)?;
    match &names[..] {
        [text] if text.contains(',') => {
            let name = |name: &str| Ok(name.to_owned());
            let runs = listed(text, "a yarn such as \"8 cotton\"", name);
            let runs = runs.map_err(serde::de::Error::custom)?;
            let threads: usize = runs.iter().map(|(count, _)| count).sum();
            if threads > MAX_THREADS {
                let message = format!("expected at most {MAX_THREADS} threads, found {threads}");
                return Err(serde::de::Error::custom(message));
            }
            let each = runs.into_iter();
            let each = each.flat_map(|(count, name)| std::iter::repeat_n(name, count));
            Ok(each.collect())
        }
        _ => Ok(names),
    }
}

/// A string or a list of strings.
fn one_or_many<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    struct Names;
    impl<'de> serde::de::Visitor<'de> for Names {
        type Value = Vec<String>;
        fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
            f.write_str("a name or a list of names")
        }
        fn visit_str<E>(self, name: &str) -> Result<Vec<String>, E> {
            Ok(vec![name.to_owned()])
        }
        fn visit_seq<A: serde::de::SeqAccess<'de>>(
            self,
            mut seq: A,
        ) -> Result<Vec<String>, A::Error> {
            let mut names = Vec::new();
            while let Some(name) = seq.next_element()? {
                names.push(name);
            }
            if names.is_empty() {
                return Err(serde::de::Error::custom(
                    "expected a name or a list of names, found an empty list",
                ));
            }
            Ok(names)
        }
    }
    deserializer.deserialize_any(Names)
}
