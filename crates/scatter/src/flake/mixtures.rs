//! How the populations of a voxel, as micro-flakes, share an event.

use super::{DiffuseFlake, FlakePopulation, FlakeScattering};
use crate::{FlakeMaterials, FlakeOptics, Lobe, LobeSample};
use glam::Vec3;
use organza_basis::{FibrePopulation, Mixture, PathRng, Rgb};
use std::sync::Arc;

/// Mixtures of the populations of a cloth as flakes of one family.
///
/// # Contract
/// That of [`FlakeScattering`]; where a family draws a flake per collision, `eval` and
/// `sample` are given it. The extinction toward `w` is at most the mixture's broadside one.
pub struct FlakeMixtures {
    materials: FlakeMaterials,
    scattering: Arc<dyn FlakeScattering>,
}

impl FlakeMixtures {
    /// From the optics of each material.
    pub fn new(optics: Vec<FlakeOptics>, scattering: Arc<dyn FlakeScattering>) -> FlakeMixtures {
        FlakeMixtures {
            materials: FlakeMaterials::new(optics),
            scattering,
        }
    }

    /// The materials.
    pub fn materials(&self) -> &FlakeMaterials {
        &self.materials
    }

    /// How a population scatters.
    pub fn scattering(&self) -> &Arc<dyn FlakeScattering> {
        &self.scattering
    }

    /// Extinction of a population across its axis, 1/mm, and its flakes.
    pub fn flakes(&self, c: &FibrePopulation) -> (f32, FlakePopulation) {
        let (broadside, end_on) = self.materials.shape(c);
        let flakes = FlakePopulation {
            axis: c.axis,
            end_on,
            albedo: self.materials.albedo(c),
            material: c.material,
        };
        (c.broadside_per_mm() * broadside, flakes)
    }

    /// Extinction of a population toward `w`, 1/mm, and its flakes.
    fn seen(&self, c: &FibrePopulation, w: Vec3) -> (f32, FlakePopulation) {
        let (across, flakes) = self.flakes(c);
        (across * self.scattering.area(&flakes, w), flakes)
    }

    /// Extinction of all toward `w`, 1/mm.
    pub fn sigma_t_per_mm(&self, mixture: &Mixture, w: Vec3) -> f32 {
        mixture.iter().map(|c| self.seen(c, w).0).sum()
    }

    /// Draws the population that a walk meets, in proportion to its extinction.
    fn meet(&self, mixture: &Mixture, w_out: Vec3, rng: &mut PathRng) -> Option<FlakePopulation> {
        let mut left = rng.unit() * self.sigma_t_per_mm(mixture, w_out);
        let (last, before) = mixture.split_last()?;
        let mut seen = before.iter().map(|c| self.seen(c, w_out));
        let found = seen.find(|(sigma, _)| {
            left -= sigma;
            left < 0.0
        });
        Some(found.map_or_else(|| self.flakes(last).1, |(_, flakes)| flakes))
    }

    /// Draws the flake that a walk meets, if the family does so.
    pub fn draw_flake(
        &self,
        mixture: &Mixture,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> Option<DiffuseFlake> {
        if !self.scattering.draws_flakes() {
            return None;
        }
        let met = self.meet(mixture, w_out, rng)?;
        self.scattering.draw_flake(&met, w_out, rng)
    }

    /// Albedo times phase, and phase: each population weighs as much as it extinguishes
    /// toward `w_out`.
    pub fn eval(
        &self,
        mixture: &Mixture,
        flake: Option<&DiffuseFlake>,
        w_out: Vec3,
        w_in: Vec3,
    ) -> (Rgb, f32) {
        if let Some(flake) = flake {
            return (flake.eval(w_out, w_in), flake.pdf(w_out, w_in));
        }
        let (mut value, mut pdf, mut total) = (Rgb::BLACK, 0.0, 0.0);
        for c in mixture.iter() {
            let (sigma, flakes) = self.seen(c, w_out);
            let own = self.scattering.eval(&flakes, w_out, w_in);
            value += own.0 * sigma;
            pdf += own.1 * sigma;
            total += sigma;
        }
        if total > 0.0 {
            (value / total, pdf / total)
        } else {
            (Rgb::BLACK, 0.0)
        }
    }

    /// Draws where light comes from.
    pub fn sample(
        &self,
        mixture: &Mixture,
        flake: Option<&DiffuseFlake>,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> Option<LobeSample> {
        if let Some(flake) = flake {
            return flake.sample(w_out, rng);
        }
        let met = self.meet(mixture, w_out, rng)?;
        let w_in = self.scattering.sample(&met, w_out, rng)?;
        let (value, pdf) = self.eval(mixture, None, w_out, w_in);
        (pdf > 0.0).then(|| LobeSample::new(w_in, value / pdf, pdf))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BandProfile, FlakeFamily, GaussianBand, SineBand, population_shape};
    use std::f64::consts::{FRAC_PI_2, PI};

    /// Mean of `area(sine of the angle between w and t)` over tangents t spread
    /// about an axis at `beta` from w.
    fn mean_over_tangents(spread: f64, beta: f64, area: &dyn Fn(f32) -> f32) -> f64 {
        let (mut sum, mut all) = (0.0, 0.0);
        let reach = FRAC_PI_2.min(7.0 * spread);
        for i in 0..120 {
            let alpha = (f64::from(i) + 0.5) / 120.0 * reach;
            let weight = (-0.5 * (alpha / spread).powi(2)).exp();
            for k in 0..60 {
                let phi = (f64::from(k) + 0.5) / 60.0 * PI;
                let along = beta.cos() * alpha.cos() + beta.sin() * alpha.sin() * phi.cos();
                sum += weight * f64::from(area((1.0 - along * along).max(0.0).sqrt() as f32));
                all += weight;
            }
        }
        sum / all
    }

    /// What [`population_shape`] promises, for all families.
    #[test]
    fn populations_show_what_their_fibres_show() {
        let mut worst = [0.0f64; 3];
        for ratio in [0.02f32, 0.1, 0.3, 0.7, 1.0] {
            let axial = |sine: f32| (ratio * ratio * (1.0 - sine * sine) + sine * sine).sqrt();
            let (g, s) = (
                GaussianBand::with_end_on_ratio(ratio),
                SineBand::with_end_on_ratio(ratio),
            );
            let gaussian = |sine: f32| g.projected_area(sine) / g.projected_area(1.0);
            let sine_power = |sine: f32| s.projected_area(sine) / s.projected_area(1.0);
            let [gaussians, sines] = ["gaussian", "sin-power"].map(|name| {
                FlakeFamily::named(name)
                    .unwrap()
                    .of_materials(vec![FlakeOptics::new(Rgb::WHITE, ratio)])
            });
            for spread_rad in [0.02f32, 0.1, 0.3, 0.8, 3.0] {
                let c = FibrePopulation {
                    length_density_per_mm2: 50.0,
                    axis: Vec3::Z,
                    spread_rad,
                    radius_mm: 0.01,
                    ..Default::default()
                };
                for i in 0..=12 {
                    let beta = FRAC_PI_2 * f64::from(i) / 12.0;
                    let w = Vec3::new(beta.sin() as f32, 0.0, beta.cos() as f32);
                    let sin_sq = w.x * w.x;
                    let (broadside, e) = population_shape(spread_rad, ratio);
                    let sggx = broadside * (e * e * (1.0 - sin_sq) + sin_sq).sqrt();
                    let pairs: [(&dyn Fn(f32) -> f32, f32); 3] = [
                        (&axial, sggx),
                        (&gaussian, gaussians.seen(&c, w).0),
                        (&sine_power, sines.seen(&c, w).0),
                    ];
                    for ((area, got), worst) in pairs.into_iter().zip(&mut worst) {
                        let exact = mean_over_tangents(f64::from(spread_rad), beta, area);
                        *worst = worst.max((f64::from(got) - exact).abs());
                        assert!(got <= c.broadside_per_mm(), "{got}");
                    }
                }
            }
        }
        assert!(worst.iter().all(|w| *w < 0.03), "{worst:?}");
    }
}
