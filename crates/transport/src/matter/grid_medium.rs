//! A medium from dense grids that other programs made: extinction, SGGX
//! matrices and albedo, as Mitsuba's heterogeneous medium takes them.

use crate::{Medium, SiteInfo};
use glam::{UVec3, Vec3};
use organza_basis::{Aabb, CellGrid, CellSpan, LocalRay, PathRng, Rgb, Sym3};
use organza_scatter::{AxialFlake, Lobe, LobeSample, MicroFlake, Sggx, SpecularFlakes};
use std::ops::ControlFlow;

/// Voxels along the edge of a brick with one majorant.
const BRICK: u32 = 8;

/// The greatest extinction that is taken: light gets a millionth of a millimetre into
/// it. Single precision finds no free path beyond.
pub const MAX_EXTINCTION_PER_MM: f32 = 1e9;

/// How far below zero an eigenvalue may lie, relative to the trace: matrices of 16-bit
/// floats are off by as much.
const INDEFINITE_SLACK: f32 = 2e-3;

/// How values between samples are found. Samples sit at cell centres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interpolation {
    /// A cell is constant.
    #[default]
    Nearest,
    /// Linear between the eight nearest centres, constant beyond the outermost.
    Trilinear,
}

/// A dense grid of `N` channels over a box, x fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid<const N: usize> {
    dims: UVec3,
    data: Vec<[f32; N]>,
}

impl<const N: usize> Grid<N> {
    /// A grid from its samples; `None` unless there are `dims.x dims.y dims.z`
    /// of them, at least one.
    pub fn new(dims: UVec3, data: Vec<[f32; N]>) -> Option<Grid<N>> {
        let count = u64::from(dims.x)
            .checked_mul(u64::from(dims.y))?
            .checked_mul(u64::from(dims.z))?;
        (count > 0 && data.len() as u64 == count).then_some(Grid { dims, data })
    }

    /// One value everywhere.
    pub fn constant(value: [f32; N]) -> Grid<N> {
        Grid {
            dims: UVec3::ONE,
            data: vec![value],
        }
    }

    /// Samples along each axis.
    pub fn dims(&self) -> UVec3 {
        self.dims
    }

    /// The samples, x fastest.
    pub fn data(&self) -> &[[f32; N]] {
        &self.data
    }

    fn at(&self, c: UVec3) -> &[f32; N] {
        let (nx, ny) = (self.dims.x as usize, self.dims.y as usize);
        &self.data[(c.z as usize * ny + c.y as usize) * nx + c.x as usize]
    }
}

/// Grids that make no medium.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GridMediumError {
    /// The box has no volume or is not finite.
    #[error("the grid's bounding box {0:?} has no volume")]
    Box(Aabb),
    /// A matrix that no flakes have.
    #[error(
        "sggx: sample ({x}, {y}, {z}) has the eigenvalue {value}; expected none below zero: \
         areas are squares", x = .at.x, y = .at.y, z = .at.z
    )]
    Indefinite {
        /// Where.
        at: UVec3,
        /// The least eigenvalue.
        value: f32,
    },
    /// An extinction that no medium has.
    #[error(
        "sample ({x}, {y}, {z}) blocks up to {value} per mm; the limit is {limit} per mm \
         (extinction times the root of the matrix's diagonal)", x = .at.x, y = .at.y, z = .at.z,
        limit = MAX_EXTINCTION_PER_MM
    )]
    Extinction {
        /// Where.
        at: UVec3,
        /// What it may block.
        value: f32,
    },
    /// A value that no medium has.
    #[error("{grid}: sample ({x}, {y}, {z}) is {value}; expected {expected}", x = .at.x, y = .at.y, z = .at.z)]
    Value {
        /// Which grid.
        grid: &'static str,
        /// Where.
        at: UVec3,
        /// What is there.
        value: f32,
        /// What may be there.
        expected: &'static str,
    },
}

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
    majorants: Vec<f32>,
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
        let flakes: Vec<Sggx> = sggx
            .data
            .iter()
            .map(|&s| Sggx::new(Sym3::from_array(s)))
            .collect();
        let s = Grid {
            dims: sggx.dims,
            data: flakes.iter().map(|f| f.matrix().to_array()).collect(),
        };
        let mut medium = GridMedium {
            cell_grid,
            interpolation,
            sigma_t_per_mm,
            s,
            flakes,
            albedo,
            majorants: Vec::new(),
        };
        medium.majorants = medium.brick_majorants();
        Ok(medium)
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

    /// A bound for every brick: the largest extinction times the largest
    /// projected area among the samples that any point of the brick looks at.
    /// Interpolated matrices are convex combinations, and the largest
    /// eigenvalue is convex, so samples bound what lies between them.
    fn brick_majorants(&self) -> Vec<f32> {
        let areas = Grid {
            dims: self.s.dims,
            data: self.flakes.iter().map(|f| [area_bound(f)]).collect(),
        };
        let bricks = self.cell_grid.cell_dims(BRICK);
        let mut bounds = Vec::new();
        for z in 0..bricks.z {
            for y in 0..bricks.y {
                for x in 0..bricks.x {
                    let brick = UVec3::new(x, y, z);
                    let sigma = self.largest_in_brick(&self.sigma_t_per_mm, brick);
                    // Rounding of the interpolation may exceed the samples by a few ulp.
                    bounds.push(sigma * self.largest_in_brick(&areas, brick) * (1.0 + 4e-6));
                }
            }
        }
        bounds
    }

    fn largest_in_brick(&self, grid: &Grid<1>, brick: UVec3) -> f32 {
        let dims = self.cell_grid.dims();
        let scale = grid.dims.as_vec3() / dims.as_vec3();
        let reach = match self.interpolation {
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
                    let cell = self.cell_grid.wrap(glam::IVec3::new(x, y, z), grid.dims);
                    largest = largest.max(grid.at(cell)[0]);
                }
            }
        }
        largest
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
        let in_grid = |dims: UVec3| {
            if dims == UVec3::ONE {
                UVec3::ZERO
            } else {
                cell
            }
        };
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

/// The largest projected area, or a little more where that is quicker.
fn area_bound(flakes: &Sggx) -> f32 {
    match AxialFlake::from_matrix(flakes.matrix()) {
        Some((area, _)) => area * (1.0 + 3e-4),
        None => flakes.max_projected_area(),
    }
}

/// The place of a sample by its index.
fn place_of(dims: UVec3, index: usize) -> UVec3 {
    let (nx, ny) = (dims.x as usize, dims.y as usize);
    UVec3::from_array([index % nx, index / nx % ny, index / (nx * ny)].map(|i| i as u32))
}

/// Refuses matrices with an eigenvalue below zero. Their principal minors show the
/// rest at once to be sound.
fn check_definite(sggx: &Grid<6>) -> Result<(), GridMediumError> {
    for (index, &sample) in sggx.data.iter().enumerate() {
        let s = Sym3::from_array(sample);
        let (d, o) = (s.diagonal, s.off_diagonal);
        let trace = s.trace();
        let slack = 1e-6 * trace;
        let minors = [
            d.x * d.y - o.x * o.x,
            d.x * d.z - o.y * o.y,
            d.y * d.z - o.z * o.z,
        ];
        let sound = minors.iter().all(|m| *m >= -slack * trace)
            && s.determinant() >= -slack * trace * trace;
        if sound {
            continue;
        }
        let least = s.eigen()[2].0;
        if least < -INDEFINITE_SLACK * trace {
            return Err(GridMediumError::Indefinite {
                at: place_of(sggx.dims, index),
                value: least,
            });
        }
    }
    Ok(())
}

/// Refuses samples that block more than any walk gets through.
fn check_extinction(sigma_t: &Grid<1>, sggx: &Grid<6>) -> Result<(), GridMediumError> {
    let area = |s: &[f32; 6]| s[0].max(s[1]).max(s[2]).sqrt();
    let refuse = |at, value| Err(GridMediumError::Extinction { at, value });
    for (index, s) in sggx.data.iter().enumerate() {
        if area(s) > MAX_EXTINCTION_PER_MM {
            return refuse(place_of(sggx.dims, index), area(s));
        }
    }
    for (index, &[sigma]) in sigma_t.data.iter().enumerate() {
        let at = place_of(sigma_t.dims, index);
        let there = at.as_u64vec3() * sggx.dims.as_u64vec3() / sigma_t.dims.as_u64vec3();
        let most = sigma * area(sggx.at(there.as_uvec3())).max(1.0);
        if most > MAX_EXTINCTION_PER_MM {
            return refuse(at, most);
        }
    }
    Ok(())
}

fn check<const N: usize>(
    grid: &Grid<N>,
    name: &'static str,
    expected: &'static str,
    good: impl Fn(usize, f32) -> bool,
) -> Result<(), GridMediumError> {
    for (index, sample) in grid.data.iter().enumerate() {
        for (channel, &value) in sample.iter().enumerate() {
            if !value.is_finite() || !good(channel, value) {
                return Err(GridMediumError::Value {
                    grid: name,
                    at: place_of(grid.dims, index),
                    value,
                    expected,
                });
            }
        }
    }
    Ok(())
}

impl Medium for GridMedium {
    type Site = GridSite;

    fn cell_grid(&self) -> &CellGrid {
        &self.cell_grid
    }

    fn for_each_span<B>(
        &self,
        ray: &LocalRay,
        mut visit: impl FnMut(&CellSpan, f32) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let bricks = self.cell_grid.cell_dims(BRICK);
        for span in self.cell_grid.cells(ray, BRICK) {
            let brick = span.cell;
            let index = (brick.z * bricks.y + brick.y) * bricks.x + brick.x;
            let majorant = self.majorants[index as usize];
            if majorant > 0.0 {
                visit(&span, majorant)?;
            }
        }
        ControlFlow::Continue(())
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
        SiteInfo {
            axis: site.scattering.flakes.matrix().eigen()[2].1,
            yarn: None,
        }
    }
}
