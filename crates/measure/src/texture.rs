//! Pictures of a patch: one value per texel for a pair of directions.

use crate::parts::measure_parts;
use crate::{MeasureError, Pair, PatchResponse};
use glam::{UVec2, Vec2};
use organza_basis::{Moments, PathRng, Stopped, Watch};
use organza_transport::Stats;

/// The positions of the texels in the middle plane of the cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TexelGrid {
    /// Lower left corner, mm.
    pub low_mm: Vec2,
    /// Extent, mm.
    pub size_mm: Vec2,
    /// Texels in x and y.
    pub texels: UVec2,
}

/// The BSDF over a patch. Texels lie in the plane of the cloth, so every direction of view
/// fills the same texels.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// The directions.
    pub pair: Pair,
    /// Means per texel, 1/sr, the row of the largest y first.
    pub mean: Vec<[f32; 3]>,
    /// Their standard errors.
    pub se: Vec<[f32; 3]>,
}

/// Streams of random numbers that belong to texels.
const TEXEL_STREAMS: u64 = 1 << 62;

/// Measures a picture with `paths` paths per texel. `watch` is called with the number of finished
/// paths, from any thread.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_texture(
    patch: &impl PatchResponse,
    pair: Pair,
    grid: &TexelGrid,
    paths: u64,
    seed: u64,
    watch: Watch<'_>,
) -> Result<Texture, MeasureError> {
    if paths < 2 {
        return Err(MeasureError::TooFewPaths(paths));
    }
    let (w_in, w_out) = (pair.incident.direction(), pair.exitant.direction());
    let texel_mm = grid.size_mm / grid.texels.as_vec2();
    let row = |y: usize| {
        let y = y as u32;
        let mut stats = Stats::default();
        let mut list = Vec::with_capacity(grid.texels.x as usize);
        for x in 0..grid.texels.x {
            let corner = UVec2::new(x, grid.texels.y - 1 - y).as_vec2();
            let stream = TEXEL_STREAMS + u64::from(y) * u64::from(grid.texels.x) + u64::from(x);
            let mut moments = [Moments::default(); 3];
            for path in 0..paths {
                let mut rng = PathRng::new(seed, stream, path);
                let place = grid.low_mm + (corner + rng.unit2()) * texel_mm;
                let value = patch.estimate_at(place, w_in, w_out, &mut rng, &mut stats);
                if !value.0.is_finite() {
                    stats.rejected += 1;
                    continue;
                }
                for (m, v) in moments.iter_mut().zip(value.0.to_array()) {
                    m.add(f64::from(v));
                }
            }
            list.push(moments);
        }
        Stopped::check(watch(paths * u64::from(grid.texels.x)))?;
        Ok((list, stats))
    };
    let (rows, _) = measure_parts(grid.texels.y as usize, row)?;
    let texels = || rows.iter().flatten();
    Ok(Texture {
        pair,
        mean: texels().map(|m| m.map(|c| c.mean as f32)).collect(),
        se: texels()
            .map(|m| m.map(|c| c.standard_error() as f32))
            .collect(),
    })
}
