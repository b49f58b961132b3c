//! A scene: its matter, lights and camera.

use crate::matter::collision::Collision;
use crate::matter::level_choice::{Detail, Progress, Tracking};
use crate::matter::ray_target::Query;
use crate::{AnyMedium, Camera, Integrator, Light, Stats};
use glam::DVec3;
use organza_basis::{PathRng, Ray};

/// Media, lights and the camera that looks at them.
pub struct Scene {
    /// Matter; extinctions of media add where boxes overlap.
    pub media: Vec<AnyMedium>,
    /// Lights; their light adds.
    pub lights: Vec<Light>,
    /// The camera.
    pub camera: Camera,
}

impl Scene {
    /// The first collision along a ray, with whichever matter. Collisions of
    /// superposed media are independent, so the nearest of each medium's own
    /// first collision is the first of their sum.
    pub fn first_collision(
        &self,
        ray: &Ray,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let mut nearest: Option<Collision<'_>> = None;
        for medium in &self.media {
            let query = Query {
                ray,
                reach_mm: nearest.as_ref().map_or(f64::INFINITY, |c| c.t),
                tracking,
                over: None,
            };
            nearest = medium.target().collide(query, rng, stats).or(nearest);
        }
        if let Some(collision) = &mut nearest {
            collision.draw_event(-ray.direction, rng);
        }
        nearest
    }

    /// Peak bytes of the cells of explicit fibres that the general walk lays out when it
    /// first meets them: an estimate, 0 without explicit fibres.
    pub fn hierarchy_bytes(&self) -> u64 {
        let media = self.media.iter().map(|m| m.target().walk_bytes());
        media.fold(0, u64::saturating_add)
    }

    /// Estimates the transmittance from a point to `reach` mm along a ray,
    /// which may be infinite.
    pub fn transmittance(
        &self,
        ray: &Ray,
        reach: f64,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        stats.shadow_rays += 1;
        let query = Query {
            ray,
            reach_mm: reach,
            tracking,
            over: None,
        };
        let mut product = 1.0;
        for medium in &self.media {
            product *= medium.target().pass(query, rng, stats);
            if product == 0.0 {
                break;
            }
        }
        product
    }

    /// How a camera ray and the path that follows it track: through the
    /// representations that suit the width of its pixel.
    ///
    /// Random numbers are drawn only where there are several to choose from.
    pub fn tracking(
        &self,
        integrator: Integrator,
        (origin_mm, direction): (DVec3, DVec3),
        rng: &mut PathRng,
    ) -> Tracking {
        let cone = self.camera.pixel_cone(direction);
        let footprint = |m: &AnyMedium| match m {
            AnyMedium::Levelled(m) => m.footprint_mm(cone, origin_mm, direction),
            _ => None,
        };
        let nearest = self.media.iter().filter_map(footprint).reduce(f64::min);
        Tracking {
            integrator,
            detail: nearest.map_or(Detail::FINEST, |width| Detail {
                footprint_mm: width as f32,
                choice: rng.unit(),
            }),
            progress: Progress::NONE,
        }
    }

    /// Distance in mm along a ray from far away to just before the first
    /// matter or light with a place: where a walk in `f32` should start.
    pub fn near_start(&self, lights: &[Light], origin_mm: DVec3, direction: DVec3) -> f64 {
        let matter = self.media.iter().map(|m| match (m, m.cell_grid()) {
            (AnyMedium::Plane(p), _) => before(p.distance_mm(origin_mm, direction)),
            (_, Some(cell_grid)) => cell_grid.distance_mm(origin_mm, direction),
            (_, None) => f64::INFINITY,
        });
        let places = lights
            .iter()
            .filter_map(|l| l.distance_mm(origin_mm, direction))
            .map(before);
        let nearest = matter.chain(places).fold(f64::INFINITY, f64::min);
        if nearest.is_finite() { nearest } else { 0.0 }
    }
}

/// A little short of what has no thickness, which a ray that starts on it
/// would miss.
fn before(distance_mm: f64) -> f64 {
    (distance_mm - 1.0).max(0.0)
}
