//! The keys of a fabric file.

use crate::optics::OpticsFile;
use crate::ply_table::PlyFile;
use crate::scattering::ScatteringTable;
use organza_surface::SurfaceTable;
use organza_weave::spec::{
    CurveKind, DraftSpec, NonwovenSpec, PileSpec, RelaxationSpec, ThreadSetSpec, TileSpec, YarnSpec,
};
use organza_weave::{PrintSpec, SynthesisSpec, WearSpec};
use serde::Deserialize;
use std::collections::BTreeMap;

/// A whole fabric file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FabricFile {
    /// Name, for people.
    pub name: Option<String>,
    /// The weave, knit, openwork or curves; none of a nonwoven.
    #[serde(default)]
    pub draft: DraftSpec,
    /// The warp.
    #[serde(default)]
    pub warp: ThreadSetSpec,
    /// The weft.
    #[serde(default)]
    pub weft: ThreadSetSpec,
    /// Yarns by name.
    #[serde(default)]
    pub yarn: BTreeMap<String, YarnSpec>,
    /// Fibres laid at random, in place of a draft.
    pub nonwoven: Option<NonwovenSpec>,
    /// Yarns that stand on the weave, if any.
    pub pile: Option<PileSpec>,
    /// How yarns find their places.
    #[serde(default)]
    pub relaxation: RelaxationSpec,
    /// An image printed on the cloth.
    pub print: Option<PrintSpec>,
    /// Rubbing that took dye off its faces.
    pub wear: Option<WearSpec>,
    /// How much of the cloth is made.
    #[serde(default)]
    pub tile: TileSpec,
    /// Makes the cloth of blocks.
    pub synthesis: Option<SynthesisSpec>,
    /// Leaves out all irregularity of threads and yarns.
    #[serde(default)]
    pub ideal: bool,
    /// Makes yarns that the threads have no room for finer until they fit.
    #[serde(default)]
    pub fit_yarn: bool,
    /// How the fibres of a yarn scatter light, by the yarn's name.
    #[serde(default)]
    pub optics: OpticsFile,
    /// Corrections of the plies of a yarn, by the yarn's name.
    #[serde(default)]
    pub plies: PlyFile,
    /// Which model scatters light, unless a scene says otherwise.
    #[serde(default)]
    pub scattering: ScatteringTable,
    /// How fine it is voxelized.
    #[serde(default)]
    pub voxel: VoxelTable,
    /// The cloth as a surface, where there is one to compare with.
    pub surface: Option<SurfaceTable>,
    /// Seed of everything random in the geometry.
    #[serde(default)]
    pub seed: u64,
}

impl FabricFile {
    /// Refuses what would have no effect.
    ///
    /// # Errors
    /// `key: what was expected`.
    pub(crate) fn check(&self) -> Result<(), String> {
        if self.relaxation.max_iterations == 0 {
            return Err("relaxation.max_iterations: expected at least 1, found 0".into());
        }
        let of_one_tile = [
            ("print", self.print.is_some()),
            ("wear", self.wear.is_some()),
        ];
        for (key, is_given) in of_one_tile {
            if is_given && self.synthesis.is_some() {
                return Err(format!(
                    "{key}: does not go with [synthesis]; leave one of them out"
                ));
            }
        }
        let draft = &self.draft;
        let is_woven = draft.weave.is_some()
            || draft.wif.is_some()
            || draft.drawdown.is_some()
            || draft.picture.is_some();
        let (is_knit, is_curves) = (draft.knit.is_some(), draft.curves.is_some());
        let is_open = draft.openwork.is_some();
        let has_warp = is_woven || is_open;
        let woven = "a weave (draft.weave, draft.wif or draft.drawdown)";
        let crossed = "a weave or draft.openwork";
        let spaced = "a weave, draft.knit or draft.openwork";
        let (warp, weft) = (&self.warp, &self.weft);
        for (key, is_given, has_use, belongs_to) in [
            (
                "draft.wales_per_cm",
                draft.wales_per_cm.is_some(),
                is_knit,
                "draft.knit",
            ),
            (
                "draft.curve_unit_mm",
                draft.curve_unit_mm.is_some(),
                is_curves,
                "draft.curves",
            ),
            (
                "draft.curve_tile_mm",
                draft.curve_tile_mm.is_some(),
                is_curves,
                "draft.curves",
            ),
            (
                "draft.curves_are",
                draft.curves_are != CurveKind::default(),
                is_curves,
                "draft.curves",
            ),
            (
                "draft.curves_collide",
                draft.curves_collide,
                is_curves,
                "draft.curves",
            ),
            ("warp.yarn", !warp.yarn.is_empty(), has_warp, crossed),
            ("warp.colours", !warp.colours.is_empty(), has_warp, crossed),
            ("warp.per_cm", warp.per_cm.is_some(), has_warp, crossed),
            (
                "warp.spacing_mm",
                warp.spacing_mm.is_some(),
                has_warp,
                crossed,
            ),
            (
                "warp.spacing_cv_percent",
                warp.spacing_cv_percent.is_some(),
                is_woven,
                woven,
            ),
            (
                "weft.spacing_cv_percent",
                weft.spacing_cv_percent.is_some(),
                is_woven,
                woven,
            ),
            ("draft.part", draft.part.is_some(), is_woven, woven),
            ("pile", self.pile.is_some(), is_woven, woven),
            ("weft.per_cm", weft.per_cm.is_some(), !is_curves, spaced),
            (
                "weft.spacing_mm",
                weft.spacing_mm.is_some(),
                !is_curves,
                spaced,
            ),
            (
                "tile.repeats",
                self.tile.repeats != [1, 1],
                !is_curves,
                spaced,
            ),
        ] {
            // The builder reports a draft of no kind, or of two.
            let is_one_kind = [is_woven, is_knit, is_open, is_curves]
                .iter()
                .filter(|k| **k)
                .count()
                == 1;
            if is_given && !has_use && is_one_kind {
                return Err(format!("{key}: belongs to {belongs_to}"));
            }
        }
        Ok(())
    }
}

/// `[voxel]`
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VoxelTable {
    /// Edge of the finest voxels.
    pub size_um: f32,
    /// The same of voxels for packed fibres; the mean radius of the fibres if none.
    pub packed_um: Option<f32>,
}

impl Default for VoxelTable {
    fn default() -> VoxelTable {
        VoxelTable {
            size_um: 10.0,
            packed_um: None,
        }
    }
}
