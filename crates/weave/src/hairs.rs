//! Hairs of a yarn: straight ones by the statistics of [Zhao2016], or random curves.

use crate::drawn_curve::Look;
use crate::protruding::protrude;
use crate::strand::{HAIR, HAIR_SCALE, Strand, any_fibre, normal, unit};
use glam::DVec2;
use organza_basis::{PathRng, Segment};
use std::f64::consts::TAU;

impl Strand<'_> {
    /// The hairs, numbered from `first`. Returns the number after the last.
    pub fn emit_hairs(&self, first: u32, emit: &mut dyn FnMut(&Segment)) -> u32 {
        if let Some(hairiness) = &self.yarn.hairiness {
            return protrude(self, hairiness, first, &mut self.rng(HAIR), emit);
        }
        let length = self.path.length_mm();
        let expected = self.yarn.hairs.per_mm * length;
        let ply_phase = self.ply_phase();
        let mut id = first;
        for ply in 0..self.yarn.plies {
            let mut rng = self.rng(HAIR + u64::from(ply));
            // The mean is the expected number, even where that is below one.
            let count = expected.floor() as u32 + u32::from(unit(&mut rng) < expected.fract());
            for _ in 0..count {
                self.emit_hair(id, ply, ply_phase, &mut rng, emit);
                id += 1;
            }
        }
        id
    }

    /// One hair. It begins inside the ply: its line is extended towards the axis, by at most
    /// twice the length that stands out.
    fn emit_hair(
        &self,
        id: u32,
        ply: u32,
        ply_phase: f64,
        rng: &mut PathRng,
        emit: &mut dyn FnMut(&Segment),
    ) {
        let scale = self.yarn.ply_radius_mm;
        let hairs = self.yarn.hairs;
        let start = scale * normal(rng, hairs.start, HAIR_SCALE).max(0.1);
        let rise = scale * normal(rng, hairs.rise, HAIR_SCALE).max(0.1);
        let run = scale * normal(rng, hairs.run, HAIR_SCALE);
        let turn = normal(rng, hairs.turn_rad, HAIR_SCALE);
        let (at, phase) = (unit(rng) * self.path.length_mm(), unit(rng) * TAU);
        let from = -(start / rise).min(2.0);
        let point = |t: f64| {
            let arc = at + t * run;
            let s = arc / self.path.length_mm();
            let o = self.ply_centre(ply, ply_phase, s)
                + (start + t * rise) * DVec2::from_angle(phase + t * turn);
            self.path
                .at_arc(arc, self.scale(s) * self.section.at(s) * o)
        };
        let size = (1.0 - from) * run.hypot(rise).hypot(turn * (start + rise));
        let steps = (size / self.path.mean_step_mm()).ceil().clamp(6.0, 1000.0);
        let at_step = |i: isize| (point(from + (1.0 - from) * i as f64 / steps), ());
        let look = match self.yarn.blends_materials {
            true => {
                let (radius_mm, dye) = any_fibre(self.yarn, self.dye, rng);
                Look {
                    radius_mm,
                    material: dye.at(|| 1.0),
                }
            }
            false => self.whole(self.yarn.fibre_radius_mm),
        };
        let look = |_, ()| look;
        self.emit_curve(id, steps as isize, at_step, look, emit);
    }
}
