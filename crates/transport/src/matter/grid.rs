//! Dense grids of samples: how they are interpolated, and what they may hold to make a
//! medium.

use glam::UVec3;
use organza_basis::{Aabb, Sym3};

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
    pub(crate) dims: UVec3,
    pub(crate) data: Vec<[f32; N]>,
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

    #[inline]
    pub(crate) fn at(&self, c: UVec3) -> &[f32; N] {
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

/// The place of a sample by its index.
fn place_of(dims: UVec3, index: usize) -> UVec3 {
    let (nx, ny) = (dims.x as usize, dims.y as usize);
    UVec3::from_array([index % nx, index / nx % ny, index / (nx * ny)].map(|i| i as u32))
}

/// Refuses matrices with an eigenvalue below zero. Their principal minors show the
/// rest at once to be sound.
pub fn check_definite(sggx: &Grid<6>) -> Result<(), GridMediumError> {
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
pub fn check_extinction(sigma_t: &Grid<1>, sggx: &Grid<6>) -> Result<(), GridMediumError> {
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

/// Refuses values that are not finite or not `good` in their channel.
pub fn check<const N: usize>(
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
