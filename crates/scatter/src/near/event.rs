//! Light at the surface of a fibre at a known offset, of one path or of many: the near field.
//
// Loops over lobes go by index: the compiler may leave iterators of vectors without
// the back end's instructions.
#![allow(clippy::needless_range_loop)]

use super::LOBES;
use super::crossing::{Crossing, incidence};
use super::frame::Frame;
use super::optics::{Balanced, Material, Optics};
use crate::inclination_pair::InclinationPair;
use crate::longitudinal::{folded_gaussian, wrapped_gaussian};
use glam::Vec3;
use organza_lanes::math::{Draws, V3, asin, atan2, clamp, normal, sin_cos, sin_cos_of_turns, wrap};
use organza_lanes::{Floats, Ints, Mask};
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Tries to draw an inclination before the last one is taken.
const MAX_TRIES: u32 = 2048;

/// An event in every lane.
#[derive(Clone, Copy)]
pub struct Event<F: Floats> {
    /// Of the fibre and the walk.
    pub frame: Frame<F>,
    /// Where across the fibre's width it was met, in `[-1, 1]`.
    pub offset: F,
    gamma_i: F,
    material: Material<F>,
    out: Balanced<F>,
    /// Probability of drawing each lobe, and that over its norm.
    shares: [F; LOBES],
    draws: [F; LOBES],
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
    /// Unit.
    pub direction: V3<F>,
    /// What the walk's throughput is multiplied by.
    pub weight: V3<F>,
    /// What the event does with light from there.
    pub scattered: Scattered<F>,
}

impl<F: Floats> Event<F> {
    /// The event of lanes of a mask, with fibres that were met at an offset.
    #[inline(always)]
    pub fn new(
        optics: &Optics,
        material: Material<F>,
        (frame, offset): (Frame<F>, F),
        mask: F::Mask,
    ) -> Self {
        let one = F::splat(1.0);
        let cos_out = frame.cos_out;
        let drawing = drawing_cosine(cos_out, material.blurs[0]);
        let mut event = Event {
            frame,
            offset,
            gamma_i: incidence(offset),
            material,
            out: optics.balanced(&material, cos_out),
            shares: [F::splat(0.0); LOBES],
            draws: [F::splat(0.0); LOBES],
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
        let crossing = event.crossing(cos_out);
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
            let white = V3::splat(Vec3::ONE);
            let r = schlick(m.absorption, mean_cos);
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
        wrapped_gaussian(apart, [m.azimuth_blur, m.inverse_azimuth_blur], mask)
    }

    /// The inclination of a direction with that of the way.
    #[inline(always)]
    fn pair(&self, sin: F, cos: F) -> InclinationPair<F> {
        InclinationPair::new([sin, cos], [self.frame.sin_out, self.frame.cos_out])
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
            let own = mask & m.fold_cosines[p].below(cos);
            all[p] = folded_gaussian([sum, at_fold], inverse, own);
        }
        // The rest is as wide as TRT.
        all[3] = all[2];
        all
    }

    /// Light from a direction.
    #[inline(always)]
    pub fn toward(&self, optics: &Optics, w_in: V3<F>, mask: F::Mask) -> Scattered<F> {
        let one = F::splat(1.0);
        let frame = &self.frame;
        let (x, y) = (w_in.dot(frame.forward), w_in.dot(frame.side));
        let angles = Angles {
            sin: clamp(w_in.dot(frame.tangent)),
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
    pub fn turn(&self, optics: &Optics, rng: &mut impl Draws<F>, mask: F::Mask) -> Turn<F> {
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
            let (sin_out, cos_out) = (self.frame.sin_out, self.frame.cos_out);
            // Folded at an end the sine stays and the cosine changes its sign.
            let drawn_sin = clamp(s * cos_out - c * sin_out);
            let drawn_cos = c.mul_add(cos_out, s * sin_out).abs().min(one);
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
        let across = self.frame.across([s * cos, c * cos]);
        let direction = self.frame.tangent.scaled_add(sin, across);
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

    /// Unit outward normal of the surface point, on the fibre's cross-section through the
    /// event, where light leaves toward a direction by a lobe drawn in proportion to what it
    /// sends there, so that the mean over draws is that over lobes.
    ///
    /// R, TT and TRT of a round dielectric leave where a smooth cylinder sends them, and so
    /// does R of another section; lobes whose paths are not resolved leave evenly over the
    /// width that faces the direction. Where blur turns light into the fibre it leaves from
    /// the nearest point of the outline instead, so that no ray starts into its own fibre.
    #[inline(always)]
    pub fn exit_normal(&self, toward: &Scattered<F>, [u_lobe, u_place]: [F; 2]) -> V3<F> {
        let one = F::splat(1.0);
        let total = toward.sent[0] + toward.sent[1] + toward.sent[2] + toward.sent[3];
        let lobe = pick(&toward.sent, u_lobe * total);
        let exits = &self.exit_normals;
        let s = u_place + u_place - one;
        let anywhere = toward.angles.azimuth + asin(s);
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
        self.frame.across([s, c])
    }
}

/// Cosine of the inclination at which lobes are drawn: that of the way, kept as far from zero as
/// the blur of R moves the mean inclination. Exactly along the fibre a smooth one only reflects,
/// while a rough one also transmits.
#[inline(always)]
pub(crate) fn drawing_cosine<F: Floats>(cos_out: F, blur: F) -> F {
    let square = cos_out.mul_add(cos_out, blur * blur * F::splat(0.25));
    square.min(F::splat(1.0)).sqrt()
}

/// Schlick's reflectance per channel for that at normal incidence.
#[inline(always)]
pub(crate) fn schlick<F: Floats>(normal: V3<F>, cos: F) -> V3<F> {
    let one = F::splat(1.0);
    let x = (one - cos).max(F::splat(0.0)).min(one);
    let square = x * x;
    let fifth = square * square * x;
    (V3::splat(Vec3::ONE) - normal).scaled_add(fifth, normal)
}

/// The index at which the sum of parts first exceeds `left`, never of a part
/// that is zero unless all are.
#[inline(always)]
pub(crate) fn pick<F: Floats>(parts: &[F; LOBES], mut left: F) -> F::Ints {
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
