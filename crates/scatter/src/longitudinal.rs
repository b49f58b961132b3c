//! Blur of the inclination: symmetric, energy conserving, and drawn exactly.
//!
//! A smooth fibre sends theta to -theta. A rough one spreads that by a Gaussian
//! in the angle, folded back at the ends of `[-pi/2, pi/2]`, which leaves it
//! symmetric in its two angles and of unit integral over either. What a fibre
//! needs, though, is a symmetric function f whose integral of `f cos^2 theta_i`
//! over the angle is one: light arrives over solid angle (one cosine) on a
//! foreshortened cylinder (the other). Dividing by a cosine, as hair models do,
//! gives up one of the two properties. [`Balance`] keeps both: it scales the
//! kernel by c(theta_i) c(theta_o), with the one positive function c for which
//! all integrals are one [Sinkhorn1967].

use crate::cone_table::node;
use crate::inclination_pair::InclinationPair;
use glam::{Vec3, Vec4};
use organza_basis::{PathRng, Rgb};
use organza_lanes::math::{atan2, bell, wrap};
use organza_lanes::{Floats, Mask};
use std::f32::consts::{FRAC_PI_2, PI, TAU};

/// Least deviation of a blur, half a degree: below it, tables would have to be
/// finer than anything visible.
pub const MIN_BLUR_RAD: f32 = 0.0087;
/// Greatest deviation of a longitudinal blur, so that one fold at each end is
/// all that single precision sees.
pub const MAX_BLUR_RAD: f32 = 0.6;
/// The same in the whole degrees that files take.
pub const MAX_BLUR_DEG: f32 = 34.0;

/// The deviation of a longitudinal blur, with what its density needs of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Blur {
    /// Radians.
    pub deviation_rad: f32,
    inverse: f32,
    /// Cosine of how near to an end folds matter: six deviations, beyond which
    /// they are below 1e-7.
    fold_cos: f32,
}

impl Blur {
    /// A deviation, brought into `[MIN_BLUR_RAD, MAX_BLUR_RAD]`.
    pub fn new(deviation_rad: f32) -> Blur {
        let deviation_rad = deviation_rad.clamp(MIN_BLUR_RAD, MAX_BLUR_RAD);
        Blur {
            deviation_rad,
            inverse: 1.0 / deviation_rad,
            fold_cos: (6.0 * deviation_rad).min(PI).cos(),
        }
    }
}

/// Two inclinations, as the blur sees them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inclinations {
    /// theta_in + theta_out: zero on the specular cone.
    sum_rad: f32,
    /// Sine and cosine of the same after one fold at the nearer end.
    folded: [f32; 2],
    /// Cosine of the mean inclination (theta_out - theta_in) / 2, at which light
    /// passes the fibre.
    pub mean_cos: f32,
}

impl Inclinations {
    /// From sines and cosines of theta_in and of theta_out.
    pub fn new(inclination_in: [f32; 2], inclination_out: [f32; 2]) -> Inclinations {
        let pair = InclinationPair::new(inclination_in, inclination_out);
        let [sin_sum, cos_sum] = pair.sum;
        Inclinations {
            sum_rad: atan2(sin_sum, cos_sum),
            folded: pair.folded,
            mean_cos: pair.mean_cos,
        }
    }

    /// Density per radian of theta_in given theta_out, symmetric in the two, with
    /// unit integral over either.
    pub fn density(&self, blur: &Blur) -> f32 {
        let [sin, cos] = self.folded;
        let folds = cos > blur.fold_cos;
        let fold_rad = if folds { atan2(sin, cos) } else { 0.0 };
        folded_gaussian([self.sum_rad, fold_rad], blur.inverse, folds)
    }

    /// [`Inclinations::density`] of the four blurs of a dielectric. Where they are
    /// b, b / 2, 2 b and 2 b, as no limit has changed, one exponential is all of
    /// them: its fourth and sixteenth power are the narrower ones.
    pub fn densities(&self, blurs: &[Blur; 4], geometric: bool) -> [f32; 4] {
        // Only the widest can fold where the narrower do not.
        if !geometric || self.folded[1] > blurs[2].fold_cos {
            return blurs.map(|b| self.density(&b));
        }
        let wide = self.density(&blurs[2]);
        let peak = |b: &Blur| INVERSE_SQRT_TAU * b.inverse;
        let q = wide / peak(&blurs[2]);
        let q4 = (q * q) * (q * q);
        let q16 = (q4 * q4) * (q4 * q4);
        [peak(&blurs[0]) * q4, peak(&blurs[1]) * q16, wide, wide]
    }
}

const INVERSE_SQRT_TAU: f32 = 0.398_942_3;

/// Draws sine and cosine of theta_in with density [`Inclinations::density`] from
/// a standard normal number, for sine and cosine of theta_out.
///
/// Turned by a sum with -theta_out: folding at an end keeps the sine and changes
/// the sign of the cosine, however often it is done.
pub fn folded_gaussian_sample([sin_out, cos_out]: [f32; 2], blur: &Blur, normal: f32) -> [f32; 2] {
    let (sin, cos) = (blur.deviation_rad * normal).sin_cos();
    [
        (sin * cos_out - cos * sin_out).clamp(-1.0, 1.0),
        (cos * cos_out + sin * sin_out).abs().min(1.0),
    ]
}

/// Density per radian of a Gaussian at an angle, and at the same after a fold where that matters,
/// for one over its deviation.
#[inline(always)]
pub(crate) fn folded_gaussian<F: Floats>(angles: [F; 2], inverse: F, folds: F::Mask) -> F {
    let mut value = bell(angles[0] * inverse);
    if folds.any() {
        value = (value + bell(angles[1] * inverse)).or_where_not(folds, value);
    }
    value * inverse * F::splat(INVERSE_SQRT_TAU)
}

/// Density per radian of a Gaussian around the circle, of any angle from its mean, for its
/// deviation, up to pi / 2, and one over it. Lanes outside the mask may get anything.
#[inline(always)]
pub(crate) fn wrapped_gaussian<F: Floats>(
    apart: F,
    [deviation, inverse]: [F; 2],
    mask: F::Mask,
) -> F {
    let x = wrap(apart).abs();
    let mut value = bell(x * inverse);
    let around = F::splat(TAU) - x;
    let seen = around.below(deviation * F::splat(6.0));
    if (mask & seen).any() {
        let more = bell(around * inverse) + bell((x + F::splat(TAU)) * inverse);
        value = (value + more).or_where_not(seen, value);
    }
    value * inverse * F::splat(INVERSE_SQRT_TAU)
}

/// The scale c(theta) of a fibre's lobes, even in theta, per colour channel, and
/// what drawing an inclination needs of it.
#[derive(Clone, Debug)]
pub struct Balance {
    /// Over cosines from 0 to 1, without what `near_axis` makes of them.
    nodes: Vec<Balanced>,
    /// Blur of the first lobe: the reflection, which is all there is near the axis.
    blur_rad: f32,
    /// No less than [`Balanced::drawing`] anywhere.
    most: f32,
}

/// A [`Balance`] at an inclination theta.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balanced {
    /// c(theta), per channel.
    pub scale: Vec3,
    /// Per lobe, the integral over theta_i of `K_p(theta_i, theta) c(theta_i)
    /// cos^2 theta_i`, c being the mean over channels: what the density of
    /// [`Balance::sample`] is divided by.
    pub norms: Vec4,
}

impl Balanced {
    /// `c(theta) cos^2 theta`, by which [`Balance::sample`] accepts.
    fn drawing(&self, cos: f32) -> f32 {
        self.mean_scale() * cos * cos
    }

    /// c(theta), mean over channels.
    pub fn mean_scale(&self) -> f32 {
        self.scale.element_sum() * (1.0 / 3.0)
    }
}

impl Balance {
    /// Balances `sum_p K_p(theta_i, theta_o) energy_p(cos theta_d)` for the
    /// blurs of the kernels K_p, four at most, and the energies that lobes of no
    /// absorption carry at the mean inclination theta_d = (theta_o - theta_i) / 2.
    ///
    /// The integrals are one to 1e-3, and to 1e-2 within a few degrees of the
    /// fibre's axis (tested).
    pub fn new<const N: usize>(blurs: [Blur; N], energies: impl Fn(f32) -> [Rgb; N]) -> Balance {
        let blur_rad = blurs[0].deviation_rad;
        let deviations = blurs.iter().map(|b| b.deviation_rad);
        let narrowest = deviations.fold(MAX_BLUR_RAD, f32::min);
        // The midpoint rule on folded Gaussians errs by exp(-2 (pi b / step)^2):
        // below 1e-8 at two nodes per deviation.
        let half = (FRAC_PI_2 / narrowest * 2.0).ceil().max(45.0) as usize;
        let step = FRAC_PI_2 / half as f32;
        let angles: Vec<[f32; 2]> = (0..half)
            .map(|i| ((i as f32 + 0.5) * step).sin_cos().into())
            .collect();
        // c is even: fold columns for -theta onto those for theta.
        let mut matrix = vec![Vec3::ZERO; half * half];
        for i in 0..half {
            for j in 0..half {
                let [sin, cos] = angles[j];
                for sin in [sin, -sin] {
                    let pair = Inclinations::new([sin, cos], angles[i]);
                    let at = &mut matrix[i * half + j];
                    for (e, b) in energies(pair.mean_cos).iter().zip(&blurs) {
                        *at += e.0 * pair.density(b);
                    }
                }
            }
        }
        let widths = angles.iter().map(|a| a[1].max(blur_rad));
        let mut c: Vec<Vec3> = widths.map(|width| Vec3::splat(1.0 / width)).collect();
        // Each pass halves the error; what is left is rounding.
        for _ in 0..24 {
            let pairs = c.iter().zip(&angles);
            let weighted = pairs.map(|(c, a)| *c * (step * a[1] * a[1]));
            let weighted: Vec<Vec3> = weighted.collect();
            for (c, row) in c.iter_mut().zip(matrix.chunks(half)) {
                let integral: Vec3 = row.iter().zip(&weighted).map(|(k, w)| *k * *w).sum();
                *c = (*c / integral).map(f32::sqrt);
            }
        }
        // A table over the cosine from the midpoints, by cubics of what is near
        // one: even about zero, and continued by a parabola past the pole, where
        // the lobes' energies have a slope.
        let inside = |i: usize| c[i] * angles[i][1].hypot(blur_rad);
        let [a, b, d] = [1, 2, 3].map(|k| inside(half - k));
        let at = |i: isize| match i - half as isize {
            0 => 3.0 * a - 3.0 * b + d,
            1.. => 6.0 * a - 8.0 * b + 3.0 * d,
            _ => inside(i.max(-1 - i) as usize),
        };
        let count = (24.0 / narrowest).ceil() as usize;
        let cosine = |k: usize| k as f32 / count as f32;
        let scales = (0..=count).map(|k| {
            let x = cosine(k).acos() / step - 0.5;
            let i = x.floor() as isize;
            let t = x - x.floor();
            let (p, q, r) = (t + 1.0, t - 1.0, t - 2.0);
            at(i - 1) * (-t * q * r / 6.0)
                + at(i) * (0.5 * p * q * r)
                + at(i + 1) * (-0.5 * p * t * r)
                + at(i + 2) * (p * t * q / 6.0)
        });
        let bare = |scale| Balanced {
            scale,
            norms: Vec4::ZERO,
        };
        let mut balance = Balance {
            nodes: scales.map(bare).collect(),
            blur_rad,
            most: 0.0,
        };
        // The norms by the same rule. Kernels reach from theta_o as far as the
        // widest; they are even in both angles.
        let weight = |a: &[f32; 2]| step * balance.at(a[1]).drawing(a[1]);
        let weights: Vec<f32> = angles.iter().map(weight).collect();
        let widest = blurs.iter().fold(0.0f32, |w, b| w.max(b.deviation_rad));
        let reach = (7.0 * widest / step) as isize + 1;
        let norms = (0..=count).map(|k| {
            let cos = cosine(k);
            let middle = (cos.acos() / step) as isize;
            let low = (middle - reach).max(-(half as isize));
            let high = (middle + reach).min(half as isize);
            let mut norms = Vec4::ZERO;
            for j in low..high {
                let at = j.max(-1 - j) as usize;
                let [sin, cos_in] = angles[at];
                let sin_in = if j < 0 { sin } else { -sin };
                let sin_out = (1.0 - cos * cos).max(0.0).sqrt();
                let pair = Inclinations::new([sin_in, cos_in], [sin_out, cos]);
                for (p, b) in blurs.iter().enumerate() {
                    norms[p] += weights[at] * pair.density(b);
                }
            }
            norms / cos.hypot(blur_rad)
        });
        let norms: Vec<Vec4> = norms.collect();
        for (node, norms) in balance.nodes.iter_mut().zip(norms) {
            node.norms = norms;
        }
        // A hundredth more than at any node is room for what lies between.
        let drawing = |k| balance.at(cosine(k)).drawing(cosine(k));
        balance.most = 1.01 * (0..=count).map(drawing).fold(0.0, f32::max);
        balance
    }

    /// Nodes of the table of c over the cosine, both ends included.
    pub(crate) fn nodes(&self) -> usize {
        self.nodes.len()
    }

    /// A node of the table, without what is made of it near the axis.
    pub(crate) fn node(&self, i: usize) -> &Balanced {
        &self.nodes[i]
    }

    /// No less than the mean of c over channels times the squared cosine.
    pub(crate) fn most(&self) -> f32 {
        self.most
    }

    /// All of it at an inclination.
    pub fn at(&self, cos_theta: f32) -> Balanced {
        let (i, t) = node(cos_theta, self.nodes.len());
        let (a, b) = (&self.nodes[i], &self.nodes[i + 1]);
        // What is left of both without this is even enough to interpolate.
        let near_axis = (cos_theta * cos_theta + self.blur_rad * self.blur_rad).sqrt();
        Balanced {
            scale: a.scale.lerp(b.scale, t) / near_axis,
            norms: a.norms.lerp(b.norms, t) * near_axis,
        }
    }

    /// Draws sine and cosine of theta_i with density `K_p(theta_i, theta_o)
    /// c(theta_i) cos^2 theta_i` over its norm, c being the mean over channels,
    /// for the sine and cosine of theta_o: as a fibre without absorption sends
    /// light of lobe p, so that what is left to weigh is near one.
    ///
    /// By rejection, in 1.3 to 1.5 tries on average over what a tangle of fibres
    /// shows, and along a fibre in about 1.5 over the blur.
    pub fn sample(&self, out: [f32; 2], blur: &Blur, rng: &mut PathRng) -> [f32; 2] {
        loop {
            let normals = rng.normal2();
            for normal in [normals.x, normals.y] {
                let drawn = folded_gaussian_sample(out, blur, normal);
                if rng.unit() * self.most < self.at(drawn[1]).drawing(drawn[1]) {
                    return drawn;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::Moments;
    use organza_basis::hypothesis::t_test;

    #[test]
    fn powers_of_one_exponential_are_all_four() {
        for width in [0.02f32, 0.1, 0.25] {
            let blurs = [1.0, 0.5, 2.0, 2.0].map(|k| Blur::new(k * width));
            for i in -80..=80 {
                for o in [-1.5f32, -0.7, 0.0, 1.2] {
                    let theta = i as f32 / 80.0 * FRAC_PI_2;
                    let pair = Inclinations::new(theta.sin_cos().into(), o.sin_cos().into());
                    let got = pair.densities(&blurs, true);
                    for (g, b) in got.into_iter().zip(&blurs) {
                        let want = pair.density(b);
                        assert!((g - want).abs() < 2e-4 * want + 1e-6, "{width} {theta} {o}");
                    }
                }
            }
        }
    }

    #[test]
    fn balanced_kernels_integrate_to_one() {
        for blurs in [[0.14f32, 0.07, 0.28], [0.02, 0.01, 0.04], [0.5, 0.25, 0.6]] {
            let energies = |cos: f32| {
                let r = (1.0 - cos).powi(3);
                [r, 0.7 * (1.0 - r), 0.3 * (1.0 - r)].map(Rgb::splat)
            };
            let blurs = blurs.map(Blur::new);
            let balance = Balance::new(blurs, energies);
            for theta_deg in [0.0f32, 17.0, 60.0, 80.0, 85.0, 88.0, 89.9, 90.0] {
                let theta_out = theta_deg.to_radians();
                let c_out = balance.at(theta_out.cos()).scale.x;
                let n = 20_000;
                let integral: f64 = (0..n)
                    .map(|i| {
                        let t = ((i as f32 + 0.5) / n as f32 - 0.5) * PI;
                        let pair =
                            Inclinations::new(t.sin_cos().into(), theta_out.sin_cos().into());
                        let energies = energies(pair.mean_cos);
                        let parts = energies.iter().zip(&blurs);
                        let sum: f32 = parts.map(|(e, b)| e.0.x * pair.density(b)).sum();
                        f64::from(c_out * balance.at(t.cos()).scale.x * t.cos().powi(2) * sum)
                    })
                    .sum::<f64>()
                    * std::f64::consts::PI
                    / f64::from(n);
                let error = (integral - 1.0).abs();
                assert!(error < 2e-3, "{blurs:?}, {theta_deg} degrees: {integral}");
            }
        }
    }

    /// Of one lobe that sends everything, what is drawn carries what is sent.
    #[test]
    fn balanced_draws_carry_even_weights() {
        let blur = Blur::new(0.3);
        let balance = Balance::new([blur], |_| [Rgb::WHITE]);
        let mut rng = PathRng::from_seed(64);
        for theta_deg in [0.0f32, 40.0, 75.0, 88.0] {
            let out: [f32; 2] = theta_deg.to_radians().sin_cos().into();
            let balanced = balance.at(out[1]);
            let weight = balanced.scale.x * balanced.norms.x;
            assert!((weight - 1.0).abs() < 2e-3, "{theta_deg} degrees: {weight}");
            // Its mean sine by quadrature, and drawn.
            let n = 20_000;
            let mean: f64 = (0..n)
                .map(|i| {
                    let theta = ((i as f32 + 0.5) / n as f32 - 0.5) * PI;
                    let pair = Inclinations::new(theta.sin_cos().into(), out);
                    let drawing = balance.at(theta.cos()).drawing(theta.cos());
                    let density = pair.density(&blur) * drawing / balanced.norms.x;
                    f64::from(theta.sin() * density) * std::f64::consts::PI / f64::from(n)
                })
                .sum();
            let drawn: Moments = (0..4000)
                .map(|_| f64::from(balance.sample(out, &blur, &mut rng)[0]))
                .collect();
            let verdict = t_test(&drawn, mean);
            let p_value = verdict.p_value;
            assert!(p_value > 1e-4, "seed 64, {theta_deg}: {drawn:?} {mean}");
            // The twin draws by the blur alone: toward the axis its weights are
            // those of few.
            let twin: Moments = (0..4000)
                .map(|_| {
                    let blurred = folded_gaussian_sample(out, &blur, rng.normal2().x);
                    f64::from(balanced.scale.x * balance.at(blurred[1]).drawing(blurred[1]))
                })
                .collect();
            assert!(twin.variance() > 1e-3, "seed 64, {theta_deg}: {twin:?}");
        }
    }
}
