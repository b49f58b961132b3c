//! A volume as dense grids over one box, the form in which files of other programs hold it.

use super::vol::VolGrid;
use crate::{Error, Octree};
use glam::UVec3;
use organza_basis::{MergedFlakes, Mixture, Rgb, Sym3};

/// Extinction, orientation and colour of a volume. The grids share a box and may
/// differ in resolution.
#[derive(Clone, Debug, PartialEq)]
pub struct GridSet {
    /// One channel: extinction at unit projected area, 1/mm.
    pub sigma_t: VolGrid,
    /// Six channels: SGGX matrix xx, yy, zz, xy, xz, yz. Isotropic if none.
    pub sggx: Option<VolGrid>,
    /// Four channels: mean axis of the fibres, of any length (zero: none), and their
    /// spread about it in radians, where the file has them.
    pub axes: Option<VolGrid>,
    /// Three channels: single-scattering albedo, where the file has it.
    pub albedo: Option<VolGrid>,
}

/// Bytes of the three grids for each cell.
pub const BYTES_PER_CELL: u64 = 4 * (1 + 6 + 3);

impl GridSet {
    /// Bytes that [`GridSet::from_octree`] takes.
    pub fn memory_bytes(octree: &Octree, level: u8) -> u64 {
        let cells = octree.dims(level).as_u64vec3().to_array();
        cells.into_iter().fold(BYTES_PER_CELL, u64::saturating_mul)
    }

    /// A level of an octree, each mixture merged by `merge`. Cells without fibre have no
    /// extinction, the unit matrix and no albedo.
    ///
    /// Takes [`GridSet::memory_bytes`]: every cell of the box counts, occupied or not.
    pub fn from_octree(
        octree: &Octree,
        level: u8,
        merge: &dyn Fn(&Mixture) -> MergedFlakes,
    ) -> GridSet {
        let dims = octree.dims(level);
        let cells = dims.as_u64vec3().element_product() as usize;
        let grid = |channels: u32, empty: &[f32]| VolGrid {
            dims,
            channels,
            bounds_mm: octree.bounds_mm(),
            data: empty.repeat(cells),
        };
        let colour = |c: Rgb| c.0.to_array();
        let mut sigma_t = grid(1, &[0.0]);
        let mut sggx = grid(6, &Sym3::IDENTITY.to_array());
        let mut albedo = grid(3, &colour(MergedFlakes::EMPTY.albedo));
        octree.for_each_occupied(level, |cell: UVec3| {
            let merged = merge(&octree.mixture(level, cell));
            sigma_t.cell_mut(cell)[0] = merged.density_per_mm;
            sggx.cell_mut(cell).copy_from_slice(&merged.sggx.to_array());
            albedo
                .cell_mut(cell)
                .copy_from_slice(&colour(merged.albedo));
        });
        GridSet {
            sigma_t,
            sggx: Some(sggx),
            axes: None,
            albedo: Some(albedo),
        }
    }

    /// Checks that every grid has its channels and that their boxes agree.
    ///
    /// # Errors
    /// Names the grid.
    pub fn check(&self) -> Result<(), Error> {
        let bounds_mm = self.sigma_t.bounds_mm;
        let slack = 1e-4 * bounds_mm.size().max_element();
        let grids = [
            ("extinction", 1, Some(&self.sigma_t)),
            ("sggx", 6, self.sggx.as_ref()),
            ("orientation", 4, self.axes.as_ref()),
            ("albedo", 3, self.albedo.as_ref()),
        ];
        for (name, channels, grid) in grids {
            let Some(grid) = grid else { continue };
            if grid.channels != channels {
                return Err(Error::Grid {
                    grid: name,
                    problem: format!("{} channels, expected {channels}", grid.channels),
                });
            }
            let b = grid.bounds_mm;
            let off = (b.min - bounds_mm.min)
                .abs()
                .max((b.max - bounds_mm.max).abs());
            if off.max_element() > slack {
                return Err(Error::Grid {
                    grid: name,
                    problem: format!(
                        "its box {} .. {} differs from the extinction's {} .. {}",
                        b.min, b.max, bounds_mm.min, bounds_mm.max
                    ),
                });
            }
        }
        Ok(())
    }
}
