//! A ray's way through several cloths, draped ones and planes: one stretch after the
//! other, of which each is walked from cell to cell.

use super::body::{Body, clip};
use super::cell_ray::{CellHit, CellRay};
use super::grid::GridPoint;
use super::matter::FibreMatter;
use glam::{DVec3, Mat3, Vec3};
use organza_mesh::{Shell, ShellSpan};

/// A stretch through a tetrahedron is looked at so much beyond its ends, in the rounding
/// of distances in its cells: what is met at a face belongs to one of its sides at least.
const FACE_ROUNDINGS: f64 = 16.0;

/// Stretches through a shell are looked for so far at a time, in cells: most rays that
/// leave a fibre meet the next one before.
const CELLS_AHEAD: f64 = 4.0;

/// Parts of a shell without length, of a ray along edges that might turn round and round: after so
/// many, parts are looked for instead of one leading to the next.
const MOST_IDLE: u32 = 64;

/// A ray's way, and the nearest that it met.
#[derive(Clone, Debug)]
pub struct Trip {
    origin_mm: DVec3,
    direction: DVec3,
    start: Option<TripStart>,
    /// What lies farther does not count, mm.
    reach_mm: f64,
    met: TripEnd,
    /// How many bodies have been looked at.
    looked_at: u16,
    /// The one that is walked now.
    body: u16,
    /// From the origin to where the ray through its cells begins, mm.
    before_mm: f64,
    /// Length in the world of a millimetre of that ray.
    mm_per_own: f64,
    over: Over,
}

/// Where a ray starts at a fibre.
#[derive(Clone, Copy, Debug)]
pub struct TripStart {
    /// The body in which it starts, and where in its cells.
    pub body: u16,
    pub at: GridPoint,
    /// Of a draped body: the part of the shell in which the fibre was met.
    pub part: u32,
}

/// How far a ray has come through a draped body.
#[derive(Clone, Debug)]
struct Over {
    /// Where it comes to the shell's box: from the origin, mm, and the place.
    entry_mm: f64,
    entry: DVec3,
    /// Parts in order, of which the next one is to be walked.
    spans: Vec<ShellSpan>,
    next: usize,
    /// Parts that begin before were looked for, mm from the entry.
    looked_mm: f64,
    /// Where parts are alone in their room, one leads to the next.
    onward: Option<Onward>,
    /// How many parts had no length.
    idle: u32,
}

/// What comes after a part of a shell.
#[derive(Clone, Copy, Debug)]
enum Onward {
    /// The part of this number, which begins so many mm from the entry.
    Part(u32, f64),
    /// What is found from there on.
    Unknown(f64),
}

/// What lies at the end of a ray's way.
#[derive(Clone, Copy, Debug)]
pub enum TripEnd {
    /// Nothing.
    Nothing,
    /// The plane of this number.
    Plane(u16),
    /// A fibre.
    Fibre(MetFibre),
}

/// A fibre of one of several bodies.
#[derive(Clone, Copy, Debug)]
pub struct MetFibre {
    pub hit: CellHit,
    pub body: u16,
    /// The ray's way in the places of the body, unit.
    pub way: Vec3,
    /// Turns directions of the body to the world.
    pub world_from_own: Mat3,
    /// Takes differences of places of the body to the world.
    pub stretch: Mat3,
    /// The part of its shell.
    pub part: u32,
}

impl Trip {
    /// Nowhere.
    pub fn none() -> Trip {
        Trip {
            origin_mm: DVec3::ZERO,
            direction: DVec3::Z,
            start: None,
            reach_mm: 0.0,
            met: TripEnd::Nothing,
            looked_at: 0,
            body: 0,
            before_mm: 0.0,
            mm_per_own: 1.0,
            over: Over {
                entry_mm: 0.0,
                entry: DVec3::ZERO,
                spans: Vec::new(),
                next: 0,
                looked_mm: f64::INFINITY,
                onward: None,
                idle: 0,
            },
        }
    }

    /// Starts at a point along a unit direction: what lies beyond `most_mm` does not count.
    pub fn begin(
        &mut self,
        matter: &FibreMatter,
        (origin_mm, direction): (DVec3, DVec3),
        start: Option<TripStart>,
        most_mm: f64,
    ) {
        (self.origin_mm, self.direction) = (origin_mm, direction);
        self.start = start;
        (self.reach_mm, self.met) = (most_mm, TripEnd::Nothing);
        self.looked_at = 0;
        self.leave_shell();
        self.over.idle = 0;
        for (number, plane) in matter.planes.iter().enumerate() {
            let t = plane.distance_mm(origin_mm, direction);
            if t < self.reach_mm {
                (self.reach_mm, self.met) = (t, TripEnd::Plane(number as u16));
            }
        }
    }

    /// The next stretch through the cells of a body; none is left when nothing nearer can
    /// be met.
    pub fn next(&mut self, matter: &FibreMatter) -> Option<CellRay> {
        loop {
            while let Some(&span) = self.over.spans.get(self.over.next) {
                self.over.next += 1;
                if self.over.entry_mm + span.t0 >= self.reach_mm {
                    // Nor does any after it count.
                    self.leave_shell();
                } else if let Some(ray) = self.along(matter, &span) {
                    return Some(ray);
                }
            }
            if let Some(onward) = self.over.onward {
                self.go_onward(matter, onward);
                continue;
            }
            if self.over.entry_mm + self.over.looked_mm < self.reach_mm {
                let body = &matter.bodies[usize::from(self.body)];
                if let Some(shell) = &body.shell {
                    self.look(shell, CELLS_AHEAD * f64::from(body.cells.min_edge_mm));
                    continue;
                }
            }
            self.leave_shell();
            self.body = self.next_body(matter)?;
            let body = &matter.bodies[usize::from(self.body)];
            match &body.shell {
                Some(shell) => self.enter_shell(shell),
                None => {
                    if let Some(ray) = self.enter(body) {
                        return Some(ray);
                    }
                }
            }
        }
    }

    /// The body in which the ray starts comes first.
    fn next_body(&mut self, matter: &FibreMatter) -> Option<u16> {
        let turn = self.looked_at;
        if usize::from(turn) >= matter.bodies.len() {
            return None;
        }
        self.looked_at += 1;
        Some(match self.start {
            Some(start) if turn == 0 => start.body,
            Some(start) if turn <= start.body => turn - 1,
            _ => turn,
        })
    }

    /// Into a flat body.
    fn enter(&mut self, body: &Body) -> Option<CellRay> {
        self.mm_per_own = 1.0;
        let way = self.direction.as_vec3().normalize();
        let grid = &body.cells.grid;
        if let Some(start) = self.start.filter(|start| start.body == self.body) {
            self.before_mm = 0.0;
            let end = body.way_out_mm(&start.at, way).min(self.reach_mm as f32);
            let ray = CellRay::new(grid, &start.at, way, body.start_mm, end);
            return ray.map(|r| r.of(self.body));
        }
        let entry = body.enter(self.origin_mm, self.direction)?;
        if entry.distance_mm >= self.reach_mm {
            return None;
        }
        self.before_mm = entry.distance_mm;
        let end = entry.end_mm.min((self.reach_mm - entry.distance_mm) as f32);
        CellRay::new(grid, &entry.at, way, entry.min_mm, end).map(|r| r.of(self.body))
    }

    /// No part of a shell is to be walked.
    fn leave_shell(&mut self) {
        self.over.spans.clear();
        (self.over.next, self.over.looked_mm) = (0, f64::INFINITY);
        self.over.onward = None;
    }

    /// To the part of a draped body in which the ray starts, or to the box around the body, whose
    /// parts are looked for next.
    fn enter_shell(&mut self, shell: &Shell) {
        if let Some(start) = self.start.filter(|start| start.body == self.body)
            && let Some(part) = shell.tetrahedron_at(start.part, self.origin_mm)
        {
            (self.over.entry_mm, self.over.entry) = (0.0, self.origin_mm);
            self.over.onward = Some(Onward::Part(part, 0.0));
            return;
        }
        let Some((near, _)) = clip(self.origin_mm, self.direction, shell.bounds_mm()) else {
            return;
        };
        self.over.entry_mm = near.max(0.0);
        self.over.entry = self.origin_mm + self.over.entry_mm * self.direction;
        self.over.looked_mm = 0.0;
    }

    /// Through a part that is alone in its room, toward the next one. Beyond the last, parts are
    /// looked for anew.
    fn go_onward(&mut self, matter: &FibreMatter, onward: Onward) {
        let over = &mut self.over;
        over.spans.clear();
        over.next = 0;
        over.onward = None;
        let (Onward::Part(_, from_mm) | Onward::Unknown(from_mm)) = onward;
        if over.entry_mm + from_mm >= self.reach_mm {
            return;
        }
        match (onward, &matter.bodies[usize::from(self.body)].shell) {
            (Onward::Part(part, _), Some(shell)) => {
                let step = shell.step(part, (over.entry, self.direction), from_mm);
                over.spans.extend(step.span);
                over.idle += u32::from(step.span.is_none());
                let end_mm = step.end_mm;
                let next = step.beyond.filter(|_| over.idle < MOST_IDLE);
                let onward = |part| Onward::Part(part, end_mm);
                over.onward = Some(next.map_or(Onward::Unknown(end_mm), onward));
            }
            _ => {
                // The part that was left is not to be found again.
                let places_mm = self.origin_mm.abs().max_element() + over.entry_mm + from_mm;
                over.entry_mm += from_mm + FACE_ROUNDINGS * f64::EPSILON * places_mm;
                over.entry = self.origin_mm + over.entry_mm * self.direction;
                over.looked_mm = 0.0;
            }
        }
    }

    /// Looks for the nearest parts that were not looked for yet, and for those that begin
    /// little later; only for the nearest if it is alone in its room.
    fn look(&mut self, shell: &Shell, ahead_mm: f64) {
        let over = &mut self.over;
        let (from, spans) = (over.looked_mm, &mut over.spans);
        spans.clear();
        over.next = 0;
        let limit = self.reach_mm - over.entry_mm;
        let goes_onward = over.idle < MOST_IDLE;
        let (mut nearest, mut ahead, mut wanted) = (f64::INFINITY, ahead_mm, f64::INFINITY);
        shell.visit_whole_spans((over.entry, self.direction), limit, |span| {
            if span.t0 >= from {
                if span.t0 < nearest {
                    nearest = span.t0;
                    ahead = match span.is_alone && goes_onward {
                        true => 0.0,
                        false => ahead_mm,
                    };
                }
                spans.push(*span);
            }
            wanted = wanted.min(nearest + ahead);
            wanted
        });
        over.looked_mm = wanted.max(nearest.next_up());
        spans.retain(|span| span.t0 < over.looked_mm);
        spans.sort_by(|a, b| a.t0.total_cmp(&b.t0).then(a.t1.total_cmp(&b.t1)));
        if let Some(first) = spans.first().filter(|s| s.is_alone && goes_onward) {
            over.onward = Some(Onward::Part(first.tetrahedron, first.t0));
            over.looked_mm = f64::INFINITY;
            spans.clear();
        }
    }

    /// Through a part of the shell, as the general walk goes through it.
    fn along(&mut self, matter: &FibreMatter, span: &ShellSpan) -> Option<CellRay> {
        let body = &matter.bodies[usize::from(self.body)];
        let own_per_mm = span.step.length();
        let way = span.step / own_per_mm;
        if !way.is_finite() {
            return None;
        }
        let inside_mm = (span.t1 - span.t0) * own_per_mm;
        let slack_mm = slack_mm(span, inside_mm, self.over.entry);
        let back_mm = if span.t0 > 0.0 { slack_mm } else { 0.0 };
        // A ray that starts among fibres has left its own.
        let from_origin_mm = (self.over.entry_mm + span.t0) * own_per_mm;
        let least_mm = (f64::from(body.start_mm) - from_origin_mm + back_mm).max(0.0);
        let length_mm = back_mm + inside_mm + slack_mm;
        let from = span.cloth_mm - back_mm * way;
        let entry = body.enter(from, way)?;
        if entry.distance_mm >= length_mm {
            return None;
        }
        self.mm_per_own = 1.0 / own_per_mm;
        let to_entry_mm = (entry.distance_mm - back_mm) * self.mm_per_own;
        self.before_mm = self.over.entry_mm + span.t0 + to_entry_mm;
        let reach = (self.reach_mm - self.before_mm) * own_per_mm;
        let most = reach.min(length_mm - entry.distance_mm) as f32;
        let least = (least_mm - entry.distance_mm).max(0.0) as f32;
        let ray = CellRay::new(
            &body.cells.grid,
            &entry.at,
            way.as_vec3().normalize(),
            least,
            most.min(entry.end_mm),
        );
        ray.map(|r| r.of(self.body))
    }

    /// Something was met on the stretch that is walked: the ray need go no farther.
    pub fn put(&mut self, hit: &CellHit) {
        let t = self.before_mm + f64::from(hit.distance_mm) * self.mm_per_own;
        if t >= self.reach_mm {
            return;
        }
        let span = match self.over.next.checked_sub(1) {
            Some(last) => self.over.spans.get(last),
            None => None,
        };
        let (way, turn, stretch, part) = match span {
            Some(s) => (
                s.step.normalize().as_vec3(),
                s.world_from_cloth,
                s.stretch,
                s.tetrahedron,
            ),
            None => (self.direction.as_vec3(), Mat3::IDENTITY, Mat3::IDENTITY, 0),
        };
        self.reach_mm = t;
        self.met = TripEnd::Fibre(MetFibre {
            hit: *hit,
            body: self.body,
            way,
            world_from_own: turn,
            stretch,
            part,
        });
    }

    /// What was met.
    pub fn met(&self) -> &TripEnd {
        &self.met
    }

    /// How far it was met, or how far was looked, mm.
    pub fn reach_mm(&self) -> f64 {
        self.reach_mm
    }

    /// Where it was met, in the world.
    pub fn end_mm(&self) -> DVec3 {
        self.origin_mm + self.reach_mm.max(0.0) * self.direction
    }
}

/// How far a stretch of some length through a tetrahedron is looked at beyond its ends, mm
/// of the cloth: the rounding of single precision in its cells, and of double precision in
/// the places of its ends, of which the world's is `from_mm` or near it.
fn slack_mm(span: &ShellSpan, length_mm: f64, from_mm: DVec3) -> f64 {
    let places_mm = (span.cloth_mm.abs() + from_mm.abs()).max_element() + span.t1;
    let rounding_mm = f64::from(f32::EPSILON) * length_mm + f64::EPSILON * places_mm;
    FACE_ROUNDINGS * rounding_mm
}
