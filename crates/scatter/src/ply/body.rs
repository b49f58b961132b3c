//! What a ply scatters more than once.
//!
//! Random walks in a straight ply, among fibres as packed events meet them
//! ([`PackedEvent`](crate::PackedEvent)), give by the inclination and the offset of the
//! light that comes in: the energy of each channel that leaves at each place of the
//! circumference, and, by inclination and place, how far about the ply from the normal it
//! leaves and at which inclinations. Where along the ply it leaves is not resolved.
//!
//! A cosine about the normal in place of the second table sends too much light back: what
//! leaves at the sides of a ply of clear fibres still goes forward.

use super::sent::{PLACES, Sent};
use super::{PlyParameters, PlyPlace, first_fibre};
use crate::fibre::Fibre;
use crate::fibre_frame::{FibreAngles, FibreFrame};
use crate::lobe::Lobe;
use glam::Vec3;
use organza_basis::{PathRng, Rgb};
use organza_lanes::math::wrap;
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Cells of the inclination of what comes in, 0 to 90 degrees; the other half is the mirror
/// image.
const INCLINATIONS: usize = 8;
/// Cells of its offset, -1 to 1.
const OFFSETS: usize = 12;
/// Cells of the depth of the first event: equal shares of what a thick ply scatters.
const DEPTHS: usize = 4;
/// Nodes of the sine of the inclination of what leaves, -1 to 1.
const NODES: usize = 33;
/// Walks to an inclination and an offset: a cell's noise is a few per cent, and every
/// picture averages many cells.
const WALKS: u64 = 640;
/// A walk that never ends is cut; fibres without absorption take a few hundred events.
const MAX_EVENTS: u32 = 20_000;
/// Below this share of what they began with, walks go on with this chance.
const SURVIVAL: f32 = 0.25;

/// Nodes of the azimuth of what leaves about the normal, -90 to 90 degrees.
const TURNS: usize = 13;

/// Probabilities of hats over [`NODES`].
type Along = [f32; NODES];
/// Probabilities of hats over [`TURNS`].
type About = [f32; TURNS];

/// The tables.
#[derive(Clone, Debug)]
pub(super) struct Body {
    cells: Vec<Cell>,
    /// By inclination: what leaves where light came in, and on the other side.
    along: Vec<[Along; 2]>,
    /// By inclination and place: about the normal of the place.
    about: Vec<[About; PLACES]>,
}

#[derive(Clone, Debug, Default)]
struct Cell {
    /// Walks.
    count: f32,
    /// Scattered once and gone, mean of the channels, and each of them.
    once: f32,
    once_rgb: Rgb,
    /// Scattered more often.
    sent: Sent,
}

/// What is drawn of the body at an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyEvent {
    frame: FibreFrame,
    azimuth_rad: f32,
    /// What leaves at that place over the probability of the place.
    pub(super) colour: Rgb,
    /// Chance with which a next direction is drawn here.
    share: f32,
    /// Turns the inclinations of the table to those of the event: 1 or -1.
    sense: f32,
    /// Cells of the tables of what leaves.
    inclination: u8,
    place: u8,
}

impl Body {
    /// By random walks.
    pub fn walked(parameters: &PlyParameters, fibre: &Fibre) -> Body {
        let mut cells = Vec::with_capacity(INCLINATIONS * OFFSETS * DEPTHS);
        let mut along = Vec::with_capacity(INCLINATIONS);
        let mut about = Vec::with_capacity(INCLINATIONS);
        for inclination in 0..INCLINATIONS {
            let mut rows = [[0.0; NODES]; 2];
            let mut turns = [[0.0; TURNS]; PLACES];
            for offset in 0..OFFSETS {
                let mut depths: [Cell; DEPTHS] = Default::default();
                let stream = (inclination * OFFSETS + offset) as u64;
                for walk in 0..WALKS {
                    let mut rng = PathRng::new(SEED, stream, walk);
                    let theta = (inclination as f32 + rng.unit()) / INCLINATIONS as f32;
                    let h = 2.0 * (offset as f32 + rng.unit()) / OFFSETS as f32 - 1.0;
                    let walker = Walker { parameters, fibre };
                    let inclined = (theta * FRAC_PI_2).sin_cos().into();
                    let Some((met, depth)) = walker.begin(inclined, h, &mut rng) else {
                        continue;
                    };
                    let cell = &mut depths[depth_cell(depth)];
                    cell.count += 1.0;
                    let Some(exit) = walker.walk(inclined, met, &mut rng) else {
                        continue;
                    };
                    if exit.events == 1 {
                        cell.once += exit.weight.mean();
                        cell.once_rgb += exit.weight;
                        continue;
                    }
                    let turn = exit.azimuth_rad / TAU;
                    let place = ((turn - turn.floor()) * PLACES as f32) as usize;
                    let (place, mean) = (place.min(PLACES - 1), exit.weight.mean());
                    cell.sent.0[place] += exit.weight;
                    let is_across = usize::from(exit.azimuth_rad.cos() > 0.0);
                    add_hat(&mut rows[is_across], 0.5 * (exit.sin + 1.0), mean);
                    add_hat(&mut turns[place], exit.turn_rad / PI + 0.5, mean);
                }
                settle(&mut depths);
                for cell in &mut depths {
                    parameters.correction.apply(cell.once_rgb, &mut cell.sent);
                }
                cells.extend(depths);
            }
            rows.iter_mut().for_each(|row| make_probabilities(row));
            turns.iter_mut().for_each(|row| make_probabilities(row));
            along.push(rows);
            about.push(turns);
        }
        Body {
            cells,
            along,
            about,
        }
    }

    /// Known bad: more light on one side, and no less on the other.
    #[cfg(test)]
    pub fn scale_through(&mut self, factor: f32) {
        let side = |is_through: bool| if is_through { factor } else { 1.0 };
        for cell in &mut self.cells {
            cell.sent.scale(|is_through| Rgb::splat(side(is_through)));
        }
    }

    pub fn memory_bytes(&self) -> u64 {
        (size_of_val(&self.cells[..]) + size_of_val(&self.along[..]) + size_of_val(&self.about[..]))
            as u64
    }

    /// Draws what is left open at an event of a frame, an offset and an optical depth: between
    /// cells, and the place where light leaves.
    pub fn event(
        &self,
        frame: FibreFrame,
        offset: f32,
        depth: f32,
        rng: &mut PathRng,
    ) -> BodyEvent {
        // A half turn about the radius swaps both signs and keeps the twist.
        let sense = if frame.sin_out < 0.0 { -1.0 } else { 1.0 };
        let theta = frame.sin_out.abs().min(1.0).asin() / FRAC_PI_2;
        let h = 0.5 * (sense * offset + 1.0);
        let mut cell = |x: f32, count: usize| {
            let at = (x * count as f32 - 0.5 + rng.unit()).floor();
            (at.max(0.0) as usize).min(count - 1)
        };
        let (inclination, offset) = (cell(theta, INCLINATIONS), cell(h, OFFSETS));
        let cell = &self.cells[(inclination * OFFSETS + offset) * DEPTHS + depth_cell(depth)];
        let total: f32 = cell.sent.0.iter().map(|c| c.mean()).sum();
        let (mut left, mut place) = (rng.unit() * total, 0);
        for (i, sent) in cell.sent.0.iter().enumerate() {
            if sent.mean() > 0.0 {
                place = i;
                left -= sent.mean();
                if left < 0.0 {
                    break;
                }
            }
        }
        let azimuth = sense * TAU * (place as f32 + rng.unit()) / PLACES as f32;
        let sent = cell.sent.0[place];
        BodyEvent {
            frame,
            azimuth_rad: wrap(azimuth),
            colour: sent * (total / sent.mean().max(f32::MIN_POSITIVE)),
            share: total / (total + cell.once).max(f32::MIN_POSITIVE),
            sense,
            inclination: inclination as u8,
            place: place as u8,
        }
    }
}

/// The cell of an optical depth.
fn depth_cell(depth: f32) -> usize {
    ((1.0 - (-depth).exp()) * DEPTHS as f32).clamp(0.0, (DEPTHS - 1) as f32) as usize
}

/// Makes sums means; depths that no walk came to take the values of the nearest that has some.
fn settle(depths: &mut [Cell; DEPTHS]) {
    for cell in depths.iter_mut() {
        let share = 1.0 / cell.count.max(1.0);
        cell.once *= share;
        cell.once_rgb *= share;
        cell.sent.0.iter_mut().for_each(|sent| *sent *= share);
    }
    for i in 0..DEPTHS {
        let walked = (0..DEPTHS).filter(|&k| depths[k].count > 0.0);
        if let Some(k) = walked.min_by_key(|k| k.abs_diff(i)) {
            depths[i] = depths[k].clone();
        }
    }
}

/// Of the tables' walks.
const SEED: u64 = 20;

impl BodyEvent {
    /// Chance with which a next direction is drawn here.
    pub fn share(&self) -> f32 {
        self.share
    }

    /// Unit normal where light leaves.
    pub fn exit_normal(&self) -> Vec3 {
        self.frame.across(self.azimuth_rad)
    }

    /// Of the body whose event it is.
    fn along<'a>(&self, body: &'a Body) -> &'a Along {
        let is_across = usize::from(self.azimuth_rad.cos() > 0.0);
        &body.along[usize::from(self.inclination)][is_across]
    }

    fn about<'a>(&self, body: &'a Body) -> &'a About {
        &body.about[usize::from(self.inclination)][usize::from(self.place)]
    }

    /// Density of directions, 1/sr, of an event of this body.
    pub fn pdf(&self, body: &Body, w_in: Vec3) -> f32 {
        let angles = self.frame.angles(w_in);
        let turn = wrap(self.sense * (angles.azimuth_rad - self.azimuth_rad)) / PI + 0.5;
        let along = 0.5 * (self.sense * angles.sin + 1.0);
        hat_density(self.about(body), turn) / PI * (0.5 * hat_density(self.along(body), along))
    }

    /// What is sent, per steradian.
    pub fn value(&self, body: &Body, w_in: Vec3) -> Rgb {
        self.colour * self.pdf(body, w_in)
    }

    /// A direction by [`BodyEvent::pdf`].
    pub fn sample(&self, body: &Body, rng: &mut PathRng) -> Vec3 {
        let sin = 2.0 * draw_hat(self.along(body), rng) - 1.0;
        let sin = self.sense * sin.clamp(-1.0, 1.0);
        let turn = self.sense * PI * (draw_hat(self.about(body), rng) - 0.5);
        self.frame.direction(&FibreAngles {
            sin,
            cos: (1.0 - sin * sin).max(0.0).sqrt(),
            azimuth_rad: wrap(self.azimuth_rad + turn),
        })
    }
}

/// Adds a weight at `x`, 0 to 1, to the hats over even nodes from 0 to 1.
fn add_hat(nodes: &mut [f32], x: f32, weight: f32) {
    let (node, share) = between(nodes.len(), x);
    nodes[node] += weight * (1.0 - share);
    nodes[node + 1] += weight * share;
}

/// The node at or below `x`, and the share of the way to the next.
fn between(count: usize, x: f32) -> (usize, f32) {
    let x = x * (count - 1) as f32;
    let node = (x.max(0.0) as usize).min(count - 2);
    (node, (x - node as f32).clamp(0.0, 1.0))
}

/// Scales sums to probabilities; even ones where nothing was added.
fn make_probabilities(nodes: &mut [f32]) {
    let (total, even) = (nodes.iter().sum::<f32>(), 1.0 / nodes.len() as f32);
    for p in nodes {
        *p = if total > 0.0 { *p / total } else { even };
    }
}

/// Density at `x` of the hats with such probabilities; 0 outside 0 to 1.
fn hat_density(nodes: &[f32], x: f32) -> f32 {
    if !(0.0..=1.0).contains(&x) {
        return 0.0;
    }
    let last = nodes.len() - 1;
    let height = |k: usize| {
        let is_end = k == 0 || k == last;
        nodes[k] * last as f32 * if is_end { 2.0 } else { 1.0 }
    };
    let (node, share) = between(nodes.len(), x);
    height(node) * (1.0 - share) + height(node + 1) * share
}

/// A number from 0 to 1 by [`hat_density`].
fn draw_hat(nodes: &[f32], rng: &mut PathRng) -> f32 {
    let (mut left, mut node, last) = (rng.unit(), 0, nodes.len() - 1);
    for (k, &p) in nodes.iter().enumerate() {
        if p > 0.0 {
            node = k;
            left -= p;
            if left < 0.0 {
                break;
            }
        }
    }
    let aside = rng.unit() + rng.unit() - 1.0;
    let aside = match node {
        0 => aside.abs(),
        k if k == last => -aside.abs(),
        _ => aside,
    };
    (node as f32 + aside) / last as f32
}

/// Walks in a straight ply along z.
struct Walker<'a> {
    parameters: &'a PlyParameters,
    fibre: &'a Fibre,
}

/// Where and how light leaves.
struct Exit {
    weight: Rgb,
    events: u32,
    /// Of the place, in the frame of what came in.
    azimuth_rad: f32,
    /// Of the direction about the normal of the place.
    turn_rad: f32,
    /// Of the inclination.
    sin: f32,
}

impl Walker<'_> {
    /// Where light with a sine and cosine of its inclination at an offset first meets a fibre,
    /// and the optical depth; `None` where it hardly ever does.
    fn begin(&self, inclined: [f32; 2], h: f32, rng: &mut PathRng) -> Option<(PlyPlace, f32)> {
        let frame = frame_of(inclined);
        let radius_mm = self.parameters.radius_mm;
        let entry = frame.side * h - frame.forward * (1.0 - h * h).max(0.0).sqrt();
        let entry = PlyPlace {
            axis: Vec3::Z,
            out_mm: radius_mm * entry,
            radius_mm,
        };
        let travel = travel_of(inclined);
        // What passes is not of the body: as many tries as a thin edge takes.
        let t = (0..4096).find_map(|_| first_fibre(self.parameters, &entry, travel, rng))?;
        let depth = self.parameters.broadside_per_mm() * t * frame.cos_out;
        Some((entry.moved(travel, t), depth))
    }

    /// On from there; `None` where it is absorbed.
    fn walk(&self, inclined: [f32; 2], met: PlyPlace, rng: &mut PathRng) -> Option<Exit> {
        let frame = frame_of(inclined);
        let mut travel = travel_of(inclined);
        let mut place = met;
        let mut weight = Rgb::WHITE;
        for events in 1..MAX_EVENTS {
            let along = self.parameters.fibre_direction(place.axis, place.out_mm);
            let along = self.parameters.correction.met(along, travel, rng);
            let met_at = FibreFrame::new(along, -travel);
            let near = self.fibre.near_field(met_at, 2.0 * rng.unit() - 1.0);
            let next = near.sample(-travel, rng)?;
            weight *= next.weight;
            let off = near.exit_mm(self.parameters.fibre_radius_mm, next.w_in, rng);
            place = place.moved(off, 1.0);
            travel = next.w_in;
            if weight.max_component() < SURVIVAL {
                if rng.unit() >= SURVIVAL {
                    return None;
                }
                weight *= 1.0 / SURVIVAL;
            }
            if let Some(met) = self.next_event(&place, travel, rng) {
                place = met;
                continue;
            }
            let out = place.moved(travel, place.chord_mm(travel)).out_mm;
            let azimuth_rad = out.dot(frame.side).atan2(out.dot(frame.forward));
            return Some(Exit {
                weight,
                events,
                azimuth_rad,
                turn_rad: wrap(frame.angles(travel).azimuth_rad - azimuth_rad),
                sin: travel.z,
            });
        }
        None
    }

    /// The next fibre along a way.
    fn next_event(&self, from: &PlyPlace, travel: Vec3, rng: &mut PathRng) -> Option<PlyPlace> {
        let t = first_fibre(self.parameters, from, travel, rng)?;
        Some(from.moved(travel, t))
    }
}

/// The frame of what comes in with a sine and cosine of its inclination, about z.
fn frame_of([sin, cos]: [f32; 2]) -> FibreFrame {
    FibreFrame::new(Vec3::Z, Vec3::new(-cos, 0.0, sin))
}

fn travel_of([sin, cos]: [f32; 2]) -> Vec3 {
    Vec3::new(cos, 0.0, -sin)
}

#[cfg(test)]
mod tests;
