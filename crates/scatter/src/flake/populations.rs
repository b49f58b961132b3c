//! How the populations of a voxel, as micro-flakes, share an event.

use super::band::{BandFlakes, BandProfile};
use super::{DiffuseFlake, FlakeScattering, MicroFlake};
use crate::population::{FlakeMaterials, ShapeTable};
use crate::{AxialFlake, FlakeOptics, Lobe, LobeSample};
use glam::Vec3;
use organza_basis::{FibrePopulation, Mixture, PathRng, Rgb};

/// The populations of a cloth as flakes of one distribution. Provided methods
/// scatter as mirrors.
pub trait PopulationFlakes {
    /// The distribution.
    type Flakes: MicroFlake;

    /// Extinction of a population toward `w`, 1/mm: at most its broadside one.
    fn extinction(&self, c: &FibrePopulation, w: Vec3) -> f32;

    /// Its flakes, at any scale.
    fn flakes(&self, c: &FibrePopulation) -> Self::Flakes;

    /// Albedo of its material.
    fn albedo(&self, c: &FibrePopulation) -> Rgb;

    /// Extinction of all toward `w`, 1/mm.
    fn total(&self, site: &Mixture, w: Vec3) -> f32 {
        site.as_slice().iter().map(|c| self.extinction(c, w)).sum()
    }

    /// Draws the population that a walk meets, in proportion to its extinction.
    fn meet<'a>(
        &self,
        site: &'a Mixture,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> Option<&'a FibrePopulation> {
        let mut left = rng.unit() * self.total(site, w_out);
        let (last, before) = site.as_slice().split_last()?;
        let found = before.iter().find(|c| {
            left -= self.extinction(c, w_out);
            left < 0.0
        });
        Some(found.unwrap_or(last))
    }

    /// Albedo times phase, and phase, of the mixture: each population weighs
    /// as much as it extinguishes toward `w_out`.
    fn mix(&self, site: &Mixture, w_out: Vec3, w_in: Vec3) -> (Rgb, f32) {
        let (mut value, mut pdf, mut total) = (Rgb::BLACK, 0.0, 0.0);
        for c in site.as_slice() {
            let sigma = self.extinction(c, w_out);
            let phase = sigma * self.flakes(c).eval(w_out, w_in);
            value += self.albedo(c) * phase;
            pdf += phase;
            total += sigma;
        }
        if total > 0.0 {
            (value / total, pdf / total)
        } else {
            (Rgb::BLACK, 0.0)
        }
    }

    /// Draws from the phase function of the mixture.
    fn scatter(&self, site: &Mixture, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let met = self.meet(site, w_out, rng)?;
        let w_in = self.flakes(met).sample(w_out, rng);
        let (value, pdf) = self.mix(site, w_out, w_in);
        (pdf > 0.0).then(|| LobeSample {
            w_in,
            weight: value / pdf,
            pdf,
        })
    }
}

impl<P: PopulationFlakes + Send + Sync> FlakeScattering for P {
    fn sigma_t_per_mm(&self, mixture: &Mixture, w: Vec3) -> f32 {
        self.total(mixture, w)
    }

    fn eval(
        &self,
        mixture: &Mixture,
        _: Option<&DiffuseFlake>,
        w_out: Vec3,
        w_in: Vec3,
    ) -> (Rgb, f32) {
        self.mix(mixture, w_out, w_in)
    }

    fn sample(
        &self,
        mixture: &Mixture,
        _: Option<&DiffuseFlake>,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> Option<LobeSample> {
        self.scatter(mixture, w_out, rng)
    }
}

/// Populations whose flakes are diffuse: one flake is drawn per collision and
/// scatters toward lights and walk alike.
pub(crate) struct Diffuse<P>(pub P);

impl<P: PopulationFlakes + Send + Sync> FlakeScattering for Diffuse<P> {
    fn sigma_t_per_mm(&self, mixture: &Mixture, w: Vec3) -> f32 {
        self.0.total(mixture, w)
    }

    fn draws_flakes(&self) -> bool {
        true
    }

    fn draw_flake(
        &self,
        mixture: &Mixture,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> Option<DiffuseFlake> {
        let met = self.0.meet(mixture, w_out, rng)?;
        let (flakes, albedo) = (self.0.flakes(met), self.0.albedo(met));
        Some(DiffuseFlake::meet(&flakes, albedo, w_out, rng))
    }

    fn eval(
        &self,
        _: &Mixture,
        flake: Option<&DiffuseFlake>,
        w_out: Vec3,
        w_in: Vec3,
    ) -> (Rgb, f32) {
        flake.map_or((Rgb::BLACK, 0.0), |f| {
            (f.eval(w_out, w_in), f.pdf(w_out, w_in))
        })
    }

    fn sample(
        &self,
        _: &Mixture,
        flake: Option<&DiffuseFlake>,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> Option<LobeSample> {
        flake?.sample(w_out, rng)
    }
}

impl PopulationFlakes for FlakeMaterials {
    type Flakes = AxialFlake;

    /// Without building the flake: `sqrt(e^2 + (1 - e^2) sin^2)` times the
    /// broadside value.
    fn extinction(&self, c: &FibrePopulation, w: Vec3) -> f32 {
        let (broadside, end_on) = self.shape(c);
        let along = c.axis.dot(w);
        let sin_sq = (1.0 - along * along).max(0.0);
        let area = (end_on * end_on * (1.0 - sin_sq) + sin_sq).sqrt();
        c.broadside_per_mm() * broadside * area
    }

    fn flakes(&self, c: &FibrePopulation) -> AxialFlake {
        self.flake(c)
    }

    fn albedo(&self, c: &FibrePopulation) -> Rgb {
        FlakeMaterials::albedo(self, c)
    }
}

/// Populations as flakes of a band profile.
pub(crate) struct Bands<P> {
    materials: Vec<(Rgb, ShapeTable<Band<P>>)>,
}

#[derive(Clone, Copy)]
struct Band<P> {
    profile: P,
    /// From the profile's projected area to the population's, relative to
    /// straight smooth fibres seen broadside.
    scale: f32,
}

impl<P: BandProfile + Copy> Bands<P> {
    /// The profiles with the shapes of each material's populations.
    pub(crate) fn new(optics: &[FlakeOptics]) -> Bands<P> {
        let row = |broadside, end_on| {
            let profile = P::with_end_on_ratio(end_on);
            let scale = broadside / profile.projected_area(1.0);
            Band { profile, scale }
        };
        let materials = optics
            .iter()
            .map(|o| (o.albedo, ShapeTable::new(o.end_on_ratio, row)))
            .collect();
        Bands { materials }
    }

    /// Rows are taken whole, not mixed, so that sampler and density stay those
    /// of one profile: a spread s is then off by less than (1 + s)^2 / 1000, as
    /// it is by being stored in eight bits.
    fn band(&self, c: &FibrePopulation) -> &Band<P> {
        self.materials[usize::from(c.material)]
            .1
            .nearest(c.spread_rad)
    }
}

impl<P: BandProfile + Copy> PopulationFlakes for Bands<P> {
    type Flakes = BandFlakes<P>;

    fn extinction(&self, c: &FibrePopulation, w: Vec3) -> f32 {
        let band = self.band(c);
        let sine = c.axis.cross(w).length().min(1.0);
        // The bound holds but for the table's thousandth.
        c.broadside_per_mm() * (band.scale * band.profile.projected_area(sine)).min(1.0)
    }

    fn flakes(&self, c: &FibrePopulation) -> BandFlakes<P> {
        BandFlakes::new(c.axis, self.band(c).profile)
    }

    fn albedo(&self, c: &FibrePopulation) -> Rgb {
        self.materials[usize::from(c.material)].0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GaussianBand, SineBand, population_shape};
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
            let optics = [FlakeOptics {
                albedo: Rgb::WHITE,
                end_on_ratio: ratio,
            }];
            let (gaussians, sines) = (
                Bands::<GaussianBand>::new(&optics),
                Bands::<SineBand>::new(&optics),
            );
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
                        (&gaussian, gaussians.extinction(&c, w)),
                        (&sine_power, sines.extinction(&c, w)),
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

    /// The extinction is that of the flakes themselves, which find it another way.
    #[test]
    fn extinction_is_the_area_that_the_flakes_show() {
        let materials = FlakeMaterials::new(vec![FlakeOptics {
            albedo: Rgb::WHITE,
            end_on_ratio: 0.1,
        }]);
        for spread_rad in [0.0f32, 0.1, 0.5, 2.0] {
            let c = FibrePopulation {
                length_density_per_mm2: 50.0,
                axis: Vec3::new(0.6, 0.0, 0.8),
                spread_rad,
                radius_mm: 0.01,
                material: 0,
                yarn: 0,
            };
            for w in [
                Vec3::X,
                Vec3::Y,
                Vec3::NEG_Z,
                Vec3::new(0.36, 0.48, 0.8),
                Vec3::new(0.0, 0.8, -0.6),
            ] {
                let area = materials.shape(&c).0 * materials.flake(&c).projected_area(w);
                let (got, want) = (materials.extinction(&c, w), c.broadside_per_mm() * area);
                assert!(
                    (got / want - 1.0).abs() < 4.0 * f32::EPSILON,
                    "{spread_rad}, {w}: {got} {want}"
                );
            }
        }
    }
}
