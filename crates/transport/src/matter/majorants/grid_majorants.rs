//! Majorants of dense grids, from their samples.

use super::BlockMajorants;
use crate::matter::grid::{Grid, Interpolation};
use glam::{IVec3, UVec3};
use organza_basis::CellGrid;
use organza_scatter::{AxialFlake, Sggx};

/// Voxels along the edge of a brick with one majorant.
const BRICK: u32 = 8;

/// The majorants of a grid's bricks: the largest extinction at unit projected area times
/// the largest projected area among the samples that any point of the brick looks at.
/// `flakes` are those of a grid of `flake_dims` samples.
///
/// Interpolated matrices are convex combinations, and the largest eigenvalue is convex, so
/// samples bound what lies between them.
pub fn block_majorants(
    cell_grid: &CellGrid,
    interpolation: Interpolation,
    sigma_t_per_mm: &Grid<1>,
    flakes: &[Sggx],
    flake_dims: UVec3,
) -> BlockMajorants {
    let areas = Grid {
        dims: flake_dims,
        data: flakes.iter().map(|f| [area_bound(f)]).collect(),
    };
    BlockMajorants::new(cell_grid, BRICK, |brick| {
        let largest = |grid| largest_in_brick(cell_grid, interpolation, grid, brick);
        // Rounding of the interpolation may exceed the samples by a few ulp.
        largest(sigma_t_per_mm) * largest(&areas) * (1.0 + 4e-6)
    })
}

/// The greatest sample of a grid that any point of a brick looks at.
fn largest_in_brick(
    cells: &CellGrid,
    interpolation: Interpolation,
    grid: &Grid<1>,
    brick: UVec3,
) -> f32 {
    let dims = cells.dims();
    let scale = grid.dims.as_vec3() / dims.as_vec3();
    let reach = match interpolation {
        Interpolation::Nearest => 0,
        Interpolation::Trilinear => 1,
    };
    let low = (brick * BRICK).as_vec3() * scale;
    let high = ((brick + 1) * BRICK).min(dims).as_vec3() * scale;
    let (low, high) = (
        low.floor().as_ivec3() - reach,
        high.ceil().as_ivec3() - 1 + reach,
    );
    let mut largest = 0.0f32;
    for z in low.z..=high.z {
        for y in low.y..=high.y {
            for x in low.x..=high.x {
                let cell = cells.wrap(IVec3::new(x, y, z), grid.dims);
                largest = largest.max(grid.at(cell)[0]);
            }
        }
    }
    largest
}

/// The largest projected area, or a little more where that is quicker.
fn area_bound(flakes: &Sggx) -> f32 {
    match AxialFlake::from_matrix(flakes.matrix()) {
        Some((area, _)) => area * (1.0 + 3e-4),
        None => flakes.max_projected_area(),
    }
}
