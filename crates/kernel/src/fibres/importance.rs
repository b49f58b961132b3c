//! How much light a path may expect from where it goes, for roulette and splitting
//! \[Vorba2016].
//!
//! A fibre turns light about its axis and hardly changes its inclination, and the fibres of
//! a yarn are nearly parallel. Light of a lamp therefore stays near the lamp's cone about
//! the fibres. A path that travels near that cone finds the lamp at most events, at some of
//! them through a narrow lobe, and such finds are rare and bright. A path far from the cone
//! finds nothing. So the first kind is divided into several paths that carry less, and the
//! other kind ends early. Both leave the mean as it is.

use glam::Vec3;
use organza_basis::PathRng;
use organza_lanes::Floats;
use organza_lanes::math::{V3, bell};
use organza_light::{Hemisphere, KernelLight, Light, LightSearch};
use std::f32::consts::PI;

/// Importance of directions without a lamp, of a scene without a sky.
const BASE: f32 = 0.15;
/// What the strongest lamp adds to it where a path travels straight toward it.
const LAMP: f32 = 3.0;
/// Deviation of the inclination of light that comes from one direction, radians: 8 degrees.
const SPREAD_RAD: f32 = 0.14;
/// Form of the importance around a fibre: with the cosine c of the azimuth from the lamp, it
/// falls as `(1 - k)^2 / (1 + k^2 - 2 k c)`, to a ninth on the far side.
const ROUND: f32 = 0.5;
/// Lamps that count, the strongest.
const MAX_LAMPS: usize = 4;
/// Directions drawn toward a light to learn where it is.
const DRAWS: u64 = 256;

/// The importance of directions at fibres.
pub struct Importance {
    base: f32,
    lamps: Vec<Lamp>,
}

struct Lamp {
    toward: Vec3,
    weight: f32,
    per_spread: f32,
}

/// What a light sends, and how far it comes from one direction.
struct Beam {
    toward: Vec3,
    irradiance: f32,
    /// Length of the mean direction: one of parallel light, zero of an even sky.
    length: f32,
}

impl Importance {
    /// Under such lights, as seen from a point of the matter. `None` where light comes from
    /// everywhere alike.
    pub fn new(lights: &[Light], from_mm: Vec3) -> Option<Importance> {
        let beams: Vec<Beam> = lights.iter().filter_map(|l| beam(l, from_mm)).collect();
        let strength = |b: &Beam| b.irradiance * b.length * b.length;
        let most = beams.iter().map(strength).fold(0.0, f32::max);
        let sky: f32 = beams.iter().map(|b| b.irradiance - strength(b)).sum();
        if most.is_nan() || most <= 0.0 || !(most + sky).is_finite() {
            return None;
        }
        let share = sky / (most + sky);
        let lamp = |b: &Beam| Lamp {
            toward: b.toward,
            weight: LAMP * strength(b) / (most + sky),
            per_spread: 1.0 / (SPREAD_RAD * SPREAD_RAD + (1.0 - b.length).max(0.0)).sqrt(),
        };
        let mut lamps: Vec<Lamp> = beams.iter().filter(|b| b.length > 0.1).map(lamp).collect();
        lamps.sort_by(|a, b| b.weight.total_cmp(&a.weight));
        lamps.truncate(MAX_LAMPS);
        Some(Importance {
            base: BASE + (1.0 - BASE) * share * share,
            lamps,
        })
    }

    /// The importance of directions without a lamp.
    #[inline(always)]
    pub fn base<F: Floats>(&self) -> F {
        F::splat(self.base)
    }

    /// What lamps add where a path travels along unit directions among fibres along unit
    /// tangents.
    #[inline(always)]
    pub fn of_lamps<F: Floats>(&self, tangent: V3<F>, direction: V3<F>) -> F {
        let (one, least) = (F::splat(1.0), F::splat(1e-6));
        let sin = direction.dot(tangent);
        let cos = (one - sin * sin).max(least).sqrt();
        let mut sum = F::splat(0.0);
        for k in 0..self.lamps.len() {
            let lamp = &self.lamps[k];
            let toward = V3::splat(lamp.toward);
            let sin_lamp = toward.dot(tangent);
            let cos_lamp = (one - sin_lamp * sin_lamp).max(least).sqrt();
            // The sine of the difference serves for the angle.
            let apart = (sin * cos_lamp - cos * sin_lamp) * F::splat(lamp.per_spread);
            let inclined = bell(apart);
            let round = (direction.dot(toward) - sin * sin_lamp) / (cos * cos_lamp);
            let round = round.max(-one).min(one);
            let fall = F::splat(2.0 * ROUND).mul_add(-round, F::splat(1.0 + ROUND * ROUND));
            let weight = F::splat(lamp.weight * (1.0 - ROUND) * (1.0 - ROUND));
            sum = sum + weight * inclined / fall;
        }
        sum
    }
}

/// `None` of a light that sends nothing there.
fn beam(light: &Light, from_mm: Vec3) -> Option<Beam> {
    if let KernelLight::Parallel {
        direction,
        irradiance,
    } = light.for_kernel()
    {
        return Some(Beam {
            toward: -direction,
            irradiance: irradiance.mean(),
            length: 1.0,
        });
    }
    if let KernelLight::Sky {
        radiance,
        hemisphere,
    } = light.for_kernel()
    {
        let is_whole = hemisphere == Hemisphere::All;
        let sides = if is_whole { 2.0 } else { 1.0 };
        return Some(Beam {
            toward: Vec3::Z,
            irradiance: sides * PI * radiance.mean(),
            length: 0.0,
        });
    }
    if light.search() == LightSearch::Walk {
        return None;
    }
    let (mut sum, mut total) = (Vec3::ZERO, 0.0);
    for draw in 0..DRAWS {
        let drawn = light.sample_toward(from_mm, &mut PathRng::from_seed(draw));
        if let Some(drawn) = drawn {
            sum += drawn.irradiance.mean() * drawn.w_in;
            total += drawn.irradiance.mean();
        }
    }
    let toward = sum.try_normalize()?;
    Some(Beam {
        toward,
        irradiance: total / DRAWS as f32,
        length: (sum.length() / total).min(1.0),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::Rgb;
    use organza_lanes::one;
    use organza_light::{DirectionalLight, EnvironmentLight, RectangleLight};

    fn sun(direction: Vec3, irradiance: f32) -> Light {
        let (direction, irradiance) = (direction.normalize(), Rgb::WHITE * irradiance);
        Light::from(DirectionalLight::new(direction, irradiance))
    }

    fn sky() -> Light {
        Light::from(EnvironmentLight::new(Rgb::WHITE, Hemisphere::All))
    }

    #[test]
    fn paths_near_a_lamps_cone_are_important() {
        let made = Importance::new(&[sun(-Vec3::new(0.3, 0.2, 0.9), 2.0)], Vec3::ZERO).unwrap();
        let toward = Vec3::new(0.3, 0.2, 0.9).normalize();
        let of = |d: Vec3| {
            let v = |v: Vec3| V3::<one::F>::splat(v);
            made.of_lamps(v(Vec3::X), v(d.normalize())).0
        };
        let found = of(toward);
        assert!((found - LAMP).abs() < 4.0 * f32::EPSILON, "{found}");
        // Around the fibre and still on the cone; and off the cone.
        let behind = Vec3::new(toward.x, -toward.y, -toward.z);
        let found = of(behind);
        let off = (found - LAMP / 9.0).abs();
        assert!(off < 4.0 * f32::EPSILON, "{found}");
        assert!(of(toward + 0.9 * Vec3::X) < 6e-4 * LAMP);
        for end in [Vec3::X, -Vec3::X] {
            assert!(of(end).is_finite(), "along the fibre");
        }
    }

    #[test]
    fn an_even_sky_has_no_importance_and_outshines_a_weak_sun() {
        assert!(Importance::new(&[sky()], Vec3::ZERO).is_none());
        assert!(Importance::new(&[], Vec3::ZERO).is_none());
        let both = |e| Importance::new(&[sky(), sun(Vec3::NEG_Z, e)], Vec3::ZERO).unwrap();
        let (weak, strong) = (both(0.01), both(1e4));
        assert!(weak.base > 0.9 && weak.lamps[0].weight < 0.01 * LAMP);
        assert!(strong.base < BASE + 0.01 && strong.lamps[0].weight > 0.99 * LAMP);
    }

    #[test]
    fn only_the_strongest_lamps_count() {
        let lights: Vec<Light> = (1..9)
            .map(|k| sun(Vec3::new(0.1 * k as f32, 0.0, -1.0), k as f32))
            .collect();
        let made = Importance::new(&lights, Vec3::ZERO).unwrap();
        assert_eq!(made.lamps.len(), MAX_LAMPS);
        assert!((made.lamps[0].weight - LAMP).abs() < 4.0 * f32::EPSILON);
    }
    /// The irradiance is the radiance times the solid angle of the panel, a degree wide, from one
    /// direction.
    #[test]
    fn a_small_panel_is_a_beam() {
        let (corner, side_mm) = (Vec3::new(-0.1, -0.1, 10.0), 0.2);
        let (u, v) = (side_mm * Vec3::X, side_mm * Vec3::Y);
        let panel = RectangleLight::new(corner, u, v, Rgb::splat(3.0), true);
        let found = beam(&Light::from(panel.unwrap()), Vec3::ZERO).unwrap();
        let expected = 3.0 * side_mm * side_mm / 100.0;
        // The mean of the inverse square of the distance and of the cosine is 1e-4 less.
        let ratio = found.irradiance / expected;
        assert!((ratio - 1.0).abs() < 2e-4, "{}", found.irradiance);
        assert!(found.toward.z > 0.9999 && found.length > 0.9999);
    }
}
