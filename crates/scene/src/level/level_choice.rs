//! Which representations of a cloth a scene needs, and at which pixel widths each
//! gives way to the next.

use crate::cloth_place::{ClothPlace, FarSheet};
use crate::error::Result;
use organza_transport::{AnyMedium, LevelSteps};
use organza_volume::Octree;
use std::ops::RangeInclusive;

/// Voxels to the spacing of threads that `lod = "auto"` keeps at least. Coarser
/// ones transmit at least a tenth too little: see `docs/far_field.md`.
const VOXELS_ACROSS_THREAD: f32 = 12.0;

/// Which representations a camera sees, of all that a cloth has.
pub struct Levels {
    /// Octree levels, finest first.
    pub volumes: RangeInclusive<u8>,
    /// Whether the last one is the sheet.
    pub has_sheet: bool,
    /// Footprints at which each gives way to the next.
    steps: Vec<(f32, f32)>,
}

impl Levels {
    /// The levels of an octree from `finest` on, as far as footprints in mm
    /// between `nearest` and `farthest` ask for them.
    ///
    /// A level is enough when its voxels are half a pixel wide, so level `l`
    /// gives way to the next while a pixel grows from two of its voxels to two
    /// of the next one's. The sheet takes over while a pixel grows from half a
    /// repeat to a whole one; levels that would still be on their way to a
    /// coarser one there are left out, and so are levels with fewer than
    /// `VOXELS_ACROSS_THREAD` voxels to `thread_spacing_mm`.
    pub fn for_footprints(
        octree: &Octree,
        finest: u8,
        thread_spacing_mm: f32,
        repeat_mm: Option<f32>,
        (nearest, farthest): (f32, f32),
    ) -> Levels {
        let enough_mm = |level: u8| 2.0 * octree.voxel_mm(level).max_element();
        let last_mm = repeat_mm
            .map_or(f32::INFINITY, |r| 0.5 * r)
            .min(2.0 * (thread_spacing_mm / VOXELS_ACROSS_THREAD));
        let most = (finest + 1..octree.level_count())
            .take_while(|&l| enough_mm(l) <= last_mm)
            .last()
            .unwrap_or(finest);
        let mut steps: Vec<(f32, f32)> = (finest..most)
            .map(|l| (enough_mm(l), enough_mm(l + 1)))
            .collect();
        steps.extend(repeat_mm.map(|r| (0.5 * r, r)));
        // Representation i is left behind where step i has ended.
        let skipped = steps.iter().filter(|s| s.1 <= nearest).count();
        let reached = steps.iter().filter(|s| s.0 < farthest).count();
        let count = usize::from(most - finest) + 1;
        let last_volume = reached.min(count - 1) as u8;
        Levels {
            volumes: finest + skipped as u8..=finest + last_volume,
            has_sheet: reached == count,
            steps: steps[skipped..reached].to_vec(),
        }
    }

    /// One representation near and a sheet far away, for footprints in mm of at most
    /// `farthest`: the sheet takes over as in [`Levels::for_footprints`].
    pub fn near_and_far(repeat_mm: f32, farthest: f32) -> Levels {
        let step = (0.5 * repeat_mm, repeat_mm);
        let has_sheet = step.0 < farthest;
        Levels {
            volumes: 0..=0,
            has_sheet,
            steps: has_sheet.then_some(step).into_iter().collect(),
        }
    }

    /// One octree level from near and far.
    pub fn only(level: u8) -> Levels {
        Levels {
            volumes: level..=level,
            has_sheet: false,
            steps: Vec::new(),
        }
    }

    /// The medium of these levels, flat in a box or over a mesh; `None` when a
    /// level cannot be made.
    ///
    /// # Errors
    /// Those of `volume` and of the sheet, and a shell that cannot be made.
    pub fn medium(
        self,
        place: &ClothPlace<'_>,
        sheet: Option<FarSheet<'_>>,
        mut volume: impl FnMut(u8) -> Result<Option<AnyMedium>>,
    ) -> Result<Option<AnyMedium>> {
        let sheet = sheet.filter(|_| self.has_sheet);
        let sheet = sheet.map(FarSheet::sheet).transpose()?;
        if sheet.is_none() && self.steps.is_empty() && place.mesh.is_none() {
            return volume(*self.volumes.start());
        }
        let volumes: Option<Vec<AnyMedium>> = self.volumes.map(volume).collect::<Result<_>>()?;
        match volumes.zip(LevelSteps::new(self.steps)) {
            Some((volumes, steps)) => place.fill(volumes, sheet, steps),
            None => Ok(None),
        }
    }
}
