//! A .vdb file as dense grids.

use super::{Cells, Data, ENDING, File, Grid, Value};
use crate::{Error, GridSet, VolGrid};
use glam::{DMat3, DVec3, IVec3, UVec3};
use organza_basis::{Aabb, Budget, Sym3, nearest_name};

/// Bytes for each cell of the grids that a file may have.
const BYTES_PER_CELL: f64 = 4.0 * (1 + 6 + 4 + 3) as f64;

impl File {
    /// The grid `density` and, where there are any, `sggx_diag` and `sggx_offdiag`,
    /// `orientation` with `spread` (zero if none), and `albedo`. The box is that of the file's
    /// metadata, otherwise that of the active cells. Cells whose matrix is zero or not finite
    /// get the unit matrix.
    ///
    /// # Errors When there is no `density` grid of floats, its map rotates or shears, a density
    /// is negative or not finite, another grid has another map, or the dense grids need more
    /// than the rest of the budget.
    pub fn grid_set(&self, budget: &mut Budget) -> Result<GridSet, Error> {
        let density = self.grid("density")?.ok_or_else(|| self.no_density())?;
        let Data::Float(cells) = &density.data else {
            return Err(wrong("grid \"density\" holds no floats"));
        };
        let map = density.mm_from_cell;
        let m = map.matrix3;
        let scale = DVec3::new(m.x_axis.x, m.y_axis.y, m.z_axis.z);
        if map.matrix3 != DMat3::from_diagonal(scale) || scale.min_element() <= 0.0 {
            return Err(wrong(
                "the map of grid \"density\" turns or shears, which cannot be rendered",
            ));
        }
        let (low, high) = match (density.extent, cells.active_box()) {
            (Some(extent), _) | (None, Some(extent)) => extent,
            (None, None) => return Err(wrong("grid \"density\" has no active cells")),
        };
        let dims = (high.as_i64vec3() - low.as_i64vec3() + 1).as_dvec3();
        if dims.min_element() < 1.0 {
            return Err(wrong(format!("grid \"density\" spans {dims} cells")));
        }
        // A cast beyond 64 bits saturates, which exceeds every budget.
        budget.take((BYTES_PER_CELL * dims.element_product()) as u64, "cells")?;
        let face = |cell: DVec3| map.transform_point3(cell - 0.5).as_vec3();
        let bounds_mm = Aabb::new(face(low.as_dvec3()), face(high.as_dvec3() + 1.0));
        let dense = Dense {
            low,
            dims: dims.as_uvec3(),
            bounds_mm,
        };
        let sigma_t = dense.fill(cells, |v| [v]);
        if sigma_t.data.iter().any(|v| !(v.is_finite() && *v >= 0.0)) {
            return Err(wrong(
                "grid \"density\" holds values that are negative or not finite",
            ));
        }
        let same_map = |name: &str| -> Result<Option<&Grid>, Error> {
            let grid = self.grid(name)?;
            match grid {
                Some(g) if g.mm_from_cell != map => Err(wrong(format!(
                    "grids \"{name}\" and \"density\" have different maps"
                ))),
                other => Ok(other),
            }
        };
        let vectors = |name: &str| -> Result<Option<&Cells<[f32; 3]>>, Error> {
            match same_map(name)?.map(|g| &g.data) {
                Some(Data::Vec3(c)) => Ok(Some(c)),
                Some(_) => Err(wrong(format!("grid \"{name}\" holds no vectors"))),
                None => Ok(None),
            }
        };
        let matrices = vectors("sggx_diag")?.zip(vectors("sggx_offdiag")?);
        let sggx = matrices.map(|(d, o)| {
            let (d, o) = (dense.fill(d, |v| v), dense.fill(o, |v| v));
            let cells = d.data.chunks(3).zip(o.data.chunks(3));
            dense.sggx(cells.map(|(d, o)| Sym3::from_array([d[0], d[1], d[2], o[0], o[1], o[2]])))
        });
        let axes = match vectors("orientation")? {
            Some(axes) => {
                let mut grid = dense.fill(axes, |[x, y, z]| [x, y, z, 0.0]);
                if let Some(Data::Float(spread)) = same_map("spread")?.map(|g| &g.data) {
                    let spread = dense.fill(spread, |v| [v]);
                    let cells = grid.data.chunks_exact_mut(4);
                    cells.zip(spread.data).for_each(|(c, s)| c[3] = s.max(0.0));
                }
                Some(grid)
            }
            None => None,
        };
        let albedo = vectors("albedo")?.map(|c| dense.fill(c, |v| v));
        Ok(GridSet {
            sigma_t,
            sggx,
            axes,
            albedo,
        })
    }

    /// A grid by name; an error when the file has it but it cannot be read.
    fn grid(&self, name: &str) -> Result<Option<&Grid>, Error> {
        if let Some((_, reason)) = self.unread.iter().find(|(n, _)| n == name) {
            return Err(wrong(format!("grid \"{name}\": {reason}")));
        }
        Ok(self.grids.iter().find(|g| g.name == name))
    }

    fn no_density(&self) -> Error {
        let names: Vec<&str> = self.grids.iter().map(|g| &g.name[..]).collect();
        let near = nearest_name("density", names.iter());
        let hint = near.map_or(String::new(), |n| format!("; did you mean \"{n}\"?"));
        wrong(format!("no grid \"density\" among {names:?}{hint}"))
    }
}

fn wrong(problem: impl Into<String>) -> Error {
    Error::format(ENDING, problem)
}

/// The box that all grids are spread over.
struct Dense {
    low: IVec3,
    dims: UVec3,
    bounds_mm: Aabb,
}

impl Dense {
    fn fill<T: Value, const N: usize>(
        &self,
        cells: &Cells<T>,
        split: impl Fn(T) -> [f32; N],
    ) -> VolGrid {
        let mut grid = VolGrid {
            dims: self.dims,
            channels: N as u32,
            bounds_mm: self.bounds_mm,
            data: split(cells.background).repeat(self.dims.as_u64vec3().element_product() as usize),
        };
        cells.for_each_active(|cell, edge, value| {
            // Only the part of a cube that lies in the box.
            let first = (cell - self.low).max(IVec3::ZERO);
            let end = (cell - self.low + edge).min(self.dims.as_ivec3());
            for z in first.z..end.z {
                for y in first.y..end.y {
                    for x in first.x..end.x {
                        grid.cell_mut(IVec3::new(x, y, z).as_uvec3())
                            .copy_from_slice(&split(value));
                    }
                }
            }
        });
        grid
    }

    /// Cells whose matrix is zero or not finite get the unit matrix.
    fn sggx(&self, cells: impl Iterator<Item = Sym3>) -> VolGrid {
        let sound = |s: &Sym3| s.trace() > 0.0 && s.to_array().iter().all(|x| x.is_finite());
        let data = cells.flat_map(|s| if sound(&s) { s } else { Sym3::IDENTITY }.to_array());
        VolGrid {
            dims: self.dims,
            channels: 6,
            bounds_mm: self.bounds_mm,
            data: data.collect(),
        }
    }
}
