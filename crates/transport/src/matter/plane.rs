//! An opaque plane: the table below the cloth, or a table of light.

use crate::matter::collision::{AnySite, Collision};
use crate::matter::ray_target::{Query, RayTarget};
use crate::matter::site::Site;
use crate::{SiteInfo, Stats};
use glam::{DVec3, Vec2, Vec3};
use organza_basis::{CellGrid, Frame, PathRng, Ray, Rgb, warp};
use organza_scatter::LobeSample;
use std::f32::consts::FRAC_1_PI;

/// An endless plane that scatters light evenly on both sides (Lambert) and may
/// shine on the side of its normal, the same in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    position_mm: Vec3,
    normal: Vec3,
    reflectance: Rgb,
    radiance: Rgb,
}

/// A ray that starts on the plane is moved off by this part of its greatest
/// coordinate: many roundings, and far below a fibre.
const LIFT: f64 = 1e-12;

impl Plane {
    /// A plane through a point. `None` unless point and normal are finite, the
    /// normal is not zero, reflectance lies in `[0, 1]` and radiance is finite
    /// and not negative.
    pub fn new(position_mm: Vec3, normal: Vec3, reflectance: Rgb, radiance: Rgb) -> Option<Plane> {
        let normal = normal.try_normalize()?;
        let good = position_mm.is_finite()
            && reflectance.is_valid()
            && reflectance.max_component() <= 1.0
            && radiance.is_valid();
        good.then_some(Plane {
            position_mm,
            normal,
            reflectance,
            radiance,
        })
    }

    /// A point of the plane and its unit normal.
    pub fn position_and_normal(&self) -> (Vec3, Vec3) {
        (self.position_mm, self.normal)
    }

    /// Share of light that it scatters.
    pub fn reflectance(&self) -> Rgb {
        self.reflectance
    }

    /// Radiance on the side of the normal.
    pub fn radiance(&self) -> Rgb {
        self.radiance
    }

    /// Distance along a ray; infinite when it misses.
    pub(crate) fn distance_mm(&self, origin_mm: DVec3, direction: DVec3) -> f64 {
        let n = self.normal.as_dvec3();
        let t = (self.position_mm.as_dvec3() - origin_mm).dot(n) / direction.dot(n);
        // Rays in the plane divide by zero and miss it.
        if t > 0.0 { t } else { f64::INFINITY }
    }

    fn hit(&self, ray: &Ray, limit: f64) -> Option<f64> {
        let t = self.distance_mm(ray.origin, ray.direction.as_dvec3());
        (t < limit).then_some(t)
    }

    /// Radiance that the plane sends along `w_out`.
    fn emitted(&self, w_out: Vec3) -> Rgb {
        if w_out.dot(self.normal) > 0.0 {
            self.radiance
        } else {
            Rgb::BLACK
        }
    }

    /// How far above the plane a ray starts at a point, on the side of `w_in`.
    fn lift_mm(&self, at: DVec3, w_in: Vec3) -> Vec3 {
        let off = (LIFT * at.abs().max_element().max(1.0)) as f32;
        off * w_in.dot(self.normal).signum() * self.normal
    }

    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.pdf(w_out, w_in) * self.reflectance
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        let (o, i) = (w_out.dot(self.normal), w_in.dot(self.normal));
        if o * i > 0.0 {
            i.abs() * FRAC_1_PI
        } else {
            0.0
        }
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        if self.reflectance.is_black() {
            return None;
        }
        let side = w_out.dot(self.normal).signum() * self.normal;
        let local = warp::cosine_hemisphere(rng.unit2());
        let w_in = Frame::from_normal(side).world_from_frame(local);
        let pdf = self.pdf(w_out, w_in);
        (pdf > 0.0).then_some(LobeSample {
            w_in,
            weight: self.reflectance,
            pdf,
        })
    }
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

    fn collide(
        &self,
        query: Query<'_>,
        _rng: &mut PathRng,
        _stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let ray = query.ray;
        let t = self.hit(ray, query.reach_mm)?;
        let site = PlaneSite {
            plane: self,
            at: ray.at(t),
        };
        Some(Collision::new(t, AnySite::Plane(site)))
    }

    fn pass(&self, query: Query<'_>, _rng: &mut PathRng, _stats: &mut Stats) -> f32 {
        f32::from(self.hit(query.ray, query.reach_mm).is_none())
    }
}

/// Where a plane is hit.
pub(crate) struct PlaneSite<'a> {
    plane: &'a Plane,
    at: DVec3,
}

impl Site for PlaneSite<'_> {
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.plane.eval(w_out, w_in)
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        self.plane.sample(w_out, rng)
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        self.plane.pdf(w_out, w_in)
    }

    fn exit_mm(&self, _w_out: Vec3, w_in: Vec3, _rng: &mut PathRng) -> Vec3 {
        self.plane.lift_mm(self.at, w_in)
    }

    fn info(&self) -> Option<SiteInfo> {
        None
    }

    fn emitted(&self, w_out: Vec3) -> Rgb {
        self.plane.emitted(w_out)
    }
}
