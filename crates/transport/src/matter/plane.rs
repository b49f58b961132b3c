//! Planes as the general walk meets them.

use crate::matter::collision::{AnySite, Collision, Met};
use crate::matter::ray_target::{Query, RayTarget};
use crate::matter::site::Site;
use crate::{Plane, SiteInfo, Stats};
use glam::{DVec3, Vec2, Vec3};
use organza_basis::{CellGrid, PathRng, Ray, Rgb};
use organza_kernel::fibres::LIFT;
use organza_scatter::LobeSample;

/// How far along a ray a plane is hit.
fn hit(plane: &Plane, ray: &Ray, limit: f64) -> Option<f64> {
    let t = plane.distance_mm(ray.origin, ray.direction.as_dvec3());
    (t < limit).then_some(t)
}

impl RayTarget for Plane {
    fn cell_grid(&self) -> Option<&CellGrid> {
        None
    }

    fn cut_to(&mut self, _min_mm: Vec2, _max_mm: Vec2) -> Option<()> {
        None
    }

    fn is_piecewise_constant(&self) -> bool {
        true
    }

    fn collide(&self, query: Query<'_>, _rng: &mut PathRng, _stats: &mut Stats) -> Met<'_> {
        let ray = query.ray;
        let t = hit(self, ray, query.reach_mm)?;
        let site = PlaneSite {
            plane: self,
            at: ray.at(t),
        };
        Some(Collision::new(t, AnySite::Plane(site)))
    }

    fn pass(&self, query: Query<'_>, _rng: &mut PathRng, _stats: &mut Stats) -> f32 {
        f32::from(hit(self, query.ray, query.reach_mm).is_none())
    }
}

/// Where a plane is hit.
pub(crate) struct PlaneSite<'a> {
    plane: &'a Plane,
    at: DVec3,
}

impl Site for PlaneSite<'_> {
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.plane.pdf(w_out, w_in) * self.plane.reflectance()
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let weight = self.plane.reflectance();
        if weight.is_black() {
            return None;
        }
        let w_in = self.plane.draw(w_out, rng);
        let pdf = self.plane.pdf(w_out, w_in);
        (pdf > 0.0).then_some(LobeSample { w_in, weight, pdf })
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        self.plane.pdf(w_out, w_in)
    }

    /// A hair above the plane, on the side of `w_in`.
    fn exit_mm(&self, _w_out: Vec3, w_in: Vec3, _rng: &mut PathRng) -> Vec3 {
        let off = (LIFT * self.at.abs().max_element().max(1.0)) as f32;
        let (_, normal) = self.plane.position_and_normal();
        off * w_in.dot(normal).signum() * normal
    }

    fn info(&self) -> Option<SiteInfo> {
        None
    }

    fn emitted(&self, w_out: Vec3) -> Rgb {
        self.plane.emitted(w_out)
    }
}
