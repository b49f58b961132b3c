//! An opaque plane: the table below the cloth, or a table of light.

use glam::{DVec3, Vec3};
use organza_basis::{Frame, PathRng, Ray, Rgb, warp};
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
/// coordinate: several roundings, and far below a fibre.
const LIFT: f32 = 2e-6;

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

    pub(crate) fn hit(&self, ray: &Ray, limit: f32) -> Option<f32> {
        let t = self.distance_mm(ray.origin.as_dvec3(), ray.direction.as_dvec3()) as f32;
        (t < limit).then_some(t)
    }

    /// Radiance that the plane sends along `w_out`.
    pub(crate) fn emitted(&self, w_out: Vec3) -> Rgb {
        if w_out.dot(self.normal) > 0.0 {
            self.radiance
        } else {
            Rgb::BLACK
        }
    }

    /// How far above the plane a ray starts at a point, on the side of `w_in`.
    pub(crate) fn lift_mm(&self, at: Vec3, w_in: Vec3) -> Vec3 {
        let off = LIFT * at.abs().max_element().max(1.0);
        off * w_in.dot(self.normal).signum() * self.normal
    }

    pub(crate) fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.pdf(w_out, w_in) * self.reflectance
    }

    pub(crate) fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        let (o, i) = (w_out.dot(self.normal), w_in.dot(self.normal));
        if o * i > 0.0 {
            i.abs() * FRAC_1_PI
        } else {
            0.0
        }
    }

    pub(crate) fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
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
