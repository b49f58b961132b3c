//! Sums over paths that look straight down on every texel of a tile.

use crate::parts::measure_parts;
use crate::{Look, MeasureError, PatchResponse, PathNames, PathRun, TexelGrid};
use glam::{UVec2, Vec2};
use organza_basis::{Rgb, Stopped, Watch};
use organza_transport::Stats;

/// What the paths through one texel found, along the normal of the face.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LookSums {
    /// Paths.
    pub count: u32,
    /// Paths that met the cloth.
    pub hits: u32,
    /// Sum of the weights of paths that were reflected.
    pub reflected: Rgb,
    /// The part of `reflected` whose paths met one fibre only.
    pub reflected_once: Rgb,
    /// Sum of the weights of paths that were scattered to the other side.
    pub transmitted: Rgb,
    /// Sum of the heights of the first fibre over the middle plane, mm.
    pub height_mm: f32,
    /// Sum of the squares of the horizontal part of the fibre axis, as complex numbers, so
    /// that opposite axes count alike: `(x^2 - y^2, 2 x y)`.
    pub axis: Vec2,
}

/// Streams of random numbers that belong to rows of texels.
const LOOK_STREAMS: u64 = (1 << 62) + (1 << 61);

/// Paths that one thread traces at a time; this bounds the memory of their samples.
const MAX_AT_ONCE: u64 = 1 << 15;

/// Traces `paths` paths through every texel, rows of the largest y first. `watch` is called
/// with the number of finished paths, from any thread.
///
/// # Errors
/// See [`MeasureError`].
pub fn gather_looks(
    patch: &impl PatchResponse,
    grid: &TexelGrid,
    paths: u32,
    seed: u64,
    watch: Watch<'_>,
) -> Result<Vec<LookSums>, MeasureError> {
    let texel_mm = grid.size_mm / grid.texels.as_vec2();
    let row = |y: usize| {
        let y = y as u32;
        let mut stats = Stats::default();
        let mut sums = vec![LookSums::default(); grid.texels.x as usize];
        let total = u64::from(grid.texels.x) * u64::from(paths);
        let place = |path: u64, rng: &mut organza_basis::PathRng| {
            let x = (path / u64::from(paths)) as u32;
            let corner = UVec2::new(x, grid.texels.y - 1 - y).as_vec2();
            grid.low_mm + (corner + rng.unit2()) * texel_mm
        };
        let (mut path, mut rejected) = (0u64, 0);
        let mut found = |look: Look| {
            let texel = sums.get_mut((path / u64::from(paths)) as usize);
            path += 1;
            let energy = look.exit.energy(glam::Vec3::Z);
            if !energy.sum().0.is_finite() {
                rejected += 1;
                return;
            }
            let Some(texel) = texel else { return };
            texel.count += 1;
            let Some(first) = look.first else { return };
            texel.hits += 1;
            texel.reflected += energy.reflected;
            if look.events == 1 {
                texel.reflected_once += energy.reflected;
            }
            texel.transmitted += energy.transmitted;
            texel.height_mm += first.height_mm;
            let (x, y) = (first.axis.x, first.axis.y);
            texel.axis += Vec2::new(x * x - y * y, 2.0 * x * y);
        };
        for first in (0..total).step_by(MAX_AT_ONCE as usize) {
            let names = PathNames::new(
                seed,
                LOOK_STREAMS + u64::from(y),
                first..(first + MAX_AT_ONCE).min(total),
            );
            let run = PathRun::new(&names, &mut stats, &mut found);
            patch.each_look(&place, run);
        }
        stats.rejected += rejected;
        Stopped::check(watch(total))?;
        Ok((sums, stats))
    };
    let (rows, _) = measure_parts(grid.texels.y as usize, row)?;
    Ok(rows.concat())
}
