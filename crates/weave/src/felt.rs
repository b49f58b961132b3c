//! Fulling: fibres that leave their yarns and lie in the openings between them.
//!
//! Wool that is worked wet migrates, because its scales catch in one direction only, and
//! entangles. Stretches of the fibres of a yarn are taken out of it; each goes on from where it
//! leaves the yarn as a smooth random curve of the same length, radius and colour, so that the
//! cloth keeps its fibres. The curve is led out of yarns into their openings, and back between the
//! faces of the cloth.

use crate::drawn_curve::Look;
use crate::openings::Openings;
use crate::random_curve::RandomCurve;
use crate::strand::{FIBRE_LENGTH_MM, Strand, thickest_fibre_mm, unit};
use crate::yarn::Yarn;
use glam::DVec3;
use organza_basis::{PathRng, Segment};

/// Share of the fibres that is out of the yarn at degree 1 (estimated: what hides the weave, as in
/// melton).
const MOST_OUT: f64 = 0.5;
/// Length of a stretch that is out, as a share of the length of a fibre (estimated).
const STRETCH: f64 = 0.25;
/// Radius to which they curl, root mean square (estimated).
const CURL_MM: f64 = 0.7;
/// How much more sharply than its curl a fibre bends when it is led, and how sharply it is drawn
/// to the middle of the cloth.
const LEAD: f64 = 3.0;
const DRAW: f64 = 1.0;
/// Distance from the centre of a yarn, in radii, below which fibres are led out of it.
const CLEAR: f64 = 1.15;
/// How far beyond the faces of the cloth fibres lie, yarn radii (estimated).
const NAP: f64 = 0.3;
/// Steps per radius of curl, and per radius of the yarn.
const STEPS_PER_CURL: f64 = 8.0;
const STEPS_PER_RADIUS: f64 = 5.0;
/// A fibre that gets nowhere ends after so many times its steps.
const MAX_DETOUR: usize = 2;
/// Family of random numbers: two for each fibre.
const FELT: u64 = 14 << 40;

/// Upper bound of the distance of felt from the faces of a cloth of this yarn.
pub(crate) fn nap_mm(yarn: &Yarn) -> f64 {
    if yarn.fulling > 0.0 {
        NAP * yarn.radius_mm() + thickest_fibre_mm(yarn)
    } else {
        0.0
    }
}

/// Which stretches of a fibre are out of its yarn: as many as `cycles`, at equal distances.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Out {
    cycles: u32,
    share: f64,
    start: f64,
}

impl Out {
    /// Of fibres of a length over all their windings, in a yarn that was fulled to a degree.
    pub fn new(degree: f64, fibre_mm: f64, length_mm: f64, rng: &mut PathRng) -> Out {
        let share = MOST_OUT * degree;
        let cycles = length_mm * share / (STRETCH * fibre_mm);
        Out {
            cycles: cycles.round().clamp(1.0, 1e9) as u32,
            share,
            start: unit(rng),
        }
    }

    /// The stretch that is out at a share of all windings of the fibre.
    fn stretch(&self, run: f64) -> Option<u32> {
        let at = run * f64::from(self.cycles) + self.start;
        let is_out = at - at.floor() < self.share;
        is_out.then(|| (at.floor() as i64).rem_euclid(i64::from(self.cycles)) as u32)
    }
}

/// A stretch that was taken out of the yarn.
#[derive(Clone, Debug)]
struct Taken {
    stretch: u32,
    /// Where it leaves the yarn, and in what direction.
    at_mm: DVec3,
    along: DVec3,
    length_mm: f64,
    material: u16,
}

/// Parts the segments of a fibre into those that stay and the stretches that leave.
pub(crate) struct Sorter {
    out: Out,
    /// That of the fibre where it does not taper.
    radius_mm: f64,
    taken: Vec<Taken>,
    was_out: bool,
    cuts: u32,
}

impl Sorter {
    pub fn new(out: Out, radius_mm: f64) -> Sorter {
        Sorter {
            out,
            radius_mm,
            taken: Vec::new(),
            was_out: false,
            cuts: 0,
        }
    }

    /// Numbers that cuts have taken since this was last asked, at the end of a winding.
    pub fn take_cuts(&mut self) -> u32 {
        std::mem::take(&mut self.cuts)
    }

    /// Emits a segment that lies at a share of all windings, if it stays.
    pub fn sort(&mut self, run: f64, segment: &Segment, emit: &mut dyn FnMut(&Segment)) {
        let Some(stretch) = self.out.stretch(run) else {
            self.cuts += u32::from(std::mem::take(&mut self.was_out));
            return emit(&Segment {
                fibre: segment.fibre + self.cuts,
                ..*segment
            });
        };
        let begins = !std::mem::replace(&mut self.was_out, true);
        let found = self.taken.iter().rposition(|t| t.stretch == stretch);
        let index = found.unwrap_or(self.taken.len());
        if found.is_none() {
            self.taken.push(Taken {
                stretch,
                at_mm: DVec3::ZERO,
                along: DVec3::X,
                length_mm: 0.0,
                material: segment.material,
            });
        }
        let taken = &mut self.taken[index];
        // A stretch over the seam between the windings is met in its middle first.
        if begins || found.is_none() {
            taken.at_mm = segment.start_mm.as_dvec3();
            taken.along = segment.start_tangent.as_dvec3();
            taken.material = segment.material;
        }
        // As much volume, where the fibre tapers, too.
        let radius = f64::from(0.5 * (segment.start_radius_mm + segment.end_radius_mm));
        taken.length_mm += f64::from(segment.length_mm()) * (radius / self.radius_mm).powi(2);
    }
}

impl Strand<'_> {
    /// The stretches of a fibre of a fulled yarn that are out of it.
    pub fn out(&self, degree: f64, fibre: u64) -> Out {
        let fibre_mm = self
            .yarn
            .evenness
            .map_or(FIBRE_LENGTH_MM, |e| e.fibre_length_mm);
        let length_mm = f64::from(self.closure.windings()) * self.path.length_mm();
        Out::new(degree, fibre_mm, length_mm, &mut self.rng(FELT + 2 * fibre))
    }

    /// Emits the stretches of a fibre that left the yarn, numbered from `first`. Returns the
    /// number after the last.
    pub fn emit_felt(
        &self,
        openings: &Openings,
        sorter: Sorter,
        (fibre, first): (u64, u32),
        emit: &mut dyn FnMut(&Segment),
    ) -> u32 {
        let mut rng = self.rng(FELT + 2 * fibre + 1);
        let mut id = first;
        for taken in &sorter.taken {
            let curve = self.felt(openings, taken, &mut rng);
            let look = Look {
                radius_mm: sorter.radius_mm,
                material: taken.material,
            };
            id = self.emit_points(id, &curve, |_| look, emit);
        }
        id
    }

    /// The way of a fibre through the openings.
    fn felt(&self, openings: &Openings, taken: &Taken, rng: &mut PathRng) -> Vec<DVec3> {
        let yarn_mm = self.yarn.radius_mm();
        let step_mm = (CURL_MM / STEPS_PER_CURL).min(yarn_mm / STEPS_PER_RADIUS);
        let steps = (taken.length_mm / step_mm).ceil().max(2.0);
        let step_mm = taken.length_mm / steps;
        let [low, high] = openings.faces_mm;
        let (middle, half) = (0.5 * (low + high), 0.5 * (high - low));
        let nap = NAP * yarn_mm;
        let mut random = RandomCurve::new(CURL_MM, step_mm);
        let lead = LEAD / CURL_MM.min(yarn_mm);
        let (mut at, mut heading) = (taken.at_mm, taken.along);
        let mut curve = Vec::with_capacity(steps as usize + 1);
        curve.push(at);
        let mut left_mm = taken.length_mm;
        for _ in 0..MAX_DETOUR * steps as usize {
            if left_mm <= 0.0 {
                break;
            }
            let mut bend = random.bend(rng);
            let (radii, slope) = openings.at(at);
            let inside = (1.0 - radii / CLEAR).max(0.0);
            let from_middle = (at.z - middle) / half;
            let beyond = ((from_middle.abs() - 1.0) * half / nap).clamp(0.0, 1.0);
            let up = from_middle.signum() * DVec3::Z;
            bend += lead * inside.sqrt() * slope.normalize_or_zero();
            bend -= DRAW / CURL_MM * from_middle * DVec3::Z + lead * beyond * up;
            heading = random.turned(heading, bend);
            let mut next = at + step_mm.min(left_mm) * heading;
            next.z = next.z.clamp(low - nap, high + nap);
            left_mm -= at.distance(next);
            heading = (next - at).normalize_or(heading);
            at = next;
            curve.push(at);
        }
        curve
    }
}
