//! Populations of fibres for lanes: how far the tangents behind an end-on ratio are
//! spread, and what they show, by quadrature. The same for all fibres.

use super::fibre_tables::{WIDE_RAD, area_squared};
use organza_basis::quadrature::{gauss_legendre, integrate_rule};
use organza_lanes::{Floats, one};
use rayon::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::LazyLock;

/// Codes of the end-on ratio.
const CODES: u32 = 1 << 12;
/// Codes that share a row of [`PopulationTables::shown`], as a power of two.
pub const CODES_PER_ROW_LOG2: u32 = 6;
/// Those rows.
pub const ROWS: u32 = CODES >> CODES_PER_ROW_LOG2;
/// Nodes of a row, over the part of the ellipsoid's square that is across the axis,
/// from 0 to 1.
pub const SHOWN_NODES: u32 = 65;

/// Spreads of a table from which ratios are inverted: between the first and the last,
/// radians, in even steps of the logarithm. Below the first the ratio is proportional.
const MIN_RAD: f64 = 1e-3;
const MAX_RAD: f64 = 20.0;
const STEPS: usize = 1000;

/// Tables of populations.
pub struct PopulationTables {
    /// For every code of the end-on ratio: the deviation of the tangents, radians,
    /// and the scale of the weights of what is drawn, as bits of `f32`.
    pub spreads: Vec<u32>,
    /// The fitted area that a population shows over the exact one, as bits of `f32`:
    /// rows of codes, in each of [`SHOWN_NODES`] parts.
    pub shown: Vec<u32>,
    /// Relative variance of the weights of tangents, for rows of codes.
    variances: Vec<f64>,
}

/// The tables, made once.
pub fn populations() -> &'static PopulationTables {
    static TABLES: LazyLock<PopulationTables> = LazyLock::new(PopulationTables::new);
    &TABLES
}

impl PopulationTables {
    fn new() -> PopulationTables {
        let rule = gauss_legendre(16);
        let step = (MAX_RAD / MIN_RAD).ln() / STEPS as f64;
        // Logarithms of the ratio, of the spread, and of what weights are divided by
        // over the spread: straight enough between steps to be kept to 2e-5.
        let curve: Vec<[f64; 3]> = (0..=STEPS)
            .into_par_iter()
            .map(|i| {
                let spread = MIN_RAD * (step * i as f64).exp();
                let across = shown(1.0, spread, &rule);
                let ratio = shown(0.0, spread, &rule) / across;
                [ratio, spread, mass(spread, &rule) * across / spread].map(f64::ln)
            })
            .collect();
        let at_ratio = |ratio: f64| -> [f64; 2] {
            let wanted = ratio.max(1e-12).ln();
            let i = curve.partition_point(|c| c[0] < wanted).clamp(1, STEPS);
            let (low, high) = (curve[i - 1], curve[i]);
            // Straight on below the least spread, and no wider than the greatest.
            let t = ((wanted - low[0]) / (high[0] - low[0])).min(1.0);
            let bend = t.max(0.0);
            let spread = low[1] + t * (high[1] - low[1]);
            [spread, low[2] + bend * (high[2] - low[2])].map(f64::exp)
        };
        let ratio_of_code = |code: f64| (code / f64::from(CODES - 1)).powi(2);
        let spreads = (0..CODES)
            .flat_map(|code| spread_words(at_ratio(ratio_of_code(f64::from(code)))))
            .collect();
        let middles = |row: u32| {
            let first = f64::from(row << CODES_PER_ROW_LOG2);
            let middle = first + 0.5 * f64::from((1 << CODES_PER_ROW_LOG2) - 1);
            at_ratio(ratio_of_code(middle))[0]
        };
        let of_row = |row| {
            let spread = middles(row);
            (correction_row(spread, &rule), variance(spread, &rule))
        };
        let rows: Vec<(Vec<u32>, f64)> = (0..ROWS).into_par_iter().map(of_row).collect();
        let (shown, variances): (Vec<_>, Vec<_>) = rows.into_iter().unzip();
        PopulationTables {
            spreads,
            shown: shown.concat(),
            variances,
        }
    }

    /// Relative variance of the weights of tangents in a population whose end-on ratio has
    /// this code, over directions as they see it.
    pub fn variance(&self, code: u32) -> f64 {
        self.variances[(code.min(CODES - 1) >> CODES_PER_ROW_LOG2) as usize]
    }
}

/// The deviation, and the scale of the weights.
///
/// Polar angles a are drawn with density `(s + a) h(a)` for a sine s, h being the
/// Gaussian of narrow spreads without its cut and one for wide ones up to the cut.
/// The scale is the integral of h over that of the Gaussian with its cut, and over
/// the area broadside.
fn spread_words([spread, divisor]: [f64; 2]) -> [u32; 2] {
    let drawn = if spread as f32 > WIDE_RAD {
        FRAC_PI_2 / spread
    } else {
        FRAC_PI_2.sqrt()
    };
    [spread.max(1e-6), drawn / divisor].map(|x| (x as f32).to_bits())
}

/// Relative variance of the weights of tangents, which are half of what a tangent and its
/// mirror image show over `sine + polar angle`, under the density that goes with that sum.
fn variance(spread: f64, rule: &[(f64, f64)]) -> f64 {
    const DIRECTIONS: usize = 8;
    const AZIMUTHS: usize = 8;
    let is_wide = spread as f32 > WIDE_RAD;
    let (mut all, mut sum) = (0.0, 0.0);
    for i in 0..DIRECTIONS {
        let beta = (i as f64 + 0.5) / DIRECTIONS as f64 * FRAC_PI_2;
        let (sine, cosine) = beta.sin_cos();
        let moment = |power: i32| {
            over_polar_angles(spread, beta, rule, |polar| {
                let (sin, cos) = polar.sin_cos();
                // The rule holds the Gaussian already.
                let held = match is_wide {
                    true => gaussian(polar, spread),
                    false => 1.0,
                };
                let seen = (0..AZIMUTHS).map(|k| {
                    let (s, c) = ((k as f64 + 0.5) / AZIMUTHS as f64 * PI).sin_cos();
                    let (a, b, y) = (sine * cos, cosine * sin * c, sin * s);
                    let both = (a - b).hypot(y) + (a + b).hypot(y);
                    (0.5 * both / (sine + polar) * held).powi(power)
                });
                seen.sum::<f64>() / AZIMUTHS as f64 * (sine + polar) / held
            })
        };
        let (zeroth, first, second) = (moment(0), moment(1), moment(2));
        let share = sine * first;
        all += share;
        sum += share * (zeroth * second / (first * first) - 1.0);
    }
    sum / all
}

/// Fitted over exact area for parts from 0 to 1.
fn correction_row(spread: f64, rule: &[(f64, f64)]) -> Vec<u32> {
    let across = shown(1.0, spread, rule);
    let end_on = shown(0.0, spread, rule) / across;
    let node = |i: u32| {
        let part = f64::from(i) / f64::from(SHOWN_NODES - 1);
        // part = s^2 / (e^2 (1 - s^2) + s^2)
        let e2 = end_on * end_on;
        let square = part * e2 / (1.0 - part + part * e2);
        let parts = [1.0 - square, square, end_on].map(|x| one::F::splat(x as f32));
        let fitted = f64::from(area_squared(parts[0], parts[1], parts[2]).0.sqrt());
        let exact = shown(square.sqrt(), spread, rule) / across;
        ((fitted / exact) as f32).to_bits()
    };
    (0..SHOWN_NODES).map(node).collect()
}

/// Pieces of the polar angle from 0 to where the population ends, cut where the mean
/// over the azimuth has a kink for a direction at `beta`.
fn over_polar_angles(spread: f64, beta: f64, rule: &[(f64, f64)], f: impl Fn(f64) -> f64) -> f64 {
    let reach = (9.0 * spread).min(FRAC_PI_2);
    let mut cuts = [
        0.0,
        0.5 * beta,
        beta,
        2.0 * beta,
        3.0 * spread,
        6.0 * spread,
        reach,
    ]
    .map(|cut| cut.min(reach));
    cuts.sort_by(f64::total_cmp);
    let pieces = cuts.windows(2).filter(|c| c[1] > c[0]);
    pieces
        .map(|c| integrate_rule(rule, c[0], c[1], |a| gaussian(a, spread) * f(a)))
        .sum()
}

fn gaussian(angle: f64, spread: f64) -> f64 {
    (-0.5 * (angle / spread).powi(2)).exp()
}

/// Integral of the half-normal polar angle.
fn mass(spread: f64, rule: &[(f64, f64)]) -> f64 {
    over_polar_angles(spread, 0.0, rule, |_| 1.0)
}

/// Mean sine between tangents of that spread and a direction with that sine toward
/// their axis.
fn shown(sine: f64, spread: f64, rule: &[(f64, f64)]) -> f64 {
    const AZIMUTHS: usize = 32;
    let beta = sine.clamp(0.0, 1.0).asin();
    let (sin_beta, cos_beta) = beta.sin_cos();
    let azimuths: [(f64, f64); AZIMUTHS] =
        std::array::from_fn(|k| ((k as f64 + 0.5) / AZIMUTHS as f64 * PI).sin_cos());
    let around = |polar: f64| {
        let (sin, cos) = polar.sin_cos();
        let sines = azimuths.iter().map(|(sin_turn, cos_turn)| {
            let x = sin_beta * cos - cos_beta * sin * cos_turn;
            let y = sin * sin_turn;
            (x * x + y * y).sqrt()
        });
        sines.sum::<f64>() / AZIMUTHS as f64
    };
    over_polar_angles(spread, beta, rule, around) / mass(spread, rule)
}
