//! The proofs that every model passes, for models of your own too.
//!
//! A density that is off by two percent, a transposed frame, swapped arguments or
//! a missing cosine leave pictures that look fine. Directions here are oblique on
//! purpose: about the coordinate axes half of these mistakes vanish.
//!
//! ```
//! use glam::Vec3;
//! use organza_basis::{PathRng, Rgb, warp};
//! use organza_scatter::proofs::{Proof, oblique};
//! use organza_scatter::{Lobe, LobeSample};
//! # use organza_basis::Frame;
//!
//! /// Scatters about the way the walk goes, with the mean cosine g.
//! struct HenyeyGreenstein { g: f32 }
//!
//! impl Lobe for HenyeyGreenstein {
//!     fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
//!         Rgb::splat(self.pdf(w_out, w_in))
//!     }
//!     fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
//!         let g = self.g;
//!         let root = (1.0 + g * g + 2.0 * g * w_out.dot(w_in)).sqrt();
//!         (1.0 - g * g) * warp::UNIFORM_SPHERE_PDF / (root * root * root)
//!     }
//!     fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
//!         // ...
//! #       let (g, u) = (self.g, rng.unit2());
//! #       let s = (1.0 - g * g) / (1.0 - g + 2.0 * g * u.x);
//! #       let cos = ((1.0 + g * g - s * s) / (2.0 * g)).clamp(-1.0, 1.0);
//! #       let around = warp::direction_from_angles(cos.acos(), std::f32::consts::TAU * u.y);
//! #       let w_in = Frame::from_normal(-w_out).world_from_frame(around);
//! #       Some(LobeSample { w_in, weight: Rgb::WHITE, pdf: self.pdf(w_out, w_in) })
//!     }
//! }
//!
//! // The ten lines of its test.
//! # fn main() -> Result<(), organza_scatter::proofs::Flaw> {
//! let lobe = HenyeyGreenstein { g: 0.6 };
//! let proof = Proof { name: "Henyey-Greenstein", tests: 10, ..Proof::DEFAULT };
//! for w_out in oblique() {
//!     proof.lobe(&lobe, w_out)?;
//! }
//! proof.reciprocal(&lobe, |_extinction_toward| 1.0)?;
//! // A twin that must not pass: its density is that of another g.
//! struct Twin(HenyeyGreenstein);
//! # impl Lobe for Twin {
//! #     fn eval(&self, o: Vec3, i: Vec3) -> Rgb { self.0.eval(o, i) }
//! #     fn pdf(&self, o: Vec3, i: Vec3) -> f32 { HenyeyGreenstein { g: 0.55 }.pdf(o, i) }
//! #     fn sample(&self, o: Vec3, rng: &mut PathRng) -> Option<LobeSample> { self.0.sample(o, rng) }
//! # }
//! assert!(proof.lobe(&Twin(lobe), oblique()[0]).is_err());
//! # Ok(())
//! # }
//! ```

use crate::{Lobe, MicroFlake};
use glam::Vec3;
use organza_basis::hypothesis::{SphereGrid, Verdict, sidak, t_test};
use organza_basis::{Moments, PathRng};

/// What a model got wrong, with everything needed to see it again.
#[derive(Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct Flaw(pub String);

impl std::fmt::Debug for Flaw {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

/// `Ok` when `holds`, otherwise the flaw described by `say`.
fn hold(holds: bool, say: impl FnOnce() -> String) -> Result<(), Flaw> {
    if holds { Ok(()) } else { Err(Flaw(say())) }
}

/// Axes and directions that no frame maps onto its own axes.
pub fn oblique() -> [Vec3; 5] {
    [
        Vec3::new(0.48, 0.36, 0.8),
        Vec3::new(-0.6, 0.64, -0.48),
        Vec3::new(0.02, -0.999, 0.03).normalize(),
        Vec3::new(0.7, 0.1, -0.7).normalize(),
        Vec3::Z,
    ]
}

/// Every direction that is likely to break something, about `axis`.
pub fn hard_directions(axis: Vec3) -> Vec<Vec3> {
    let mut all = vec![
        Vec3::X,
        Vec3::NEG_X,
        Vec3::Y,
        Vec3::NEG_Y,
        Vec3::Z,
        Vec3::NEG_Z,
    ];
    all.extend([axis, -axis]);
    for d in oblique() {
        let grazing = (axis + 1e-3 * d).normalize();
        let nearly_across = axis.cross(d).normalize_or(axis.any_orthonormal_vector());
        all.extend([d, -d, grazing, -grazing, nearly_across]);
        all.push((nearly_across + 1e-7 * axis).normalize());
    }
    all
}

/// A proof of one model, by what it needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Proof<'a> {
    /// Name, for messages.
    pub name: &'a str,
    /// Unit axis of what is narrow about it: cells of tests lie about this.
    pub pole: Vec3,
    /// Draws of each chi-square test.
    pub samples: u32,
    /// Statistical tests that are read together: each gets its share [Sidak1967]
    /// of the level, one false alarm in a thousand runs with a new seed.
    pub tests: usize,
    /// Relative error that the model states of itself, for its tables.
    pub floor: f64,
    /// Seed of the draws.
    pub seed: u64,
}

impl Proof<'_> {
    /// Fit for every build: a two-percent error of a density is found.
    pub const DEFAULT: Proof<'static> = Proof {
        name: "model",
        pole: Vec3::new(0.6, -0.64, 0.48),
        samples: 30_000,
        tests: 100,
        floor: 0.0,
        seed: 100,
    };

    fn passes(&self, v: Verdict) -> bool {
        v.p_value >= sidak(ALPHA, self.tests)
    }

    /// Proves a flake distribution: the area it shows, the normals it draws, the
    /// phase function, reciprocity, and hard directions.
    ///
    /// # Errors
    /// The first flaw found.
    pub fn flakes(&self, flakes: &impl MicroFlake) -> Result<(), Flaw> {
        let grid = SphereGrid::new(self.pole, 20, 24).admitting(1e-4 + self.floor);
        let mut rng = PathRng::from_seed(self.seed);
        for w_out in oblique() {
            let say = format!("{}, w_out {w_out}, seed {}", self.name, self.seed);
            let area = f64::from(flakes.projected_area(w_out));
            let by_quadrature =
                grid.integrate(|m| f64::from(w_out.dot(m).max(0.0) * flakes.ndf(m)));
            hold(
                (area - by_quadrature).abs() < (self.floor + 1e-4) * area,
                || format!("{say}: projected area {area} is {by_quadrature} by quadrature"),
            )?;
            let normals = grid.chi_square(
                self.samples,
                || Some(flakes.visible_normal_sample(w_out, &mut rng)),
                |m| f64::from(flakes.visible_normal_pdf(w_out, m)),
            );
            hold(self.passes(normals), || {
                format!("{say}: visible normals {normals:?}")
            })?;
            let integral = grid.integrate(|w| f64::from(flakes.eval(w_out, w)));
            hold((integral - 1.0).abs() < self.floor + 2e-4, || {
                format!("{say}: the phase function's integral is {integral}")
            })?;
            let phase = grid.chi_square(
                self.samples,
                || Some(flakes.sample(w_out, &mut rng)),
                |w| f64::from(flakes.eval(w_out, w)),
            );
            hold(self.passes(phase), || {
                format!("{say}: phase function {phase:?}")
            })?;
            for w_in in oblique() {
                let there = flakes.projected_area(w_out) * flakes.eval(w_out, w_in);
                let back = flakes.projected_area(w_in) * flakes.eval(w_in, w_out);
                hold(
                    (there - back).abs() <= 1e-4 * there.max(back) || w_in == w_out,
                    || format!("{say}: not reciprocal with {w_in}: {there} {back}"),
                )?;
            }
        }
        for w_out in hard_directions(self.pole) {
            let say = format!("{}, {w_out}", self.name);
            hold(flakes.projected_area(w_out) > 0.0, || {
                format!("{say}: shows no area")
            })?;
            for w_in in hard_directions(self.pole) {
                let f = flakes.eval(w_out, w_in);
                hold(f.is_finite() && f >= 0.0, || format!("{say}, {w_in}: {f}"))?;
            }
            let length = flakes.sample(w_out, &mut rng).length();
            hold((length - 1.0).abs() < 1e-5, || {
                format!("{say}: draws a direction of length {length}")
            })?;
        }
        Ok(())
    }

    /// Proves a lobe for one `w_out`: density, weights, energy, hard directions.
    ///
    /// # Errors
    /// The first flaw found.
    pub fn lobe(&self, lobe: &impl Lobe, w_out: Vec3) -> Result<(), Flaw> {
        let albedo = self.part_of_lobe(lobe, w_out)?;
        hold(albedo <= 1.005, || {
            format!("{}, w_out {w_out}: gains energy, {albedo}", self.name)
        })
    }

    /// The same of a lobe that is chosen among others and keeps energy only
    /// together with them. Answers with its integral.
    ///
    /// # Errors
    /// The first flaw found.
    pub fn part_of_lobe(&self, lobe: &impl Lobe, w_out: Vec3) -> Result<f64, Flaw> {
        let mut rng = PathRng::from_seed(self.seed);
        let say = format!("{}, w_out {w_out}, seed {}", self.name, self.seed);
        let grid = SphereGrid::new(self.pole, 20, 24);
        let mut weights = Moments::default();
        let mut drawn = Vec::new();
        let density = grid.chi_square(
            self.samples,
            || {
                let s = lobe.sample(w_out, &mut rng);
                weights.add(s.map_or(0.0, |s| f64::from(s.weight.0.x)));
                if drawn.len() < 200 {
                    drawn.extend(s);
                }
                s.map(|s| s.w_in)
            },
            |w| f64::from(lobe.pdf(w_out, w)),
        );
        hold(self.passes(density), || {
            format!("{say}: density {density:?}")
        })?;
        let albedo = grid.integrate(|w| f64::from(lobe.eval(w_out, w).0.x));
        // The quadrature is good to 1e-5 relative; a weight without variance is exact.
        let weight = t_test(&weights, albedo);
        hold(
            self.passes(weight) || (weights.mean - albedo).abs() < 2e-4,
            || {
                format!(
                    "{say}: mean weight {} of {albedo}: {weight:?}",
                    weights.mean
                )
            },
        )?;
        for s in drawn {
            let (pdf, eval) = (lobe.pdf(w_out, s.w_in), lobe.eval(w_out, s.w_in));
            // Single precision resolves angles about the pole no better than this.
            let across = self.pole.cross(s.w_in).length();
            let rounding = 1e-3 + 3e-7 / across.max(1e-6);
            hold((s.pdf - pdf).abs() <= rounding * pdf, || {
                format!("{say}: {s:?} has the density {pdf}")
            })?;
            let off = (s.weight * pdf - eval).0.abs().max_element();
            hold(off <= rounding * eval.max_component(), || {
                format!("{say}: {s:?} has the value {eval:?}")
            })?;
        }
        self.finite(lobe, w_out, &mut rng)?;
        Ok(albedo)
    }

    /// Proves that hard pairs of directions have finite, non-negative answers.
    ///
    /// # Errors
    /// The first flaw found.
    pub fn finite(&self, lobe: &impl Lobe, w_out: Vec3, rng: &mut PathRng) -> Result<(), Flaw> {
        let say = format!("{}, {w_out}", self.name);
        let opposite = [-w_out, w_out];
        for w_in in hard_directions(self.pole).into_iter().chain(opposite) {
            let (f, pdf) = (lobe.eval(w_out, w_in), lobe.pdf(w_out, w_in));
            hold(f.is_valid() && pdf.is_finite() && pdf >= 0.0, || {
                format!("{say}, {w_in}: {f:?}, density {pdf}")
            })?;
        }
        for s in (0..100).filter_map(|_| lobe.sample(w_out, rng)) {
            let valid = s.weight.is_valid() && s.pdf.is_finite() && s.pdf >= 0.0;
            hold(valid && (s.w_in.length() - 1.0).abs() < 1e-4, || {
                format!("{say}: {s:?}")
            })?;
        }
        Ok(())
    }

    /// Proves `extinction(a) eval(a, b) = extinction(b) eval(b, a)` to a
    /// thousandth for oblique pairs; of what blocks evenly the extinction is any
    /// constant.
    ///
    /// # Errors
    /// The first pair that differs.
    pub fn reciprocal(
        &self,
        lobe: &impl Lobe,
        extinction: impl Fn(Vec3) -> f32,
    ) -> Result<(), Flaw> {
        for a in oblique() {
            for b in oblique() {
                let there = lobe.eval(a, b) * extinction(a);
                let back = lobe.eval(b, a) * extinction(b);
                let off = (there - back).0.abs().max_element();
                hold(off <= 1e-3 * there.max_component() + 1e-6, || {
                    format!("{}: {a} to {b} {there:?}, back {back:?}", self.name)
                })?;
            }
        }
        Ok(())
    }
}

/// Level of a family of tests: one false alarm in a thousand runs with a new seed.
const ALPHA: f64 = 1e-3;

#[cfg(test)]
pub(crate) use in_tests::*;

/// Sizes for every run; larger with `ORGANZA_FULL=1`.
#[cfg(test)]
mod in_tests {
    use super::*;
    use organza_basis::Rgb;

    /// An albedo that no clamp hides.
    pub const GREY: Rgb = Rgb::splat(0.7);

    /// Draws of a test: `small`, or forty times that on demand.
    pub fn draws(small: u32) -> u32 {
        match std::env::var_os("ORGANZA_FULL") {
            Some(_) => small * 40,
            None => small,
        }
    }

    pub fn fails(v: Verdict, tests: usize) -> bool {
        assert!(!v.p_value.is_nan());
        v.p_value < sidak(ALPHA, tests)
    }

    /// Chi-square of a sampler against a density, about a pole, for one `w_out`.
    pub fn chi_square(
        pole: Vec3,
        samples: u32,
        sample: impl FnMut() -> Option<Vec3>,
        pdf: impl FnMut(Vec3) -> f64,
    ) -> Verdict {
        SphereGrid::new(pole, 20, 24).chi_square(samples, sample, pdf)
    }

    fn proof(name: &str, pole: Vec3, tests: usize) -> Proof<'_> {
        Proof {
            name,
            pole,
            tests,
            samples: draws(30_000),
            ..Proof::DEFAULT
        }
    }

    pub fn prove_flakes(name: &str, flakes: &impl MicroFlake, pole: Vec3, floor: f64) {
        let proof = Proof {
            floor,
            ..proof(name, pole, 100)
        };
        proof.flakes(flakes).unwrap();
    }

    pub fn prove_lobe(name: &str, lobe: &impl Lobe, pole: Vec3, w_out: Vec3, tests: usize) {
        proof(name, pole, tests).lobe(lobe, w_out).unwrap();
    }

    pub fn prove_part(name: &str, lobe: &impl Lobe, pole: Vec3, w_out: Vec3, tests: usize) {
        proof(name, pole, tests).part_of_lobe(lobe, w_out).unwrap();
    }

    pub fn prove_finite(name: &str, lobe: &impl Lobe, axis: Vec3, w_out: Vec3, rng: &mut PathRng) {
        proof(name, axis, 1).finite(lobe, w_out, rng).unwrap();
    }
}
