//! The parts of a staple segment where the highlight is both lit and seen.
//!
//! A place shows its highlight where three functions of it are positive: the
//! cosines of both directions to the normal, and that of the angle around the
//! yarn. Their common positive part is mostly one interval, and its ends are
//! found by [`Rule::support`](crate::quadrature::Rule). In about one of 150
//! random cases there are two, or one so short that no scanned place lies in it.
//! [`may_hide`] recognises from the scanned values that this is possible, and
//! [`search`] then finds every stretch.

use crate::real::Real;

/// The functions that must be positive at a place.
pub(crate) type Facing<T> = [T; 3];

/// The maximum number of separate stretches that are kept; at most four have been observed.
const MAX_STRETCHES: usize = 8;

/// Separate stretches of an interval, in ascending order.
#[derive(Clone, Copy)]
pub(crate) struct Stretches<T> {
    ends: [(T, T); MAX_STRETCHES],
    count: usize,
}

impl<T: Real> Stretches<T> {
    pub fn none() -> Self {
        Stretches {
            ends: [(T::zero(), T::zero()); MAX_STRETCHES],
            count: 0,
        }
    }

    pub fn one(low: T, high: T) -> Self {
        let mut one = Self::none();
        one.push(low, high);
        one
    }

    pub fn as_slice(&self) -> &[(T, T)] {
        &self.ends[..self.count]
    }

    /// Appends a stretch, or joins it with the last one if they touch.
    fn push(&mut self, low: T, high: T) {
        if let Some(last) = self.ends[..self.count].last_mut()
            && last.1 >= low
        {
            last.1 = high;
        } else if self.count < MAX_STRETCHES {
            self.ends[self.count] = (low, high);
            self.count += 1;
        }
    }
}

/// The distance of a turning point from zero, in second differences of the scanned values,
/// below which the function may have crossed zero. Of 10,000 cases over the whole range of the
/// model none was missed with 0.3, four with 0.1.
const TURNING_MARGIN: f64 = 0.3;

/// Whether the values at scanned places, four at a time, and their signs as bits, allow
/// more than one stretch or one between two places.
#[inline(always)]
pub(crate) fn may_hide<T: Real>(values: [&[[T; 4]]; 3], positive: [u32; 3]) -> bool {
    let count = 4 * values[0].len();
    let all = positive[0] & positive[1] & positive[2];
    if all != 0 {
        let run = all >> all.trailing_zeros();
        if run & (run + 1) != 0 {
            return true;
        }
    }
    // Cells between neighbouring places, by their first; dark where a function is
    // negative at both.
    let cells = (1u32 << (count - 1)) - 1;
    let dark = positive.map(|p| !p & !(p >> 1) & cells);
    if !all & !(all >> 1) & cells & !(dark[0] | dark[1] | dark[2]) != 0 {
        return true;
    }
    // Few places are suspect: the rest are ruled out together, without branches.
    (0..3).any(|k| {
        let dark_by_others = dark[(k + 1) % 3] | dark[(k + 2) % 3];
        let changes = positive[k] ^ positive[k] >> 1;
        let (suspect, after) = turning_places(values[k], positive[k]);
        let cells = suspect & after | (suspect & !after) >> 1;
        cells & !changes & !dark_by_others != 0
    })
}

/// The scanned places beside which a function turns near zero or beyond, and those from
/// which its turning point lies in the cell after them, as bits.
///
/// With three neighbouring values, slope `s` and bend `b`, the parabola through them turns
/// at the value `f - s^2 / (2 b)`. Where `f` and `b` have the same sign it has crossed or
/// comes nearer to zero than `m |b|` if `|f| |b| - s^2 / 2 < m b^2`.
#[inline(always)]
fn turning_places<T: Real>(f: &[[T; 4]], positive: u32) -> (u32, u32) {
    let (zero, half, margin) = (T::zero(), T::of(0.5), T::of(TURNING_MARGIN));
    // In a cell beside the middle place, that is; at the border there is no other
    // parabola for the far half of the cell.
    let inner = T::of(0.6);
    let (mut near, mut nearest, mut rising) = (0u32, 0u32, 0u32);
    let mut last = zero;
    for (i, four) in f.iter().enumerate() {
        // The first place and the last have one neighbour; they are left out below.
        let next = f.get(i + 1).map_or(zero, |four| four[0]);
        let before = [last, four[0], four[1], four[2]];
        let after = [four[1], four[2], four[3], next];
        last = four[3];
        let mut bits = [[false; 3]; 4];
        for lane in 0..4 {
            let slope = (after[lane] - before[lane]) * half;
            let bend = after[lane] - four[lane] - four[lane] + before[lane];
            let (steep, bent) = (slope.abs(), bend.abs());
            let is_same_sign = bend * four[lane] >= zero;
            let is_near = four[lane].abs() * bent - slope * slope * half < margin * bent * bent;
            let turns = is_same_sign & is_near;
            bits[lane] = [
                turns & (steep < bent),
                turns & (steep < inner * bent),
                slope > zero,
            ];
        }
        for (lane, [is_near, is_nearest, is_rising]) in bits.into_iter().enumerate() {
            near |= u32::from(is_near) << (4 * i + lane);
            nearest |= u32::from(is_nearest) << (4 * i + lane);
            rising |= u32::from(is_rising) << (4 * i + lane);
        }
    }
    let count = 4 * f.len();
    let after = rising ^ positive;
    let borders = after & 1 << (count - 2) | !after & 1 << 1;
    let within = ((1u32 << (count - 1)) - 1) & !1;
    ((nearest | near & borders) & within, after)
}

/// Places of the fine scan.
const FINE: usize = 64;

/// The maximum number of zeros that are kept. There are at most twenty-four, because the square
/// of each function is a trigonometric polynomial of degree four.
const MAX_ZEROS: usize = 24;

/// Every stretch of `[low, high]` on which all three functions are positive: their
/// zeros are bracketed between places of a fine scan and between these and the
/// turning points near zero.
#[cold]
pub(crate) fn search<T: Real>(low: T, high: T, facing: impl Fn(T) -> Facing<T>) -> Stretches<T> {
    let half = T::of(0.5);
    let (mid, span) = ((low + high) * half, (high - low) * half);
    let mut places = [T::zero(); FINE];
    let mut values = [[T::zero(); 3]; FINE];
    for (i, (place, value)) in places.iter_mut().zip(&mut values).enumerate() {
        let angle = std::f64::consts::PI * i as f64 / (FINE - 1) as f64;
        *place = mid - span * T::of(angle.cos());
        *value = facing(*place);
    }
    let mut zeros = [T::zero(); MAX_ZEROS];
    let mut count = 0;
    let mut add = |t: T| {
        if count < MAX_ZEROS {
            zeros[count] = t;
            count += 1;
        }
    };
    // One index selects a function both in the scan and in new evaluations.
    #[allow(clippy::needless_range_loop)]
    for k in 0..3 {
        let f = |t: T| facing(t)[k];
        let is_positive = |i: usize| values[i][k] > T::zero();
        for i in 0..FINE {
            let (before, after) = (i.saturating_sub(1), (i + 1).min(FINE - 1));
            if is_positive(i) != is_positive(after) {
                add(crossing(places[i], places[after], f));
            }
            let size = |i: usize| values[i][k].abs();
            let turns = is_positive(before) == is_positive(i)
                && is_positive(after) == is_positive(i)
                && size(i) <= size(before)
                && size(i) <= size(after);
            if turns && let Some(t) = beyond_zero(places[before], places[after], f) {
                add(crossing(places[before], t, f));
                add(crossing(t, places[after], f));
            }
        }
    }
    let zeros = &mut zeros[..count];
    zeros.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    let mut found = Stretches::none();
    let mut from = low;
    for &to in zeros.iter().chain([&high]) {
        let is_positive = facing((from + to) * half).iter().all(|&x| x > T::zero());
        if from < to && is_positive {
            found.push(from, to);
        }
        from = to;
    }
    found
}

/// The zero between two places where a function differs in sign, by halving.
fn crossing<T: Real>(mut a: T, mut b: T, f: impl Fn(T) -> T) -> T {
    let is_positive = f(a) > T::zero();
    // More steps than a double has binary digits.
    for _ in 0..60 {
        let middle = (a + b) * T::of(0.5);
        if (f(middle) > T::zero()) == is_positive {
            a = middle;
        } else {
            b = middle;
        }
    }
    (a + b) * T::of(0.5)
}

/// A place where a function with equal signs at both ends has the opposite sign: a
/// golden-section search approaches its turning point and stops beyond zero.
fn beyond_zero<T: Real>(mut a: T, mut b: T, f: impl Fn(T) -> T) -> Option<T> {
    let is_positive = f(a) > T::zero();
    let ratio = T::of(0.618_033_988_749_894_9);
    let inner = |a: T, b: T| [b - (b - a) * ratio, a + (b - a) * ratio];
    // 0.618^40 is below the square root of the precision of a double, which limits the
    // precision of a turning point.
    for _ in 0..40 {
        let [c, d] = inner(a, b);
        let (f_c, f_d) = (f(c), f(d));
        for (t, value) in [(c, f_c), (d, f_d)] {
            if (value > T::zero()) != is_positive {
                return Some(t);
            }
        }
        if f_c.abs() < f_d.abs() {
            b = d;
        } else {
            a = c;
        }
    }
    None
}
