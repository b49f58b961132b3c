//! `model = "diffuse"`: an ideally diffuse sheet with holes.
//!
//! Both sides reflect and transmit by Lambert's law; a share of the light passes straight
//! through, whatever its direction. Three such figures describe window shades \[CEN2021]. The
//! model is also the reference in tests of everything else, because its integrals have closed
//! forms.

use crate::catalogue::{ClothSurface, SurfaceKind};
use crate::error::Error;
use glam::{Vec2, Vec3};
use organza_basis::{PathRng, Rgb, SegmentSource, warp};
use organza_scatter::{Footprint, LobeSample, Surface};
use organza_weave::Cloth;
use serde::{Deserialize, Serialize};
use std::f32::consts::FRAC_1_PI;

/// The `[surface]` section of a diffuse sheet.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DiffuseSpec {
    /// Share of arriving light that is scattered back, linear RGB from 0 to 1.
    pub reflectance: Rgb,
    /// Share of arriving light that is scattered to the other side, linear RGB from 0 to 1;
    /// black by default.
    #[serde(default)]
    pub transmittance: Rgb,
    /// Share of arriving light that passes straight through, 0 to 1; 0 by default.
    #[serde(default)]
    pub openness: f32,
}

impl SurfaceKind for DiffuseSpec {
    const NAME: &'static str = "diffuse";

    fn of_cloth(&self, cloth: &Cloth) -> Result<ClothSurface, Error> {
        Ok(ClothSurface {
            surface: Box::new(DiffuseSheet::new(self)?),
            origin_mm: Vec2::ZERO,
            repeat_mm: self.repeat_mm(cloth)?,
        })
    }

    fn repeat_mm(&self, cloth: &Cloth) -> Result<f32, Error> {
        DiffuseSheet::new(self)?;
        Ok(cloth.tile().bounds_mm.size().truncate().max_element())
    }
}

/// An ideally diffuse sheet with holes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseSheet {
    reflectance: Rgb,
    transmittance: Rgb,
    openness: f32,
    /// Probability of reflection per arriving ray, and of transmission.
    chances: [f32; 2],
}

impl DiffuseSheet {
    /// A sheet of the given shares.
    ///
    /// # Errors
    /// A share outside 0 to 1, or shares that add up to more than 1 in a channel.
    pub fn new(spec: &DiffuseSpec) -> Result<DiffuseSheet, Error> {
        for (key, colour) in [
            ("reflectance", spec.reflectance),
            ("transmittance", spec.transmittance),
        ] {
            for channel in colour.0.to_array() {
                Error::check(key, channel.into(), 0.0, 1.0)?;
            }
        }
        Error::check("openness", spec.openness.into(), 0.0, 1.0)?;
        let scattered = spec.reflectance + spec.transmittance;
        let total = scattered.max_component() + spec.openness;
        if total > 1.0 + 1e-6 {
            return Err(Error::Shares {
                total: total.into(),
            });
        }
        let chance = |part: Rgb| {
            if scattered.is_black() {
                0.0
            } else {
                (1.0 - spec.openness) * part.mean() / scattered.mean()
            }
        };
        Ok(DiffuseSheet {
            reflectance: spec.reflectance,
            transmittance: spec.transmittance,
            openness: spec.openness,
            chances: [chance(spec.reflectance), chance(spec.transmittance)],
        })
    }
}

impl Surface for DiffuseSheet {
    fn gap(&self, _: Vec3, _: Footprint) -> f32 {
        self.openness
    }

    fn eval(&self, w_out: Vec3, w_in: Vec3, _: Footprint) -> Rgb {
        let share = match w_out.z * w_in.z {
            same if same > 0.0 => self.reflectance,
            opposite if opposite < 0.0 => self.transmittance,
            _ => Rgb::BLACK,
        };
        share * FRAC_1_PI
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3, _: Footprint) -> f32 {
        let chance = match w_out.z * w_in.z {
            same if same > 0.0 => self.chances[0],
            opposite if opposite < 0.0 => self.chances[1],
            _ => 0.0,
        };
        chance * w_in.z.abs() * FRAC_1_PI
    }

    fn sample(&self, w_out: Vec3, at: Footprint, rng: &mut PathRng) -> Option<LobeSample> {
        let [back, through] = self.chances;
        let side = if rng.unit() * (back + through) < back {
            w_out.z
        } else {
            -w_out.z
        };
        let w = warp::cosine_hemisphere(rng.unit2());
        let w_in = Vec3::new(w.x, w.y, w.z.copysign(side));
        let pdf = self.pdf(w_out, w_in, at);
        (pdf > 0.0)
            .then(|| LobeSample::new(w_in, self.eval(w_out, w_in, at) * (w_in.z.abs() / pdf), pdf))
    }

    fn axis(&self, _: Footprint) -> Vec3 {
        Vec3::ZERO
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::Moments;
    use organza_scatter::Passage;

    fn shade() -> DiffuseSheet {
        DiffuseSheet::new(&DiffuseSpec {
            reflectance: Rgb::new(0.5, 0.4, 0.1),
            transmittance: Rgb::new(0.2, 0.3, 0.1),
            openness: 0.25,
        })
        .unwrap()
    }

    #[test]
    fn samples_bring_the_shares_of_the_file() {
        let sheet = shade();
        let mut rng = PathRng::from_seed(5);
        let (mut back, mut through, mut straight) =
            (Moments::default(), Moments::default(), Moments::default());
        for w_out in [Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.8, -0.6)] {
            for _ in 0..20_000 {
                let passage = sheet.pass_or_sample(w_out, Footprint::FAR, &mut rng);
                let mut shares = [0.0; 3];
                match passage {
                    Some(Passage::Straight) => shares[2] = 1.0,
                    Some(Passage::Scattered(s)) => {
                        let value = sheet.eval(w_out, s.w_in, Footprint::FAR).0.x;
                        let density = sheet.pdf(w_out, s.w_in, Footprint::FAR);
                        let weight = value * s.w_in.z.abs() / density;
                        assert!((weight - s.weight.0.x).abs() < 4.0 * f32::EPSILON);
                        assert_eq!(density, s.pdf);
                        shares[usize::from(w_out.z * s.w_in.z < 0.0)] = f64::from(s.weight.0.x);
                    }
                    None => {}
                }
                back.add(shares[0]);
                through.add(shares[1]);
                straight.add(shares[2]);
            }
        }
        for (moments, share) in [(&back, 0.5), (&through, 0.2), (&straight, 0.25)] {
            let z = (moments.mean - share) / moments.standard_error();
            assert!(z.abs() < 4.0, "seed 5: {} for {share}", moments.mean);
            // An error of a twentieth in a share is detected.
            let wrong = (moments.mean - 1.05 * share) / moments.standard_error();
            assert!(wrong.abs() > 4.0, "seed 5: {share}");
        }
    }

    #[test]
    fn densities_integrate_to_what_meets_the_sheet() {
        let sheet = shade();
        let mut rng = PathRng::from_seed(6);
        let mut sum = Moments::default();
        for _ in 0..40_000 {
            let w = warp::uniform_sphere(rng.unit2());
            let density = sheet.pdf(Vec3::Z, w, Footprint::FAR) / warp::UNIFORM_SPHERE_PDF;
            sum.add(f64::from(density));
        }
        let off = (sum.mean - 0.75).abs();
        assert!(off < 4.0 * sum.standard_error(), "seed 6: {}", sum.mean);
    }

    #[test]
    fn black_sheets_absorb_and_impossible_ones_are_refused() {
        let black = DiffuseSheet::new(&DiffuseSpec::default()).unwrap();
        let mut rng = PathRng::from_seed(7);
        assert_eq!(black.sample(Vec3::Z, Footprint::FAR, &mut rng), None);
        let in_the_plane = shade().eval(Vec3::Z, Vec3::X, Footprint::FAR);
        assert!(in_the_plane.is_black());
        let message = |spec: DiffuseSpec| DiffuseSheet::new(&spec).unwrap_err().to_string();
        let bright = message(DiffuseSpec {
            reflectance: Rgb::splat(0.8),
            transmittance: Rgb::splat(0.3),
            openness: 0.0,
        });
        assert!(bright.contains("1.1"), "{bright}");
        let negative = message(DiffuseSpec {
            openness: -0.1,
            ..DiffuseSpec::default()
        });
        assert!(negative.contains("openness = -0.1"), "{negative}");
    }
}
