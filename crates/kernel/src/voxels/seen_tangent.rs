//! Which tangent of a population of fibres a way meets, in lanes.

use super::fibre_tables::{WIDE_RAD, area_squared};
use super::population_tables::{CODES_PER_ROW_LOG2, SHOWN_NODES};
use organza_lanes::math::{LaneRng, V3, beside, exp2, minus_ln, positive, sin_cos_of_turns};
use organza_lanes::{Floats, Ints, Mask};
use std::f32::consts::{FRAC_2_PI, FRAC_PI_2, FRAC_PI_4, LOG2_E, TAU};

/// A population of fibres in every lane, spread about an axis.
pub struct SpreadFibres<F: Floats> {
    /// Unit mean axis.
    pub axis: V3<F>,
    /// The end-on ratio, and the code that tables know it by.
    pub end_on: F,
    pub end_on_code: F::Ints,
}

/// A tangent in every lane.
pub struct SeenTangent<F: Floats> {
    /// Unit tangent.
    pub tangent: V3<F>,
    /// Cosine of the inclination of the way.
    pub cos_out: F,
    /// How much more of the fibre is seen than it was drawn for.
    pub weight: F,
    /// A random number that is left.
    pub u: F,
}

impl<F: Floats> SpreadFibres<F> {
    /// Draws a tangent as the population shows it toward `w`. `spreads` and `shown` are
    /// the [tables](super::population_tables) of these names.
    ///
    /// Tangents are first drawn with a density that goes with the sum of two
    /// sines, as [`organza_scatter::virtual_fibres::visible_tangent_sample`] does;
    /// then that one or its mirror image about the axis, in proportion to what
    /// is seen of them, and what their mean differs from the density is weighed.
    #[inline(always)]
    pub fn seen_from(
        &self,
        spreads: &[u32],
        shown: &[u32],
        w: V3<F>,
        rng: &mut LaneRng<F::Ints>,
        mask: F::Mask,
    ) -> SeenTangent<F> {
        let (word, one, zero) = (F::Ints::splat, F::splat(1.0), F::splat(0.0));
        let (axis, end_on) = (self.axis, self.end_on);
        let code = self.end_on_code + self.end_on_code;
        let spread = code.gather(spreads).as_floats();
        let drawn = (code + word(1)).gather(spreads).as_floats();

        // w = s e1 + c axis.
        let across = axis.cross(w);
        let (sine, cosine) = (across.dot(across).sqrt(), axis.dot(w));
        let lost = sine.below(F::splat(1e-6));
        let mut e2 = across.scaled(one / sine.max(F::splat(1e-6)));
        if lost.any() {
            e2 = beside(axis).or_where_not(lost, e2);
        }
        let e1 = e2.cross(axis);

        let [u_term, u_polar, v_polar] = rng.units(mask);
        let [u_turn, u_mirror, u] = rng.units(mask);
        let wide = F::splat(WIDE_RAD).below(spread);
        let mean = spread * F::splat(FRAC_2_PI.sqrt());
        let mean = F::splat(FRAC_PI_4).or_where_not(wide, mean);
        let is_flat = (u_term * (sine + mean)).below(sine);
        let half_square = minus_ln(positive(u_polar));
        let (_, v_cos) = sin_cos_of_turns(v_polar);
        let radius = (half_square + half_square).sqrt() * spread;
        let mut polar = radius * v_cos.abs().or_where_not(is_flat, one);
        let mut weight = drawn * (sine + mean);
        if wide.any() {
            let even = u_polar.or_where_not(is_flat, u_polar.sqrt()) * F::splat(FRAC_PI_2);
            polar = even.or_where_not(wide, polar);
            let deviations = polar / spread.max(F::splat(f32::MIN_POSITIVE));
            let gaussian = exp2(deviations * deviations * F::splat(-0.5 * LOG2_E));
            weight = (weight * gaussian).or_where_not(wide, weight);
        }
        let beyond = F::splat(FRAC_PI_2).below(polar);
        let weight = zero.or_where_not(beyond, weight);
        let (sin_polar, cos_polar) = sin_cos_of_turns(polar * F::splat(1.0 / TAU));
        let (sin_turn, cos_turn) = sin_cos_of_turns(u_turn);

        let (x, y) = (sin_polar * cos_turn, sin_polar * sin_turn);
        let (a, b, y2) = (sine * cos_polar, cosine * x, y * y);
        let own = (a - b).mul_add(a - b, y2).sqrt();
        let mirrored = (a + b).mul_add(a + b, y2).sqrt();
        let both = own + mirrored;
        let is_own = (u_mirror * both).below(own);
        let cos_out = own.or_where_not(is_own, mirrored).min(one);
        let sign = one.or_where_not(is_own, -one);
        let tangent = e1.scaled_add(x * sign, e2.scaled_add(y * sign, axis.scaled(cos_polar)));

        let seen = sine * sine;
        let along = (one - seen).max(zero);
        let fitted = area_squared(along, seen, end_on).sqrt();
        let exactly = shown_correction(shown, self.end_on_code, along, seen, end_on);
        let weight = weight * F::splat(0.5) * both * exactly / ((sine + polar) * fitted);
        SeenTangent {
            tangent,
            cos_out,
            weight: weight.or_where_not(zero.below(both), zero),
            u,
        }
    }
}

/// The fitted area that a population shows over the exact one: rows by the code of its
/// end-on ratio, linear in the part of the ellipsoid's square that is across the axis.
#[inline(always)]
pub fn shown_correction<F: Floats>(
    table: &[u32],
    code: F::Ints,
    along: F,
    across: F,
    end_on: F,
) -> F {
    let word = F::Ints::splat;
    let ellipsoid = (end_on * end_on).mul_add(along, across);
    let part = across / ellipsoid.max(F::splat(f32::MIN_POSITIVE));
    let place = part.min(F::splat(1.0)) * F::splat((SHOWN_NODES - 1) as f32);
    let node = place.min(F::splat((SHOWN_NODES - 2) as f32)).floor();
    let row = code.shr::<CODES_PER_ROW_LOG2>() * word(SHOWN_NODES);
    let at = row + node.to_ints();
    let low = at.gather(table).as_floats();
    let high = (at + word(1)).gather(table).as_floats();
    (high - low).mul_add(place - node, low)
}
