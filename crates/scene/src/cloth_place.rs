//! Where a cloth lies: flat in its box, or over a mesh.

use crate::error::{InputError, Result};
use crate::loader::Loader;
use organza_basis::Aabb;
use organza_mesh::{DrapedMesh, Folds, Mesh, Shell};
use organza_scatter::{Shifted, Surface};
use organza_surface::ClothSurface;
use organza_transport::{AnyMedium, Camera, CellGrid, Draping, LevelSteps, LevelledCloth};
use std::path::Path;

/// A surface and the longer side of its repeat.
pub struct FarSheet<'a> {
    /// Makes the surface. This takes a while, and cloth that is near does not need it.
    pub surface: Box<dyn FnOnce() -> Result<ClothSurface> + 'a>,
    /// The longer side of its repeat.
    pub repeat_mm: f32,
}

impl FarSheet<'_> {
    /// The surface, in register with the volume of the same cloth.
    ///
    /// # Errors
    /// A surface model that makes no sense.
    pub fn sheet(self) -> Result<Box<dyn Surface>> {
        let ClothSurface {
            surface, origin_mm, ..
        } = (self.surface)()?;
        Ok(Box::new(Shifted::new(surface, origin_mm)))
    }
}

impl From<ClothSurface> for FarSheet<'_> {
    fn from(surface: ClothSurface) -> Self {
        FarSheet {
            repeat_mm: surface.repeat_mm,
            surface: Box::new(|| Ok(surface)),
        }
    }
}

/// Where a cloth lies.
pub struct ClothPlace<'a> {
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

impl ClothPlace<'_> {
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
    /// As [`Place::fill`].
    pub fn sheet_alone(&self, sheet: FarSheet<'_>) -> Result<Option<AnyMedium>> {
        self.fill(Vec::new(), Some(sheet.sheet()?), LevelSteps::default())
    }

    /// A cloth of several representations, finest first, then `sheet`; `None` when
    /// `steps` does not lead from each to the next.
    ///
    /// # Errors
    /// A mesh whose shell takes more memory than allowed, or cannot be made.
    pub fn fill(
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
            return Err(InputError::new(format!(
                "a shell over {} faces takes {} MiB; {} MiB are allowed",
                mesh.triangles().len(),
                needed >> 20,
                self.max_memory_bytes >> 20
            ))
            .at_key("object.mesh"));
        }
        let shell = Shell::new(mesh, middle - half, middle + half)
            .map_err(|e| InputError::new(e).at_key("object.mesh"))?;
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
