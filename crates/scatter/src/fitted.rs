//! The fitted two-lobe fibre of cloth [Khungurn2015]: a surface reflection R and
//! a transmission TT, with colours and widths found by matching photographs.
//!
//! R carries the part F of the light, Schlick's reflectance for the mean
//! inclination, evenly in azimuth; TT carries `(1 - F) colour_tt`, straight on
//! with a Gaussian in azimuth. The published form normalises each lobe for one
//! direction of light only and takes F from one of the two directions; here both
//! lobes are balanced (see [`Balance`]) and F is taken midway, so that the fibre
//! is reciprocal and keeps energy, and its parameters keep their meaning.

use crate::error::{Error, in_range};
use crate::longitudinal::{Balance, Blur, MAX_BLUR_RAD, MIN_BLUR_RAD, wrapped_gaussian};
use crate::near::Optics;
use crate::near::event::schlick;
use crate::near::parts::{NearKind, NearParts};
use organza_basis::{PathRng, Rgb, nearest_name};
use organza_lanes::V3;
use std::f32::consts::{PI, TAU};
use std::sync::Arc;

/// R and TT.
pub(crate) const LOBES: usize = 2;

/// Parameters of a fitted fibre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedParameters {
    /// Reflectance of R at normal incidence, per channel in `[0, 1]`.
    pub colour_r: Rgb,
    /// Part of the light past R that TT keeps, per channel in `[0, 1]`.
    pub colour_tt: Rgb,
    /// Deviation of the inclination of R, radians.
    pub longitudinal_r_rad: f32,
    /// Deviation of the inclination of TT, radians.
    pub longitudinal_tt_rad: f32,
    /// Deviation of the azimuth of TT, radians.
    pub azimuthal_tt_rad: f32,
}

/// Names of the presets, in the order of their table.
pub const PRESETS: [&str; 5] = ["fleece", "gabardine", "silk", "cotton", "polyester"];

impl FittedParameters {
    /// A preset: values matched to photographs [Khungurn2015], as carried by
    /// the code of [Soh2024]. Some sit at the bounds of the fit (widths of 1 and
    /// 10 degrees, colours of 0.999), and the reflectances are not those of a
    /// physical surface.
    ///
    /// An unknown name is answered with the nearest known one, if any is near.
    pub fn preset(name: &str) -> Result<FittedParameters, Option<&'static str>> {
        let rows = [
            (
                [0.040, 0.087, 0.087],
                [0.452, 0.725, 0.948],
                [7.238, 10.0, 25.989],
            ),
            (
                [0.185, 0.047, 0.069],
                [0.999, 0.330, 0.354],
                [2.141, 10.0, 23.548],
            ),
            (
                [0.745, 0.008, 0.070],
                [0.620, 0.553, 0.562],
                [1.0, 10.0, 19.823],
            ),
            (
                [0.989, 0.959, 0.874],
                [0.999, 0.999, 0.999],
                [1.0, 27.197, 38.269],
            ),
            (
                [0.700, 0.700, 0.700],
                [0.600, 0.0, 0.800],
                [5.238, 10.0, 25.0],
            ),
        ];
        let Some(i) = PRESETS.iter().position(|&p| p == name) else {
            let near = nearest_name(name, PRESETS);
            return Err(near.and_then(|n| PRESETS.into_iter().find(|&p| p == n)));
        };
        let (r, tt, degrees) = rows[i];
        let [beta_r, beta_tt, gamma_tt] = degrees.map(f32::to_radians);
        Ok(FittedParameters {
            colour_r: Rgb::from(r),
            colour_tt: Rgb::from(tt),
            longitudinal_r_rad: beta_r,
            longitudinal_tt_rad: beta_tt,
            azimuthal_tt_rad: gamma_tt,
        })
    }
}

/// A fitted fibre, ready to evaluate.
#[derive(Clone, Debug)]
pub struct FittedFibre {
    parameters: FittedParameters,
    blurs: [Blur; LOBES],
    azimuth_blur: f32,
    balance: Balance,
    /// Of the near field.
    optics: Arc<Optics>,
}

impl FittedFibre {
    /// Checks the parameters and balances the lobes.
    pub fn new(parameters: FittedParameters) -> Result<FittedFibre, Error> {
        let p = parameters;
        for (name, colour) in [("colour_r", p.colour_r), ("colour_tt", p.colour_tt)] {
            for channel in colour.0.to_array() {
                in_range(name, channel, [0.0, 1.0], "0 to 1 in every channel")?;
            }
        }
        let blur = |name, value: f32| {
            in_range(name, value, [0.0, MAX_BLUR_RAD], "0 to 0.6 (34 degrees)").map(Blur::new)
        };
        let blurs = [
            blur("longitudinal_r_rad", p.longitudinal_r_rad)?,
            blur("longitudinal_tt_rad", p.longitudinal_tt_rad)?,
        ];
        in_range(
            "azimuthal_tt_rad",
            p.azimuthal_tt_rad,
            [0.0, 0.5 * PI],
            "0 to pi / 2",
        )?;
        let balance = Balance::new(blurs, |cos| {
            let f = reflectance(p.colour_r, cos);
            [f, Rgb::WHITE - f]
        });
        let mut fibre = FittedFibre {
            parameters,
            blurs,
            azimuth_blur: p.azimuthal_tt_rad.max(MIN_BLUR_RAD),
            balance,
            optics: Arc::new(Optics::of_parts(&[])),
        };
        fibre.optics = Arc::new(Optics::of_parts(&[fibre.near_parts()]));
        Ok(fibre)
    }

    /// The numbers behind its near field.
    pub(crate) fn near_parts(&self) -> NearParts {
        let kind = NearKind::Fitted {
            colour_r: self.parameters.colour_r,
            colour_tt: self.parameters.colour_tt,
        };
        NearParts::new(kind, &self.blurs, self.azimuth_blur, &self.balance)
    }

    /// The same as a table.
    pub(crate) fn optics(&self) -> &Optics {
        &self.optics
    }

    /// What it was made from.
    pub fn parameters(&self) -> &FittedParameters {
        &self.parameters
    }

    pub(crate) fn blurs(&self) -> &[Blur; LOBES] {
        &self.blurs
    }

    pub(crate) fn balance(&self) -> &Balance {
        &self.balance
    }

    /// Part of the light in each lobe at a mean inclination.
    pub(crate) fn energies(&self, cos_theta: f32) -> [Rgb; LOBES] {
        let f = reflectance(self.parameters.colour_r, cos_theta);
        [f, (Rgb::WHITE - f) * self.parameters.colour_tt]
    }

    /// Deviation of the azimuth of TT.
    pub(crate) fn azimuth_blur_rad(&self) -> f32 {
        self.azimuth_blur
    }

    /// Density per radian of lobe `p`'s azimuth.
    pub(crate) fn azimuth(&self, p: usize, azimuth_rad: f32) -> f32 {
        if p == 0 {
            1.0 / TAU
        } else {
            wrapped_gaussian(
                azimuth_rad,
                [self.azimuth_blur, 1.0 / self.azimuth_blur],
                true,
            )
        }
    }

    /// Draws the azimuth of lobe `p`, not wrapped.
    pub(crate) fn azimuth_sample(&self, p: usize, rng: &mut PathRng) -> f32 {
        if p == 0 {
            PI - TAU * rng.unit()
        } else {
            self.azimuth_blur * rng.normal2().x
        }
    }
}

/// Schlick's reflectance per channel.
fn reflectance(normal: Rgb, cos: f32) -> Rgb {
    Rgb(schlick(V3::splat(normal.0), cos).into())
}
