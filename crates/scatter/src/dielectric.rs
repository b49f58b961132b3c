//! A rough dielectric fibre: R, TT, TRT and the rest
//! [Marschner2003], with blurs that keep energy and reciprocity.
//!
//! Per lobe p, with K the folded Gaussian of the inclination, N the wrapped
//! Gaussian of the azimuth and A the attenuation at the mean inclination
//! `theta_d = (theta_o - theta_i) / 2`,
//!
//! `f = c(theta_o) c(theta_i) sum_p K_p(theta_i, theta_o) A_p(theta_d, h) N(azimuth - azimuth_p(theta_d, h))`.
//!
//! The far field is the mean of this over h uniform in `[-1, 1]`, tabulated. The
//! last lobe is the sum of the series after TRT, even in azimuth.
//!
//! This is a round fibre. One of another [`Section`] has the same form, with lobes traced
//! through its outline and averaged over its rotation, which is random because fibres twist:
//! R, TT, all that comes later, and a remainder that is even in azimuth. Which side of it a
//! ray meets is then unknown at every offset, so that its near field is its far field.

use crate::cone_table::node;
use crate::cylinder::{attenuations, mean_attenuations, offsets};
use crate::error::{Error, in_range};
use crate::fibre::FibreModel;
use crate::lobe_table::{LobeTable, ROWS, SHAPED, row_cosine};
use crate::longitudinal::{
    Balance, Blur, Inclinations, MAX_BLUR_RAD, MIN_BLUR_RAD, wrapped_gaussian,
};
use crate::near::LOBES;
use crate::near::crossing::{Crossing, incidence};
use crate::near::parts::{NearKind, NearParts};
use crate::section::Section;
use crate::traced_section::Traced;
use glam::{Vec3, Vec4};
use organza_basis::{PathRng, Rgb};
use std::f32::consts::{PI, TAU};

/// What a dielectric fibre is made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DielectricParameters {
    /// Index of refraction, 1 to 3; textile fibres have 1.46 to 1.6.
    pub ior: f32,
    /// Absorption coefficient times the fibre's radius, no unit, per channel; see
    /// [`absorption_for_colour`](crate::absorption_for_colour).
    pub absorption_radii: Rgb,
    /// Deviation of the inclination of R, radians; TT has half, TRT and the rest
    /// twice of it, as for rough interfaces passed once and twice
    /// [Marschner2003]. Raised to half a degree.
    pub longitudinal_rad: f32,
    /// Deviation of the azimuth of every lobe, radians. Raised to one degree.
    pub azimuthal_rad: f32,
}

/// Azimuths resolved per deviation of their blur.
pub(crate) const NODES_PER_BLUR: f32 = 8.0;

/// A dielectric fibre, ready to evaluate. Building tabulates the far field, in
/// 30 ms for common blurs and up to 0.5 s for the narrowest; share it among all fibres of a material.
#[derive(Clone, Debug)]
pub struct DielectricFibre {
    parameters: DielectricParameters,
    /// Of a fibre that is not round.
    section: Option<Section>,
    blurs: [Blur; LOBES],
    /// True when no limit has changed the ratios of the blurs.
    geometric: bool,
    azimuth_blur: f32,
    balance: Balance,
    table: LobeTable,
}

impl DielectricFibre {
    /// A round fibre: checks the parameters and tabulates the far field.
    pub fn new(parameters: DielectricParameters) -> Result<DielectricFibre, Error> {
        DielectricFibre::with_section(parameters, None)
    }

    /// A fibre of a section, or a round one: checks the parameters and tabulates the far
    /// field. Tracing a section takes about a tenth of a second for common blurs, up to ten
    /// times that for the narrowest.
    pub fn with_section(
        parameters: DielectricParameters,
        section: Option<Section>,
    ) -> Result<DielectricFibre, Error> {
        let p = parameters;
        in_range("ior", p.ior, [1.0, 3.0], "1 to 3")?;
        for channel in p.absorption_radii.0.to_array() {
            in_range("absorption times radius", channel, [0.0, 1e4], "0 to 10000")?;
        }
        in_range(
            "longitudinal_rad",
            p.longitudinal_rad,
            [0.0, MAX_BLUR_RAD],
            "0 to 0.6 (34 degrees)",
        )?;
        in_range(
            "azimuthal_rad",
            p.azimuthal_rad,
            [0.0, 0.5 * PI],
            "0 to pi / 2",
        )?;
        let blurs = [1.0, 0.5, 2.0, 2.0].map(|k| Blur::new(k * p.longitudinal_rad));
        section.map_or(Ok(()), |s| s.check())?;
        let azimuth_blur = p.azimuthal_rad.max(2.0 * MIN_BLUR_RAD);
        let traced = section.map(|s| {
            let outline = s.outline();
            let rays = ((400.0 / azimuth_blur) as usize).clamp(1024, 8192);
            let row = |i| Traced::new(&outline, p.ior, row_cosine(i), rays);
            (0..ROWS).map(row).collect::<Vec<Traced>>()
        });
        let energies: Vec<[Rgb; LOBES]> = (0..ROWS)
            .map(|i| match &traced {
                Some(rows) => rows[i].energies(Rgb::BLACK),
                None => mean_attenuations(p.ior, Rgb::BLACK, row_cosine(i), 256),
            })
            .collect();
        let balance = Balance::new(blurs, |cos| {
            let (i, t) = node(cos, ROWS);
            std::array::from_fn(|p| Rgb(energies[i][p].0.lerp(energies[i + 1][p].0, t)))
        });
        let azimuths = (PI * NODES_PER_BLUR / azimuth_blur).ceil().max(32.0) as usize + 1;
        let mut fibre = DielectricFibre {
            parameters,
            section,
            blurs,
            geometric: (2.0 * MIN_BLUR_RAD..=0.5 * MAX_BLUR_RAD).contains(&p.longitudinal_rad),
            azimuth_blur,
            balance,
            table: LobeTable::new(azimuths),
        };
        for i in 0..ROWS {
            fibre.add_row(row_cosine(i), traced.as_ref().map(|rows| &rows[i]));
        }
        Ok(fibre)
    }

    fn add_row(&mut self, cos: f32, traced: Option<&Traced>) {
        let p = self.parameters;
        let energies = match traced {
            Some(traced) => traced.energies(p.absorption_radii),
            None => mean_attenuations(p.ior, p.absorption_radii, cos, 256),
        };
        let exits = match traced {
            Some(traced) => self.traced_exits(traced),
            None => self.round_exits(cos),
        };
        let shapes = self.blurred(exits);
        self.table.add_row(energies, &shapes);
    }

    /// What leaves a round fibre by lobe: a histogram over azimuths.
    fn round_exits(&self, cos: f32) -> [Vec<Vec3>; SHAPED] {
        let p = self.parameters;
        let bins = 4 * (self.table.azimuth_nodes() - 1);
        let mut exits = [(); SHAPED].map(|()| vec![Vec3::ZERO; bins]);
        // Exit azimuths turn at most 8 times faster than the angle of incidence.
        for (h, weight) in offsets(2 * bins) {
            let crossing = Crossing::new(p.ior, cos, h);
            let attenuations = attenuations(&crossing, p.absorption_radii);
            for (lobe, exits) in exits.iter_mut().enumerate() {
                let a = attenuations[lobe].0 * weight;
                add_exit(exits, crossing.exit_azimuth(lobe, incidence(h)), a);
            }
        }
        exits
    }

    /// The same of a traced section.
    fn traced_exits(&self, traced: &Traced) -> [Vec<Vec3>; SHAPED] {
        let bins = 4 * (self.table.azimuth_nodes() - 1);
        let mut exits = [(); SHAPED].map(|()| vec![Vec3::ZERO; bins]);
        traced.visit(self.parameters.absorption_radii, |lobe, azimuth, light| {
            if let Some(exits) = exits.get_mut(lobe) {
                add_exit(exits, azimuth, light);
            }
        });
        exits
    }

    /// The shaped lobes averaged over offsets, at the table's azimuths, up to
    /// scale: histograms of exits from a smooth fibre, convolved with the blur.
    fn blurred(&self, exits: [Vec<Vec3>; SHAPED]) -> [Vec<Vec3>; SHAPED] {
        let nodes = self.table.azimuth_nodes() - 1;
        let bins = 4 * nodes;
        let width = TAU / bins as f32;
        let reach = ((6.0 * self.azimuth_blur / width) as usize).min(bins / 2 - 1);
        let deviation = [self.azimuth_blur, 1.0 / self.azimuth_blur];
        let kernel: Vec<f32> = (0..=reach)
            .map(|k| wrapped_gaussian(k as f32 * width, deviation, true))
            .collect();
        exits.map(|mut around| {
            // Once around and once more, so that no index wraps.
            around.extend_from_within(..);
            (0..=nodes)
                .map(|k| {
                    let centre = if 2 * k < reach { 2 * k + bins } else { 2 * k };
                    let sides: Vec3 = (1..=reach)
                        .map(|j| kernel[j] * (around[centre + j] + around[centre - j]))
                        .sum();
                    kernel[0] * around[centre] + sides
                })
                .collect()
        })
    }
}

impl FibreModel for DielectricFibre {
    fn blurs(&self) -> &[Blur] {
        &self.blurs
    }

    fn balance(&self) -> &Balance {
        &self.balance
    }

    fn near_parts(&self) -> NearParts {
        let kind = NearKind::Dielectric {
            ior: self.parameters.ior,
            absorption_radii: self.parameters.absorption_radii,
        };
        NearParts {
            section: self.section.map(|_| self.table.sections()),
            ..NearParts::new(kind, &self.blurs, self.azimuth_blur, &self.balance)
        }
    }

    fn densities(&self, pair: &Inclinations) -> [f32; LOBES] {
        pair.densities(&self.blurs, self.geometric)
    }

    fn far_lobes(&self, mean_cos: f32) -> [f32; LOBES] {
        self.table.far_lobes(mean_cos)
    }

    fn far(&self, mean_cos: f32, azimuth_rad: f32) -> [Vec4; LOBES] {
        self.table.far(mean_cos, azimuth_rad)
    }

    fn far_azimuth_sample(&self, lobe: usize, mean_cos: f32, rng: &mut PathRng) -> f32 {
        self.table.far_azimuth_sample(lobe, mean_cos, rng)
    }

    fn azimuth_nodes(&self) -> usize {
        self.table.azimuth_nodes()
    }
}

/// Adds light to a histogram over azimuths, half of it with the other sign.
fn add_exit(exits: &mut [Vec3], azimuth_rad: f32, light: Vec3) {
    let bins = exits.len();
    let width = TAU / bins as f32;
    for angle in [azimuth_rad, -azimuth_rad] {
        let x = angle.rem_euclid(TAU) / width;
        let (bin, part) = (x as usize, x.fract());
        exits[bin % bins] += light * (1.0 - part);
        exits[(bin + 1) % bins] += light * part;
    }
}
