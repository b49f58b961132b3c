//! `flake = "sggx-transmitting"`: flakes distributed as the normals of an ellipsoid
//! \[Heitz2015], each a piece of the surface of a clear fibre: it reflects as a mirror,
//! or light crosses the fibre behind it \[Marschner2003].
//!
//! # Model
//! A mirror at the offset h = sin(g) of a cylinder sends light back along the walk but for
//! an azimuth of 2 g about the axis. Light that enters there and leaves at the far side goes
//! straight on but for an azimuth of 2 (g - g'), g' being the angle of refraction, with the
//! same inclination. So a mirrored direction is drawn, and light that crosses is turned about
//! the axis from the azimuth of the mirror to its own. Light that is reflected once inside
//! leaves within tens of degrees of the way back along the walk; its azimuth from there is
//! taken as proportional to g, with the root mean square that ray optics gives, which has no
//! caustic. Light that is reflected more often leaves with the mirrored light. Shares and
//! absorption are those of [`Crossing`].
//!
//! The flakes have the symmetry of their axis. All of this depends on the two inclinations
//! in a symmetric way and on the size of the azimuth between the directions, so
//! `projected_area(a) eval(a, b)` stays symmetric.

use super::catalogue::FlakeRecord;
use super::distribution::{Distribution, Ellipsoids};
use super::{FlakePopulation, FlakeScattering, MicroFlake};
use crate::cylinder::{attenuations, offsets};
use crate::longitudinal::Inclinations;
use crate::near::crossing::{Crossing, MIN_COS, incidence};
use crate::{AxialFlake, FibreAngles, FibreFrame, FlakeOptics};
use glam::Vec3;
use organza_basis::{PathRng, Rgb};
use std::f32::consts::PI;
use std::sync::Arc;

pub(super) const FAMILY: FlakeRecord = FlakeRecord {
    name: "sggx-transmitting",
    about: "pieces of the surface of clear fibres, distributed as the normals of an ellipsoid",
    scattering: |optics| Arc::new(TransmittingFlakes::new(optics, Vec::new())),
};

/// Mean index of cotton, flax, silk and wool, which lie within 0.02 of it
/// \[MortonHearle2008].
const IOR: f32 = 1.55;

/// Least index: the nearer it is to one, the nearer light that crosses comes to going
/// straight on, which is no density.
const MIN_IOR: f32 = 1.05;

/// Least and greatest azimuth of light reflected inside, over the angle of incidence: it
/// must stay a density, and a mirror has 2.
const RETURN_TURNS: [f32; 2] = [0.1, 2.0];

/// Offsets of the mean over that light: 1e-4 and better.
const RETURN_NODES: usize = 256;

/// Ways that light leaves a fibre: mirrored, crossing it, and reflected once inside.
const WAYS: usize = 3;

/// The round fibre behind a transmitting flake.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClearFibre {
    /// Index of refraction, raised to 1.05.
    pub ior: f32,
    /// Absorption coefficient times the fibre's radius, no unit, not negative.
    pub absorption_radii: Rgb,
    /// What all scattered light is multiplied by, each channel in `[0, 1]`.
    pub albedo: Rgb,
}

impl ClearFibre {
    /// A fibre of which only the albedo is known: all of its light loses the same share.
    pub fn of_albedo(albedo: Rgb) -> ClearFibre {
        ClearFibre {
            ior: IOR,
            absorption_radii: Rgb::BLACK,
            albedo,
        }
    }

    /// What light keeps that leaves in each way, and the probabilities of drawing them: their
    /// shares without absorption.
    fn shares(&self, crossing: &Crossing<f32>) -> [(Rgb, f32); WAYS] {
        let [r, tt, trt, rest] = attenuations(crossing, self.absorption_radii);
        let mut mirrored = r;
        mirrored += rest;
        let through = (1.0 - crossing.fresnel) * (1.0 - crossing.fresnel);
        let returned = crossing.fresnel * through;
        [
            (self.albedo * mirrored, 1.0 - through - returned),
            (self.albedo * tt, through),
            (self.albedo * trt, returned),
        ]
    }

    fn crossing(&self, mean_cos: f32, gamma_rad: f32) -> Crossing<f32> {
        Crossing::new(self.ior.max(MIN_IOR), mean_cos, gamma_rad.sin())
    }

    /// Angle of incidence at which light leaves with an azimuth of `turn_rad >= 0` from
    /// straight on, and the change of twice that angle with the azimuth; `None` beyond the
    /// largest azimuth. The inverse of `2 (g - g')` with `sin g = index sin g'`.
    fn gamma_of_turn(&self, mean_cos: f32, turn_rad: f32) -> Option<(f32, f32)> {
        let ior = self.ior.max(MIN_IOR);
        let cos = mean_cos.clamp(MIN_COS, 1.0);
        let index = (ior * ior - 1.0 + cos * cos).sqrt() / cos;
        let (sin, cos) = (0.5 * turn_rad).sin_cos();
        let along = index * cos - 1.0;
        if along <= 0.0 {
            return None;
        }
        let gamma_rad = (index * sin).atan2(along);
        let sin_inside = gamma_rad.sin() / index;
        let cos_inside = (1.0 - sin_inside * sin_inside).max(0.0).sqrt();
        let slope = 1.0 - gamma_rad.cos() / (index * cos_inside);
        Some((gamma_rad, 1.0 / slope))
    }

    /// Azimuth from the way back of light that is reflected once inside, over the angle of
    /// incidence: the ratio of their root mean squares over offsets, broadside, each weighted
    /// with that light.
    fn return_turn(&self) -> f32 {
        let ior = self.ior.max(MIN_IOR);
        let (mut turns, mut gammas) = (0.0, 0.0);
        for (h, weight) in offsets(RETURN_NODES) {
            let (crossing, gamma_rad) = (Crossing::new(ior, 1.0, h), incidence(h));
            let f = crossing.fresnel;
            let light = weight * f * (1.0 - f) * (1.0 - f);
            let turn = 4.0 * crossing.gamma_t - 2.0 * gamma_rad;
            turns += light * turn * turn;
            gammas += light * gamma_rad * gamma_rad;
        }
        let [least, most] = RETURN_TURNS;
        (turns / gammas.max(f32::MIN_POSITIVE))
            .sqrt()
            .clamp(least, most)
    }
}

/// Flakes that reflect and transmit, of the fibres of a cloth.
pub struct TransmittingFlakes {
    /// Of each material, with its [`ClearFibre::return_turn`].
    fibres: Vec<(ClearFibre, f32)>,
}

impl TransmittingFlakes {
    /// Of the fibre of each material; one without gets a fibre of its albedo.
    pub fn new(optics: &[FlakeOptics], mut fibres: Vec<ClearFibre>) -> TransmittingFlakes {
        let missing = optics.iter().skip(fibres.len());
        fibres.extend(missing.map(|o| ClearFibre::of_albedo(o.albedo)));
        let turned = |fibre: ClearFibre| (fibre, fibre.return_turn());
        TransmittingFlakes {
            fibres: fibres.into_iter().map(turned).collect(),
        }
    }
}

impl FlakeScattering for TransmittingFlakes {
    fn area(&self, c: &FlakePopulation, w: Vec3) -> f32 {
        Ellipsoids.area(c.axis, c.end_on, w)
    }

    fn eval(&self, c: &FlakePopulation, w_out: Vec3, w_in: Vec3) -> (Rgb, f32) {
        let flakes = AxialFlake::new(c.axis, c.end_on);
        let (fibre, return_turn) = self.fibres[usize::from(c.material)];
        let frame = FibreFrame::new(c.axis, w_out);
        let a = frame.angles(w_in);
        let mean_cos = mean_cos(&frame, &a);
        let turn_rad = a.azimuth_rad.abs();
        let back_rad = PI - turn_rad;
        // Angle of incidence, and the change of twice that angle with the azimuth.
        let returned = (back_rad / return_turn, 2.0 / return_turn);
        let ways: [Option<(f32, f32)>; WAYS] = [
            Some((0.5 * back_rad, 1.0)),
            fibre.gamma_of_turn(mean_cos, turn_rad),
            (returned.0 <= 0.5 * PI).then_some(returned),
        ];
        let (mut value, mut pdf) = (Rgb::BLACK, 0.0);
        for (way, found) in ways.into_iter().enumerate() {
            let Some((gamma_rad, slope)) = found else {
                continue;
            };
            let phase = match way {
                0 => flakes.eval(w_out, w_in),
                _ => {
                    let mirrored = frame.direction(&FibreAngles {
                        azimuth_rad: PI - 2.0 * gamma_rad,
                        ..a
                    });
                    slope * flakes.eval(w_out, mirrored)
                }
            };
            let (kept, chance) = fibre.shares(&fibre.crossing(mean_cos, gamma_rad))[way];
            value += kept * phase;
            pdf += chance * phase;
        }
        (value, pdf)
    }

    fn sample(&self, c: &FlakePopulation, w_out: Vec3, rng: &mut PathRng) -> Option<Vec3> {
        let (fibre, return_turn) = self.fibres[usize::from(c.material)];
        let mirrored = AxialFlake::new(c.axis, c.end_on).sample(w_out, rng);
        let frame = FibreFrame::new(c.axis, w_out);
        let a = frame.angles(mirrored);
        let gamma_rad = 0.5 * (PI - a.azimuth_rad.abs());
        let crossing = fibre.crossing(mean_cos(&frame, &a), gamma_rad);
        let [_, (_, through), (_, returned)] = fibre.shares(&crossing);
        let chosen = rng.unit();
        let turn_rad = if chosen < through {
            2.0 * (gamma_rad - crossing.gamma_t)
        } else if chosen < through + returned {
            PI - return_turn * gamma_rad
        } else {
            return Some(mirrored);
        };
        let turned = FibreAngles {
            azimuth_rad: turn_rad.copysign(a.azimuth_rad),
            ..a
        };
        Some(frame.direction(&turned).normalize_or(mirrored))
    }
}

/// Cosine of the mean inclination of the two directions: symmetric in them.
fn mean_cos(frame: &FibreFrame, a: &FibreAngles) -> f32 {
    Inclinations::new([a.sin, a.cos], [frame.sin_out, frame.cos_out]).mean_cos
}

#[cfg(test)]
#[path = "sggx_transmitting_tests.rs"]
mod tests;
