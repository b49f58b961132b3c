//! Light at the surface of a fibre, in lanes: the near field of
//! [`organza_scatter::NearField`], term by term.
//!
// Loops over lobes go by index: the compiler may leave iterators of vectors without
// the back end's instructions.
#![allow(clippy::needless_range_loop)]

use super::crossing::{Crossing, atan2, exp};
use super::optics::{Balanced, LOBES, Material, Optics};
use glam::Vec3;
use organza_lanes::math::{LaneRng, V3, beside, minus_ln, positive, sin_cos_of_turns};
use organza_lanes::{Floats, Ints, Mask};
use organza_scatter::InclinationPair;
use std::f32::consts::{FRAC_1_PI, FRAC_PI_2, PI, TAU};

const INVERSE_SQRT_TAU: f32 = 0.398_942_3;
/// Tries to draw an inclination before the last one is taken.
const MAX_TRIES: u32 = 2048;

/// What is met, and by what.
pub struct Met<F: Floats> {
    /// Unit tangent of the fibre.
    pub tangent: V3<F>,
    /// From the axis to the point met, mm.
    pub out_mm: V3<F>,
    /// Unit, back along the way.
    pub w_out: V3<F>,
}

/// An event in every lane.
pub struct NearEvent<F: Floats> {
    tangent: V3<F>,
    forward: V3<F>,
    side: V3<F>,
    sin_out: F,
    cos_out: F,
    offset: F,
    gamma_i: F,
    material: Material<F>,
    out: Balanced<F>,
    /// Probability of drawing each lobe, and that over its norm.
    shares: [F; LOBES],
    draws: [F; LOBES],
    pub radius_mm: F,
    /// Angles of the surface normals where R, TT and TRT leave.
    exit_normals: [F; LOBES - 1],
}

/// A direction about the fibre.
struct Angles<F> {
    sin: F,
    cos: F,
    azimuth: F,
}

/// What an event does with light from a direction.
pub struct Scattered<F: Floats> {
    /// Light sent back along the way per radiance and steradian.
    pub value: V3<F>,
    /// Density with which the walk draws the direction, 1/sr.
    pub pdf: F,
    angles: Angles<F>,
    /// What each lobe sends, for the choice of where light leaves.
    sent: [F; LOBES],
}

/// Where a walk goes on.
pub struct Turn<F: Floats> {
    pub direction: V3<F>,
    pub weight: V3<F>,
    pub scattered: Scattered<F>,
}

impl<F: Floats> NearEvent<F> {
    /// The event of lanes of a mask.
    #[inline(always)]
    pub fn new(optics: &Optics, material: Material<F>, met: &Met<F>, mask: F::Mask) -> Self {
        let one = F::splat(1.0);
        let tangent = met.tangent;
        let sin_out = clamp(tangent.dot(met.w_out));
        let cross = met.w_out.cross(tangent);
        let cos_out = cross.dot(cross).sqrt();
        // Rounding has tilted a short product toward the tangent.
        let upright = tangent.scaled_add(-tangent.dot(cross), cross);
        let length = upright.dot(upright).sqrt();
        let is_long = F::splat(1e-7).below(length);
        let side = upright
            .scaled(one / length)
            .or_where_not(is_long, beside(tangent));
        let forward = side.cross(tangent);
        let cos_out = cos_out.min(one);
        // Across the tangent, which at a bend is not that of the cylinder.
        let across = tangent.scaled_add(-tangent.dot(met.out_mm), met.out_mm);
        let height = across.dot(across).sqrt();
        let offset = clamp(across.dot(side) / height.max(F::splat(1e-20)));
        let gamma_i = atan2(offset, (one - offset * offset).max(F::splat(0.0)).sqrt());
        let blur = material.blurs[0];
        let drawing = (cos_out.mul_add(cos_out, blur * blur * F::splat(0.25)))
            .min(one)
            .sqrt();
        let out = optics.balanced(&material, cos_out);
        let mut event = NearEvent {
            tangent,
            forward,
            side,
            sin_out,
            cos_out,
            offset,
            gamma_i,
            material,
            out,
            shares: [F::splat(0.0); LOBES],
            draws: [F::splat(0.0); LOBES],
            radius_mm: met.out_mm.dot(met.out_mm).sqrt(),
            exit_normals: [F::splat(0.0); LOBES - 1],
        };
        let crossing = event.crossing(drawing);
        let mut energies = event.energies(&crossing, drawing, mask);
        if event.has_sections(optics, mask) {
            let own = event.material.section.lobes(optics, drawing);
            for p in 0..LOBES {
                let own = V3::splat(Vec3::ONE).scaled(own[p]);
                energies[p] = own.or_where_not(event.material.is_section, energies[p]);
            }
        }
        let third = F::splat(1.0 / 3.0);
        let mut sent = [F::splat(0.0); LOBES];
        for p in 0..LOBES {
            sent[p] = energies[p].sum() * third * event.out.norms[p];
        }
        let total = sent[0] + sent[1] + sent[2] + sent[3];
        let some = F::splat(0.0).below(total);
        for p in 0..LOBES {
            let any = if p == 0 { one } else { F::splat(0.0) };
            event.shares[p] = (sent[p] / total).or_where_not(some, any);
            event.draws[p] = event.shares[p] / event.out.norms[p].max(F::splat(f32::MIN_POSITIVE));
        }
        let crossing = event.crossing(event.cos_out);
        for p in 0..LOBES - 1 {
            event.exit_normals[p] = crossing.exit_normal(p, event.gamma_i);
        }
        event
    }

    #[inline(always)]
    fn crossing(&self, cos: F) -> Crossing<F> {
        Crossing::new(self.material.ior, cos, self.offset)
    }

    /// Whether lanes of a mask met fibres that are not round.
    #[inline(always)]
    fn has_sections(&self, optics: &Optics, mask: F::Mask) -> bool {
        optics.has_sections && (mask & self.material.is_section).any()
    }

    /// What each lobe keeps of the light at a mean inclination.
    #[inline(always)]
    fn energies(&self, crossing: &Crossing<F>, mean_cos: F, mask: F::Mask) -> [V3<F>; LOBES] {
        let zero = V3::splat(Vec3::ZERO);
        let m = &self.material;
        let (dielectric, fitted) = m.kinds(mask);
        let mut all = [zero; LOBES];
        if dielectric {
            all = crossing.attenuations(m.absorption);
        }
        if fitted {
            let one = F::splat(1.0);
            let x = (one - mean_cos).max(F::splat(0.0)).min(one);
            let square = x * x;
            let fifth = square * square * x;
            let white = V3::splat(Vec3::ONE);
            let r = (white - m.absorption).scaled_add(fifth, m.absorption);
            let own = [r, (white - r).times(m.colour_tt), zero, zero];
            for p in 0..LOBES {
                all[p] = all[p].or_where_not(m.is_dielectric, own[p]);
            }
        }
        all
    }

    /// Densities per radian of each lobe's azimuth.
    #[inline(always)]
    fn azimuths(&self, crossing: &Crossing<F>, azimuth: F, mask: F::Mask) -> [F; LOBES] {
        let m = &self.material;
        let even = F::splat(1.0 / TAU);
        let (dielectric, fitted) = m.kinds(mask);
        let mut all = [even; LOBES];
        if dielectric {
            for p in 0..LOBES - 1 {
                let mean = crossing.exit_azimuth(p, self.gamma_i);
                all[p] = self.wrapped(azimuth - mean, mask);
            }
        }
        if fitted {
            let straight = self.wrapped(azimuth, mask);
            all[0] = all[0].or_where_not(m.is_dielectric, even);
            all[1] = all[1].or_where_not(m.is_dielectric, straight);
        }
        all
    }

    /// A Gaussian of the azimuth's blur around the circle.
    #[inline(always)]
    fn wrapped(&self, apart: F, mask: F::Mask) -> F {
        let m = &self.material;
        let x = wrap(apart).abs();
        let inverse = m.inverse_azimuth_blur;
        let mut value = bell(x * inverse);
        let around = F::splat(TAU) - x;
        let seen = around.below(m.azimuth_blur * F::splat(6.0));
        if (mask & seen).any() {
            let more = bell(around * inverse) + bell((x + F::splat(TAU)) * inverse);
            value = (value + more).or_where_not(seen, value);
        }
        value * inverse * F::splat(INVERSE_SQRT_TAU)
    }

    /// The inclination of a direction with that of the way.
    #[inline(always)]
    fn pair(&self, sin: F, cos: F) -> InclinationPair<F> {
        InclinationPair::new([sin, cos], [self.sin_out, self.cos_out])
    }

    /// Densities per radian of the inclination, of each lobe.
    #[inline(always)]
    fn densities(&self, pair: &InclinationPair<F>, mask: F::Mask) -> [F; LOBES] {
        let m = &self.material;
        let sum = atan2(pair.sum[0], pair.sum[1]);
        let [sin, cos] = pair.folded;
        let widest = m.fold_cosines[0]
            .min(m.fold_cosines[1])
            .min(m.fold_cosines[2]);
        let folds = widest.below(cos);
        let some_fold = (mask & folds).any();
        let at_fold = if some_fold {
            atan2(sin, cos)
        } else {
            F::splat(0.0)
        };
        let mut all = [F::splat(0.0); LOBES];
        for p in 0..LOBES - 1 {
            let inverse = m.inverse_blurs[p];
            let mut value = bell(sum * inverse);
            if some_fold {
                let own = m.fold_cosines[p].below(cos);
                value = (value + bell(at_fold * inverse)).or_where_not(own, value);
            }
            all[p] = value * inverse * F::splat(INVERSE_SQRT_TAU);
        }
        // The rest is as wide as TRT.
        all[3] = all[2];
        all
    }

    /// Light from a direction.
    #[inline(always)]
    pub fn toward(&self, optics: &Optics, w_in: V3<F>, mask: F::Mask) -> Scattered<F> {
        let one = F::splat(1.0);
        let (x, y) = (w_in.dot(self.forward), w_in.dot(self.side));
        let angles = Angles {
            sin: clamp(w_in.dot(self.tangent)),
            cos: x.mul_add(x, y * y).sqrt().min(one),
            azimuth: atan2(y, x),
        };
        let pair = self.pair(angles.sin, angles.cos);
        let crossing = self.crossing(pair.mean_cos);
        self.scattered(optics, angles, &pair, &crossing, mask)
    }

    #[inline(always)]
    fn scattered(
        &self,
        optics: &Optics,
        angles: Angles<F>,
        pair: &InclinationPair<F>,
        crossing: &Crossing<F>,
        mask: F::Mask,
    ) -> Scattered<F> {
        let kernels = self.densities(pair, mask);
        let mut azimuths = self.azimuths(crossing, angles.azimuth, mask);
        let mut colours = self.energies(crossing, pair.mean_cos, mask);
        if self.has_sections(optics, mask) {
            let m = &self.material;
            let own = m.section.at(optics, pair.mean_cos, angles.azimuth);
            for p in 0..LOBES {
                azimuths[p] = own[p].1.or_where_not(m.is_section, azimuths[p]);
                colours[p] = own[p].0.or_where_not(m.is_section, colours[p]);
            }
        }
        let (mut value, mut pdf) = (V3::splat(Vec3::ZERO), F::splat(0.0));
        let mut sent = [F::splat(0.0); LOBES];
        for p in 0..LOBES {
            let k = kernels[p] * azimuths[p];
            value = colours[p].scaled_add(k, value);
            pdf = k.mul_add(self.draws[p], pdf);
            sent[p] = k * colours[p].sum();
        }
        let own = optics.balanced(&self.material, angles.cos);
        let scale = self.out.scale.times(own.scale).scaled(angles.cos);
        let mean = own.scale.sum() * F::splat(1.0 / 3.0);
        Scattered {
            value: value.times(scale),
            pdf: pdf * mean * angles.cos,
            angles,
            sent,
        }
    }

    /// Draws where light comes from, for lanes of a mask.
    #[inline(always)]
    pub fn turn(&self, optics: &Optics, rng: &mut LaneRng<F::Ints>, mask: F::Mask) -> Turn<F> {
        let one = F::splat(1.0);
        let m = &self.material;
        let [u_lobe, u_radius, u_angle] = rng.units(mask);
        let lobe = pick(&self.shares, u_lobe);
        let blur = of_lobe(lobe, &m.blurs);

        // The inclination: by the blur, kept in proportion to what the balance
        // makes of it.
        let (mut sin, mut cos) = (F::splat(0.0), one);
        let mut left = mask;
        for _ in 0..MAX_TRIES {
            let [u, v, keep] = rng.units(left);
            let turns = normal(u, v) * blur * F::splat(1.0 / TAU);
            let (s, c) = sin_cos_of_turns(turns - turns.floor());
            let drawn_sin = clamp(s * self.cos_out - c * self.sin_out);
            let drawn_cos = c.mul_add(self.cos_out, s * self.sin_out).abs().min(one);
            sin = drawn_sin.or_where_not(left, sin);
            cos = drawn_cos.or_where_not(left, cos);
            let drawing = optics.mean_scale(m, drawn_cos) * drawn_cos * drawn_cos;
            left = left & !(keep * m.max_drawn).below(drawing);
            if !left.any() {
                break;
            }
        }
        let pair = self.pair(sin, cos);
        let crossing = self.crossing(pair.mean_cos);

        // The azimuth: about where the lobe leaves, or anywhere.
        let about = normal(u_radius, u_angle) * m.azimuth_blur;
        let anywhere = F::splat(PI) - u_angle * F::splat(TAU);
        let exits = [
            crossing.exit_azimuth(0, self.gamma_i),
            crossing.exit_azimuth(1, self.gamma_i),
            crossing.exit_azimuth(2, self.gamma_i),
        ];
        let straight = F::splat(0.0);
        let mean = of_lobe(lobe, &[exits[0], exits[1], exits[2], straight])
            .or_where_not(m.is_dielectric, straight);
        let word = F::Ints::splat;
        let even_dielectric = m.is_dielectric & lobe.equals(word(3));
        let even_fitted = !m.is_dielectric & lobe.equals(word(0));
        let mut azimuth = wrap(anywhere.or_where_not(even_dielectric | even_fitted, mean + about));
        if self.has_sections(optics, mask) {
            let traced = m.is_section & !lobe.equals(word(3));
            let more = [rng.units(mask & traced), rng.units(mask & traced)];
            let drawn = m.section.azimuth(optics, lobe, pair.mean_cos, more);
            let drawn = drawn.or_where_not(traced, wrap(anywhere));
            azimuth = drawn.or_where_not(m.is_section, azimuth);
        }

        let (s, c) = sin_cos(azimuth);
        let across = self.forward.scaled(c * cos);
        let across = self.side.scaled_add(s * cos, across);
        let direction = self.tangent.scaled_add(sin, across);
        let length = direction.dot(direction);
        let angles = Angles { sin, cos, azimuth };
        let scattered = self.scattered(optics, angles, &pair, &crossing, mask);
        let some = F::splat(0.0).below(scattered.pdf);
        let per = (one / scattered.pdf).or_where_not(some, F::splat(0.0));
        Turn {
            // One step toward unit length, against rounding.
            direction: direction.scaled(length.mul_add(F::splat(-0.5), F::splat(1.5))),
            weight: scattered.value.scaled(per),
            scattered,
        }
    }

    /// The unit normal of the surface where light leaves toward a direction: see
    /// [`organza_scatter::NearField::exit_normal`].
    #[inline(always)]
    pub fn exit_normal(&self, toward: &Scattered<F>, [u_lobe, u_place]: [F; 2]) -> V3<F> {
        let one = F::splat(1.0);
        let total = toward.sent[0] + toward.sent[1] + toward.sent[2] + toward.sent[3];
        let lobe = pick(&toward.sent, u_lobe * total);
        let exits = &self.exit_normals;
        let s = u_place + u_place - one;
        let spread = atan2(s, (one - s * s).max(F::splat(0.0)).sqrt());
        let anywhere = toward.angles.azimuth + spread;
        let word = F::Ints::splat;
        // Of fibres that are not round only R.
        let resolved = (self.material.is_dielectric & !lobe.equals(word(3)))
            | (self.material.is_section & lobe.equals(word(0)));
        let angle = of_lobe(lobe, &[exits[0], exits[1], exits[2], anywhere])
            .or_where_not(resolved, anywhere);
        let aside = wrap(angle - toward.angles.azimuth)
            .max(F::splat(-FRAC_PI_2))
            .min(F::splat(FRAC_PI_2));
        let (s, c) = sin_cos(wrap(toward.angles.azimuth + aside));
        self.side.scaled_add(s, self.forward.scaled(c))
    }
}

#[inline(always)]
fn clamp<F: Floats>(x: F) -> F {
    x.max(F::splat(-1.0)).min(F::splat(1.0))
}

/// `exp(-x^2 / 2)`.
#[inline(always)]
fn bell<F: Floats>(x: F) -> F {
    exp(x * x * F::splat(-0.5))
}

/// A standard normal number.
#[inline(always)]
fn normal<F: Floats>(u: F, v: F) -> F {
    let half_square = minus_ln(positive(u));
    let (_, cos) = sin_cos_of_turns(v);
    (half_square + half_square).sqrt() * cos
}

/// An angle brought to between about -pi and pi.
#[inline(always)]
fn wrap<F: Floats>(angle: F) -> F {
    let turns = (angle * F::splat(0.5 * FRAC_1_PI) + F::splat(0.5)).floor();
    turns.mul_add(F::splat(-TAU), angle)
}

#[inline(always)]
fn sin_cos<F: Floats>(angle: F) -> (F, F) {
    let turns = angle * F::splat(0.5 * FRAC_1_PI);
    sin_cos_of_turns(turns - turns.floor())
}

/// The index at which the sum of parts first exceeds `left`, never of a part
/// that is zero unless all are.
#[inline(always)]
fn pick<F: Floats>(parts: &[F; LOBES], mut left: F) -> F::Ints {
    let word = F::Ints::splat;
    let zero = F::splat(0.0);
    let mut chosen = word(0);
    let mut open = !zero.below(zero);
    for p in 0..LOBES {
        let part = parts[p];
        let here = open & zero.below(part);
        chosen = word(p as u32).or_where_not(here, chosen);
        left = (left - part).or_where_not(here, left);
        open = open & !(here & left.below(zero));
    }
    chosen
}

/// The number of a lobe.
#[inline(always)]
fn of_lobe<F: Floats>(lobe: F::Ints, all: &[F; LOBES]) -> F {
    let is = |p: u32| lobe.equals(F::Ints::splat(p));
    let late = all[2].or_where_not(is(2), all[3]);
    all[0].or_where_not(is(0), all[1].or_where_not(is(1), late))
}
