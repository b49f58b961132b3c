//! The stages that make cloth of a scanned field: alignment, flattening, yarns, a tile.

use crate::{
    ClothFrame, FlattenError, PeriodicCut, ScannedField, SegmentError, Segmented, TooSmall,
    cloth_frame, flattened, made_periodic, segment_yarns,
};

/// Which stages to take.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SheetStages {
    /// Turn the sheet into its own frame and subtract a surface of heights of this degree: 0
    /// for a plane.
    pub flatten: Option<u32>,
    /// Tell yarns apart.
    pub yarns: bool,
    /// Cut a tile that repeats, with periods of at least so many voxels along x and y.
    pub tile: Option<Option<[u32; 2]>>,
}

/// What the stages found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SheetFindings {
    /// How the cloth lay in the scan.
    pub frame: Option<ClothFrame>,
    /// Range of the heights that were subtracted, mm.
    pub bend_mm: f64,
    /// Share of the fibre that the rectangle of flat cloth has.
    pub kept: f64,
    /// Warp and weft.
    pub segmented: Option<Segmented>,
    /// The tile.
    pub cut: Option<PeriodicCut>,
}

/// Why a stage failed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SheetError {
    /// No plane of cloth.
    #[error("there is no sheet of cloth: the fibre is as thick as it is wide")]
    NoSheet,
    /// The sheet is not flat and cannot be made so.
    #[error(transparent)]
    Flatten(#[from] FlattenError),
    /// Warp and weft cannot be told.
    #[error(transparent)]
    Segment(#[from] SegmentError),
    /// No room for a tile.
    #[error(transparent)]
    Tile(#[from] TooSmall),
}

/// Takes the stages in order: alignment and flattening, yarns, tile.
///
/// # Errors
/// The first stage that fails.
pub fn made_cloth(
    field: ScannedField,
    stages: &SheetStages,
) -> Result<(ScannedField, SheetFindings), SheetError> {
    let mut findings = SheetFindings {
        kept: 1.0,
        ..SheetFindings::default()
    };
    let mut field = field;
    if let Some(degree) = stages.flatten {
        let frame = cloth_frame(&field).ok_or(SheetError::NoSheet)?;
        let flat = flattened(&field, &frame, degree)?;
        findings.frame = Some(frame);
        (findings.bend_mm, findings.kept) = (flat.bend_mm, flat.kept);
        field = flat.field;
    }
    if stages.yarns {
        findings.segmented = Some(segment_yarns(&mut field)?);
    }
    if let Some(least) = stages.tile {
        let (tile, cut) = made_periodic(&field, least)?;
        findings.cut = Some(cut);
        field = tile;
    }
    Ok((field, findings))
}

impl SheetFindings {
    /// What was found, in lines.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        if let Some(frame) = &self.frame {
            let weft = match frame.has_systems() {
                true => "x is the weft",
                false => "no weft was found, x is the scan's",
            };
            lines.push(format!(
                "the sheet was tilted by {:.2} degrees and bent by {:.1} um; {weft} (order {:.2}); \
                 the flat rectangle has {:.0} % of the fibre",
                frame.tilt_deg(),
                1e3 * self.bend_mm,
                frame.order,
                100.0 * self.kept
            ));
        }
        if let Some(s) = &self.segmented {
            lines.push(format!(
                "{} yarns of weft with {:.0} % of the fibre, {} of warp with {:.0} % (order {:.2})",
                s.yarns[0],
                100.0 * s.share[0],
                s.yarns[1],
                100.0 * s.share[1],
                s.order
            ));
        }
        if let Some(cut) = &self.cut {
            lines.push(format!(
                "a tile of {} x {} voxels",
                cut.period[0], cut.period[1]
            ));
            for (k, axis) in ["x", "y"].iter().enumerate() {
                let (seam, inside) = (cut.seam[k], cut.inside[k]);
                lines.push(format!(
                    "across its border in {axis} fill differs by {:.3} and direction by {:.3}; \
                     in the whole sheet there by {:.3} and {:.3}",
                    seam.fill, seam.sine, inside.fill, inside.sine
                ));
            }
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::woven::Weave;
    use glam::{DMat3, DVec3};

    #[test]
    fn a_tilted_scan_becomes_a_tile_with_two_systems() {
        let weave = Weave {
            pitch_mm: 0.08,
            ..Weave::default()
        };
        let turn =
            DMat3::from_axis_angle(DVec3::new(0.6, 0.8, 0.0), 0.1) * DMat3::from_rotation_z(0.08);
        let field = weave.field([120, 116, 34], 0.01, &|p| turn.transpose() * p);
        let stages = SheetStages {
            flatten: Some(2),
            yarns: true,
            tile: Some(None),
        };
        let (tile, found) = made_cloth(field, &stages).unwrap();
        let cut = found.cut.unwrap();
        assert!(tile.repeats && tile.material_count() == 2, "{found:?}");
        assert_eq!(found.lines().len(), 5);
        for period in cut.period {
            let off = (f64::from(period) / 16.0).fract();
            assert!(
                off.min(1.0 - off) < 4.0 * f64::from(f32::EPSILON),
                "{cut:?}"
            );
        }
        for k in [0, 1] {
            assert!(
                cut.seam[k].sine < 1.5 * cut.inside[k].sine + 0.02,
                "{cut:?}"
            );
        }
        // Fibre in all directions is a sheet without systems.
        let strewn = weave.strewn([60, 60, 12], 0.01);
        let refused = made_cloth(strewn, &stages).unwrap_err();
        assert!(matches!(refused, SheetError::Segment(_)), "{refused}");
    }
}
