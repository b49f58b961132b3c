//! `kind = "disc"`: a disc that emits light, such as a round lamp or its diffuser.

use crate::catalogue::{LightError, LightKind, LoadPicture, brightness};
use crate::light::{KernelLight, Light, LightSample, LightSearch, LightSource};
use crate::mitsuba::{self, MitsubaLight};
use crate::rectangle::RectangleLight;
use glam::{DVec3, Vec3};
use organza_basis::{PathRng, Ray, Rgb};
use serde::Deserialize;

/// A disc with the same radiance everywhere and in all directions to its side.
///
/// Directions are drawn from the solid angle of the square around it; those beside the disc
/// send no shadow ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiscLight {
    centre_mm: Vec3,
    radius_mm: f32,
    square: RectangleLight,
}

impl DiscLight {
    /// A disc that shines along a direction, or to both sides; `None` where it has no area or
    /// no side.
    pub fn new(
        centre_mm: Vec3,
        direction: Vec3,
        radius_mm: f32,
        radiance: Rgb,
        two_sided: bool,
    ) -> Option<DiscLight> {
        let (u, v) = direction.try_normalize()?.any_orthonormal_pair();
        let (u, v) = (2.0 * radius_mm * u, 2.0 * radius_mm * v);
        let corner = centre_mm - 0.5 * (u + v);
        let square = RectangleLight::new(corner, u, v, radiance, two_sided).ok()?;
        (radius_mm > 0.0).then_some(DiscLight {
            centre_mm,
            radius_mm,
            square,
        })
    }

    fn holds(&self, origin_mm: DVec3, direction: DVec3, distance_mm: f64) -> bool {
        let beside = origin_mm + distance_mm * direction - self.centre_mm.as_dvec3();
        beside.length() <= f64::from(self.radius_mm)
    }
}

/// The `[[light]]` table of a disc.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DiscTable {
    /// Its middle.
    pub centre_mm: [f32; 3],
    /// Where its light goes, across the disc; any length.
    pub direction: [f32; 3],
    /// Radius.
    pub radius_mm: f32,
    /// Radiance, linear RGB.
    pub radiance: [f32; 3],
    /// Whether both sides shine.
    #[serde(default)]
    pub two_sided: bool,
}

impl LightKind for DiscTable {
    fn example() -> &'static str {
        "centre_mm = [0.0, 0.0, 60.0]\ndirection = [0.0, 0.0, -1.0]\n\
        radius_mm = 20.0\nradiance = [2.0, 2.0, 2.0]"
    }

    fn build(&self, _: &LoadPicture<'_>) -> Result<Light, LightError> {
        let radiance = brightness(self.radiance, "radiance")?;
        let (centre, direction) = (self.centre_mm.into(), self.direction.into());
        if !Vec3::is_finite(centre) {
            let why = format!("expected three finite numbers, found {:?}", self.centre_mm);
            return Err(LightError::of("centre_mm", why));
        }
        if Vec3::try_normalize(direction).is_none() {
            let why = "expected a finite vector that is not zero";
            return Err(LightError::of("direction", why));
        }
        DiscLight::new(centre, direction, self.radius_mm, radiance, self.two_sided)
            .map(Light::from)
            .ok_or_else(|| {
                let why = format!("expected a finite number above 0, found {}", self.radius_mm);
                LightError::of("radius_mm", why)
            })
    }

    fn sides(&self, height_mm: f64) -> [bool; 2] {
        let normal = Vec3::from(self.direction).normalize_or(Vec3::Z);
        let reach = f64::from(self.radius_mm * normal.truncate().length());
        let height = f64::from(self.centre_mm[2]);
        [height + reach > height_mm, height - reach < height_mm]
    }
}

impl LightSource for DiscLight {
    fn radiance_toward(&self, direction: Vec3) -> Rgb {
        self.square.radiance_toward(direction)
    }

    fn search(&self) -> LightSearch {
        LightSearch::Both
    }

    fn sample_toward(&self, from_mm: Vec3, rng: &mut PathRng) -> Option<LightSample> {
        let (w_in, pdf) = self.square.sample_toward(from_mm, rng)?;
        self.distance_along(&Ray::new(from_mm, w_in))?;
        Some(LightSample {
            w_in,
            irradiance: self.square.radiance_toward(w_in) / pdf,
            pdf,
        })
    }

    fn pdf_toward(&self, from_mm: Vec3, w_in: Vec3) -> f32 {
        match self.distance_along(&Ray::new(from_mm, w_in)) {
            Some(_) => self.square.pdf_toward(from_mm, w_in),
            None => 0.0,
        }
    }

    fn distance_along(&self, ray: &Ray) -> Option<f64> {
        self.distance_mm(ray.origin, ray.direction.as_dvec3())
    }

    fn distance_mm(&self, origin_mm: DVec3, direction: DVec3) -> Option<f64> {
        let distance_mm = self.square.distance_mm(origin_mm, direction)?;
        self.holds(origin_mm, direction, distance_mm)
            .then_some(distance_mm)
    }

    fn for_kernel(&self) -> KernelLight<'_> {
        KernelLight::Placed {
            bounds_mm: self.square.bounds_mm(),
            radiance: self.square.radiance(),
        }
    }

    fn for_mitsuba(&self, _: usize) -> Result<MitsubaLight, String> {
        let [_, u, v] = self.square.corner_and_edges_mm();
        let frame = [0.5 * u, 0.5 * v, self.centre_mm];
        let (radiance, two_sided) = (self.square.radiance(), self.square.is_two_sided());
        Ok(mitsuba::area_light("disk", frame, radiance, two_sided))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::Moments;
    use organza_basis::hypothesis::t_test;

    /// On its axis a disc lights a plane with pi L r^2 / (r^2 + d^2), also very near to it. The
    /// twin is the square around it.
    #[test]
    fn irradiance_on_the_axis_is_the_closed_form() {
        let disc = DiscLight::new(Vec3::ZERO, Vec3::NEG_Z, 3.0, Rgb::WHITE, false).unwrap();
        let mut rng = PathRng::from_seed(31);
        for depth_mm in [0.05f32, 2.0, 40.0] {
            let from = Vec3::new(0.0, 0.0, -depth_mm);
            let irradiance = |light: &dyn LightSource, rng: &mut PathRng| -> Moments {
                let drawn = (0..20_000).map(|_| light.sample_toward(from, rng));
                drawn
                    .map(|d| d.map_or(0.0, |d| f64::from(d.irradiance.0.x * d.w_in.z)))
                    .collect()
            };
            let square = f64::from(9.0 + depth_mm * depth_mm);
            let exact = std::f64::consts::PI * 9.0 / square;
            let got = irradiance(&disc, &mut rng);
            let verdict = t_test(&got, exact);
            assert!(
                verdict.p_value > 1e-4,
                "seed 31, {depth_mm}: {got:?} {exact}"
            );
            let twin = t_test(&irradiance(&disc.square, &mut rng), exact);
            assert!(twin.p_value < 1e-6 || depth_mm < 1.0, "seed 31, {depth_mm}");
        }
        // Behind it there is none.
        assert!(disc.sample_toward(Vec3::Z, &mut rng).is_none());
        assert_eq!(disc.pdf_toward(Vec3::NEG_Z, Vec3::X), 0.0);
    }
}
