//! A mixture as one micro-flake population, for files of other programs.

use crate::{Octree, VolGrid};
use glam::{UVec3, Vec3};
use organza_basis::spread::{MAX_SPREAD_RAD, sggx_across_along};
use organza_basis::{Mixture, Rgb, Sym3};
use std::sync::LazyLock;

/// Least eigenvalue of an exported SGGX matrix: an end-on ratio of 0.01, so
/// that readers in 32-bit floats can invert it.
const LEAST_EIGENVALUE: f32 = 1e-4;

/// What is left of a mixture when it must be one population.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Sum of the broadside extinctions, 1/mm.
    pub density_per_mm: f32,
    /// SGGX matrix at unit density: the extinction-weighted mean of the
    /// populations' matrices, positive definite, greatest eigenvalue at most
    /// one.
    pub sggx: Sym3,
    /// Mean axis of the population that blocks most.
    pub axis: Vec3,
    /// Spread of the same.
    pub spread_rad: f32,
    /// Yarn of the same.
    pub yarn: u32,
}

/// Eigenvalues for spreads in equal steps, since a file asks for millions.
static ACROSS_ALONG: LazyLock<Vec<(f32, f32)>> = LazyLock::new(|| {
    (0..=4096)
        .map(|k| sggx_across_along(MAX_SPREAD_RAD * (k as f32 / 4096.0).powi(2)))
        .collect()
});

fn across_along(spread_rad: f32) -> (f32, f32) {
    let at = 4096.0 * (spread_rad / MAX_SPREAD_RAD).clamp(0.0, 1.0).sqrt();
    let k = (at as usize).min(4095);
    let (a, b, f) = (ACROSS_ALONG[k], ACROSS_ALONG[k + 1], at - k as f32);
    (a.0 + f * (b.0 - a.0), a.1 + f * (b.1 - a.1))
}

/// The SGGX matrix of a population with this axis and spread: eigenvalues are
/// the squared means of |sin| `[Heitz2015]`.
pub fn sggx(axis: Vec3, spread_rad: f32) -> Sym3 {
    let (across, along) = across_along(spread_rad);
    Sym3::axial(axis, across, along.max(LEAST_EIGENVALUE))
}

impl Summary {
    /// Of a mixture; an empty one has zero density, the unit matrix and axis z.
    pub fn of(mixture: &Mixture) -> Summary {
        let components = mixture.as_slice();
        let total = mixture.broadside_per_mm();
        let largest = components
            .iter()
            .max_by(|a, b| a.broadside_per_mm().total_cmp(&b.broadside_per_mm()));
        let (Some(largest), true) = (largest, total > 0.0) else {
            return Summary {
                density_per_mm: 0.0,
                sggx: Sym3::IDENTITY,
                axis: largest.map_or(Vec3::Z, |c| c.axis),
                spread_rad: largest.map_or(0.0, |c| c.spread_rad),
                yarn: largest.map_or(0, |c| c.yarn),
            };
        };
        let mean = components.iter().fold(Sym3::default(), |s, c| {
            let share = c.broadside_per_mm() / total;
            s.plus(sggx(c.axis, c.spread_rad).scaled(share))
        });
        Summary {
            density_per_mm: total,
            sggx: mean,
            axis: largest.axis,
            spread_rad: largest.spread_rad,
            yarn: largest.yarn,
        }
    }
}

/// One level of an octree as Mitsuba's three grids.
#[derive(Clone, Debug, PartialEq)]
pub struct VolTriple {
    /// One channel: extinction at unit projected area, 1/mm.
    pub sigma_t: VolGrid,
    /// Six channels: SGGX matrix xx, yy, zz, xy, xz, yz.
    pub sggx: VolGrid,
    /// Three channels: albedo, the extinction-weighted mean over materials.
    pub albedo: VolGrid,
}

/// Flattens a level. `albedo(material)` gives the single-scattering albedo of
/// the cloth's materials; cells without fibre get that of material 0.
///
/// Needs 40 bytes for each cell of the box, occupied or not.
pub fn vol_triple(octree: &Octree, level: u8, albedo: &dyn Fn(u16) -> Rgb) -> VolTriple {
    let dims = octree.dims(level);
    let cells = dims.as_u64vec3().element_product() as usize;
    let grid = |channels: u32, empty: &[f32]| VolGrid {
        dims,
        channels,
        bounds_mm: octree.bounds_mm(),
        data: empty.repeat(cells),
    };
    let colour = |c: Rgb| c.0.to_array();
    let mut out = VolTriple {
        sigma_t: grid(1, &[0.0]),
        sggx: grid(6, &Sym3::IDENTITY.to_array()),
        albedo: grid(3, &colour(albedo(0))),
    };
    octree.for_each_occupied(level, |cell: UVec3| {
        let mixture = octree.mixture(level, cell);
        let s = Summary::of(&mixture);
        out.sigma_t.cell_mut(cell)[0] = s.density_per_mm;
        out.sggx.cell_mut(cell).copy_from_slice(&s.sggx.to_array());
        if s.density_per_mm > 0.0 {
            let mut sum = [0.0; 3];
            for c in mixture.as_slice() {
                let share = c.broadside_per_mm() / s.density_per_mm;
                for (x, a) in sum.iter_mut().zip(colour(albedo(c.material))) {
                    *x += share * a;
                }
            }
            out.albedo.cell_mut(cell).copy_from_slice(&sum);
        }
    });
    out
}
