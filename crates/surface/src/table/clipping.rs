//! How much light a texture makes where its negative ratios are set to zero.
//!
//! A ratio `1 + s` has the mean 1 over a period, but that of `max(0, 1 + s)` is larger. By how much
//! depends on how `s` is distributed over the places of the period, mostly on its standard
//! deviation. For each of the levels of a texture, the mean over places is measured at some pairs of
//! directions when the texture is read, and kept as a function of the deviation.

use glam::Vec2;

/// Between two knots, standard deviation of the ratio.
const STEP: f32 = 0.25;
/// Knots after the one at zero.
const KNOTS: usize = 20;
/// Pairs of directions at which the mean is measured, for light from each side.
pub const PAIRS: usize = 128;
/// Places at which it is measured.
const PLACES: usize = 512;

/// The mean over a period of ratios whose negative values are zero, by their standard deviation.
#[derive(Clone, Debug, PartialEq)]
pub struct Clipping {
    /// By how much the mean is above one, at the knots after zero.
    excess: [f32; KNOTS],
}

impl Clipping {
    /// A curve through measured means: the deviation of a ratio and the mean without its negative
    /// values.
    pub fn new(measured: &[(f32, f32)]) -> Clipping {
        let mut sums = [[0.0f64; 2]; KNOTS];
        let finite = |m: &&(f32, f32)| m.0.is_finite() && m.1.is_finite();
        for &(deviation, mean) in measured.iter().filter(finite) {
            // No distribution has a larger mean of what is below zero.
            let excess = f64::from((mean - 1.0).clamp(0.0, deviation / 2.0));
            let at = deviation / STEP;
            for (knot, sum) in sums.iter_mut().enumerate() {
                let share = f64::from((1.0 - (at - (knot + 1) as f32).abs()).max(0.0));
                sum[0] += share;
                sum[1] += share * excess;
            }
        }
        // Knots without measurements continue the line of those before.
        let mut excess = [0.0f32; KNOTS];
        for knot in 0..KNOTS {
            let [weight, sum] = sums[knot];
            let at = (knot + 1) as f32;
            excess[knot] = match knot {
                _ if weight > 0.0 => (sum / weight) as f32,
                0 => 0.0,
                _ => excess[knot - 1] * at / (at - 1.0),
            };
        }
        Clipping { excess }
    }

    /// The mean of a ratio of this standard deviation.
    pub fn mean(&self, deviation: f32) -> f32 {
        let at = deviation / STEP;
        let of = |knot: usize| knot.checked_sub(1).map_or(0.0, |k| self.excess[k]);
        let below = (at as usize).min(KNOTS - 1);
        let share = at - below as f32;
        1.0 + (of(below) + (of(below + 1) - of(below)) * share).max(0.0)
    }

    /// The places at which means are measured, in turns of the period: an additive recurrence that
    /// fills the square evenly.
    pub fn places() -> impl Iterator<Item = Vec2> {
        (0..PLACES).map(|k| Vec2::new(0.754_877_7, 0.569_840_3) * k as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Normal deviations: the mean of what is not negative has a closed form.
    #[test]
    fn means_of_normal_ratios() {
        let exact = |deviation: f64| {
            // Integrates max(0, 1 + deviation z) over the normal density of z.
            let steps = 4000;
            let width = 16.0 / f64::from(steps);
            let terms = (0..steps).map(|k| {
                let z = -8.0 + (f64::from(k) + 0.5) * width;
                (1.0 + deviation * z).max(0.0) * (-0.5 * z * z).exp() * width
            });
            terms.sum::<f64>() / std::f64::consts::TAU.sqrt()
        };
        let measured: Vec<_> = (0..400)
            .map(|k| f64::from(k) / 100.0)
            .map(|deviation| (deviation as f32, exact(deviation) as f32))
            .collect();
        let clipping = Clipping::new(&measured);
        for deviation in [0.0, 0.1, 0.3, 0.5, 0.9, 1.6, 2.5, 3.6, 4.8] {
            let (found, exact) = (clipping.mean(deviation), exact(deviation.into()) as f32);
            // Beyond the measurements the curve continues as a line through zero.
            let allowed = if deviation < 4.0 { 0.01 } else { 0.15 };
            let off = (found - exact).abs();
            assert!(off < allowed, "{deviation}: {found}, {exact}");
        }
        // Without measurements nothing is divided out.
        assert_eq!(Clipping::new(&[]).mean(2.0), 1.0);
        // Larger than any distribution allows, or not a number.
        let wrong = Clipping::new(&[(1.0, 100.0), (f32::NAN, f32::NAN)]);
        assert_eq!(wrong.mean(1.0), 1.5);
    }
}
