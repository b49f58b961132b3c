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
use crate::fibre::{Fibre, FibreModel};
use crate::fibre_catalogue::FibreKind;
use crate::longitudinal::{
    Balance, Blur, MAX_BLUR_DEG, MAX_BLUR_RAD, MIN_BLUR_RAD, wrapped_gaussian,
};
use crate::near::LOBES;
use crate::near::event::schlick;
use crate::near::parts::{NearKind, NearParts};
use glam::Vec4;
use organza_basis::{PathRng, Rgb, nearest_name};
use organza_lanes::V3;
use serde::Deserialize;
use std::f32::consts::{PI, TAU};

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
    /// Of R and TT.
    blurs: [Blur; 2],
    azimuth_blur: f32,
    balance: Balance,
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
        Ok(FittedFibre {
            parameters,
            blurs,
            azimuth_blur: p.azimuthal_tt_rad.max(MIN_BLUR_RAD),
            balance,
        })
    }

    /// Part of the light in each lobe at a mean inclination.
    fn energies(&self, cos_theta: f32) -> [Rgb; LOBES] {
        let f = reflectance(self.parameters.colour_r, cos_theta);
        [
            f,
            (Rgb::WHITE - f) * self.parameters.colour_tt,
            Rgb::BLACK,
            Rgb::BLACK,
        ]
    }
}

impl FibreModel for FittedFibre {
    fn blurs(&self) -> &[Blur] {
        &self.blurs
    }

    fn balance(&self) -> &Balance {
        &self.balance
    }

    fn near_parts(&self) -> NearParts {
        let kind = NearKind::Fitted {
            colour_r: self.parameters.colour_r,
            colour_tt: self.parameters.colour_tt,
        };
        NearParts::new(kind, &self.blurs, self.azimuth_blur, &self.balance)
    }

    fn far_lobes(&self, mean_cos: f32) -> [f32; LOBES] {
        self.energies(mean_cos).map(|e| e.mean().max(0.0))
    }

    fn far(&self, mean_cos: f32, azimuth_rad: f32) -> [Vec4; LOBES] {
        let deviation = [self.azimuth_blur, 1.0 / self.azimuth_blur];
        let straight = wrapped_gaussian(azimuth_rad, deviation, true);
        let even = 1.0 / TAU;
        let densities = [even, straight, even, even];
        let energies = self.energies(mean_cos);
        std::array::from_fn(|p| (energies[p].0 * densities[p]).extend(densities[p]))
    }

    fn far_azimuth_sample(&self, lobe: usize, _: f32, rng: &mut PathRng) -> f32 {
        if lobe == 1 {
            self.azimuth_blur * rng.normal2().x
        } else {
            PI - TAU * rng.unit()
        }
    }

    fn azimuth_nodes(&self) -> usize {
        let nodes = PI * crate::dielectric::NODES_PER_BLUR / self.azimuth_blur;
        nodes.ceil().max(32.0) as usize + 1
    }
}

/// Schlick's reflectance per channel.
fn reflectance(normal: Rgb, cos: f32) -> Rgb {
    Rgb(schlick(V3::splat(normal.0), cos).into())
}

/// `fitted = { preset = "silk", colour_tt = [0.8, 0.1, 0.1] }`: a preset with
/// other values for some keys, or all five keys.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FittedTable {
    /// Its name.
    pub preset: Option<String>,
    /// Reflectance of the surface straight on.
    pub colour_r: Option<[f32; 3]>,
    /// Part of the rest that goes through.
    pub colour_tt: Option<[f32; 3]>,
    /// Width of the highlight along the fibre.
    pub longitudinal_r_deg: Option<f32>,
    /// Width of transmitted light along the fibre.
    pub longitudinal_tt_deg: Option<f32>,
    /// Width of transmitted light about the fibre.
    pub azimuthal_tt_deg: Option<f32>,
}

impl FibreKind for FittedTable {
    fn build(&self) -> Result<Fibre, String> {
        let named = |name: &str| {
            FittedParameters::preset(name).map_err(|near| {
                format!(
                    ": no fibre is named `{name}`; expected one of {}{}",
                    PRESETS.join(", "),
                    near.map_or(String::new(), |n| format!("; did you mean `{n}`?"))
                )
            })
        };
        let preset = self.preset.as_deref().map(named).transpose()?;
        let colour = |key, own: Option<[f32; 3]>, preset: Option<Rgb>| {
            own.map(Rgb::from).or(preset).ok_or_else(|| missing(key))
        };
        let width = |key, own: Option<f32>, preset: Option<f32>, most_deg: f32| match own {
            Some(deg) if !(0.0..=most_deg).contains(&deg) => Err(format!(
                ".{key}: expected a number from 0 to {most_deg}, found {deg}"
            )),
            _ => own
                .map(f32::to_radians)
                .or(preset)
                .ok_or_else(|| missing(key)),
        };
        let parameters = FittedParameters {
            colour_r: colour("colour_r", self.colour_r, preset.map(|p| p.colour_r))?,
            colour_tt: colour("colour_tt", self.colour_tt, preset.map(|p| p.colour_tt))?,
            longitudinal_r_rad: width(
                "longitudinal_r_deg",
                self.longitudinal_r_deg,
                preset.map(|p| p.longitudinal_r_rad),
                MAX_BLUR_DEG,
            )?,
            longitudinal_tt_rad: width(
                "longitudinal_tt_deg",
                self.longitudinal_tt_deg,
                preset.map(|p| p.longitudinal_tt_rad),
                MAX_BLUR_DEG,
            )?,
            azimuthal_tt_rad: width(
                "azimuthal_tt_deg",
                self.azimuthal_tt_deg,
                preset.map(|p| p.azimuthal_tt_rad),
                90.0,
            )?,
        };
        FittedFibre::new(parameters)
            .map(Fibre::from)
            .map_err(|e| format!(": {e}"))
    }
}

fn missing(key: &str) -> String {
    format!(".{key}: is missing, and there is no `preset`")
}
