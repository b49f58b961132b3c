//! Plies, fibres and loops along one period of a yarn [Zhao2016]. `closure.rs` says how they
//! close over the period, `hairs.rs` adds hairs.

use crate::blend::{part_at, spread};
use crate::closure::Closure;
use crate::crimp::Crimp;
use crate::drawn_curve::Look;
use crate::dye::{Dye, FibreDye, TuftsOfFibre, unit_of};
use crate::evenness::{MOST, Profile};
use crate::felt::Sorter;
use crate::neps;
use crate::openings::Openings;
use crate::path::Path;
use crate::push_apart::{Bundle, FibrePlace, FibreShifts, ROUNDS, ROUNDS_OF_CRIMPED};
use crate::section::ThreadSection;
use crate::spec::BlendTuftSpec;
use crate::wander::Wander;
use crate::yarn::Yarn;
use glam::DVec2;
use organza_basis::{PathRng, Segment, mix64};
use std::cell::Cell;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Random directions tried per fibre; the one with the most room is taken.
const CANDIDATES: u32 = 8;
/// Normal deviates are clamped to this magnitude, so that no hair is endless.
pub(crate) const MAX_DEVIATIONS: f64 = 2.5;
/// The thinnest fibre of a yarn, relative to the mean.
const MIN_RADIUS: f64 = 0.3;
/// Length over which a fibre's end tapers, fibre radii (estimated).
const TAPER_RADII: f64 = 12.0;
/// Length of a fibre, millimetres, where the yarn does not give it.
pub(crate) const FIBRE_LENGTH_MM: f64 = 28.0;
/// Turns of the section over a period that wandering adds to the stations at most.
const MAX_WANDER_TURNS: f64 = 1e4;
/// Factor on the measured deviations of hairs; [`LOOP_SCALE`] is that of loops.
pub(crate) const HAIR_SCALE: f64 = 0.75;
const LOOP_SCALE: f64 = 0.5;

/// One yarn in the tile, ready to emit curves.
pub(crate) struct Strand<'a> {
    pub yarn: &'a Yarn,
    pub path: &'a Path,
    pub closure: Closure,
    /// Its cross-section.
    pub section: &'a ThreadSection,
    /// Seed of the random numbers of the yarn.
    pub seed: (u64, u64),
    /// The properties that all segments share.
    pub template: Segment,
    /// Mass along the period; `None` for an even yarn.
    pub profile: Option<&'a Profile>,
    pub dye: &'a Dye,
    /// Where fibres of fulled yarn go; `None` of other yarn.
    pub openings: Option<&'a Openings>,
}

/// A fibre before it is wound through the tile.
struct Fibre {
    /// The first of the plies that it visits.
    orbit: u32,
    radius_mm: f64,
    phase_rad: f64,
    swing_rad: f64,
    /// Its own radius.
    fibre_radius_mm: f64,
    /// Where along its windings its ends lie, as a share of them; only in uneven yarn.
    end: f64,
    wander: Option<Wander>,
    crimp: Option<Crimp>,
    dye: FibreDye,
    /// The tufts of a blend that it runs through, which then give it its colours.
    tufts: Option<TuftsOfFibre>,
    /// Radius of the loop's top at each outer turning point that has one.
    loops_mm: Vec<Option<f64>>,
}

/// How far the ends of a tuft's fibres lie apart, as a share of its length (estimated).
const RAGGED: f64 = 0.3;

/// Families of random numbers within a strand.
const PLY_PHASE: u64 = 0;
const PLACING: u64 = 1 << 40;
const FIBRE: u64 = 2 << 40;
pub(crate) const HAIR: u64 = 3 << 40;
const BLEND: u64 = 10 << 40;

impl Strand<'_> {
    /// All fibres, then all hairs, then all neps.
    pub fn emit_fibres(&self, emit: &mut dyn FnMut(&Segment)) {
        let orbits = self.yarn.plies / self.closure.visited;
        let fibres: Vec<Fibre> = (0..orbits).flat_map(|o| self.fibres(o)).collect();
        let shifts = self.push_apart(&fibres);
        let ply_phase = self.ply_phase();
        let windings = self.closure.windings();
        let mut id = 0;
        for (i, fibre) in fibres.iter().enumerate() {
            let mut sorter = self.openings.map(|openings| {
                let out = self.out(self.yarn.fulling, i as u64);
                (openings, Sorter::new(out, fibre.fibre_radius_mm))
            });
            for winding in 0..windings {
                let place = |s: f64| {
                    let run = self.run(winding, s);
                    let shift = shifts.as_ref().map_or(DVec2::ZERO, |all| all.at(i, run));
                    self.place(fibre, winding, ply_phase, s).shifted(shift)
                };
                let share = Cell::new(0.0);
                let look = |s: f64, place: DVec2| {
                    share.set(s);
                    Look {
                        radius_mm: self.radius_mm(fibre, winding, s),
                        material: match &fibre.tufts {
                            Some(tufts) => tufts.at(self.dye, self.run(winding, s)),
                            None => fibre
                                .dye
                                .at(|| place.length() / (self.scale(s) * self.yarn.radius_mm())),
                        },
                    }
                };
                id = match &mut sorter {
                    None => self.emit_period(id, place, look, emit),
                    Some((_, sorter)) => {
                        let next = self.emit_period(id, place, look, &mut |s| {
                            sorter.sort(self.run(winding, share.get()), s, emit);
                        });
                        next + sorter.take_cuts()
                    }
                };
            }
            if let Some((openings, sorter)) = sorter {
                id = self.emit_felt(openings, sorter, (i as u64, id), emit);
            }
        }
        let id = self.emit_hairs(id, emit);
        self.emit_neps(id, emit);
    }

    /// Pushes fibres apart that would overlap.
    fn push_apart(&self, fibres: &[Fibre]) -> Option<FibreShifts> {
        let ply_phase = self.ply_phase();
        let place = |i: usize, winding, s| self.place(&fibres[i], winding, ply_phase, s);
        self.bundle(&place, &|s| self.section.at(s)).push_apart()
    }

    /// Whether there are too many fibres, or too long ones, to push them apart.
    pub fn is_too_large_to_push_apart(&self) -> bool {
        let nowhere = FibrePlace {
            ply_mm: DVec2::ZERO,
            direction: DVec2::X,
            distance_mm: 0.0,
            reach_mm: 0.0,
            radius_mm: 0.0,
            scale: 1.0,
        };
        self.bundle(&|_, _, _| nowhere, &|_| DVec2::ONE)
            .is_too_large()
    }

    fn bundle<'b>(
        &self,
        place: &'b dyn Fn(usize, u32, f64) -> FibrePlace,
        flatten: &'b dyn Fn(f64) -> DVec2,
    ) -> Bundle<'b> {
        let c = self.closure;
        // A round section turns as a whole; the flatter it is, the more its fibres move
        // relative to each other.
        let flatness = |f: DVec2| 1.0 - f.min_element() / f.max_element();
        let [flattest, highest] = self.section.range().map(flatness);
        let flatness = flattest.max(highest);
        let over_period = |turns: i64| turns.unsigned_abs() as f64 / f64::from(c.windings());
        let turns = (2.0 * flatness).min(1.0) * over_period(c.turns)
            + over_period(c.swings)
            + c.ply_shift.unsigned_abs() as f64 / f64::from(self.yarn.plies)
            // Each length of wandering leads about a quarter of a turn away.
            + self.yarn.wander.map_or(0.0, |w| {
                (0.25 * self.path.length_mm() / w.length_mm).min(MAX_WANDER_TURNS)
            })
            + self.yarn.crimp.map_or(0.0, |c| {
                (0.1 * c.per_cm * self.path.length_mm()).min(MAX_WANDER_TURNS)
            });
        Bundle {
            fibres: (self.yarn.plies / c.visited * c.fibres) as usize,
            windings: c.windings() as usize,
            angle_rad: TAU * turns,
            length_mm: self.path.length_mm(),
            fibre_radius_mm: thickest_fibre_mm(self.yarn),
            rounds: match self.yarn.crimp {
                Some(_) => ROUNDS_OF_CRIMPED,
                None => ROUNDS,
            },
            flatten,
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
        let (direction, distance_mm) = self.in_ply(fibre, winding, s);
        let scale = self.scale(s);
        FibrePlace {
            ply_mm: scale * self.ply_centre(ply, ply_phase, s),
            direction,
            distance_mm: scale * distance_mm,
            reach_mm: self.reach_mm(fibre),
            radius_mm: self.radius_mm(fibre, winding, s),
            scale,
        }
    }

    /// The largest distance of a fibre's centre from that of its ply, unless it begins farther
    /// out, in a section of scale 1.
    fn reach_mm(&self, fibre: &Fibre) -> f64 {
        let radius_mm = match self.yarn.blends_materials {
            true => fibre.fibre_radius_mm,
            false => self.yarn.fibre_radius_mm,
        };
        (self.yarn.ply_radius_mm - radius_mm).max(0.0)
    }

    /// Linear size of the section at the share `s` of the period, relative to the thread's mean:
    /// the packing is the same everywhere.
    pub fn scale(&self, s: f64) -> f64 {
        self.profile.map_or(1.0, |p| p.mass(s).sqrt())
    }

    /// The share of the period's twist up to the share `s` of its length.
    fn twisted(&self, s: f64) -> f64 {
        self.profile.map_or(s, |p| p.twisted(s))
    }

    /// The radius of a fibre, 0 where it is missing. Uneven yarn has fewer fibres in thin places:
    /// each fibre has a rank at each point, which drifts by one cycle over about a fibre's
    /// length, and is there while its rank is below the share of fibres that are.
    fn radius_mm(&self, fibre: &Fibre, winding: u32, s: f64) -> f64 {
        let Some(profile) = self.profile else {
            return fibre.fibre_radius_mm;
        };
        let cycles = self.fibre_cycles();
        let turn = fibre.end + cycles * self.run(winding, s);
        let rank = (2.0 * (turn - turn.floor()) - 1.0).abs();
        let room = profile.mass(s) / profile.most() - rank;
        if room <= 0.0 {
            return 0.0;
        }
        let length = f64::from(self.closure.windings()) * self.path.length_mm();
        let taper = 2.0 * cycles * TAPER_RADII * fibre.fibre_radius_mm / length;
        fibre.fibre_radius_mm * (room / taper).min(1.0).sqrt()
    }

    /// Pairs of ends on all windings of a fibre.
    fn fibre_cycles(&self) -> f64 {
        let fibre_mm = self
            .yarn
            .evenness
            .map_or(FIBRE_LENGTH_MM, |e| e.fibre_length_mm);
        let length = f64::from(self.closure.windings()) * self.path.length_mm();
        (length / fibre_mm).round().max(1.0)
    }

    /// The fibres of one cycle of plies. Radii are stratified over their distribution. Each
    /// fibre takes, among several random directions, the one that is farthest from all fibres
    /// before it.
    fn fibres(&self, orbit: u32) -> Vec<Fibre> {
        let count = self.closure.fibres;
        let mut placing = self.rng(PLACING + u64::from(orbit));
        let mut placed: Vec<(f64, f64)> = Vec::with_capacity(count as usize);
        let sector = TAU / f64::from(self.closure.rounds);
        let parts = self.yarn.blends_materials.then(|| {
            let mut rng = self.rng(BLEND + u64::from(orbit));
            spread(&self.yarn.blend, count as usize, &mut rng)
        });
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
                // Draws of an ideal yarn come first, so that irregularity does not change them.
                let (swing_rad, loops_mm) = (unit(&mut rng) * TAU, self.loops(radius_mm, &mut rng));
                let part = parts.as_ref().map(|parts| parts[i as usize]);
                let mut fibre = Fibre {
                    orbit,
                    radius_mm,
                    phase_rad,
                    swing_rad,
                    loops_mm,
                    fibre_radius_mm: radius_of_part_mm(self.yarn, part, &mut rng),
                    end: self.profile.map_or(0.0, |_| unit(&mut rng)),
                    wander: self.yarn.wander.map(|spec| {
                        let length = f64::from(self.closure.windings()) * self.path.length_mm();
                        Wander::new(&spec, length, self.yarn.ply_radius_mm, &mut rng)
                    }),
                    crimp: self.yarn.crimp.map(|spec| {
                        let length = f64::from(self.closure.windings()) * self.path.length_mm();
                        Crimp::new(&spec, length, &mut rng)
                    }),
                    dye: match part {
                        Some(part) => self.dye.of_part(part),
                        None => self.dye.of_fibre(&mut rng),
                    },
                    tufts: self
                        .yarn
                        .blend_tufts
                        .map(|spec| self.tufts(&spec, orbit, (radius_mm, phase_rad), &mut rng)),
                };
                // Fibres that are thicker than the mean begin farther inside.
                if part.is_some() {
                    fibre.radius_mm = fibre.radius_mm.min(self.reach_mm(&fibre));
                }
                fibre
            })
            .collect()
    }

    /// The tufts of a blend that a fibre at a place of the section runs through: those of its
    /// cell of the section, whose ends are ragged.
    fn tufts(
        &self,
        spec: &BlendTuftSpec,
        orbit: u32,
        (radius_mm, phase_rad): (f64, f64),
        rng: &mut PathRng,
    ) -> TuftsOfFibre {
        let area = PI * self.yarn.ply_radius_mm.powi(2) / f64::from(self.yarn.fibres_per_ply);
        let cell_mm = (spec.fibres * area).sqrt();
        let at = (radius_mm * DVec2::from_angle(phase_rad) / cell_mm).floor();
        let [seed, thread] = [self.seed.0, self.seed.1].map(mix64);
        let cell = (at.x as i64 as u64) << 32 ^ (at.y as i64 as u64) & 0xffff_ffff;
        let name = mix64(seed ^ mix64(thread ^ mix64(cell ^ u64::from(orbit) << 60)));
        let length_mm = f64::from(self.closure.windings()) * self.path.length_mm();
        TuftsOfFibre {
            name,
            count: (length_mm / spec.length_mm).round().clamp(1.0, 1e9) as u32,
            start: unit_of(mix64(!name)) + RAGGED * (unit(rng) - 0.5),
        }
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

    /// Direction and distance of a fibre from the centre of its ply at the share `s` of a
    /// winding, in a section of scale 1.
    fn in_ply(&self, fibre: &Fibre, winding: u32, s: f64) -> (DVec2, f64) {
        let run = self.run(winding, s);
        let twisted = self.run(winding, self.twisted(s));
        let mut angle = fibre.phase_rad + TAU * twisted * self.closure.turns as f64;
        let swing = fibre.swing_rad + TAU * run * self.closure.swings as f64;
        let mut radius = fibre.radius_mm * self.yarn.migrated(swing);
        if let Some(crimp) = &fibre.crimp {
            let middle = radius * self.yarn.crimp_room();
            let shift = crimp.at(run);
            // Across the fibre, which runs at an angle to the section.
            let slope = self.yarn.twist_rad_per_mm * middle;
            let place = DVec2::new(middle + shift.x, shift.y * slope.hypot(1.0));
            angle += place.y.atan2(place.x);
            radius = place.length().min(self.reach_mm(fibre).max(radius));
        }
        if let Some(wander) = &fibre.wander {
            let shift = wander.at(run);
            // Near the centre the same displacement is a larger angle; on the surface fibres
            // stay inside.
            let least = 0.25 * self.yarn.ply_radius_mm;
            let reach = self.reach_mm(fibre).max(radius);
            angle += shift.y / radius.max(least);
            radius = (radius + shift.x).abs().min(reach);
        }
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

    pub fn rng(&self, stream: u64) -> PathRng {
        PathRng::new(self.seed.0, self.seed.1, stream)
    }

    /// The angle of the first ply at the start of the tile.
    pub fn ply_phase(&self) -> f64 {
        unit(&mut self.rng(PLY_PHASE)) * TAU
    }

    /// Centre of a ply in the round cross-section at the fraction `s` of the
    /// period.
    pub fn ply_centre(&self, ply: u32, phase: f64, s: f64) -> DVec2 {
        let turns = (f64::from(ply) + self.twisted(s) * self.closure.ply_shift as f64)
            / f64::from(self.yarn.plies);
        self.yarn.ply_centre_mm * DVec2::from_angle(phase + TAU * turns)
    }
}

/// Radius in millimetres and materials of a fibre at random.
pub(crate) fn any_fibre(yarn: &Yarn, dye: &Dye, rng: &mut PathRng) -> (f64, FibreDye) {
    if yarn.blends_materials {
        let part = part_at(&yarn.blend, unit(rng));
        return (radius_of_part_mm(yarn, Some(part), rng), dye.of_part(part));
    }
    (radius_of_part_mm(yarn, None, rng), dye.of_fibre(rng))
}

/// The radius of a fibre of a part of the blend, or of any. The root mean square of all is that
/// of the part, or of the yarn.
pub(crate) fn radius_of_part_mm(yarn: &Yarn, part: Option<usize>, rng: &mut PathRng) -> f64 {
    let (radius_mm, cv) = match part.map(|p| &yarn.blend[p]) {
        Some(part) => (part.fibre_radius_mm, part.fibre_radius_cv),
        None => (yarn.fibre_radius_mm, yarn.fibre_radius_cv),
    };
    if cv == 0.0 {
        return radius_mm;
    }
    let factor = normal(rng, [1.0, cv], 1.0).max(MIN_RADIUS);
    radius_mm * factor / cv.hypot(1.0)
}

pub(crate) fn unit(rng: &mut PathRng) -> f64 {
    f64::from(rng.unit())
}

/// A normal deviate with scaled deviation and clamped tails.
pub(crate) fn normal(rng: &mut PathRng, [mean, deviation]: [f64; 2], scale: f64) -> f64 {
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
    let uneven = yarn.evenness.is_some() || yarn.slubs.is_some();
    let scale = if uneven { MOST.sqrt() } else { 1.0 };
    scale * (yarn.ply_centre_mm + yarn.ply_radius_mm * reach)
}

/// Upper bound of the radius of a fibre.
pub(crate) fn thickest_fibre_mm(yarn: &Yarn) -> f64 {
    let thickest = |cv: f64, radius_mm: f64| (1.0 + MAX_DEVIATIONS * cv) * radius_mm;
    if !yarn.blends_materials {
        return thickest(yarn.fibre_radius_cv, yarn.fibre_radius_mm);
    }
    let parts = yarn.blend.iter();
    let each = parts.map(|p| thickest(p.fibre_radius_cv, p.fibre_radius_mm));
    each.fold(0.0, f64::max)
}

/// Upper bound of the distance of protruding fibres and of neps from the faces of the yarn.
pub(crate) fn protruding_mm(yarn: &Yarn) -> f64 {
    let hairs_mm = yarn.hairiness.map_or(0.0, |h| h.reach_mm);
    hairs_mm.max(neps::reach_mm(yarn))
}
