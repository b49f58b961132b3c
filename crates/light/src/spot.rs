//! `kind = "spot"`: light from a point, into a cone with a soft edge or all around.

use crate::catalogue::{LightError, LightKind, LoadPicture, colour};
use crate::light::{KernelLight, Light, LightSample, LightSearch, LightSource};
use crate::mitsuba::{self, MitsubaLight};
use glam::Vec3;
use organza_basis::{PathRng, Ray, Rgb};
use serde::Deserialize;
use std::f32::consts::PI;

/// The `[[light]]` table of a spot.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpotTable {
    /// Where the light is.
    pub position_mm: [f32; 3],
    /// Radiant intensity along the axis, linear RGB: a plane that faces the light
    /// from d mm away has an irradiance of `intensity / d^2`.
    pub intensity: [f32; 3],
    /// Axis of the cone, away from the light; any length.
    pub direction: Option<[f32; 3]>,
    /// Angle between the axis and the edge of the cone; a point light without it.
    pub half_angle_deg: Option<f32>,
    /// Width of the cone's soft edge, within `half_angle_deg`; a quarter of that if
    /// none.
    pub falloff_deg: Option<f32>,
}

impl LightKind for SpotTable {
    fn example() -> &'static str {
        "position_mm = [0.0, 0.0, 60.0]\nintensity = [4000.0, 4000.0, 4000.0]"
    }

    fn build(&self, _: &LoadPicture<'_>) -> Result<Light, LightError> {
        let position_mm = Vec3::from_array(self.position_mm);
        if !position_mm.is_finite() {
            let why = format!(
                "expected three finite numbers, found {:?}",
                self.position_mm
            );
            return Err(LightError::of("position_mm", why));
        }
        let intensity = colour(self.intensity, "intensity")?;
        let Some(half_angle_deg) = self.half_angle_deg else {
            for (key, is_given) in [
                ("direction", self.direction.is_some()),
                ("falloff_deg", self.falloff_deg.is_some()),
            ] {
                if is_given {
                    let why = format!("{key} belongs to a spot with half_angle_deg");
                    return Err(LightError::Keys(why));
                }
            }
            return Ok(Light::from(SpotLight::point(position_mm, intensity)));
        };
        if !(half_angle_deg > 0.0 && half_angle_deg <= 180.0) {
            let why = format!("expected more than 0, at most 180, found {half_angle_deg}");
            return Err(LightError::of("half_angle_deg", why));
        }
        let falloff_deg = self.falloff_deg.unwrap_or(0.25 * half_angle_deg);
        if !(0.0..=half_angle_deg).contains(&falloff_deg) {
            let why = format!("expected 0 to half_angle_deg, found {falloff_deg}");
            return Err(LightError::of("falloff_deg", why));
        }
        let axis = self.direction.map(Vec3::from_array);
        let axis = axis.and_then(Vec3::try_normalize).ok_or_else(|| {
            LightError::of("direction", "expected a finite vector that is not zero")
        })?;
        Ok(Light::from(SpotLight {
            position_mm,
            intensity,
            axis,
            half_angle_rad: half_angle_deg.to_radians(),
            falloff_rad: falloff_deg.to_radians(),
        }))
    }

    fn sides(&self, height_mm: f64) -> [bool; 2] {
        let height = f64::from(self.position_mm[2]);
        [height > height_mm, height < height_mm]
    }
}

/// Light from a point, which only shadow rays find. Its intensity is even within
/// the cone and falls to zero across the edge by the cubic `3 x^2 - 2 x^3` in the
/// angle from the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpotLight {
    /// Where it is.
    pub position_mm: Vec3,
    /// Radiant intensity along the axis.
    pub intensity: Rgb,
    /// Unit axis of the cone, away from the light.
    pub axis: Vec3,
    /// Between the axis and the edge of the cone.
    pub half_angle_rad: f32,
    /// Width of the cone's soft edge.
    pub falloff_rad: f32,
}

impl SpotLight {
    /// A light that shines alike in all directions.
    pub fn point(position_mm: Vec3, intensity: Rgb) -> SpotLight {
        SpotLight {
            position_mm,
            intensity,
            axis: Vec3::NEG_Z,
            half_angle_rad: PI,
            falloff_rad: 0.0,
        }
    }

    /// Share of the intensity in a direction away from the light.
    fn share(&self, direction: Vec3) -> f32 {
        let inside = self.half_angle_rad - self.axis.angle_between(direction);
        if inside >= self.falloff_rad {
            1.0
        } else if inside <= 0.0 {
            0.0
        } else {
            let x = inside / self.falloff_rad;
            x * x * (3.0 - 2.0 * x)
        }
    }

    fn is_point(&self) -> bool {
        self.half_angle_rad >= PI && self.falloff_rad == 0.0
    }
}

impl LightSource for SpotLight {
    fn radiance_toward(&self, _: Vec3) -> Rgb {
        Rgb::BLACK
    }

    fn search(&self) -> LightSearch {
        LightSearch::ShadowRays
    }

    fn sample_toward(&self, from_mm: Vec3, _: &mut PathRng) -> Option<LightSample> {
        let to = self.position_mm - from_mm;
        let w_in = to.try_normalize()?;
        let share = if self.is_point() {
            1.0
        } else {
            self.share(-w_in)
        };
        let irradiance = self.intensity * (share / to.length_squared());
        let is_seen = irradiance.is_valid() && !irradiance.is_black();
        is_seen.then_some(LightSample {
            w_in,
            irradiance,
            pdf: f32::INFINITY,
        })
    }

    fn pdf_toward(&self, _: Vec3, _: Vec3) -> f32 {
        f32::INFINITY
    }

    fn distance_along(&self, ray: &Ray) -> Option<f64> {
        let t = (self.position_mm.as_dvec3() - ray.origin).dot(ray.direction.as_dvec3());
        (t > 0.0).then_some(t)
    }

    fn for_kernel(&self) -> KernelLight<'_> {
        KernelLight::Spot(self)
    }

    fn for_mitsuba(&self, index: usize) -> Result<MitsubaLight, String> {
        let (position, intensity) = (
            mitsuba::vector(self.position_mm),
            mitsuba::colour(self.intensity),
        );
        if self.is_point() {
            return Ok(MitsubaLight::of_xml(format!(
                r#"    <emitter type="point">
        <point name="position" value="{position}"/>
        <rgb name="intensity" value="{intensity}"/>
    </emitter>
"#
            )));
        }
        let cutoff_deg = self.half_angle_rad.to_degrees();
        let beam_deg = (self.half_angle_rad - self.falloff_rad).to_degrees();
        let mut spot = MitsubaLight::of_xml(format!(
            r#"    <emitter type="spot">
        <transform name="to_world"><lookat origin="{position}" target="{}" up="{}"/></transform>
        <rgb name="intensity" value="{intensity}"/>
        <float name="cutoff_angle" value="{cutoff_deg}"/>
        <float name="beam_width" value="{beam_deg}"/>
    </emitter>
"#,
            mitsuba::vector(self.position_mm + self.axis),
            mitsuba::vector(self.axis.any_orthonormal_vector()),
        ));
        if self.falloff_rad > 0.0 {
            spot.notes.push(format!(
                "light[{index}]: the soft edge of a spot is linear in Mitsuba, cubic here"
            ));
        }
        Ok(spot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::warp;

    fn build(text: &str) -> Result<Light, String> {
        let table: SpotTable = toml::from_str(text).unwrap();
        let none = |_: &str| Err(String::new());
        table.build(&none).map_err(|e| e.to_string())
    }

    /// Irradiance of a plane that faces the light at a place.
    fn irradiance(light: &Light, from_mm: Vec3) -> f32 {
        let mut rng = PathRng::from_seed(1);
        let sample = light.sample_toward(from_mm, &mut rng);
        sample.map_or(0.0, |s| s.irradiance.0.x)
    }

    const SPOT: &str = "position_mm = [1.0, 2.0, 3.0]\nintensity = [8.0, 8.0, 8.0]\n\
                        direction = [0.0, 0.0, -5.0]\nhalf_angle_deg = 40.0\nfalloff_deg = 10.0\n";

    #[test]
    fn intensity_falls_with_the_square_and_across_the_edge() {
        let light = build(SPOT).unwrap();
        let at = |angle_deg: f32, distance: f32| {
            let away = warp::direction_from_angles((180.0 - angle_deg).to_radians(), 0.7);
            irradiance(&light, Vec3::new(1.0, 2.0, 3.0) + distance * away)
        };
        for (angle_deg, distance, expected) in [
            (0.0, 2.0, 2.0),
            (29.0, 4.0, 0.5),
            (35.0, 2.0, 1.0),
            (37.5, 2.0, 2.0 * 0.156_25),
            (41.0, 2.0, 0.0),
            (120.0, 2.0, 0.0),
        ] {
            let got = at(angle_deg, distance);
            assert!((got - expected).abs() < 1e-4, "{angle_deg}: {got}");
        }
        assert_eq!(irradiance(&light, Vec3::new(1.0, 2.0, 3.0)), 0.0);
    }

    #[test]
    fn the_power_of_a_hard_cone_is_intensity_times_solid_angle() {
        let hard = SPOT.replace("falloff_deg = 10.0", "falloff_deg = 0.0");
        let point = "position_mm = [1.0, 2.0, 3.0]\nintensity = [8.0, 8.0, 8.0]\n";
        let cone = 2.0 * PI * (1.0 - 40f32.to_radians().cos());
        for (text, solid_angle) in [(hard.as_str(), cone), (point, 4.0 * PI)] {
            let light = build(text).unwrap();
            let n = 200;
            let mut sum = 0.0;
            for i in 0..n {
                for j in 0..n {
                    let u = (glam::Vec2::new(i as f32, j as f32) + 0.5) / n as f32;
                    let away = warp::uniform_sphere(u);
                    sum += irradiance(&light, Vec3::new(1.0, 2.0, 3.0) + 2.0 * away) * 4.0;
                }
            }
            let power = sum * 4.0 * PI / (n * n) as f32;
            let expected = 8.0 * solid_angle;
            // Margin: a row of the sum is the most that the edge can be off.
            assert!((power / expected - 1.0).abs() < 2.0 / n as f32 / (solid_angle / (4.0 * PI)));
        }
    }

    #[test]
    fn wrong_keys_are_refused_by_name() {
        for (from, to, message) in [
            ("half_angle_deg = 40.0\n", "", "direction belongs to"),
            (
                "half_angle_deg = 40.0",
                "half_angle_deg = 190.0",
                "half_angle_deg: expected",
            ),
            (
                "falloff_deg = 10.0",
                "falloff_deg = 50.0",
                "falloff_deg: expected 0 to",
            ),
            ("direction = [0.0, 0.0, -5.0]\n", "", "direction: expected"),
            ("[8.0, 8.0, 8.0]", "[8.0, -8.0, 8.0]", "intensity: expected"),
            (
                "[1.0, 2.0, 3.0]",
                "[1.0, nan, 3.0]",
                "position_mm: expected",
            ),
        ] {
            let e = build(&SPOT.replace(from, to)).unwrap_err();
            assert!(e.starts_with(message), "{e}");
        }
    }

    #[test]
    fn it_is_exported() {
        let light = build(SPOT).unwrap();
        assert!(matches!(light.for_kernel(), KernelLight::Spot(_)));
        let spot = light.for_mitsuba(3).unwrap();
        assert!(spot.xml.contains("cutoff_angle") && spot.notes.len() == 1);
        let point = Light::from(SpotLight::point(Vec3::ZERO, Rgb::WHITE));
        let point = point.for_mitsuba(0).unwrap();
        assert!(point.xml.contains("type=\"point\"") && point.notes.is_empty());
    }
}
