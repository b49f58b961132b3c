//! Fibres laid out for lanes: the azimuthal parts of their far fields, and how to
//! draw from them.
//!
//! Between its nodes a far field is linear in the cosine of the mean inclination
//! and in the azimuth, so that the node drawn by where a place lies between its
//! neighbours is right on average, and one look-up does. An azimuth is drawn the
//! same way around: a node by an alias table [Walker1977], then a place in the
//! tent that interpolation spreads it over. What is looked up and what is drawn
//! are one function, that of the words here, and nothing needs weighing.
//!
//! ```text
//! head, for every fibre:  rows, words a row, azimuths, 3 inverse blurs, scale, nodes of the scale
//! row:    chances of the first and of the first two lobes 16 + 16, 3 totals,
//!         colours of 3 lobes, alias words of 3 lobes
//! colour: exponent 5 | blue 9 | green 9 | red 9
//! alias:  share of the slot that is its own 16 | who has the rest 16
//! scale:  green 16 | red 16, exponent 16 | blue 16
//! ```
//!
//! # Energy
//! What an event sends on is kept to `2^-16`, whatever the words round, because paths
//! have tens of events and an error of one is theirs to the power of that number:
//! - totals of lobes are those of the field itself, not of its rounded colours;
//! - the scale, a factor of every event twice, has 16 bits a channel, and its nodes
//!   are chosen so that means over the steps between them are right;
//! - tangents are weighed by the area that a population shows exactly
//!   ([`shown_correction`]), and not by the fit that extinction uses.

use super::event_weights::{EventWeights, LobeRow};
use super::population_tables::populations;
use glam::Vec3;
use organza_basis::AliasTable;
use organza_lanes::math::V3;
use organza_lanes::{Floats, Ints, one};
use organza_scatter::{FAR_LOBES, FAR_ROWS, Fibre, effective_cross_section};
use std::f32::consts::PI;

/// Words of a fibre's head.
pub const HEAD: u32 = 8;
/// Words of a row before its colours.
pub const ROW_HEAD: u32 = 1 + FAR_LOBES as u32;
/// What chances of lobes are of.
pub const CHANCES: f32 = 65_535.0;
/// A lobe is drawn at least so often where it may carry light.
const MIN_CHANCE: f64 = 64.0;
/// Spreads above this are drawn from by way of an even polar angle.
pub const WIDE_RAD: f32 = 1.0;

const MANTISSA: f32 = 511.0;
/// Exponent of the colour code zero: of 2.
const MIN_EXPONENT: i32 = -20;

/// The fibres of a medium.
pub struct FibreTables {
    /// Heads, then the rest.
    pub words: Vec<u32>,
    /// For every code of the end-on ratio: the deviation of the tangents, radians,
    /// and the scale of the weights of what is drawn, as bits of `f32`.
    pub spreads: Vec<u32>,
    /// See [`shown_correction`], as bits of `f32`.
    pub shown: Vec<u32>,
    /// What weights of events are like, by fibre.
    pub weights: Vec<EventWeights>,
}

impl FibreTables {
    /// No fibres.
    pub fn none() -> FibreTables {
        FibreTables {
            words: Vec::new(),
            spreads: Vec::new(),
            shown: Vec::new(),
            weights: Vec::new(),
        }
    }

    /// Lays out fibres in the order of their numbers.
    pub fn new<'a>(fibres: impl Iterator<Item = &'a Fibre>) -> FibreTables {
        let fibres: Vec<&Fibre> = fibres.collect();
        let mut words = vec![0; fibres.len().max(1) * HEAD as usize];
        let mut weights = Vec::with_capacity(fibres.len());
        for (number, fibre) in fibres.iter().enumerate() {
            let (head, of_events) = lay_out(fibre, &mut words);
            weights.push(of_events);
            words[number * HEAD as usize..][..HEAD as usize].copy_from_slice(&head);
        }
        let populations = populations();
        FibreTables {
            words,
            spreads: populations.spreads.clone(),
            shown: populations.shown.clone(),
            weights,
        }
    }

    /// A fault: nine bits are left of scales.
    pub fn round_scales(&mut self) {
        let head = HEAD as usize;
        let fibres = self.words.first().map_or(0, |&first| first as usize / head);
        for fibre in 0..fibres {
            let [.., start, nodes] = self.words[fibre * head..][..head] else {
                continue;
            };
            let scales = &mut self.words[start as usize..][..2 * nodes as usize];
            for pair in scales.chunks_exact_mut(2) {
                let scale = scale_of([pair[0], pair[1]].map(<one::U as Ints>::splat));
                let rounded = colour(one::U::splat(colour_code([
                    scale.x.0, scale.y.0, scale.z.0,
                ])));
                pair.copy_from_slice(&scale_words([rounded.x.0, rounded.y.0, rounded.z.0]));
            }
        }
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        4 * (self.words.len() + self.spreads.len() + self.shown.len()) as u64
    }
}

/// Appends the tables of a fibre and gives its head, and what its events are like.
fn lay_out(fibre: &Fibre, words: &mut Vec<u32>) -> ([u32; HEAD as usize], EventWeights) {
    let parts = fibre.far_parts();
    let azimuths = parts.azimuth_nodes().min(1 << 15);
    let start = words.len() as u32;
    let rows: Vec<Row> = (0..FAR_ROWS)
        .map(|i| {
            let cos = i as f32 / (FAR_ROWS - 1) as f32;
            Row::new(azimuths, |p, azimuth| {
                parts.azimuthal(p, cos, azimuth).0.to_array()
            })
        })
        .collect();
    let bright = [0, 1, 2].map(|p| rows.iter().any(|row| row.totals[p] > 0.0));
    for row in &rows {
        row.append(bright, words);
    }
    let scale = words.len() as u32;
    let nodes = parts.scale_nodes();
    for c in means_kept(nodes, |cos| parts.scale(cos)) {
        words.extend(scale_words(c.to_array()));
    }
    let [r, tt, rest] = parts.blurs_rad().map(|blur| (1.0 / blur).to_bits());
    let stride = ROW_HEAD + 2 * (FAR_LOBES * azimuths) as u32;
    let head = [
        start,
        stride,
        azimuths as u32,
        r,
        tt,
        rest,
        scale,
        nodes as u32,
    ];
    let rows: Vec<LobeRow> = rows
        .iter()
        .map(|row| LobeRow {
            energies: row.energies,
            chances: row.chances(bright),
        })
        .collect();
    (head, EventWeights::new(&parts, &rows))
}

/// Nodes over `[0, 1]` between which the linear function has the means of `f` over
/// each step: the trapezoid of a curved function is off by a twelfth of its second
/// difference. `f` is even about 0.
fn means_kept(nodes: usize, f: impl Fn(f32) -> Vec3) -> Vec<Vec3> {
    let at = |i: usize| f(i as f32 / (nodes - 1) as f32);
    let exact: Vec<Vec3> = (0..nodes).map(at).collect();
    let bend = |i: usize| match i {
        0 => 2.0 * (exact[1] - exact[0]),
        _ => {
            let i = i.min(nodes - 2);
            exact[i - 1] - 2.0 * exact[i] + exact[i + 1]
        }
    };
    (0..nodes).map(|i| exact[i] - bend(i) / 12.0).collect()
}

/// A fibre at one mean inclination.
struct Row {
    /// Sums over channels of `energies`.
    totals: [f64; FAR_LOBES],
    /// What lobes send on, per channel.
    energies: [[f64; 3]; FAR_LOBES],
    colours: Vec<u32>,
    aliases: Vec<u32>,
}

impl Row {
    /// From what each lobe sends to each azimuth.
    fn new(azimuths: usize, lobe: impl Fn(usize, f32) -> [f32; 3]) -> Row {
        let step = PI / (azimuths - 1) as f32;
        let mut row = Row {
            totals: [0.0; FAR_LOBES],
            energies: [[0.0; 3]; FAR_LOBES],
            colours: Vec::with_capacity(FAR_LOBES * azimuths),
            aliases: Vec::with_capacity(FAR_LOBES * azimuths),
        };
        for (p, energies) in row.energies.iter_mut().enumerate() {
            // What a code misses goes on to the next, so that sums are kept.
            let mut missed = [0.0f32; 3];
            let mut tents = Vec::with_capacity(azimuths);
            for k in 0..azimuths {
                // The tents at both ends are split between the signs.
                let is_end = k == 0 || k == azimuths - 1;
                let signs = if is_end { 1.0 } else { 2.0 };
                let exact = lobe(p, k as f32 * step);
                let wanted = [0, 1, 2].map(|c| (exact[c] + missed[c] / signs).max(0.0));
                let code = colour_code(wanted);
                let V3 { x, y, z } = colour(one::U::splat(code));
                missed = [wanted[0] - x.0, wanted[1] - y.0, wanted[2] - z.0].map(|m| m * signs);
                row.colours.push(code);
                let width = f64::from(signs * step);
                tents.push(width * f64::from(x.0 + y.0 + z.0));
                for (energy, exact) in energies.iter_mut().zip(exact) {
                    *energy += width * f64::from(exact);
                }
            }
            row.totals[p] = energies.iter().sum();
            match AliasTable::new(&tents) {
                Some(table) => row.aliases.extend(table.slots().iter().map(alias_code)),
                // Dark, and never drawn but where it is bright nearby.
                None => row
                    .aliases
                    .extend((0..azimuths as u32).map(|k| k | 0xffff << 16)),
            }
        }
        row
    }

    /// With which chances lobes are drawn, of [`CHANCES`], the last being the rest.
    fn bounds(&self, bright: [bool; FAR_LOBES]) -> [u32; 2] {
        let all: f64 = self.totals.iter().sum::<f64>().max(1e-30);
        let chance = |p: usize| match bright[p] {
            true => (self.totals[p] / all * f64::from(CHANCES)).max(MIN_CHANCE),
            false => 0.0,
        };
        let sum = chance(0) + chance(1) + chance(2);
        let of_all = |c: f64| (c / sum.max(1.0) * f64::from(CHANCES)).round() as u32;
        [of_all(chance(0)), of_all(chance(0) + chance(1))]
    }

    /// The same as shares of one.
    fn chances(&self, bright: [bool; FAR_LOBES]) -> [f64; FAR_LOBES] {
        let [first, two] = self
            .bounds(bright)
            .map(|bound| f64::from(bound) / f64::from(CHANCES));
        [first, two - first, 1.0 - two]
    }

    fn append(&self, bright: [bool; FAR_LOBES], words: &mut Vec<u32>) {
        let [first, two] = self.bounds(bright);
        words.push(first | two << 16);
        words.extend(self.totals.map(|total| (total as f32).to_bits()));
        words.extend(&self.colours);
        words.extend(&self.aliases);
    }
}

fn alias_code(&(own, other): &(f32, u32)) -> u32 {
    other | ((own * 65_535.0).round() as u32) << 16
}

/// Codes of colours from `2^-20` to half a million, to 2^-10 of the greatest channel.
fn colour_code(colour: [f32; 3]) -> u32 {
    let most = colour.into_iter().fold(0.0, f32::max);
    let exponent = (most / MANTISSA).max(f32::MIN_POSITIVE).log2().ceil() as i32;
    let code = (exponent - MIN_EXPONENT).clamp(0, 31);
    let per_step = 2f32.powi(-(code + MIN_EXPONENT));
    let [r, g, b] = colour.map(|c| (c * per_step).round().min(MANTISSA) as u32);
    r | g << 9 | b << 18 | (code as u32) << 27
}

/// The colours of codes.
#[inline(always)]
pub fn colour<U: Ints>(code: U) -> V3<U::Floats> {
    let mantissa = U::splat(0x1ff);
    let exponent = code.shr::<27>() + U::splat((127 + MIN_EXPONENT) as u32);
    let scale = exponent.shl::<23>().as_floats();
    V3 {
        x: (code & mantissa).to_floats() * scale,
        y: (code.shr::<9>() & mantissa).to_floats() * scale,
        z: (code.shr::<18>() & mantissa).to_floats() * scale,
    }
}

/// Two words of a scale: mantissas of 16 bits with one exponent.
fn scale_words(scale: [f32; 3]) -> [u32; 2] {
    const MOST: f32 = 65_535.0;
    let most = scale.into_iter().fold(0.0, f32::max);
    let exponent = (most / MOST).max(1e-30).log2().ceil() as i32;
    let per_step = 2f32.powi(-exponent);
    let [r, g, b] = scale.map(|c| (c * per_step).round().clamp(0.0, MOST) as u32);
    [r | g << 16, b | ((exponent + 127) as u32) << 16]
}

/// The scale of two words.
#[inline(always)]
pub fn scale_of<U: Ints>([first, second]: [U; 2]) -> V3<U::Floats> {
    let mantissa = U::splat(0xffff);
    let scale = second.shr::<16>().shl::<23>().as_floats();
    V3 {
        x: (first & mantissa).to_floats() * scale,
        y: first.shr::<16>().to_floats() * scale,
        z: (second & mantissa).to_floats() * scale,
    }
}

/// Coefficients of [`area_squared`]: of powers of the part, and in each of powers of
/// the end-on ratio.
const AREA: [[f32; 3]; 4] = [
    [0.329_337_31, 0.280_642_35, -0.228_811_58],
    [-1.030_507_3, -0.114_350_21, 0.570_037_65],
    [1.241_587_4, 0.202_911_51, -0.746_594_5],
    [-0.858_03, 0.268_674_73, 0.399_252_2],
];

/// Square of the mean sine between a direction and tangents that are spread about
/// an axis, over that across the axis, from the squares of the axis' parts along
/// and across the direction, and times their sum: what a population of fibres
/// blocks.
///
/// That of an ellipsoid, `e^2 along + across`, but for a term that vanishes along
/// and across. Fitted: its root is within 0.2 % of the quadrature for every spread
/// and direction (tested; the ellipsoid is off by up to 2.5 %), so that no
/// transmittance is off by more than 0.0008.
#[inline(always)]
pub fn area_squared<F: Floats>(along: F, across: F, end_on: F) -> F {
    let along = end_on * end_on * along;
    let ellipsoid = along + across;
    let part = across / ellipsoid.max(F::splat(f32::MIN_POSITIVE));
    let of_end_on = |[a, b, c]: [f32; 3]| {
        let slope = end_on.mul_add(F::splat(c), F::splat(b));
        slope.mul_add(end_on, F::splat(a))
    };
    let [a, b, c, d] = AREA;
    let cubic = of_end_on(d).mul_add(part, of_end_on(c));
    let term = cubic
        .mul_add(part, of_end_on(b))
        .mul_add(part, of_end_on(a));
    (along * part).mul_add(term, ellipsoid)
}

/// End-on ratio of a population of fibres of that spread.
pub fn end_on_ratio(spread_rad: f32) -> f32 {
    effective_cross_section(0.0, spread_rad) / effective_cross_section(1.0, spread_rad)
}
