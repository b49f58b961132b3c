//! Micro-flakes: what every flake distribution offers, and the specular and
//! diffuse scattering that follows from it [Jakob2010]. The [`catalogue`] lists the
//! families that files can name.

pub mod band;
pub mod catalogue;
mod distribution;
mod gaussian;
mod gaussian_diffuse;
mod mixtures;
mod scattering;
mod sggx_diffuse;
mod sggx_specular;
mod sggx_transmitting;
mod sine_power;

pub use gaussian::GaussianBand;
pub use mixtures::FlakeMixtures;
pub use scattering::{FlakePopulation, FlakeScattering, LaneEvent};
pub use sggx_transmitting::{ClearFibre, TransmittingFlakes};
pub use sine_power::{SineBand, sine_power_from_gamma};

use crate::lobe::{Lobe, LobeSample};
use glam::Vec3;
use organza_basis::{Frame, PathRng, Rgb, warp};
use organza_lanes::{Floats, V3};
use std::f32::consts::FRAC_1_PI;

/// Below this squared length of `w_out + w_in` the half vector is rounding
/// noise: a direction carries an error of 6e-8, so at a length of 1e-5 the half
/// vector is wrong by less than a hundredth of a radian.
pub(crate) const MIN_HALF_SQUARED: f32 = 1e-10;

/// A distribution of two-sided flat flakes, and the specular phase function it
/// implies.
///
/// # Contract
/// All directions are unit vectors. `ndf` is the area of flake *faces* per
/// steradian of face normal (both faces of a flake count, so it is even), and
/// `projected_area(w)` the integral of `max(0, w . m) ndf(m)` over the sphere.
/// Extinction toward `w` is a density times `projected_area(w)`; each
/// distribution says what it normalises to. Multiplying `ndf` by a constant
/// leaves the phase functions as they are.
pub trait MicroFlake {
    /// Area that the flakes show to `w`.
    fn projected_area(&self, w: Vec3) -> f32;

    /// Area of faces per steradian of normal `m`.
    fn ndf(&self, m: Vec3) -> f32;

    /// Mean of [`MicroFlake::ndf`] over the great circle of normals
    /// perpendicular to `w`.
    fn ndf_mean_across(&self, w: Vec3) -> f32;

    /// Draws a normal of any positive length, with density `max(0, w . m) ndf(m)
    /// / projected_area(w)` per steradian: always on the side of `w`.
    fn visible_direction_sample(&self, w: Vec3, rng: &mut PathRng) -> Vec3;

    /// [`MicroFlake::visible_direction_sample`] brought to unit length.
    fn visible_normal_sample(&self, w: Vec3, rng: &mut PathRng) -> Vec3 {
        self.visible_direction_sample(w, rng).normalize_or(w)
    }

    /// Density of [`MicroFlake::visible_normal_sample`], per steradian.
    fn visible_normal_pdf(&self, w: Vec3, m: Vec3) -> f32 {
        w.dot(m).max(0.0) * self.ndf(m) / self.projected_area(w)
    }

    /// Phase function of mirror flakes, per steradian of `w_in`, with unit
    /// integral: also the density of [`MicroFlake::sample`].
    ///
    /// Not symmetric by itself: `projected_area(w_out) eval(w_out, w_in)` is.
    /// At `w_in = -w_out` the half vector is undefined and the value is the mean
    /// over the circle of possible ones, which is what a directional light seen
    /// straight on receives on average over nearby views.
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        let h = w_out + w_in;
        let squared = h.length_squared();
        let ndf = if squared > MIN_HALF_SQUARED {
            self.ndf(h / squared.sqrt())
        } else {
            self.ndf_mean_across(w_out)
        };
        0.25 * ndf / self.projected_area(w_out)
    }

    /// Draws where a mirror flake sends `w_out`, with density
    /// [`MicroFlake::eval`].
    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Vec3 {
        let m = self.visible_direction_sample(w_out, rng);
        mirrored(V3::splat(w_out), V3::splat(m)).into()
    }
}

/// Where a mirror with a normal of any positive length sends `w_out`.
#[inline(always)]
pub(crate) fn mirrored<F: Floats>(w_out: V3<F>, m: V3<F>) -> V3<F> {
    let across = w_out.dot(m) / m.dot(m).max(F::splat(f32::MIN_POSITIVE));
    let w_in = m.scaled(across + across) - w_out;
    // One step toward unit length: rounding would otherwise grow along a path of many
    // events.
    w_in.scaled(w_in.dot(w_in).mul_add(F::splat(-0.5), F::splat(1.5)))
}

/// Mirror flakes with an albedo: the phase function as a [`Lobe`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpecularFlakes<F> {
    /// The distribution of normals.
    pub flakes: F,
    /// Part of the light that an event keeps, each channel in `[0, 1]`.
    pub albedo: Rgb,
}

impl<F: MicroFlake> Lobe for SpecularFlakes<F> {
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.albedo * self.flakes.eval(w_out, w_in)
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        self.flakes.eval(w_out, w_in)
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let w_in = self.flakes.sample(w_out, rng);
        Some(LobeSample::new(
            w_in,
            self.albedo,
            self.flakes.eval(w_out, w_in),
        ))
    }
}

/// One diffuse flake, drawn in proportion to the area it shows: light leaves it
/// on the lit side with a cosine.
///
/// The phase function of a cloud of diffuse flakes has no closed form [Heitz2015];
/// the mean of this lobe over drawn flakes is it. Draw one flake per event and
/// use it for the light and for the next direction alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiffuseFlake {
    /// Unit normal on the side that was seen.
    pub normal: Vec3,
    /// Part of the light that an event keeps, each channel in `[0, 1]`.
    pub albedo: Rgb,
}

impl DiffuseFlake {
    /// The flake that a walk arriving from `w_out` meets.
    pub fn meet(
        flakes: &impl MicroFlake,
        albedo: Rgb,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> DiffuseFlake {
        DiffuseFlake {
            normal: flakes.visible_normal_sample(w_out, rng),
            albedo,
        }
    }
}

impl Lobe for DiffuseFlake {
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.albedo * self.pdf(w_out, w_in)
    }

    fn pdf(&self, _w_out: Vec3, w_in: Vec3) -> f32 {
        w_in.dot(self.normal).max(0.0) * FRAC_1_PI
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let local = warp::cosine_hemisphere(rng.unit2());
        let w_in = Frame::from_normal(self.normal).world_from_frame(local);
        Some(LobeSample::new(w_in, self.albedo, self.pdf(w_out, w_in)))
    }
}
