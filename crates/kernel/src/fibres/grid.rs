//! The regular grid of cells that fibres are sorted into.

use glam::{DVec3, IVec2, IVec3, Vec3};

/// Cells are at least so many for every piece of fibre before they are made wider.
const MAX_CELLS_PER_PIECE: f64 = 4.0;
/// A small set may have so many.
const FREE_CELLS: f64 = 65_536.0;
/// No grid has more.
const MAX_CELLS: f64 = 268_435_456.0;

/// Equal boxes that fill one period, or all there is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Least corner of the first cell, in the world.
    corner_mm: DVec3,
    /// Edges of a cell.
    cell_mm: DVec3,
    /// Cells along each axis.
    pub dims: IVec3,
    /// Whether the cells repeat in x and y.
    pub repeats: bool,
}

/// A point in the grid: its cell, how many periods on, and from the cell's centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GridPoint {
    pub cell: IVec3,
    pub period: IVec2,
    pub at_mm: Vec3,
}

impl Grid {
    /// Cells of about `edge_mm` over a box, wider ones where those would be too
    /// many for the number of pieces.
    pub fn new(
        (min_mm, max_mm): (DVec3, DVec3),
        edge_mm: f64,
        pieces: usize,
        repeats: bool,
    ) -> Grid {
        let size = (max_mm - min_mm).max(DVec3::splat(1e-6));
        let most = (MAX_CELLS_PER_PIECE * pieces as f64 + FREE_CELLS).min(MAX_CELLS);
        let count = |edge: f64| (size / edge).ceil().max(DVec3::ONE).element_product();
        let mut edge = edge_mm.max(1e-6);
        while count(edge) > most {
            edge *= 1.25;
        }
        let dims = (size / edge).ceil().max(DVec3::ONE);
        Grid {
            corner_mm: min_mm,
            cell_mm: size / dims,
            dims: dims.as_ivec3(),
            repeats,
        }
    }

    /// Number of cells.
    pub fn count(&self) -> usize {
        self.dims.as_usizevec3().element_product()
    }

    /// Edges of a cell, mm.
    pub fn cell_mm(&self) -> DVec3 {
        self.cell_mm
    }

    /// Least corner of the first cell, in the world, mm.
    pub fn corner_mm(&self) -> DVec3 {
        self.corner_mm
    }

    /// Index of a cell of the first period.
    #[inline(always)]
    pub fn index(&self, cell: IVec3) -> usize {
        ((cell.z * self.dims.y + cell.y) * self.dims.x + cell.x) as usize
    }

    /// The cell that holds a point of the world; points beyond a face that does
    /// not repeat belong to the cell behind it.
    pub fn locate(&self, world_mm: DVec3) -> GridPoint {
        let p = (world_mm - self.corner_mm) / self.cell_mm;
        let last = (self.dims - 1).as_dvec3();
        let mut cell = p.floor();
        let mut period = IVec2::ZERO;
        let dims = self.dims.as_dvec3();
        if self.repeats {
            for axis in 0..2 {
                let whole = (cell[axis] / dims[axis]).floor();
                period[axis] = whole as i32;
                cell[axis] -= whole * dims[axis];
            }
        }
        cell = cell.clamp(DVec3::ZERO, last);
        let beyond = (period.as_dvec2() * dims.truncate()).extend(0.0);
        GridPoint {
            cell: cell.as_ivec3(),
            period,
            at_mm: ((p - beyond - cell - 0.5) * self.cell_mm).as_vec3(),
        }
    }

    /// The point in the world.
    pub fn world_mm(&self, p: &GridPoint) -> DVec3 {
        let beyond = (p.period * self.dims.truncate()).extend(0);
        let cells = (p.cell + beyond).as_dvec3() + 0.5;
        self.corner_mm + cells * self.cell_mm + p.at_mm.as_dvec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_come_back_from_anywhere() {
        let corners = (DVec3::new(-1.0, 2.0, -0.3), DVec3::new(4.0, 5.0, 0.4));
        for repeats in [false, true] {
            let grid = Grid::new(corners, 0.11, 10_000, repeats);
            for i in 0..1000 {
                let k = f64::from(i);
                let spread = if repeats { 100.0 } else { 1.0 };
                let p = DVec3::new(
                    1.5 + 2.4 * spread * (0.7 * k).sin(),
                    3.5 + 1.4 * spread * (1.3 * k).sin(),
                    0.05 + 0.34 * (2.1 * k).sin(),
                );
                let there = grid.locate(p);
                assert!(there.cell.cmpge(IVec3::ZERO).all() && there.cell.cmplt(grid.dims).all());
                let off = (grid.world_mm(&there) - p).length();
                assert!(off < 0.05 * f64::from(f32::EPSILON), "{p} {there:?}");
            }
        }
    }

    #[test]
    fn sparse_sets_get_wide_cells() {
        let corners = (DVec3::ZERO, DVec3::splat(1000.0));
        let grid = Grid::new(corners, 0.01, 100, false);
        assert!(grid.count() <= 70_000, "{:?}", grid.dims);
    }
}
