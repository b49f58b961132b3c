//! Neps of a yarn: small clumps of entangled fibre that were spun into it.
//!
//! They lie along the yarn as a Poisson process, each about its surface, so that part of it is
//! held by the yarn and part stands out. Some of their fibres go on into the yarn, along its
//! twist. They come on top of the yarn's own fibres.

use crate::clump::{Clump, FILL, LEAST, STRAY_EXTENT};
use crate::drawn_curve::Look;
use crate::protruding::Root;
use crate::spec::NepSpec;
use crate::strand::{FIBRE_LENGTH_MM, MAX_DEVIATIONS, Strand, any_fibre, normal, unit};
use crate::yarn::Yarn;
use glam::{DVec2, DVec3};
use organza_basis::{PathRng, Segment};
use std::f64::consts::{PI, TAU};

/// Length over thickness: twist draws them out (estimated).
const ELONGATION: f64 = 1.6;
/// Least and largest distance of a nep's middle from the yarn's, in radii of the yarn
/// (estimated).
const PLACES: [f64; 2] = [0.3, 0.9];
/// Share of the fibres that go on into the yarn (estimated).
const HELD: f64 = 0.3;
/// Family of random numbers: that of the places, and one more for each nep.
pub(crate) const NEP: u64 = 11 << 40;

/// A nep in its place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Nep {
    /// Length along the yarn.
    pub arc_mm: f64,
    pub size_mm: f64,
    pub clump: Clump,
}

/// Volume of the fibres of all neps, per length of yarn.
pub(crate) fn fibre_mm2(spec: &NepSpec) -> f64 {
    let [mean, deviation] = spec.size_mm;
    let cube = mean.powi(3) + 3.0 * mean * deviation * deviation;
    1e-3 * spec.per_m * FILL * PI / 6.0 * cube
}

/// Upper bound of the distance of neps from the surface of the yarn.
pub(crate) fn reach_mm(yarn: &Yarn) -> f64 {
    yarn.neps.as_ref().map_or(0.0, |n| {
        let [mean, deviation] = n.size_mm;
        STRAY_EXTENT * half_axes(mean + MAX_DEVIATIONS * deviation)[0]
    })
}

/// Half the length and half the thickness of a nep of the volume of a ball.
fn half_axes(size_mm: f64) -> [f64; 2] {
    let across = 0.5 * size_mm * ELONGATION.powf(-1.0 / 3.0);
    [ELONGATION * across, across]
}

impl Strand<'_> {
    /// The neps along the period.
    pub fn neps(&self) -> impl Iterator<Item = Nep> {
        self.yarn.neps.iter().flat_map(|n| self.neps_of(n))
    }

    fn neps_of(&self, spec: &NepSpec) -> impl Iterator<Item = Nep> {
        let mut rng = self.rng(NEP);
        let (distance_mm, size) = (1e3 / spec.per_m, spec.size_mm);
        let mut arc_mm = 0.0;
        std::iter::from_fn(move || {
            arc_mm += distance_mm * f64::from(rng.exponential());
            // Of a distance that is not finite the sum may be no number, which ends them, too.
            let is_within = arc_mm < self.path.length_mm();
            is_within.then(|| {
                let size_mm = normal(&mut rng, size, 1.0).max(LEAST * size[0]);
                let away = PLACES[0] + (PLACES[1] - PLACES[0]) * unit(&mut rng);
                let phase_rad = unit(&mut rng) * TAU;
                self.nep(arc_mm, phase_rad, away, size_mm)
            })
        })
    }

    fn nep(&self, arc_mm: f64, phase_rad: f64, away: f64, size_mm: f64) -> Nep {
        let s = arc_mm / self.path.length_mm();
        let radius_mm = self.scale(s) * self.yarn.radius_mm();
        let section = self.section.at(s);
        let place = away * radius_mm * section * DVec2::from_angle(phase_rad);
        let middle_mm = self.path.at_arc(arc_mm, place);
        let ahead = self.path.at_arc(arc_mm + 0.25 * size_mm, place);
        let along = (ahead - middle_mm).normalize_or(DVec3::X);
        let across = along.any_orthonormal_vector();
        let [half_length, half_width] = half_axes(size_mm);
        Nep {
            arc_mm,
            size_mm,
            clump: Clump {
                middle_mm,
                half_axes_mm: [
                    half_length * along,
                    half_width * across,
                    half_width * along.cross(across),
                ],
            },
        }
    }

    /// The fibres of the neps, numbered from `first`. Returns the number after the last.
    pub fn emit_neps(&self, first: u32, emit: &mut dyn FnMut(&Segment)) -> u32 {
        let mut id = first;
        for (i, nep) in self.neps().enumerate() {
            let mut rng = self.rng(NEP + 1 + i as u64);
            let material = self.dye.of_nep(&mut rng);
            id = self.emit_nep(&nep, material, id, &mut rng, emit);
        }
        id
    }

    fn emit_nep(
        &self,
        nep: &Nep,
        material: Option<u16>,
        first: u32,
        rng: &mut PathRng,
        emit: &mut dyn FnMut(&Segment),
    ) -> u32 {
        let all_mm = nep.clump.fibre_mm(self.yarn.fibre_radius_mm);
        let count = (all_mm / FIBRE_LENGTH_MM).ceil().max(1.0);
        let mut id = first;
        for _ in 0..count as u64 {
            let (radius_mm, dye) = any_fibre(self.yarn, self.dye, rng);
            let look = Look {
                radius_mm,
                material: material.unwrap_or_else(|| dye.at(|| 1.0)),
            };
            let mut curve = match unit(rng) < HELD {
                true => self.root_of_nep(nep, rng),
                false => Vec::new(),
            };
            let each_mm = all_mm / count;
            nep.clump.wind(&mut curve, each_mm, radius_mm, rng);
            id = self.emit_points(id, &curve, |_| look, emit);
        }
        id
    }

    /// The way of a fibre through the yarn to where it first meets the nep.
    fn root_of_nep(&self, nep: &Nep, rng: &mut PathRng) -> Vec<DVec3> {
        let length_mm = nep.size_mm + 2.0 * self.yarn.ply_radius_mm;
        let root = Root {
            ply: rng.below(self.yarn.plies),
            arc_mm: nep.arc_mm,
            phase_rad: unit(rng) * TAU,
            along: if unit(rng) < 0.5 { 1.0 } else { -1.0 },
            length_mm,
        };
        let steps = (length_mm / nep.clump.step_mm(self.yarn.fibre_radius_mm)).ceil();
        let mut curve = root.points(self, steps.clamp(2.0, 256.0) as usize);
        let met = curve.iter().position(|at| nep.clump.extent(*at) < 1.0);
        curve.truncate(met.map_or(0, |i| i + 1));
        curve
    }
}
