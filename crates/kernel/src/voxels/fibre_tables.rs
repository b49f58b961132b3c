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
//! ```

use crate::cpu::lanes::{Floats, Ints, one};
use crate::cpu::math::V3;
use organza_basis::AliasTable;
use organza_basis::quadrature::{gauss_legendre, integrate_rule};
use organza_scatter::{FAR_LOBES, FAR_ROWS, Fibre, effective_cross_section};
use std::f32::consts::{FRAC_PI_2, PI};

/// Words of a fibre's head.
pub const HEAD: u32 = 8;
/// Words of a row before its colours.
pub const ROW_HEAD: u32 = 1 + FAR_LOBES as u32;
/// What chances of lobes are of.
pub const CHANCES: f32 = 65_535.0;
/// A lobe is drawn at least so often where it may carry light.
const LEAST_CHANCE: f64 = 64.0;
/// Spreads above this are drawn from by way of an even polar angle.
pub const WIDE_RAD: f32 = 1.0;

const MANTISSA: f32 = 511.0;
/// Exponent of the colour code zero: of 2.
const LEAST_EXPONENT: i32 = -20;

/// The fibres of a medium.
pub struct FibreTables {
    /// Heads, then the rest.
    pub words: Vec<u32>,
    /// For every code of the end-on ratio: the deviation of the tangents, radians,
    /// and the scale of the weights of what is drawn, as bits of `f32`.
    pub spreads: Vec<u32>,
}

impl FibreTables {
    /// No fibres.
    pub fn none() -> FibreTables {
        FibreTables {
            words: Vec::new(),
            spreads: Vec::new(),
        }
    }

    /// Lays out fibres in the order of their numbers.
    pub fn new<'a>(fibres: impl Iterator<Item = &'a Fibre>) -> FibreTables {
        let fibres: Vec<&Fibre> = fibres.collect();
        let mut words = vec![0; fibres.len().max(1) * HEAD as usize];
        for (number, fibre) in fibres.iter().enumerate() {
            let head = lay_out(fibre, &mut words);
            words[number * HEAD as usize..][..HEAD as usize].copy_from_slice(&head);
        }
        let rule = gauss_legendre(32);
        let spreads = (0..=0xfff).flat_map(|code| spread_words(code, &rule));
        FibreTables {
            words,
            spreads: spreads.collect(),
        }
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        4 * (self.words.len() + self.spreads.len()) as u64
    }
}

/// Appends the tables of a fibre and gives its head.
fn lay_out(fibre: &Fibre, words: &mut Vec<u32>) -> [u32; HEAD as usize] {
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
    for i in 0..nodes {
        let c = parts.scale(i as f32 / (nodes - 1) as f32);
        words.push(colour_code(c.to_array()));
    }
    let [r, tt, rest] = parts.blurs_rad().map(|blur| (1.0 / blur).to_bits());
    let stride = ROW_HEAD + 2 * (FAR_LOBES * azimuths) as u32;
    [
        start,
        stride,
        azimuths as u32,
        r,
        tt,
        rest,
        scale,
        nodes as u32,
    ]
}

/// A fibre at one mean inclination.
struct Row {
    totals: [f64; FAR_LOBES],
    colours: Vec<u32>,
    aliases: Vec<u32>,
}

impl Row {
    /// From what each lobe sends to each azimuth.
    fn new(azimuths: usize, lobe: impl Fn(usize, f32) -> [f32; 3]) -> Row {
        let step = PI / (azimuths - 1) as f32;
        let mut row = Row {
            totals: [0.0; FAR_LOBES],
            colours: Vec::with_capacity(FAR_LOBES * azimuths),
            aliases: Vec::with_capacity(FAR_LOBES * azimuths),
        };
        for (p, total) in row.totals.iter_mut().enumerate() {
            // What a code misses goes on to the next, so that sums are kept.
            let mut missed = [0.0f32; 3];
            let mut tents = Vec::with_capacity(azimuths);
            for k in 0..azimuths {
                let exact = lobe(p, k as f32 * step);
                let wanted = [0, 1, 2].map(|c| (exact[c] + missed[c]).max(0.0));
                let code = colour_code(wanted);
                let V3 { x, y, z } = colour(one::U::splat(code));
                missed = [wanted[0] - x.0, wanted[1] - y.0, wanted[2] - z.0];
                row.colours.push(code);
                // The tents at both ends are split between the signs.
                let signs = if k == 0 || k == azimuths - 1 {
                    1.0
                } else {
                    2.0
                };
                tents.push(signs * f64::from(step) * f64::from(x.0 + y.0 + z.0));
            }
            *total = tents.iter().sum();
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

    fn append(&self, bright: [bool; FAR_LOBES], words: &mut Vec<u32>) {
        let all: f64 = self.totals.iter().sum::<f64>().max(1e-30);
        let chance = |p: usize| match bright[p] {
            true => (self.totals[p] / all * f64::from(CHANCES)).max(LEAST_CHANCE),
            false => 0.0,
        };
        let sum = chance(0) + chance(1) + chance(2);
        let of_all = |c: f64| (c / sum.max(1.0) * f64::from(CHANCES)).round() as u32;
        let (first, two) = (of_all(chance(0)), of_all(chance(0) + chance(1)));
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
    let code = (exponent - LEAST_EXPONENT).clamp(0, 31);
    let per_step = 2f32.powi(-(code + LEAST_EXPONENT));
    let [r, g, b] = colour.map(|c| (c * per_step).round().min(MANTISSA) as u32);
    r | g << 9 | b << 18 | (code as u32) << 27
}

/// The colours of codes.
#[inline(always)]
pub fn colour<U: Ints>(code: U) -> V3<U::Floats> {
    let mantissa = U::splat(0x1ff);
    let exponent = code.shr::<27>() + U::splat((127 + LEAST_EXPONENT) as u32);
    let scale = exponent.shl::<23>().as_floats();
    V3 {
        x: (code & mantissa).to_floats() * scale,
        y: (code.shr::<9>() & mantissa).to_floats() * scale,
        z: (code.shr::<18>() & mantissa).to_floats() * scale,
    }
}

/// Coefficients of [`area_squared`].
const AREA: [[f32; 2]; 2] = [[0.277_01, 0.068_09], [-0.474_85, 0.322_79]];

/// Square of the mean sine between a direction and tangents that are spread about
/// an axis, over that across the axis, from the squares of the axis' parts along
/// and across the direction, and times their sum: what a population of fibres
/// blocks.
///
/// That of an ellipsoid, `e^2 along + across`, but for a term that vanishes along
/// and across. Fitted: within 0.4 % of [`effective_cross_section`] for every
/// spread and direction (tested; the ellipsoid is off by up to 2.5 %).
#[inline(always)]
pub fn area_squared<F: Floats>(along: F, across: F, end_on: F) -> F {
    let along = end_on * end_on * along;
    let ellipsoid = along + across;
    let part = across / ellipsoid.max(F::splat(f32::MIN_POSITIVE));
    let [[a, b], [c, d]] = AREA;
    let slope = end_on.mul_add(F::splat(d), F::splat(c));
    let term = slope.mul_add(part, end_on.mul_add(F::splat(b), F::splat(a)));
    (along * part).mul_add(term, ellipsoid)
}

/// End-on ratio of a population of fibres of that spread.
pub fn end_on_ratio(spread_rad: f32) -> f32 {
    effective_cross_section(0.0, spread_rad) / effective_cross_section(1.0, spread_rad)
}

/// The spread that gives an end-on ratio, by bisection in 40 steps.
fn spread_of(end_on: f32) -> f32 {
    let (mut low, mut high) = (0.0f32, 20.0f32);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if end_on_ratio(middle) < end_on {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// The words of [`FibreTables::spreads`] for a code of the end-on ratio.
///
/// Polar angles a are drawn with density `(s + a) h(a)` for a sine s, h being the
/// Gaussian of narrow spreads without its cut and one for wide ones up to the cut.
/// The scale is the integral of h over that of the Gaussian with its cut, and over
/// the area broadside.
fn spread_words(code: u32, rule: &[(f64, f64)]) -> [u32; 2] {
    let root = code as f32 / 4095.0;
    let spread = spread_of(root * root);
    let drawn = if spread > WIDE_RAD {
        FRAC_PI_2
    } else {
        FRAC_PI_2.sqrt() * spread
    };
    let deviation = f64::from(spread.max(1e-6));
    let gaussian = |a: f64| (-0.5 * (a / deviation).powi(2)).exp();
    let reach = f64::from(FRAC_PI_2).min(9.0 * deviation);
    let mass = integrate_rule(rule, 0.0, reach, gaussian) as f32;
    let broadside = effective_cross_section(1.0, spread);
    [
        spread.to_bits(),
        (drawn.max(1e-6) / (mass * broadside)).to_bits(),
    ]
}
