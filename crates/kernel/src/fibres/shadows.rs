//! Shadow rays of a wave.

use super::cell_ray::{CellRay, Visit};
use super::matter::FibreMatter;
use super::trip::{Trip, TripEnd, TripStart};
use super::walk::AHEAD;
use crate::packed::volume_ray::{NOWHERE, VolumeRay};
use glam::{DVec3, Vec3};
use organza_film::Stats;
use organza_lanes::Floats;

/// Rays toward lights, and what each adds to its path when nothing is in the way.
pub struct Shadows {
    rays: Vec<CellRay>,
    adds: Vec<(u16, Vec3)>,
    active: Vec<u32>,
    /// Where several bodies may be met: the ways of the rays.
    trips: Vec<Trip>,
    /// Rays among packed fibres, in the same way.
    volume_rays: Vec<VolumeRay>,
    volume_adds: Vec<(u16, Vec3)>,
}

impl Shadows {
    pub fn new() -> Shadows {
        Shadows {
            rays: Vec::new(),
            adds: Vec::new(),
            active: Vec::new(),
            trips: Vec::new(),
            volume_rays: Vec::new(),
            volume_adds: Vec::new(),
        }
    }

    /// Adds a ray through several bodies and planes, from a point along a unit direction;
    /// see [`Trip::begin`].
    pub fn send(
        &mut self,
        matter: &FibreMatter,
        ray: (DVec3, DVec3),
        start: Option<TripStart>,
        most_mm: f64,
        (slot, light): (usize, Vec3),
    ) {
        let number = self.rays.len();
        if self.trips.len() <= number {
            self.trips.resize(number + 1, Trip::none());
        }
        let trip = &mut self.trips[number];
        trip.begin(matter, ray, start, most_mm);
        if let TripEnd::Plane(_) = trip.met() {
            self.push(None, slot, Vec3::ZERO);
            return;
        }
        let next = trip.next(matter);
        if let Some(ray) = &next {
            ray.prepare_head(matter);
        }
        self.push(next, slot, light);
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

    /// Adds a ray among packed fibres.
    #[inline]
    pub fn push_packed(&mut self, ray: VolumeRay, slot: usize, light: Vec3) {
        self.volume_rays.push(ray);
        self.volume_adds.push((slot as u16, light));
    }

    /// Whether there are rays among packed fibres, which are followed with those of paths.
    pub fn has_packed(&self) -> bool {
        !self.volume_rays.is_empty()
    }

    /// Moves the rays among packed fibres behind others.
    pub fn move_packed(&mut self, rays: &mut Vec<VolumeRay>) {
        rays.append(&mut self.volume_rays);
    }

    /// Calls `add` for the moved rays that have arrived, in the order in which they were
    /// pushed.
    pub fn add_packed(&mut self, rays: &[VolumeRay], mut add: impl FnMut(usize, Vec3)) {
        for (ray, (slot, light)) in rays.iter().zip(self.volume_adds.drain(..)) {
            if ray.place == NOWHERE {
                add(usize::from(slot), light);
            }
        }
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
                self.rays[number as usize].prepare(matter);
            }
            let mut kept = 0;
            for i in 0..self.active.len() {
                if let Some(&next) = self.active.get(i + AHEAD) {
                    self.rays[next as usize].prepare(matter);
                }
                let number = self.active[i];
                let ray = &mut self.rays[number as usize];
                let steps = &mut stats.shadow_steps;
                let cells = &ray.body(matter).cells;
                match ray.visit::<F>(cells, &matter.joints, true, steps) {
                    Visit::Onward => {
                        self.active[kept] = number;
                        kept += 1;
                    }
                    Visit::Left => {
                        let trip = self.trips.get_mut(number as usize);
                        if let Some(next) = trip.and_then(|trip| trip.next(matter)) {
                            next.prepare_head(matter);
                            *ray = next;
                            self.active[kept] = number;
                            kept += 1;
                        }
                    }
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
