//! Shadow rays of a wave.

use super::cell_ray::{CellRay, Visit};
use super::matter::FibreMatter;
use super::walk::AHEAD;
use crate::cpu::lanes::Floats;
use glam::Vec3;
use organza_film::Stats;

/// Rays toward lights, and what each adds to its path when nothing is in the way.
pub struct Shadows {
    rays: Vec<CellRay>,
    adds: Vec<(u16, Vec3)>,
    active: Vec<u32>,
}

impl Shadows {
    pub fn new() -> Shadows {
        Shadows {
            rays: Vec::new(),
            adds: Vec::new(),
            active: Vec::new(),
        }
    }

    /// Adds a ray; `None` is one that leaves the matter at once.
    #[inline]
    pub fn push(&mut self, ray: Option<CellRay>, slot: usize, light: Vec3) {
        if let Some(ray) = ray {
            self.active.push(self.rays.len() as u32);
            self.rays.push(ray);
        } else {
            self.rays.push(CellRay::none());
        }
        self.adds.push((slot as u16, light));
    }

    /// Follows all rays, a cell of each at a time, and calls `add` for those
    /// that arrive, in the order in which they were pushed.
    #[inline(always)]
    pub fn follow<F: Floats>(
        &mut self,
        matter: &FibreMatter,
        stats: &mut Stats,
        mut add: impl FnMut(usize, Vec3),
    ) {
        stats.shadow_rays += self.rays.len() as u64;
        while !self.active.is_empty() {
            for &number in self.active.iter().take(AHEAD) {
                self.rays[number as usize].prepare(&matter.cells);
            }
            let mut kept = 0;
            for i in 0..self.active.len() {
                if let Some(&next) = self.active.get(i + AHEAD) {
                    self.rays[next as usize].prepare(&matter.cells);
                }
                let number = self.active[i];
                let ray = &mut self.rays[number as usize];
                let steps = &mut stats.shadow_steps;
                match ray.visit::<F>(&matter.cells, &matter.joints, true, steps) {
                    Visit::Onward => {
                        self.active[kept] = number;
                        kept += 1;
                    }
                    Visit::Left => {}
                    Visit::Met(_) => self.adds[number as usize].1 = Vec3::ZERO,
                }
            }
            self.active.truncate(kept);
        }
        for (slot, light) in self.adds.drain(..) {
            add(usize::from(slot), light);
        }
        self.rays.clear();
    }
}
