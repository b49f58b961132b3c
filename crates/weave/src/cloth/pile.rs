//! Pile on a woven ground: where its tufts and loops stand.

mod check;
mod collide;
mod cover;
mod ruffle;

use super::spun::Spun;
use super::yarns::{Materials, Yarns};
use super::{Centreline, Cloth, CurveLevel, ThreadAtRest};
use crate::Error;
use crate::dye::Dye;
use crate::path::Hermite;
use crate::pile::{Ridge, Tuft, Tufts};
use crate::section::ThreadSection;
use crate::spec::{FabricGeometry, PileKind, PileSides, PileSpec};
use crate::strand::{MAX_DEVIATIONS, normal, protruding_mm, reach_mm, thickest_fibre_mm};
use crate::yarn::Yarn;
use glam::{DVec2, DVec3};
use organza_basis::PathRng;
use ruffle::Ruffle;
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::sync::Arc;

pub(super) use check::{check, repeat};
pub(super) use cover::loop_cover;

/// Family of the random numbers of lean and height.
const LEAN: u64 = 7 << 40;
/// The largest number of tufts or loops in a tile.
const MAX_TUFTS: usize = 1 << 20;
/// Share of half a ridge in which its tufts are bound; their tips fan out over all of it
/// (estimated).
const BOUND_SHARE: f64 = 0.7;
/// Share of the deviation of height and lean that the fibres of a tuft have in common; half of
/// the variance in velvet, and little in ridges, which are brushed across (estimated).
const TUFT_SHARE: f64 = FRAC_1_SQRT_2;
const RIDGE_TUFT_SHARE: f64 = 0.1;
/// Waves of a fibre where the fabric does not give them (estimated).
const WAVE: f64 = 0.02;
/// Points on a loop, and how far it bulges beyond its feet, as a share of its height
/// (estimated).
const LOOP_POINTS: usize = 14;
const BULGE: f64 = 0.16;
/// Where between two picks the legs of a loop leave the ground, as shares of their distance.
const FEET: [f64; 2] = [0.3, 0.7];

/// The pile of a cloth.
#[derive(Clone, Debug)]
pub(super) struct Pile {
    pub kind: PileKind,
    /// Height of the ground's face.
    pub face_mm: f64,
    /// Tufts, or loops, in a tile.
    pub count: usize,
    /// Mean height of loops above the ground.
    pub loop_height_mm: f64,
    /// Cut pile; loops are threads.
    pub tufts: Option<Arc<Tufts>>,
}

/// A thread of the ground.
struct Ground {
    at_mm: f64,
    half_mm: DVec2,
    curve: Hermite,
}

/// Puts pile on a woven cloth.
pub(super) fn raise(
    cloth: &mut Cloth,
    fabric: &FabricGeometry,
    spec: &PileSpec,
    seed: u64,
) -> Result<(), Error> {
    let [ends, picks] = ground(cloth);
    let highest = |threads: &[Ground]| {
        let tops = threads.iter().map(|t| t.curve.range_mm().1 + t.half_mm.y);
        tops.fold(f64::NEG_INFINITY, f64::max)
    };
    let mut yarns = Yarns::new(&fabric.yarn);
    yarns.built = std::mem::take(&mut cloth.yarns);
    let index = yarns.index("pile", &spec.yarn)?;
    cloth.yarns = yarns.built;
    let yarn = cloth.yarns[index].clone();
    let mut materials = Materials(std::mem::take(&mut cloth.materials));
    let colours: Vec<_> = match spec.colours.as_slice() {
        [] => vec![None],
        colours => colours.iter().map(|c| Some(*c)).collect(),
    };
    let dyes = colours.iter().map(|c| materials.dye(&yarn, *c));
    let dyes = dyes.collect::<Result<Vec<Dye>, Error>>()?;
    cloth.materials = materials.0;

    let size_mm = cloth.tile.bounds_mm.size().truncate().as_dvec2();
    let place = Place {
        spec,
        face_mm: highest(&ends).max(highest(&picks)),
        size_mm,
        ends,
        picks,
        yarn,
        rng: PathRng::new(seed, 0, LEAN),
        ruffle: Ruffle::new(spec, size_mm, seed),
        dyes,
    };
    place.raise(cloth, index, seed)
}

/// The ends and the picks.
fn ground(cloth: &Cloth) -> [Vec<Ground>; 2] {
    let [mut ends, mut picks] = [Vec::new(), Vec::new()];
    for thread in &cloth.threads {
        let Centreline::Woven {
            curve,
            axis,
            origin,
            ..
        } = &thread.line
        else {
            continue;
        };
        let is_end = axis.y > 0.5;
        let thread = Ground {
            at_mm: if is_end { origin.x } else { origin.y },
            half_mm: thread.spun.yarn.radius_mm() * thread.section.mean(),
            curve: curve.clone(),
        };
        if is_end { &mut ends } else { &mut picks }.push(thread);
    }
    [ends, picks]
}

/// What is known while the pile is placed.
struct Place<'a> {
    spec: &'a PileSpec,
    face_mm: f64,
    size_mm: DVec2,
    ends: Vec<Ground>,
    picks: Vec<Ground>,
    yarn: Arc<Yarn>,
    rng: PathRng,
    ruffle: Option<Ruffle>,
    dyes: Vec<Dye>,
}

impl Place<'_> {
    fn raise(mut self, cloth: &mut Cloth, yarn: usize, seed: u64) -> Result<(), Error> {
        let spec = self.spec;
        let lean = spec.lean_deviation_deg.unwrap_or(0.0).to_radians().tan();
        let (mut low, mut high) = {
            let b = cloth.tile.bounds_mm;
            (f64::from(b.min.z), f64::from(b.max.z))
        };
        let mut pile = Pile {
            kind: spec.kind,
            face_mm: self.face_mm,
            count: 0,
            loop_height_mm: 0.0,
            tufts: None,
        };
        if spec.kind == PileKind::Loop {
            let first = cloth.threads.len();
            let mut lines = Vec::new();
            for (column, e) in self.columns().enumerate() {
                let (points, loops, height_mm) = self.loops(column, e);
                pile.count += loops;
                pile.loop_height_mm += height_mm;
                self.within_limit(pile.count)?;
                lines.push(points);
            }
            if spec.collide {
                self.push_apart(&mut lines, pile.count)?;
            }
            for (column, points) in lines.into_iter().enumerate() {
                let period = self.size_mm.y * DVec3::Y;
                let length_mm = points.windows(2).map(|p| p[0].distance(p[1])).sum();
                let thread = ThreadAtRest {
                    line: Centreline::Laid {
                        points: points.into(),
                        period,
                    },
                    yarn,
                    spun: Spun::new(&self.yarn, length_mm, seed, first + column),
                    dye: self.dyes[column % self.dyes.len()].clone(),
                    section: ThreadSection::even(DVec2::ONE),
                };
                let spun = &thread.spun.yarn;
                let hairs = spun.radius_mm() + protruding_mm(spun);
                let out = reach_mm(spun).max(hairs) + 2.0 * thickest_fibre_mm(spun);
                for p in &cloth.path(&thread, CurveLevel::Fibre).points {
                    low = low.min(p.z - out);
                    high = high.max(p.z + out);
                }
                cloth.threads.push(thread);
            }
            pile.loop_height_mm /= pile.count.max(1) as f64;
        } else {
            let tufts = match (spec.kind, spec.tufts_per_cm2) {
                (PileKind::Wale, _) => self.wales(&mut cloth.warnings)?,
                (_, Some(density)) => self.scattered(density)?,
                _ => self.bound()?,
            };
            let fibre_share = match spec.kind {
                PileKind::Wale => (1.0 - RIDGE_TUFT_SHARE * RIDGE_TUFT_SHARE).sqrt(),
                PileKind::Cut | PileKind::Loop => FRAC_1_SQRT_2,
            };
            let height_cv = fibre_share * 0.01 * spec.height_cv_percent.unwrap_or(0.0);
            let thickest = thickest_fibre_mm(&self.yarn);
            for t in &tufts {
                let top = t.height_mm * (1.0 + MAX_DEVIATIONS * height_cv);
                high = high.max(self.face_mm + top + thickest);
                let root = t.bound_half_mm.y + 2.0 * self.yarn.radius_mm();
                low = low.min(t.bound_mm.z - root - thickest);
            }
            pile.count = tufts.len();
            let mut tufts = Tufts {
                yarn: self.yarn,
                dyes: self.dyes,
                tufts,
                face_mm: self.face_mm,
                splay: spec.splay.unwrap_or(1.2),
                fibre_lean: fibre_share * lean,
                height_cv,
                wave: spec.wave.unwrap_or(WAVE),
            };
            if spec.collide {
                tufts.push_apart(self.size_mm)?;
            }
            pile.tufts = Some(Arc::new(tufts));
        }
        cloth.tile.bounds_mm.min.z = (low as f32).next_down();
        cloth.tile.bounds_mm.max.z = (high as f32).next_up();
        cloth.pile = Some(pile);
        Ok(())
    }

    fn within_limit(&self, count: usize) -> Result<(), Error> {
        if count <= MAX_TUFTS {
            return Ok(());
        }
        let message = format!("the pile has more than {MAX_TUFTS} tufts or loops in one tile");
        Err(Error::spec("tile.repeats", message))
    }

    /// The ends beside which pile stands.
    fn columns(&self) -> impl Iterator<Item = usize> + use<> {
        let every = self.spec.every.map_or(1, |e| e[0]) as usize;
        (0..self.ends.len()).step_by(every)
    }

    /// Middle between a thread and the next.
    fn gap_mm(threads: &[Ground], i: usize, period_mm: f64) -> f64 {
        let next = threads
            .get(i + 1)
            .map_or(threads[0].at_mm + period_mm, |t| t.at_mm);
        0.5 * (threads[i].at_mm + next)
    }

    /// A height and a lean of a tuft or loop at a place; the lean as its tangent. `share` is the
    /// part of the deviation that tufts have in common with their fibres.
    fn stance(&mut self, share: f64, at_mm: DVec2) -> (f64, DVec2) {
        let spec = self.spec;
        let cv = 0.01 * share * spec.height_cv_percent.unwrap_or(0.0);
        let height = spec.height_mm * normal(&mut self.rng, [1.0, cv], 1.0);
        let lean = spec.lean_deg.unwrap_or(0.0).to_radians().tan();
        let direction = spec.lean_direction_deg.unwrap_or(90.0).to_radians();
        let spread = share * spec.lean_deviation_deg.unwrap_or(0.0).to_radians().tan();
        let [x, y] = [(); 2].map(|()| normal(&mut self.rng, [0.0, spread], 1.0));
        let ruffle = self.ruffle.as_ref().map(|r| r.lean_at(at_mm));
        let own = lean * DVec2::from_angle(direction) + DVec2::new(x, y);
        (height, own + ruffle.unwrap_or_default())
    }

    /// Tufts around picks, between ends; neighbouring columns are offset.
    fn bound(&mut self) -> Result<Vec<Tuft>, Error> {
        let [every_x, every_y] = self.spec.every.unwrap_or([1, 1]).map(|n| n as usize);
        let (ends, picks) = (self.ends.len(), self.picks.len());
        let rows = picks / every_y;
        self.within_limit((ends / every_x).saturating_mul(rows))?;
        let room_mm = 0.5
            * DVec2::new(
                every_y as f64 * self.size_mm.y / picks as f64,
                every_x as f64 * self.size_mm.x / ends as f64,
            );
        let mut tufts = Vec::new();
        for (column, e) in self.columns().enumerate() {
            let x = Self::gap_mm(&self.ends, e, self.size_mm.x);
            for row in 0..rows {
                let p = row * every_y + column % 2 * (every_y / 2);
                let at_mm = DVec2::new(x, self.picks[p % picks].at_mm);
                let (height_mm, lean) = self.stance(TUFT_SHARE, at_mm);
                let pick = &self.picks[p % picks];
                tufts.push(Tuft {
                    bound_mm: DVec3::new(x, pick.at_mm, pick.curve.height_at(x)),
                    bound_half_mm: pick.half_mm,
                    across: DVec2::Y,
                    room_mm,
                    tip_mm: height_mm * lean,
                    height_mm,
                    pushed_mm: Default::default(),
                    dye: column % self.dyes.len(),
                    ridge: None,
                });
            }
        }
        Ok(tufts)
    }

    /// Tufts on a lattice of a density, whatever the threads are.
    fn scattered(&mut self, per_cm2: f64) -> Result<Vec<Tuft>, Error> {
        let wanted = (0.01 * per_cm2 * self.size_mm.x * self.size_mm.y).max(1.0);
        self.within_limit(wanted as usize)?;
        let columns = (0.1 * per_cm2.sqrt() * self.size_mm.x).round().max(1.0);
        let rows = (wanted / columns).round().max(1.0);
        let cell = self.size_mm / DVec2::new(columns, rows);
        let mut tufts = Vec::new();
        for column in 0..columns as usize {
            for row in 0..rows as usize {
                let half = 0.5 * (column % 2) as f64;
                let at = cell * DVec2::new(column as f64 + 0.5, row as f64 + 0.25 + half);
                let (height_mm, lean) = self.stance(TUFT_SHARE, at);
                tufts.push(Tuft {
                    bound_mm: at.extend(0.0),
                    bound_half_mm: self.picks[0].half_mm.min(DVec2::splat(0.25 * cell.y)),
                    across: DVec2::Y,
                    room_mm: 0.5 * DVec2::new(cell.y, cell.x),
                    tip_mm: height_mm * lean,
                    height_mm,
                    pushed_mm: Default::default(),
                    dye: column % self.dyes.len(),
                    ridge: None,
                });
            }
        }
        Ok(tufts)
    }

    /// Tufts of weft around the ends in the middle of each ridge.
    fn wales(&mut self, warnings: &mut Vec<String>) -> Result<Vec<Tuft>, Error> {
        let [every_x, every_y] = self.spec.every.unwrap_or([1, 1]).map(|n| n as usize);
        let wanted = self.spec.wales_per_cm.unwrap_or(1.0) * self.size_mm.x / 10.0;
        let count = wanted.round().max(1.0);
        if (wanted / count - 1.0).abs() > 0.05 {
            warnings.push(format!(
                "pile.wales_per_cm: {:.2} were changed to {:.2} so that the tile holds whole \
                 ridges; more tile.repeats along the weft reduce the change",
                self.spec.wales_per_cm.unwrap_or(1.0),
                10.0 * count / self.size_mm.x
            ));
        }
        let distance = self.size_mm.x / count;
        let half = 0.5 * distance * self.spec.wale_width.unwrap_or(0.85);
        let picks = self.picks.len();
        let rows = picks / every_y;
        let mut tufts = Vec::new();
        for wale in 0..count as usize {
            let middle = (wale as f64 + 0.5) * distance;
            let from_middle = |e: usize| (self.ends[e].at_mm - middle).abs();
            let inside: Vec<usize> = (0..self.ends.len())
                .filter(|&e| from_middle(e) <= BOUND_SHARE * half)
                .step_by(every_x)
                .collect();
            let nearest = (0..self.ends.len())
                .min_by(|&a, &b| from_middle(a).total_cmp(&from_middle(b)))
                .unwrap_or(0);
            let inside = if inside.is_empty() {
                vec![nearest]
            } else {
                inside
            };
            let across = inside.len() as f64;
            self.within_limit(tufts.len() + inside.len().saturating_mul(rows))?;
            for (j, &e) in inside.iter().enumerate() {
                let over = middle + half * ((2.0 * j as f64 + 1.0) / across - 1.0);
                for row in 0..rows {
                    let p = (row * every_y + j % 2 * (every_y / 2)) % picks;
                    let y = Self::gap_mm(&self.picks, p, self.size_mm.y);
                    let at_mm = DVec2::new(self.ends[e].at_mm, y);
                    let (height_mm, lean) = self.stance(RIDGE_TUFT_SHARE, at_mm);
                    let end = &self.ends[e];
                    tufts.push(Tuft {
                        bound_mm: DVec3::new(end.at_mm, y, end.curve.height_at(y)),
                        bound_half_mm: end.half_mm,
                        across: DVec2::X,
                        room_mm: DVec2::new(
                            half / across,
                            0.5 * every_y as f64 * self.size_mm.y / picks as f64,
                        ),
                        tip_mm: height_mm * lean + (over - end.at_mm) * DVec2::X,
                        height_mm,
                        pushed_mm: Default::default(),
                        dye: wale % self.dyes.len(),
                        ridge: Some(Ridge {
                            middle_mm: middle,
                            half_mm: half,
                        }),
                    });
                }
            }
        }
        Ok(tufts)
    }

    /// The line of a pile end beside end `e`: bound by the picks of each group, it rises in a
    /// loop after each. Also the number of its loops, and the sum of their heights above the
    /// ground.
    fn loops(&mut self, column: usize, e: usize) -> (Vec<DVec3>, usize, f64) {
        let group = self.spec.every.map_or(1, |n| n[1]) as usize;
        let x = Self::gap_mm(&self.ends, e, self.size_mm.x);
        let is_back = self.spec.sides == Some(PileSides::Both) && column % 2 == 1;
        let up = if is_back { -1.0 } else { 1.0 };
        let count = self.picks.len() / group;
        let leg_mm = self.yarn.radius_mm();
        let mut points = Vec::new();
        let mut sum = 0.0;
        for g in 0..count {
            for i in 0..group {
                let pick = &self.picks[g * group + i];
                // A group begins and ends on the side away from the loops.
                let away = if i % 2 == 0 || i + 1 == group {
                    -up
                } else {
                    up
                };
                let out = away * (pick.half_mm.y + leg_mm);
                points.push(DVec3::new(x, pick.at_mm, pick.curve.height_at(x) + out));
            }
            let last = &self.picks[g * group + group - 1];
            let next_mm = match self.picks.get(g * group + group) {
                Some(next) => next.at_mm,
                None => self.picks[0].at_mm + self.size_mm.y,
            };
            let feet = FEET.map(|t| last.at_mm + t * (next_mm - last.at_mm));
            let (height_mm, lean) = self.stance(1.0, DVec2::new(x, feet[0]));
            let turn = normal(
                &mut self.rng,
                [0.0, self.spec.turn_deg.unwrap_or(30.0).to_radians()],
                1.0,
            );
            sum += height_mm;
            let top = self.face_mm.abs() + height_mm;
            let (middle, half) = (0.5 * (feet[0] + feet[1]), 0.5 * (feet[1] - feet[0]));
            points.extend((0..=LOOP_POINTS).map(|i| {
                let u = i as f64 / LOOP_POINTS as f64;
                let share = (PI * u).sin();
                let along = -half * (PI * u).cos() - BULGE * height_mm * (2.0 * PI * u).sin();
                let plane = DVec2::from_angle(share * turn).perp() * along
                    + share * share * height_mm * lean;
                DVec3::new(x + plane.x, middle + plane.y, up * share * top)
            }));
        }
        (points, count, sum)
    }
}
