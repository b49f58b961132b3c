//! Pushes the fibres of a strand apart until they hardly overlap.
//!
//! Random placement, migration and flattening make fibres overlap: a sixth of the fibre
//! volume of a flattened cotton yarn would lie inside other fibres as well. A volume that
//! adds up fibre lengths would count all of it. Therefore the cross-section is treated as
//! discs at stations along the yarn. Steps that move overlapping discs apart alternate with
//! smoothing along the fibres. Only positions change; number and radii of fibres stay.
//!
//! Shifts are stored relative to the ply's centre, as a radial and a tangential part, so that
//! a fibre that keeps its place among its neighbours has the same shift all along. Between
//! stations they are interpolated with continuous tangents.

use crate::spline::closed_spline;
use glam::{DVec2, Vec2};

/// Rounds, each of which searches neighbours again; more of fibres that cross each other all
/// along, as crimped ones do. Pushes within a round.
pub(crate) const ROUNDS: usize = 3;
pub(crate) const ROUNDS_OF_CRIMPED: usize = 8;
const PUSHES: usize = 6;
/// Share of the differences along a fibre that smoothing removes after every round but the
/// last.
const SMOOTHING: f32 = 0.25;
/// Distance in radii within which discs are neighbours at the start of a round.
const REACH_RADII: f32 = 3.0;
/// Angle of twist and migration between stations, radians.
const STATION_RAD: f64 = 0.5;
const MIN_STATIONS: usize = 4;
/// Maximum number of discs, of 52 bytes each; larger bundles are not pushed apart.
const MAX_DISCS: usize = 1 << 20;

/// The fibres to push apart: those of all plies, each wound through the period several times.
pub(crate) struct Bundle<'a> {
    pub fibres: usize,
    /// Periods that a fibre runs through.
    pub windings: usize,
    /// Twist and migration over one period.
    pub angle_rad: f64,
    pub length_mm: f64,
    /// The largest radius of a fibre.
    pub fibre_radius_mm: f64,
    /// Rounds of pushing.
    pub rounds: usize,
    /// Factors on the round cross-section's width and height at a share of the period.
    pub flatten: &'a dyn Fn(f64) -> DVec2,
    /// The place of a fibre in a winding, at a share of the period.
    pub place: &'a dyn Fn(usize, u32, f64) -> FibrePlace,
}

/// Where a fibre would lie in the round cross-section if the yarn held no other fibre.
#[derive(Clone, Copy)]
pub(crate) struct FibrePlace {
    /// The centre of its ply.
    pub ply_mm: DVec2,
    /// Unit direction from there to the fibre.
    pub direction: DVec2,
    pub distance_mm: f64,
    /// The largest distance of its centre from the centre of its ply, unless it starts farther
    /// out, in a section of scale 1.
    pub reach_mm: f64,
    /// Radius of the fibre; 0 where there is none.
    pub radius_mm: f64,
    /// Linear size of the section relative to the yarn's mean.
    pub scale: f64,
}

impl FibrePlace {
    /// The centre of the fibre after a shift, whose components are radial and tangential to the
    /// centre of the ply.
    pub fn shifted(&self, shift_mm: DVec2) -> DVec2 {
        let from_ply = DVec2::new(self.distance_mm, 0.0) + shift_mm;
        self.ply_mm + self.direction.rotate(from_ply)
    }
}

/// How far fibres were shifted.
pub(crate) struct FibreShifts {
    /// Stations along a whole fibre.
    around: usize,
    /// By fibre, then station.
    shifts_mm: Vec<Vec2>,
}

impl FibreShifts {
    /// The shift of a fibre at the share `run` of all its windings, which may lie slightly
    /// outside 0 to 1: radial and tangential to the centre of the ply, mm.
    pub fn at(&self, fibre: usize, run: f64) -> DVec2 {
        let n = self.around;
        closed_spline(&self.shifts_mm[fibre * n..][..n], run)
    }
}

/// One disc of a cross-section. All but its reach and shift refer to the flattened
/// cross-section.
#[derive(Clone, Copy)]
struct Disc {
    base_mm: Vec2,
    ply_mm: Vec2,
    /// Of the ply's centre, in the round cross-section.
    direction: Vec2,
    /// Part of the unit tangent that lies in the cross-section.
    slant: Vec2,
    reach_mm: f32,
    radius_mm: f32,
    at_mm: Vec2,
    /// Index in the section.
    piece: u32,
}

impl Bundle<'_> {
    /// Sections along a period.
    fn stations(&self) -> usize {
        ((self.angle_rad / STATION_RAD).ceil() as usize).max(MIN_STATIONS)
    }

    fn flatten_at(&self, station: usize, stations: usize) -> Vec2 {
        (self.flatten)(station as f64 / stations as f64).as_vec2()
    }

    /// Whether pushing these fibres apart takes too much memory.
    pub fn is_too_large(&self) -> bool {
        let pieces = self.fibres.saturating_mul(self.windings);
        pieces.saturating_mul(self.stations()) > MAX_DISCS
    }

    /// Pushes the fibres apart; `None` for a single fibre or [too many](Bundle::is_too_large).
    pub fn push_apart(&self) -> Option<FibreShifts> {
        let (windings, pieces) = (self.windings, self.fibres * self.windings);
        if pieces < 2 || self.is_too_large() {
            return None;
        }
        let stations = self.stations();
        let around = stations * windings;
        let mut discs = self.discs(stations);
        let mut shifts_mm = vec![Vec2::ZERO; self.fibres * around];
        let mut pairs = Vec::new();
        for round in 0..self.rounds {
            for (station, section) in discs.chunks_exact_mut(pieces).enumerate() {
                let flatten = self.flatten_at(station, stations);
                let place = |piece: u32| {
                    let piece = piece as usize;
                    piece / windings * around + piece % windings * stations + station
                };
                for disc in &mut *section {
                    let shift = shifts_mm[place(disc.piece)];
                    disc.at_mm = disc.base_mm + flatten * disc.direction.rotate(shift);
                }
                self.push_section(section, flatten, &mut pairs);
                let turned_back = Vec2::new(1.0, -1.0);
                for disc in &*section {
                    let moved = (disc.at_mm - disc.base_mm) / flatten;
                    shifts_mm[place(disc.piece)] = (turned_back * disc.direction).rotate(moved);
                }
            }
            if round + 1 < self.rounds {
                shifts_mm.chunks_exact_mut(around).for_each(smooth);
            }
        }
        Some(FibreShifts { around, shifts_mm })
    }

    /// All discs, by station, then fibre, then winding.
    fn discs(&self, stations: usize) -> Vec<Disc> {
        let windings = self.windings;
        let pieces = self.fibres * windings;
        let mut discs = Vec::with_capacity(stations * pieces);
        for station in 0..stations {
            let s = station as f64 / stations as f64;
            let flatten = self.flatten_at(station, stations);
            for piece in 0..pieces {
                let place = (self.place)(piece / windings, (piece % windings) as u32, s);
                let base_mm = flatten * place.shifted(DVec2::ZERO).as_vec2();
                discs.push(Disc {
                    base_mm,
                    ply_mm: flatten * place.ply_mm.as_vec2(),
                    direction: place.direction.as_vec2(),
                    slant: Vec2::ZERO,
                    reach_mm: place.distance_mm.max(place.reach_mm * place.scale) as f32,
                    radius_mm: place.radius_mm as f32,
                    at_mm: base_mm,
                    piece: piece as u32,
                });
            }
        }
        // The next winding of the same fibre begins where this one ends.
        let before = |station: usize, fibre: usize, winding: usize| match station {
            0 => (stations - 1, fibre, (winding + windings - 1) % windings),
            i => (i - 1, fibre, winding),
        };
        let after = |station: usize, fibre: usize, winding: usize| match station {
            i if i + 1 == stations => (0, fibre, (winding + 1) % windings),
            i => (i + 1, fibre, winding),
        };
        let per_mm = (0.5 * stations as f64 / self.length_mm) as f32;
        for i in 0..discs.len() {
            let (station, piece) = (i / pieces, i % pieces);
            let (fibre, winding) = (piece / windings, piece % windings);
            let [a, b] = [
                before(station, fibre, winding),
                after(station, fibre, winding),
            ]
            .map(|(station, fibre, winding)| {
                discs[station * pieces + fibre * windings + winding].base_mm
            });
            let slope = per_mm * (b - a);
            discs[i].slant = slope / (1.0 + slope.length_squared()).sqrt();
        }
        discs
    }

    /// Moves the discs of one section and leaves them sorted by x.
    fn push_section(&self, section: &mut [Disc], flatten: Vec2, pairs: &mut Vec<(u32, u32)>) {
        section.sort_by(|a, b| {
            let by_place = a.at_mm.x.total_cmp(&b.at_mm.x);
            by_place.then(a.piece.cmp(&b.piece))
        });
        let reach = REACH_RADII * self.fibre_radius_mm as f32;
        pairs.clear();
        for (a, disc) in section.iter().enumerate() {
            if disc.radius_mm == 0.0 {
                continue;
            }
            for (b, other) in section.iter().enumerate().skip(a + 1) {
                let apart = other.at_mm - disc.at_mm;
                if apart.x > reach {
                    break;
                }
                let is_there = other.radius_mm > 0.0;
                if is_there && apart.length_squared() < reach * reach {
                    pairs.push((a as u32, b as u32));
                }
            }
        }
        for _ in 0..PUSHES {
            for &(a, b) in &*pairs {
                let (a, b) = (a as usize, b as usize);
                let push = push(&section[a], &section[b]);
                if push != Vec2::ZERO {
                    section[a].at_mm -= push;
                    section[b].at_mm += push;
                }
            }
            for disc in &mut *section {
                let from_ply = (disc.at_mm - disc.ply_mm) / flatten;
                let square = from_ply.length_squared();
                if square > disc.reach_mm * disc.reach_mm {
                    let within = disc.reach_mm / square.sqrt();
                    disc.at_mm = disc.ply_mm + within * (disc.at_mm - disc.ply_mm);
                }
            }
        }
    }
}

/// The shift that separates the second of two discs from the first if the first moves by its
/// negative. Fibres cross the section at a slant, so the distance that counts is perpendicular
/// to the fibres.
#[inline]
fn push(a: &Disc, b: &Disc) -> Vec2 {
    let min_mm = a.radius_mm + b.radius_mm;
    let apart = b.at_mm - a.at_mm;
    let along = 0.5 * apart.dot(a.slant + b.slant);
    let across = apart.length_squared() - along * along;
    if across >= min_mm * min_mm {
        return Vec2::ZERO;
    }
    let toward = apart.try_normalize().unwrap_or(Vec2::X);
    0.5 * (min_mm - across.max(0.0).sqrt()) * toward
}

/// Smooths the shifts along a fibre, which is closed.
fn smooth(shifts: &mut [Vec2]) {
    let n = shifts.len();
    let (first, mut before) = (shifts[0], shifts[n - 1]);
    for i in 0..n {
        let here = shifts[i];
        let after = if i + 1 < n { shifts[i + 1] } else { first };
        shifts[i] += SMOOTHING * (0.5 * (before + after) - here);
        before = here;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;
    use std::f64::consts::{PI, TAU};

    const RADIUS_MM: f64 = 0.008;
    const PLY_MM: f64 = 0.1;
    const WINDINGS: usize = 3;
    /// Over all windings.
    const TURNS: f64 = 4.0;
    const FIBRES: usize = 26;

    /// Fibres at random, twisted, that wander in and out, filling half of the ply.
    fn place(seed: u64, fibre: usize, winding: u32, s: f64) -> FibrePlace {
        let mut rng = PathRng::from_seed(seed + fibre as u64);
        let [radius, phase, swing] = [0; 3].map(|_| f64::from(rng.unit()));
        let run = (f64::from(winding) + s) / WINDINGS as f64;
        let wander = 0.85 + 0.15 * (TAU * (swing + 4.0 * run)).cos();
        FibrePlace {
            ply_mm: DVec2::ZERO,
            direction: DVec2::from_angle(TAU * (phase + TURNS * run)),
            distance_mm: (PLY_MM - RADIUS_MM) * radius.sqrt() * wander,
            reach_mm: PLY_MM - RADIUS_MM,
            radius_mm: RADIUS_MM,
            scale: 1.0,
        }
    }

    fn bundle(place: &dyn Fn(usize, u32, f64) -> FibrePlace) -> Bundle<'_> {
        Bundle {
            fibres: FIBRES,
            windings: WINDINGS,
            angle_rad: 2.0 * TAU * TURNS / WINDINGS as f64,
            length_mm: 2.0,
            rounds: ROUNDS,
            fibre_radius_mm: RADIUS_MM,
            flatten: &|_| DVec2::new(1.2, 1.0 / 1.2),
            place,
        }
    }

    /// Area that pairs of discs share over the area of all discs, between the
    /// stations as well as at them.
    fn shared(bundle: &Bundle, shifts: Option<&FibreShifts>) -> f64 {
        let mut shared = 0.0;
        for k in 0..50 {
            let s = f64::from(k) / 50.0;
            let mut at = Vec::new();
            for fibre in 0..FIBRES {
                for winding in 0..WINDINGS {
                    let run = (winding as f64 + s) / WINDINGS as f64;
                    let shift = shifts.map_or(DVec2::ZERO, |all| all.at(fibre, run));
                    let place = (bundle.place)(fibre, winding as u32, s);
                    let from_ply = place.shifted(shift) - place.ply_mm;
                    assert!(from_ply.length() < PLY_MM, "{from_ply} left its ply");
                    at.push((bundle.flatten)(s) * from_ply);
                }
            }
            for (i, a) in at.iter().enumerate() {
                for b in &at[i + 1..] {
                    let half = 0.5 * a.distance(*b) / RADIUS_MM;
                    if half < 1.0 {
                        let lens = half.acos() - half * (1.0 - half * half).sqrt();
                        shared += 2.0 * lens * RADIUS_MM * RADIUS_MM;
                    }
                }
            }
        }
        shared / (50.0 * (FIBRES * WINDINGS) as f64 * PI * RADIUS_MM * RADIUS_MM)
    }

    #[test]
    fn fibres_that_share_room_are_pushed_apart_and_stay_in_their_ply() {
        for seed in [1, 1001, 2001] {
            let place = |fibre, winding, s| place(seed, fibre, winding, s);
            let bundle = bundle(&place);
            let shifts = bundle.push_apart().unwrap();
            let (before, after) = (shared(&bundle, None), shared(&bundle, Some(&shifts)));
            // Placed by chance; yarns place their fibres better to begin with.
            assert!(before > 0.3, "seed {seed}: {before} to begin with");
            assert!(
                after < 0.2 * before,
                "seed {seed}: {before} before, {after} after"
            );
        }
    }

    #[test]
    fn shifts_close_and_have_no_kinks() {
        let place = |fibre, winding, s| place(7, fibre, winding, s);
        let shifts = bundle(&place).push_apart().unwrap();
        let mut sharpest_chord_mm = 0.0f32;
        for fibre in 0..FIBRES {
            assert!(shifts.at(fibre, 0.0).distance(shifts.at(fibre, 1.0)) < 4.0 * f64::EPSILON);
            let knots = &shifts.shifts_mm[fibre * shifts.around..][..shifts.around];
            let step = 1e-3;
            for k in 0..shifts.around {
                // Left and right of a station, the border's too, slopes agree, which
                // those of chords from knot to knot do not.
                let run = k as f64 / shifts.around as f64;
                let [a, b, c] =
                    [-step, 0.0, step].map(|d| shifts.at(fibre, run + d / shifts.around as f64));
                let kink_mm = (c - b).distance(b - a) / step;
                assert!(kink_mm < 1e-3, "fibre {fibre}, station {k}: {kink_mm} mm");
                let [a, b, c] = [knots.len() - 1, 0, 1].map(|d| knots[(k + d) % knots.len()]);
                sharpest_chord_mm = sharpest_chord_mm.max((c - b).distance(b - a));
            }
        }
        assert!(sharpest_chord_mm > 5e-3, "{sharpest_chord_mm} mm");
    }

    #[test]
    fn one_fibre_has_nowhere_to_go() {
        let place = |fibre, winding, s| place(1, fibre, winding, s);
        let alone = Bundle {
            fibres: 1,
            windings: 1,
            ..bundle(&place)
        };
        assert!(alone.push_apart().is_none());
    }
}
