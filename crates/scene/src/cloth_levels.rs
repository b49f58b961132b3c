//! `lod`: which representations of a cloth a scene needs, and where each gives
//! way to the next.

use crate::error::{Result, input};
use crate::loader::Loader;
use organza_basis::Aabb;
use organza_mesh::{DrapedMesh, Folds, Mesh, Shell};
use organza_scatter::{Shifted, Surface};
use organza_surface::ClothSurface;
use organza_transport::{AnyMedium, Camera, CellGrid, Draping, LevelSteps, LevelledCloth};
use organza_volume::Octree;
use std::ops::RangeInclusive;
use std::path::Path;

/// Voxels to the spacing of threads that `lod = "auto"` keeps at least. Coarser
/// ones close the gaps between yarns, and save no time: see `docs/far_field.md`.
const VOXELS_ACROSS_THREAD: f32 = 12.0;

/// A sheet and the longer side of its repeat.
pub struct FarSheet {
    /// The surface.
    pub sheet: Box<dyn Surface>,
    /// The longer side of its repeat.
    pub repeat_mm: f32,
}

impl From<ClothSurface> for FarSheet {
    /// In register with the volume of the same cloth.
    fn from(surface: ClothSurface) -> FarSheet {
        FarSheet {
            sheet: Box::new(Shifted::new(surface.surface, surface.origin_mm)),
            repeat_mm: surface.repeat_mm,
        }
    }
}

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
    /// Those of `volume`, and of a shell that cannot be made.
    pub fn medium(
        self,
        place: &Place<'_>,
        sheet: Option<FarSheet>,
        mut volume: impl FnMut(u8) -> Result<Option<AnyMedium>>,
    ) -> Result<Option<AnyMedium>> {
        let sheet = sheet.filter(|_| self.has_sheet).map(|s| s.sheet);
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

/// Where a cloth lies.
pub struct Place<'a> {
    /// The box of one period.
    pub bounds_mm: Aabb,
    /// What it is laid over, if it is not flat.
    pub mesh: Option<&'a Mesh>,
    /// Limit on memory.
    pub max_memory_bytes: u64,
    /// Where warnings of folds go, and the file that they are of.
    pub loader: &'a Loader<'a>,
    /// The scene file, for warnings.
    pub scene_path: &'a Path,
}

impl Place<'_> {
    /// Least and greatest width of a pixel on the cloth, mm.
    pub fn footprints_mm(&self, camera: &Camera) -> (f32, f32) {
        if let Some(mesh) = self.mesh {
            let points = mesh.triangles().iter().flatten();
            return camera
                .footprints_in_mm(points.fold(Aabb::EMPTY, |b, v| b.with_point(v.position_mm)));
        }
        CellGrid::new(self.bounds_mm, glam::UVec3::ONE, true)
            .map_or((0.0, f32::INFINITY), |l| camera.footprints_mm(&l))
    }

    /// A cloth that is a sheet from near and far.
    ///
    /// # Errors
    /// As [`Levels::medium`].
    pub fn sheet_alone(&self, sheet: FarSheet) -> Result<Option<AnyMedium>> {
        self.fill(Vec::new(), Some(sheet.sheet), LevelSteps::default())
    }

    fn fill(
        &self,
        volumes: Vec<AnyMedium>,
        sheet: Option<Box<dyn Surface>>,
        steps: LevelSteps,
    ) -> Result<Option<AnyMedium>> {
        let cloth = match self.mesh {
            None => CellGrid::new(self.bounds_mm, glam::UVec3::ONE, true)
                .and_then(|lattice| LevelledCloth::new(volumes, sheet, steps, lattice)),
            Some(mesh) => {
                let shell = self.shell(mesh, &volumes)?;
                let draping = Draping::new(DrapedMesh::new(mesh.clone()), shell);
                LevelledCloth::draped(volumes, sheet, steps, draping)
            }
        };
        Ok(cloth.map(|cloth| AnyMedium::Levelled(Box::new(cloth))))
    }

    /// The shell that holds all volumes, with the middle of the tile on the mesh.
    fn shell(&self, mesh: &Mesh, volumes: &[AnyMedium]) -> Result<Option<Shell>> {
        if volumes.is_empty() {
            return Ok(None);
        }
        let middle = self.bounds_mm.centre().z;
        let lattices = volumes.iter().filter_map(AnyMedium::cell_grid);
        let half = lattices.fold(0.0f32, |half, lattice| {
            let b = lattice.bounds_mm();
            half.max(b.max.z - middle).max(middle - b.min.z)
        });
        let needed = Shell::memory_bytes(mesh.triangles().len());
        if needed > self.max_memory_bytes {
            return Err(input(format!(
                "object.mesh: a shell over {} faces takes {} MiB; {} MiB are allowed",
                mesh.triangles().len(),
                needed >> 20,
                self.max_memory_bytes >> 20
            )));
        }
        let shell = Shell::new(mesh, middle - half, middle + half)
            .map_err(|e| input(format!("object.mesh: {e}")))?;
        let folds = shell.folds();
        if folds != Folds::default() {
            let words = format!(
                "mesh: it bends tighter than the cloth is thick: of the shell's tetrahedra {} \
                 overlap others, {} are empty",
                folds.inverted, folds.flat
            );
            self.loader.warn(self.scene_path, words);
        }
        Ok(Some(shell))
    }
}
