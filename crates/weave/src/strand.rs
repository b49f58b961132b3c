//! Plies, fibres, loops and hairs along one period of a yarn [Zhao2016]. `closure.rs` says
//! how they close over the period.

use crate::closure::Closure;
use crate::path::Path;
use crate::push_apart::{Bundle, FibrePlace, FibreShifts};
use crate::yarn::Yarn;
use glam::{DVec2, DVec3};
use organza_basis::{PathRng, Segment};
use std::f64::consts::{FRAC_PI_2, TAU};

/// Random directions tried per fibre; the one with the most room is taken.
const CANDIDATES: u32 = 8;
/// Normal deviates are clamped to this magnitude, so that no hair is endless.
const MAX_DEVIATIONS: f64 = 2.5;
/// Factor on the measured deviations of hairs; [`LOOP_SCALE`] is that of loops.
const HAIR_SCALE: f64 = 0.75;
const LOOP_SCALE: f64 = 0.5;

/// One yarn in the tile, ready to emit curves.
pub(crate) struct Strand<'a> {
    pub yarn: &'a Yarn,
    pub path: &'a Path,
    pub closure: Closure,
    /// Factors on the cross-section's width and height.
    pub flatten: DVec2,
    /// Seed of the random numbers of the yarn.
    pub seed: (u64, u64),
    /// The properties that all segments share.
    pub template: Segment,
}

/// A fibre before it is wound through the tile.
struct Fibre {
    /// The first of the plies that it visits.
    orbit: u32,
    radius_mm: f64,
    phase_rad: f64,
    swing_rad: f64,
    /// Radius of the loop's top at each outer turning point that has one.
    loops_mm: Vec<Option<f64>>,
}

/// Families of random numbers within a strand.
const PLY_PHASE: u64 = 0;
const PLACING: u64 = 1 << 40;
const FIBRE: u64 = 2 << 40;
const HAIR: u64 = 3 << 40;

impl Strand<'_> {
    /// The centreline, with the mean radius of the cross-section.
    pub fn emit_yarn(&self, emit: &mut dyn FnMut(&Segment)) {
        let radius = self.yarn.radius_mm() * (self.flatten.x * self.flatten.y).sqrt();
        self.emit_period(0, radius, |_| DVec2::ZERO, emit);
    }

    /// The centres of the plies.
    pub fn emit_plies(&self, emit: &mut dyn FnMut(&Segment)) {
        let radius = self.yarn.ply_radius_mm * (self.flatten.x * self.flatten.y).sqrt();
        let turned = self.ply_phase();
        for ply in 0..self.yarn.plies {
            self.emit_period(ply, radius, |s| self.ply_centre(ply, turned, s), emit);
        }
    }

    /// All fibres, then all hairs.
    pub fn emit_fibres(&self, emit: &mut dyn FnMut(&Segment)) {
        let orbits = self.yarn.plies / self.closure.visited;
        let fibres: Vec<Fibre> = (0..orbits).flat_map(|o| self.fibres(o)).collect();
        let shifts = self.push_apart(&fibres);
        let ply_phase = self.ply_phase();
        let windings = self.closure.windings();
        let mut id = 0;
        for (i, fibre) in fibres.iter().enumerate() {
            for winding in 0..windings {
                let place = |s: f64| {
                    let run = self.run(winding, s);
                    let shift = shifts.as_ref().map_or(DVec2::ZERO, |all| all.at(i, run));
                    self.place(fibre, winding, ply_phase, s).shifted(shift)
                };
                self.emit_period(id, self.yarn.fibre_radius_mm, place, emit);
                id += 1;
            }
        }
        self.emit_hairs(id, emit);
    }

    /// Pushes fibres apart that would overlap.
    fn push_apart(&self, fibres: &[Fibre]) -> Option<FibreShifts> {
        let ply_phase = self.ply_phase();
        let place = |i: usize, winding, s| self.place(&fibres[i], winding, ply_phase, s);
        self.bundle(&place).push_apart()
    }

    /// Whether there are too many fibres, or too long ones, to push them apart.
    pub fn is_too_large_to_push_apart(&self) -> bool {
        let nowhere = FibrePlace {
            ply_mm: DVec2::ZERO,
            direction: DVec2::X,
            distance_mm: 0.0,
        };
        self.bundle(&|_, _, _| nowhere).is_too_large()
    }

    fn bundle<'b>(&self, place: &'b dyn Fn(usize, u32, f64) -> FibrePlace) -> Bundle<'b> {
        let c = self.closure;
        // A round section turns as a whole; the flatter it is, the more its fibres move
        // relative to each other.
        let flatness = 1.0 - self.flatten.min_element() / self.flatten.max_element();
        let over_period = |turns: i64| turns.unsigned_abs() as f64 / f64::from(c.windings());
        let turns = (2.0 * flatness).min(1.0) * over_period(c.turns)
            + over_period(c.swings)
            + c.ply_shift.unsigned_abs() as f64 / f64::from(self.yarn.plies);
        Bundle {
            fibres: (self.yarn.plies / c.visited * c.fibres) as usize,
            windings: c.windings() as usize,
            angle_rad: TAU * turns,
            length_mm: self.path.length_mm(),
            fibre_radius_mm: self.yarn.fibre_radius_mm,
            flatten: self.flatten,
            reach_mm: self.yarn.ply_radius_mm - self.yarn.fibre_radius_mm,
            place,
        }
    }

    /// The share of all its windings that a fibre has completed at the share `s` of winding
    /// `winding`.
    fn run(&self, winding: u32, s: f64) -> f64 {
        (f64::from(winding) + s) / f64::from(self.closure.windings())
    }

    /// Where a fibre would lie at the share `s` of one of its windings if the yarn held no
    /// other fibre.
    fn place(&self, fibre: &Fibre, winding: u32, ply_phase: f64, s: f64) -> FibrePlace {
        let ply = (i64::from(fibre.orbit) + i64::from(winding) * self.closure.ply_shift)
            .rem_euclid(i64::from(self.yarn.plies)) as u32;
        let (direction, distance_mm) = self.in_ply(fibre, self.run(winding, s));
        FibrePlace {
            ply_mm: self.ply_centre(ply, ply_phase, s),
            direction,
            distance_mm,
        }
    }

    /// The hairs, numbered from `first`.
    pub fn emit_hairs(&self, first: u32, emit: &mut dyn FnMut(&Segment)) {
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
            let o = self.ply_centre(ply, ply_phase, arc / self.path.length_mm())
                + (start + t * rise) * DVec2::from_angle(phase + t * turn);
            self.path.at_arc(arc, self.flatten * o)
        };
        let size = (1.0 - from) * run.hypot(rise).hypot(turn * (start + rise));
        let steps = (size / self.path.mean_step_mm()).ceil().clamp(6.0, 1000.0);
        let at_step = |i: isize| point(from + (1.0 - from) * i as f64 / steps);
        self.emit_curve(id, self.yarn.fibre_radius_mm, steps as isize, at_step, emit);
    }

    /// The fibres of one cycle of plies. Radii are stratified over their distribution. Each
    /// fibre takes, among several random directions, the one that is farthest from all fibres
    /// before it.
    fn fibres(&self, orbit: u32) -> Vec<Fibre> {
        let count = self.closure.fibres;
        let mut placing = self.rng(PLACING + u64::from(orbit));
        let mut placed: Vec<(f64, f64)> = Vec::with_capacity(count as usize);
        let sector = TAU / f64::from(self.closure.rounds);
        (0..count)
            .map(|i| {
                let u = (f64::from(i) + unit(&mut placing)) / f64::from(count);
                let radius_mm = self.yarn.radius_at(u);
                let room = |phase: f64| {
                    let gap = |&(r, p): &(f64, f64)| {
                        let turn = (phase - p + 0.5 * sector).rem_euclid(sector) - 0.5 * sector;
                        radius_mm * radius_mm + r * r - 2.0 * radius_mm * r * turn.cos()
                    };
                    // Fibres much farther inside are not neighbours.
                    let near = placed.iter().rev().take(64).map(gap);
                    near.fold(f64::INFINITY, f64::min)
                };
                let phase_rad = (0..CANDIDATES)
                    .map(|_| unit(&mut placing) * TAU)
                    .map(|phase| (phase, room(phase)))
                    .fold(
                        (0.0, f64::NEG_INFINITY),
                        |a, b| if b.1 > a.1 { b } else { a },
                    )
                    .0;
                placed.push((radius_mm, phase_rad));
                let mut rng = self.rng(FIBRE + (u64::from(orbit) << 24) + u64::from(i));
                Fibre {
                    orbit,
                    radius_mm,
                    phase_rad,
                    swing_rad: unit(&mut rng) * TAU,
                    loops_mm: self.loops(radius_mm, &mut rng),
                }
            })
            .collect()
    }

    /// Which outer turning points of a fibre become loops, and how high.
    fn loops(&self, radius_mm: f64, rng: &mut PathRng) -> Vec<Option<f64>> {
        let length = self.path.length_mm();
        let points_per_mm = f64::from(self.closure.fibres * self.closure.rounds)
            * self.closure.swings as f64
            / (f64::from(self.closure.windings()) * length);
        let loops = self.yarn.loops;
        if loops.per_mm <= 0.0 || points_per_mm <= 0.0 {
            return Vec::new();
        }
        let share = loops.per_mm / points_per_mm;
        let least = 1.05 * radius_mm * self.yarn.migrated(0.0);
        (0..self.closure.swings)
            .map(|_| {
                let peak = self.yarn.ply_radius_mm * normal(rng, loops.peak, LOOP_SCALE);
                (unit(rng) < share && peak > least).then_some(peak)
            })
            .collect()
    }

    /// Direction and distance of a fibre from the centre of its ply at the share
    /// `run` of all its windings.
    fn in_ply(&self, fibre: &Fibre, run: f64) -> (DVec2, f64) {
        let angle = fibre.phase_rad + TAU * run * self.closure.turns as f64;
        let swing = fibre.swing_rad + TAU * run * self.closure.swings as f64;
        let mut radius = fibre.radius_mm * self.yarn.migrated(swing);
        if !fibre.loops_mm.is_empty() {
            let cycle = (swing / TAU).round();
            let from_top = swing - cycle * TAU;
            let which = (cycle as i64).rem_euclid(fibre.loops_mm.len() as i64) as usize;
            if let Some(top) = fibre.loops_mm[which].filter(|_| from_top.abs() < FRAC_PI_2) {
                radius += (top - radius) * from_top.cos().powi(2);
            }
        }
        (DVec2::from_angle(angle), radius)
    }

    fn rng(&self, stream: u64) -> PathRng {
        PathRng::new(self.seed.0, self.seed.1, stream)
    }

    /// The angle of the first ply at the start of the tile.
    fn ply_phase(&self) -> f64 {
        unit(&mut self.rng(PLY_PHASE)) * TAU
    }

    /// Centre of a ply in the round cross-section at the fraction `s` of the
    /// period.
    fn ply_centre(&self, ply: u32, phase: f64, s: f64) -> DVec2 {
        let turns =
            (f64::from(ply) + s * self.closure.ply_shift as f64) / f64::from(self.yarn.plies);
        self.yarn.ply_centre_mm * DVec2::from_angle(phase + TAU * turns)
    }

    /// One curve through the period: `offset` gives its place in the round cross-section at a
    /// fraction of the period, which may lie slightly outside 0 to 1.
    fn emit_period(
        &self,
        fibre: u32,
        radius_mm: f64,
        offset: impl Fn(f64) -> DVec2,
        emit: &mut dyn FnMut(&Segment),
    ) {
        let length = self.path.length_mm();
        let point = |i: isize| {
            self.path
                .offset(i, self.flatten * offset(self.path.arc_at(i) / length))
        };
        self.emit_curve(fibre, radius_mm, self.path.steps() as isize, point, emit);
    }

    /// A curve through the points 0 to `steps`; the points before and after give the tangents
    /// at its ends. A tangent is the direction of the chord over two steps, which needs no
    /// derivative of the frame and is continuous across the border of the tile.
    fn emit_curve(
        &self,
        fibre: u32,
        radius_mm: f64,
        steps: isize,
        point: impl Fn(isize) -> DVec3,
        emit: &mut dyn FnMut(&Segment),
    ) {
        let mut segment = Segment {
            fibre,
            start_radius_mm: radius_mm as f32,
            end_radius_mm: radius_mm as f32,
            ..self.template
        };
        let mut window = [point(-1), point(0), point(1)];
        let tangent = |w: &[DVec3; 3]| (w[2] - w[0]).normalize_or(DVec3::X).as_vec3();
        segment.end_mm = window[1].as_vec3();
        segment.end_tangent = tangent(&window);
        for i in 1..=steps {
            window = [window[1], window[2], point(i + 1)];
            segment.start_mm = segment.end_mm;
            segment.start_tangent = segment.end_tangent;
            segment.end_mm = window[1].as_vec3();
            segment.end_tangent = tangent(&window);
            emit(&segment);
        }
    }
}

fn unit(rng: &mut PathRng) -> f64 {
    f64::from(rng.unit())
}

/// A normal deviate with scaled deviation and clamped tails.
fn normal(rng: &mut PathRng, [mean, deviation]: [f64; 2], scale: f64) -> f64 {
    let deviate = f64::from(rng.normal2().x).clamp(-MAX_DEVIATIONS, MAX_DEVIATIONS);
    mean + scale * deviation * deviate
}

/// Upper bound of the distance of a fibre's centre, loops and hairs included, from the centre
/// of the yarn in the round cross-section.
pub(crate) fn reach_mm(yarn: &Yarn) -> f64 {
    let most = |[mean, deviation]: [f64; 2], scale: f64| mean + MAX_DEVIATIONS * scale * deviation;
    let mut reach = 1.0f64;
    if yarn.loops.per_mm > 0.0 && yarn.migration.is_some() {
        reach = reach.max(most(yarn.loops.peak, LOOP_SCALE));
    }
    if yarn.hairs.per_mm > 0.0 {
        let start = most(yarn.hairs.start, HAIR_SCALE).max(0.1);
        reach = reach.max(start + most(yarn.hairs.rise, HAIR_SCALE).max(0.1));
    }
    yarn.ply_centre_mm + yarn.ply_radius_mm * reach
}
