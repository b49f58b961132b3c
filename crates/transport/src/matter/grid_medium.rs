//! A medium from dense grids that other programs made: extinction, SGGX
//! matrices and albedo, as Mitsuba's heterogeneous medium takes them.

use crate::matter::grid::{
    Grid, GridMediumError, Interpolation, check, check_definite, check_extinction,
};
use crate::matter::majorants::BlockMajorants;
use crate::matter::majorants::grid_majorants::block_majorants;
use crate::{Medium, SiteInfo};
use glam::{UVec3, Vec3};
use organza_basis::{Aabb, CellGrid, CellSpan, LocalRay, PathRng, Rgb, Sym3};
use organza_scatter::{Lobe, LobeSample, MicroFlake, Sggx, SpecularFlakes};
use std::ops::ControlFlow;

/// Extinction toward `w` is `sigma_t sqrt(w^T S w)`, scattering that of
/// specular SGGX flakes, both from samples at cell centres.
pub struct GridMedium {
    cell_grid: CellGrid,
    interpolation: Interpolation,
    sigma_t_per_mm: Grid<1>,
    /// Matrices with their eigenvalues floored, as Cholesky factors too.
    s: Grid<6>,
    flakes: Vec<Sggx>,
    albedo: Grid<3>,
    majorants: BlockMajorants,
}

/// What one look-up gives.
#[derive(Clone, Copy, Debug)]
pub struct GridSite {
    sigma_t_per_mm: f32,
    scattering: SpecularFlakes<Sggx>,
}

impl GridMedium {
    /// A medium over a box, repeated in x and y or not. The grids may differ in
    /// resolution; the extinction's sets the voxels.
    ///
    /// # Errors
    /// A box without volume; extinction or S not finite or below zero, S with an
    /// eigenvalue below zero, more than [`MAX_EXTINCTION_PER_MM`], albedo outside
    /// `[0, 1]`, with the place.
    pub fn new(
        bounds_mm: Aabb,
        repeats: bool,
        interpolation: Interpolation,
        sigma_t_per_mm: Grid<1>,
        sggx: Grid<6>,
        albedo: Grid<3>,
    ) -> Result<GridMedium, GridMediumError> {
        let cell_grid = CellGrid::new(bounds_mm, sigma_t_per_mm.dims, repeats)
            .ok_or(GridMediumError::Box(bounds_mm))?;
        check(
            &sigma_t_per_mm,
            "extinction",
            "a finite value of at least 0",
            |_, v| v >= 0.0,
        )?;
        check(
            &sggx,
            "sggx",
            "a finite matrix with a diagonal of at least 0",
            |channel, v| channel > 2 || v >= 0.0,
        )?;
        check(&albedo, "albedo", "a value from 0 to 1", |_, v| {
            (0.0..=1.0).contains(&v)
        })?;
        check_definite(&sggx)?;
        check_extinction(&sigma_t_per_mm, &sggx)?;
        let flakes = sggx.data.iter().map(|&s| Sggx::new(Sym3::from_array(s)));
        let flakes: Vec<Sggx> = flakes.collect();
        let s = Grid {
            dims: sggx.dims,
            data: flakes.iter().map(|f| f.matrix().to_array()).collect(),
        };
        let majorants =
            block_majorants(&cell_grid, interpolation, &sigma_t_per_mm, &flakes, s.dims);
        Ok(GridMedium {
            cell_grid,
            interpolation,
            sigma_t_per_mm,
            s,
            flakes,
            albedo,
            majorants,
        })
    }

    /// Extinction at unit projected area, matrices (eigenvalues floored) and
    /// albedo.
    pub fn grids(&self) -> (&Grid<1>, &Grid<6>, &Grid<3>) {
        (&self.sigma_t_per_mm, &self.s, &self.albedo)
    }

    /// How values between samples are found.
    pub fn interpolation(&self) -> Interpolation {
        self.interpolation
    }

    pub(crate) fn cell_grid_mut(&mut self) -> &mut CellGrid {
        &mut self.cell_grid
    }

    /// The grid's value at a local point.
    fn look_up<const N: usize>(&self, grid: &Grid<N>, p: Vec3) -> [f32; N] {
        let q = self.grid_point(grid, p);
        match self.interpolation {
            Interpolation::Nearest => {
                *grid.at(self.cell_grid.wrap(q.floor().as_ivec3(), grid.dims))
            }
            Interpolation::Trilinear => {
                let q = q - 0.5;
                let base = q.floor();
                let f = q - base;
                let base = base.as_ivec3();
                let mut value = [0.0; N];
                for corner in 0..8 {
                    let c = glam::IVec3::new(corner & 1, (corner >> 1) & 1, corner >> 2);
                    let w = Vec3::select(c.cmpeq(glam::IVec3::ZERO), 1.0 - f, f).element_product();
                    let sample = grid.at(self.cell_grid.wrap(base + c, grid.dims));
                    for (v, s) in value.iter_mut().zip(sample) {
                        *v += w * s;
                    }
                }
                value
            }
        }
    }

    fn grid_point<const N: usize>(&self, grid: &Grid<N>, p: Vec3) -> Vec3 {
        if grid.dims == self.cell_grid.dims() {
            p
        } else {
            p * (grid.dims.as_vec3() / self.cell_grid.dims().as_vec3())
        }
    }

    /// Extinction at unit projected area in 1/mm, matrix and albedo of a cell. Only
    /// for grids that are [piecewise constant](Medium::is_piecewise_constant).
    pub fn values_of(&self, cell: UVec3) -> (f32, Sym3, Rgb) {
        // Of one cell throughout, or as many as the extinction.
        let in_grid = |dims: UVec3| cell.min(dims - 1);
        (
            self.sigma_t_per_mm.at(cell)[0],
            Sym3::from_array(*self.s.at(in_grid(self.s.dims))),
            Rgb::from(*self.albedo.at(in_grid(self.albedo.dims))),
        )
    }

    fn flakes_at(&self, p: Vec3) -> Sggx {
        match self.interpolation {
            Interpolation::Nearest => {
                let q = self.grid_point(&self.s, p);
                let c = self.cell_grid.wrap(q.floor().as_ivec3(), self.s.dims);
                let (nx, ny) = (self.s.dims.x as usize, self.s.dims.y as usize);
                self.flakes[(c.z as usize * ny + c.y as usize) * nx + c.x as usize]
            }
            Interpolation::Trilinear => Sggx::new(Sym3::from_array(self.look_up(&self.s, p))),
        }
    }
}

impl Medium for GridMedium {
    type Site = GridSite;

    fn cell_grid(&self) -> &CellGrid {
        &self.cell_grid
    }

    fn for_each_span<B>(
        &self,
        ray: &LocalRay,
        visit: impl FnMut(&CellSpan, f32) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        self.majorants.for_each_span(&self.cell_grid, ray, visit)
    }

    fn for_each_voxel<B>(
        &self,
        ray: &LocalRay,
        mut visit: impl FnMut(f32, f32, GridSite) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for span in self.cell_grid.cells(ray, 1) {
            if self.sigma_t_per_mm.at(span.cell)[0] > 0.0 {
                visit(span.t0, span.t1, self.site(span.cell.as_vec3() + 0.5))?;
            }
        }
        ControlFlow::Continue(())
    }

    fn is_piecewise_constant(&self) -> bool {
        let fits = |dims: UVec3| dims == UVec3::ONE || dims == self.cell_grid.dims();
        self.interpolation == Interpolation::Nearest && fits(self.s.dims) && fits(self.albedo.dims)
    }

    fn site(&self, p: Vec3) -> GridSite {
        GridSite {
            sigma_t_per_mm: self.look_up(&self.sigma_t_per_mm, p)[0],
            scattering: SpecularFlakes {
                flakes: self.flakes_at(p),
                albedo: Rgb::from(self.look_up(&self.albedo, p)),
            },
        }
    }

    fn sigma_t(&self, site: &GridSite, w: Vec3) -> f32 {
        site.sigma_t_per_mm * site.scattering.flakes.projected_area(w)
    }

    fn eval(&self, site: &GridSite, w_out: Vec3, w_in: Vec3) -> Rgb {
        site.scattering.eval(w_out, w_in)
    }

    fn sample(&self, site: &GridSite, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        site.scattering.sample(w_out, rng)
    }

    fn pdf(&self, site: &GridSite, w_out: Vec3, w_in: Vec3) -> f32 {
        site.scattering.pdf(w_out, w_in)
    }

    fn info(&self, site: &GridSite) -> SiteInfo {
        // The flakes' thinnest direction is where the fibre runs.
        SiteInfo::new(site.scattering.flakes.matrix().eigen()[2].1, None)
    }

    fn yarn(&self, _site: &GridSite) -> Option<u32> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every event asks for the yarn: the answer is that of the whole description, whose axis
    /// takes an eigendecomposition.
    #[test]
    fn the_yarn_is_known_without_the_axis() {
        let axis = Vec3::new(0.48, 0.6, 0.64);
        let medium = GridMedium::new(
            Aabb::new(Vec3::ZERO, Vec3::ONE),
            false,
            Interpolation::Nearest,
            Grid::constant([3.0]),
            Grid::constant(Sym3::axial(axis, 1.0, 0.04).to_array()),
            Grid::constant([0.5; 3]),
        )
        .unwrap();
        let site = medium.site(Vec3::splat(0.5));
        let info = medium.info(&site);
        assert_eq!(medium.yarn(&site), info.yarn);
        assert!(info.axis.dot(axis).abs() > 0.9999, "{}", info.axis);
    }
}
