//! The walk of waves of paths among fibres.

use super::branches::{events, resume};
use super::cache::CacheUse;
use super::cell_ray::{CellRay, Visit};
use super::importance::Importance;
use super::matter::FibreMatter;
use super::paths::{Paths, State, get};
use super::several::{begin_trip, continue_trip, meet_plane};
use super::shade::{Shading, has_place, shade};
use super::shadows::Shadows;
use super::work::{End, Start, WAVE, Work};
use crate::matter::NO_YARN;
use crate::packed::PackedPart;
use crate::packed::flight::{FlightCounts, fly};
use crate::packed::volume_ray::{Departure, NOWHERE, UNDER_WAY, VolumeRay};
use organza_basis::Rgb;
use organza_film::Stats;
use organza_lanes::Floats;
use organza_light::{KernelLight, Light, LightSearch};

/// Rays between asking for the memory of a cell and looking into it. The blocks of a few
/// cells stay in the first cache until then; those of a whole wave do not.
pub const AHEAD: usize = 8;

/// What is walked through, and what lights it.
pub struct Walk<'a> {
    pub matter: &'a FibreMatter,
    pub lights: &'a [Light],
    pub max_bounces: u32,
    /// What paths are divided by, which changes what they are but not their mean. Only a
    /// flat cloth of explicit fibres alone has its paths divided.
    pub importance: Option<&'a Importance>,
    /// What paths do with the cache of radiance; they are not divided then.
    pub cache: CacheUse<'a>,
}

impl Walk<'_> {
    /// Walks all paths of some work.
    #[inline(always)]
    pub fn run<F: Floats>(&self, work: &mut dyn Work) -> Stats {
        let mut stats = Stats::default();
        let mut paths = Paths::new(self.matter);
        let mut shadows = Shadows::new();
        let mut active: Vec<u16> = Vec::with_capacity(WAVE);
        let mut packed: Vec<u32> = Vec::with_capacity(WAVE);
        let shading = Shading {
            matter: self.matter,
            lights: self.lights,
            max_bounces: self.max_bounces,
            weighs: self.lights.iter().any(has_density),
            has_places: self.lights.iter().any(has_place),
            is_draped: self.matter.is_draped(),
            importance: self
                .importance
                .filter(|_| self.matter.is_plain() && self.cache.places.is_none()),
            cache: self.cache,
        };
        let has_places = self.lights.iter().any(has_place);
        for slot in 0..WAVE {
            self.begin(&mut paths, slot, work, &mut stats);
        }
        loop {
            active.clear();
            packed.clear();
            let waits = shadows.has_packed();
            for slot in 0..WAVE {
                if !waits {
                    self.pass_on(&mut paths, slot, has_places, work, &mut stats);
                }
                if paths.state[slot] != State::Flying {
                    continue;
                }
                if paths.in_volume[slot] {
                    packed.push(slot as u32);
                } else {
                    active.push(slot as u16);
                }
            }
            if paths.state.iter().all(|state| *state == State::Idle) {
                return stats;
            }
            if let Some(part) = &self.matter.packed {
                if waits || !packed.is_empty() {
                    self.fly_packed::<F>(part, &mut paths, &mut shadows, &mut packed, &mut stats);
                }
                if waits {
                    // Light has been added to the paths that have come to their ends.
                    self.end_all(&mut paths, &mut active, has_places, work, &mut stats);
                }
            }
            self.fly::<F>(&mut paths, &mut active, has_places, work, &mut stats);
            if has_places {
                for slot in 0..WAVE {
                    let is_new = !paths.branches.resumed[slot];
                    if is_new && matches!(paths.state[slot], State::Met | State::MetPlane) {
                        self.pass_lights(&mut paths, slot);
                    }
                }
            }
            for first in (0..WAVE).step_by(F::LANES) {
                shade::<F>(&shading, &mut paths, first, &mut shadows, &mut stats);
            }
            if paths.state.contains(&State::MetPlane) {
                // Light of events counts as theirs before the next ones.
                self.follow::<F>(&mut paths, &mut shadows, &mut stats);
                for slot in 0..WAVE {
                    if paths.state[slot] == State::MetPlane {
                        meet_plane(&shading, &mut paths, slot, &mut shadows, &mut stats);
                    }
                }
            }
            self.follow::<F>(&mut paths, &mut shadows, &mut stats);
            for slot in 0..WAVE {
                if paths.state[slot] == State::Ended && !shadows.has_packed() {
                    self.end(&mut paths, slot, work, false, &mut stats);
                }
            }
        }
    }

    /// Follows all shadow rays among explicit fibres.
    #[inline(always)]
    fn follow<F: Floats>(&self, paths: &mut Paths, shadows: &mut Shadows, stats: &mut Stats) {
        shadows.follow::<F>(self.matter, stats, |slot, light| {
            paths.find_light(slot, light);
        });
    }

    /// Follows the rays of all slots to what they meet, a cell of each at a time. Where a
    /// path leaves the matter, the next one of its slot takes its place, so that the
    /// events that follow fill all lanes.
    #[inline(always)]
    fn fly<F: Floats>(
        &self,
        paths: &mut Paths,
        active: &mut Vec<u16>,
        has_places: bool,
        work: &mut dyn Work,
        stats: &mut Stats,
    ) {
        let matter = self.matter;
        while !active.is_empty() {
            for &slot in active.iter().take(AHEAD) {
                paths.rays[usize::from(slot)].prepare(matter);
            }
            let mut kept = 0;
            for i in 0..active.len() {
                if let Some(&next) = active.get(i + AHEAD) {
                    paths.rays[usize::from(next)].prepare(matter);
                }
                let number = active[i];
                let slot = usize::from(number);
                let ray = &mut paths.rays[slot];
                let tests = &mut stats.tentative;
                let cells = &ray.body(matter).cells;
                match ray.visit::<F>(cells, &matter.joints, false, tests) {
                    Visit::Onward => {}
                    Visit::Met(hit) if !paths.trips.is_empty() => {
                        paths.trips[slot].put(&hit);
                        continue_trip(matter, paths, slot);
                        self.pass_on(paths, slot, has_places, work, stats);
                    }
                    Visit::Met(hit) => {
                        matter.joints.prefetch(hit.piece);
                        paths.met.put(slot, &hit);
                        paths.state[slot] = State::Met;
                    }
                    Visit::Left => {
                        if paths.trips.is_empty() {
                            paths.state[slot] = State::Left;
                        } else {
                            continue_trip(matter, paths, slot);
                        }
                        self.pass_on(paths, slot, has_places, work, stats);
                    }
                }
                if paths.state[slot] == State::Flying {
                    active[kept] = number;
                    kept += 1;
                }
            }
            active.truncate(kept);
        }
    }

    /// Follows the rays of slots among packed fibres to what they meet, with all shadow rays
    /// among them. The last few rays of slots may stay on their way.
    #[inline(always)]
    fn fly_packed<F: Floats>(
        &self,
        part: &PackedPart,
        paths: &mut Paths,
        shadows: &mut Shadows,
        packed: &mut Vec<u32>,
        stats: &mut Stats,
    ) {
        for &number in packed.iter() {
            let slot = number as usize;
            paths.volume_rays[slot].rng = [0, 1, 2].map(|k| paths.rng[k][slot]);
        }
        let of_paths = packed.len();
        shadows.move_packed(&mut paths.volume_rays);
        packed.extend(WAVE as u32..paths.volume_rays.len() as u32);
        stats.shadow_rays += (packed.len() - of_paths) as u64;
        let mut counts = FlightCounts::default();
        fly::<F>(
            &part.volume,
            &mut paths.volume_rays,
            packed,
            WAVE as u32,
            &mut counts,
        );
        stats.tentative += counts.tentative;
        stats.shadow_steps += counts.of_shadows;
        stats.majorant_violations += counts.violations;
        let mut rays = std::mem::take(&mut paths.volume_rays);
        shadows.add_packed(&rays[WAVE..], |slot, light| paths.find_light(slot, light));
        rays.truncate(WAVE);
        paths.volume_rays = rays;
        for &number in &packed[..of_paths] {
            let slot = number as usize;
            let ray = paths.volume_rays[slot];
            for (column, word) in paths.rng.iter_mut().zip(ray.rng) {
                column[slot] = word;
            }
            paths.state[slot] = match ray.place {
                UNDER_WAY => State::Flying,
                NOWHERE => State::Left,
                _ => State::Met,
            };
            paths.met.distance[slot] = ray.gone_mm;
        }
    }

    /// Ends all paths that have come to their ends or left the matter; `active` takes the
    /// slots whose next paths begin among explicit fibres.
    fn end_all(
        &self,
        paths: &mut Paths,
        active: &mut Vec<u16>,
        has_places: bool,
        work: &mut dyn Work,
        stats: &mut Stats,
    ) {
        for slot in 0..WAVE {
            match paths.state[slot] {
                State::Ended => self.end(paths, slot, work, false, stats),
                State::Left => {}
                _ => continue,
            }
            self.pass_on(paths, slot, has_places, work, stats);
            if paths.state[slot] == State::Flying && !paths.in_volume[slot] {
                active.push(slot as u16);
            }
        }
    }

    /// Ends the path of a slot that has left the matter, and those after it that miss
    /// the matter.
    fn pass_on(
        &self,
        paths: &mut Paths,
        slot: usize,
        has_places: bool,
        work: &mut dyn Work,
        stats: &mut Stats,
    ) {
        while paths.state[slot] == State::Left {
            if has_places {
                self.pass_lights(paths, slot);
            }
            self.escape(paths, slot);
            self.end(paths, slot, work, true, stats);
        }
    }

    /// The next path of a slot.
    fn begin(&self, paths: &mut Paths, slot: usize, work: &mut dyn Work, stats: &mut Stats) {
        paths.state[slot] = State::Idle;
        let Some(start) = work.begin(slot, stats) else {
            return;
        };
        let Start {
            origin_mm,
            direction,
            key,
            index,
        } = start;
        let way = direction.as_vec3().normalize();
        paths.begin(slot, key, index, way);
        paths.drawn_at_mm[slot] = origin_mm.as_vec3();
        paths.sent_from_mm[slot] = origin_mm;
        paths.met.distance[slot] = f32::INFINITY;
        paths.in_volume[slot] = false;
        if !paths.trips.is_empty() {
            begin_trip(self.matter, paths, slot, (origin_mm, direction), None);
            return;
        }
        let body = &self.matter.bodies[0];
        let entry = body.enter(origin_mm, direction);
        paths.before_mm[slot] = entry.map_or(0.0, |e| e.distance_mm);
        let part = self.matter.packed.as_ref();
        let part = part.filter(|p| p.switch.is_over(0, 1.0));
        paths.in_volume[slot] = part.is_some();
        if let Some(part) = part {
            let ray = entry.and_then(|e| {
                let departure = Departure {
                    direction: way,
                    end_mm: e.end_mm,
                    left_yarn: NO_YARN,
                    rng: [0; 3],
                };
                let start_mm = origin_mm + e.distance_mm * direction;
                part.volume.ray_from_world(start_mm, &departure)
            });
            paths.state[slot] = State::of_ray(&ray);
            paths.volume_rays[slot] = ray.unwrap_or(VolumeRay::none());
            return;
        }
        let grid = &body.cells.grid;
        let ray = entry.and_then(|e| CellRay::new(grid, &e.at, way, e.min_mm, e.end_mm));
        paths.rays[slot] = ray.unwrap_or(CellRay::none());
        paths.rays[slot].prepare_head(self.matter);
        paths.state[slot] = State::of_ray(&ray);
    }

    fn end(
        &self,
        paths: &mut Paths,
        slot: usize,
        work: &mut dyn Work,
        escaped: bool,
        stats: &mut Stats,
    ) {
        if resume(paths, slot) {
            return;
        }
        let end = End {
            radiance: get(&paths.radiance, slot),
            direct: get(&paths.direct, slot),
            bounces: events(paths, slot),
            first: paths.first[slot],
            absorbed: get(&paths.absorbed, slot),
            escape: escaped.then(|| (get(&paths.direction, slot), get(&paths.throughput, slot))),
            notes: &paths.notes[slot],
        };
        work.end(slot, &end, stats);
        self.begin(paths, slot, work, stats);
    }

    /// Light from infinity, for a path that has left.
    fn escape(&self, paths: &mut Paths, slot: usize) {
        let direction = get(&paths.direction, slot);
        let mut seen = Rgb::BLACK;
        for light in self.lights {
            if !has_place(light) {
                seen += self.share(light, paths, slot) * light.radiance_toward(direction);
            }
        }
        add(paths, slot, seen);
    }

    /// What a path sees of lights with a place on its way.
    fn pass_lights(&self, paths: &mut Paths, slot: usize) {
        let direction = get(&paths.direction, slot);
        let reach = match paths.state[slot] {
            State::Met | State::MetPlane => {
                f64::from(paths.met.distance[slot])
                    + if paths.bounces[slot] == 0 {
                        paths.before_mm[slot]
                    } else {
                        0.0
                    }
            }
            _ => f64::INFINITY,
        };
        let mut seen = Rgb::BLACK;
        for light in self.lights {
            if has_place(light) {
                let from = paths.sent_from_mm[slot];
                let met = light.distance_mm(from, direction.as_dvec3());
                if met.is_some_and(|t| t <= reach) {
                    seen += self.share(light, paths, slot) * light.radiance_toward(direction);
                }
            }
        }
        add(paths, slot, seen);
    }

    /// Share of a light that the walk counts.
    fn share(&self, light: &Light, paths: &Paths, slot: usize) -> f32 {
        if paths.bounces[slot] == 0 {
            return 1.0;
        }
        let direction = get(&paths.direction, slot);
        light.walk_share(paths.drawn_at_mm[slot], direction, paths.pdf[slot])
    }
}

fn add(paths: &mut Paths, slot: usize, light: Rgb) {
    paths.find_light(slot, get(&paths.throughput, slot) * light.0);
}

/// Whether shadow rays and walks share the search for a light.
fn has_density(light: &Light) -> bool {
    light.search() != LightSearch::Walk
        && !matches!(light.for_kernel(), KernelLight::Parallel { .. })
}
