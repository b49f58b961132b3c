//! Camera rays in lanes: from film points to where matter begins.
//!
//! [`organza_film::Camera`] makes the rays of the general walk.

use super::borders::Borders;
use glam::{DVec3, Vec3};
use organza_basis::CellGrid;
use organza_film::{Camera, PixelFilter, Projection};
use organza_lanes::Floats;
use organza_lanes::math::{LaneRng, V3, minus_ln, positive, sin_cos_of_turns, with_sign_of};

/// A camera, seen from one medium.
///
/// A ray is given by the point where it crosses a plane near the matter (that
/// in focus, for a lens) and the way there from the camera: both are linear in
/// the film point and small enough for `f32`, however far the camera is.
pub struct CameraRays {
    pub filter: PixelFilter,
    /// Half the picture's columns and rows.
    pub half_size: [f32; 2],
    /// Film units per pixel.
    pub scale: f32,
    /// Crossing point in voxels, for the middle of the film and per unit of x
    /// and y.
    pub crossing: [Vec3; 3],
    /// From camera to crossing point, mm; the same three.
    pub way_mm: [Vec3; 3],
    /// Half the lens in x and y, mm.
    pub lens_mm: Option<[Vec3; 2]>,
}

/// Rays that were made.
pub struct NewRays<F: Floats> {
    /// Where they begin, in voxels.
    pub at: V3<F>,
    /// Unit directions.
    pub direction: V3<F>,
    /// Distance from the camera to there, mm.
    pub depth_mm: F,
    /// Those that miss the matter.
    pub missing: F::Mask,
}

impl CameraRays {
    pub fn new(camera: &Camera, cell_grid: &CellGrid) -> CameraRays {
        let bounds = cell_grid.bounds_mm();
        let per_mm = (1.0 / cell_grid.voxel_mm()).as_dvec3();
        let centre = bounds.centre().as_dvec3();
        CameraRays::in_frame(camera, bounds.min.as_dvec3(), per_mm, centre)
    }

    /// The same for matter about `centre`, with crossing points counted from `min` in units
    /// of which there are so many in a mm.
    pub fn in_frame(camera: &Camera, min: DVec3, per_mm: DVec3, centre: DVec3) -> CameraRays {
        let parts = camera.parts();
        let ahead = (centre - parts.origin_mm).dot(parts.forward);
        // A camera beyond the middle of the matter looks through the same plane
        // backwards; any other will do.
        let ahead = if ahead > 0.0 { ahead } else { 1.0 };
        let (distance, spread, aperture) = match parts.projection {
            Projection::Orthographic { .. } => (ahead, 0.0, 0.0),
            Projection::Perspective { .. } => (ahead, ahead, 0.0),
            Projection::ThinLens {
                aperture_mm,
                focus_mm,
                ..
            } => (focus_mm, focus_mm, aperture_mm),
        };
        let middle = distance * parts.forward;
        let crossing = |v: DVec3| (v * per_mm).as_vec3();
        let beside = match parts.projection {
            Projection::Orthographic { .. } => 1.0,
            _ => distance,
        };
        let size = camera.resolution();
        CameraRays {
            filter: parts.filter,
            half_size: [0.5 * size.x as f32, 0.5 * size.y as f32],
            scale: (parts.film_width / f64::from(size.x)) as f32,
            crossing: [
                crossing(parts.origin_mm + middle - min),
                crossing(beside * parts.right),
                crossing(beside * parts.up),
            ],
            way_mm: [middle, spread * parts.right, spread * parts.up].map(|v| v.as_vec3()),
            lens_mm: (aperture > 0.0)
                .then(|| [parts.right, parts.up].map(|v| (0.5 * aperture * v).as_vec3())),
        }
    }

    /// One ray for each lane of `mask`, through the pixel at column `x` and
    /// row `y`.
    #[inline(always)]
    pub fn rays<F: Floats>(
        &self,
        cell_grid: &CellGrid,
        borders: Option<Borders>,
        (x, y): (F, F),
        rng: &mut LaneRng<F::Ints>,
        mask: F::Mask,
    ) -> NewRays<F> {
        let [a, b, c] = rng.units(mask);
        let half = F::splat(0.5);
        let (mut on_lens_x, mut on_lens_y) = (F::splat(0.0), F::splat(0.0));
        let mut d = F::splat(0.0);
        if self.lens_mm.is_some() || self.filter == PixelFilter::Tent {
            let [fourth, radius, angle] = rng.units(mask);
            d = fourth;
            let (sin, cos) = sin_cos_of_turns(angle);
            let radius = radius.sqrt();
            (on_lens_x, on_lens_y) = (radius * cos, radius * sin);
        }
        let (dx, dy) = match self.filter {
            PixelFilter::Box => (a - half, b - half),
            PixelFilter::Tent => (a + b - F::splat(1.0), c + d - F::splat(1.0)),
            PixelFilter::Gaussian => {
                let (sin, cos) = sin_cos_of_turns(b);
                let radius = half * (minus_ln(positive(a)) * F::splat(2.0)).sqrt();
                (radius * cos, radius * sin)
            }
        };
        let scale = F::splat(self.scale);
        let film_x = (x + half - F::splat(self.half_size[0]) + dx) * scale;
        let film_y = (F::splat(self.half_size[1]) - half - y - dy) * scale;
        let mut way = linear(self.way_mm, film_x, film_y);
        if let Some([right, up]) = self.lens_mm {
            way = V3::splat(-right).scaled_add(on_lens_x, way);
            way = V3::splat(-up).scaled_add(on_lens_y, way);
        }
        let length = way.dot(way).sqrt();
        let direction = way.scaled(F::splat(1.0) / length);
        let crossing = linear(self.crossing, film_x, film_y);
        let step = direction.times(V3::splat(1.0 / cell_grid.voxel_mm()));
        let inverse = inverse_of_step(step);
        let dims = cell_grid.dims().as_vec3();
        let (low, high) = between(crossing.z, inverse.z, 0.0, dims.z);
        let (mut near, mut far) = (low.max(-length), high);
        if let Some(borders) = borders {
            let (first, last) = (borders.low, borders.high);
            let (low, high) = between(crossing.x, inverse.x, first.x, last.x);
            (near, far) = (near.max(low), far.min(high));
            let (low, high) = between(crossing.y, inverse.y, first.y, last.y);
            (near, far) = (near.max(low), far.min(high));
        }
        NewRays {
            at: step.scaled_add(near, crossing),
            direction,
            depth_mm: near + length,
            missing: !near.below(far),
        }
    }
}

/// The value at a film point of what is linear in it.
#[inline(always)]
fn linear<F: Floats>([v, per_x, per_y]: [Vec3; 3], x: F, y: F) -> V3<F> {
    V3::splat(per_y).scaled_add(y, V3::splat(per_x).scaled_add(x, V3::splat(v)))
}

/// Where a ray passes two places along one axis.
#[inline(always)]
fn between<F: Floats>(at: F, per_step: F, low: f32, high: f32) -> (F, F) {
    let a = (F::splat(low) - at) * per_step;
    let b = (F::splat(high) - at) * per_step;
    (a.min(b), a.max(b))
}

/// One over a step, where zero counts as very little; by one division.
#[inline(always)]
pub fn inverse_of_step<F: Floats>(step: V3<F>) -> V3<F> {
    let (x, y, z) = (not_zero(step.x), not_zero(step.y), not_zero(step.z));
    let (xy, yz) = (x * y, y * z);
    let per_all = F::splat(1.0) / (xy * z);
    V3::new(yz * per_all, x * z * per_all, xy * per_all)
}

#[inline(always)]
fn not_zero<F: Floats>(s: F) -> F {
    let little = F::splat(1e-10);
    s.or_where_not(little.below(s.abs()), with_sign_of(little, s))
}
