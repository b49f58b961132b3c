//! An opaque plane: the table below the cloth, or a table of light.

use glam::{DVec3, Vec3};
use organza_basis::{Frame, PathRng, Rgb, warp};
use std::f32::consts::FRAC_1_PI;

/// A ray that starts on the plane is moved off by this part of its greatest
/// coordinate: many roundings, and far below a fibre.
pub const LIFT: f64 = 1e-12;

/// An endless plane that scatters light evenly on both sides (Lambert) and may shine on
/// the side of its normal, the same in all directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    pub(crate) position_mm: Vec3,
    pub(crate) normal: Vec3,
    pub(crate) reflectance: Rgb,
    pub(crate) radiance: Rgb,
}

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
    pub fn distance_mm(&self, origin_mm: DVec3, direction: DVec3) -> f64 {
        let n = self.normal.as_dvec3();
        let t = (self.position_mm.as_dvec3() - origin_mm).dot(n) / direction.dot(n);
        // Rays in the plane divide by zero and miss it.
        if t > 0.0 { t } else { f64::INFINITY }
    }

    /// Radiance that it sends along `w_out`.
    pub fn emitted(&self, w_out: Vec3) -> Rgb {
        if w_out.dot(self.normal) > 0.0 {
            self.radiance
        } else {
            Rgb::BLACK
        }
    }

    /// Where a ray toward `w_in` starts that leaves the plane at a point.
    pub(super) fn start_mm(&self, at_mm: DVec3, w_in: Vec3) -> DVec3 {
        let off = LIFT * at_mm.abs().max_element().max(1.0);
        let side = f64::from(w_in.dot(self.normal).signum());
        at_mm + off * side * self.normal.as_dvec3()
    }

    /// Density with which directions of light are drawn, 1/sr.
    pub fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        let (o, i) = (w_out.dot(self.normal), w_in.dot(self.normal));
        if o * i > 0.0 {
            i.abs() * FRAC_1_PI
        } else {
            0.0
        }
    }

    /// Draws where light comes from, on the side of `w_out`.
    pub fn draw(&self, w_out: Vec3, rng: &mut PathRng) -> Vec3 {
        let side = w_out.dot(self.normal).signum() * self.normal;
        let local = warp::cosine_hemisphere(rng.unit2());
        Frame::from_normal(side).world_from_frame(local)
    }
}
