//! The proofs that every model passes, so that a new model's test is a list of
//! its parameters. Sizes are for every build; `ORGANZA_FULL=1` asks for more.

use crate::{Lobe, MicroFlake};
use glam::Vec3;
use organza_basis::hypothesis::{SphereGrid, Verdict, sidak, t_test};
use organza_basis::{Moments, PathRng, Rgb};

/// Level of a family of tests: one false alarm in a thousand runs with a new seed.
pub const ALPHA: f64 = 1e-3;

/// Draws of a test: `small`, or forty times that on demand.
pub fn draws(small: u32) -> u32 {
    match std::env::var_os("ORGANZA_FULL") {
        Some(_) => small * 40,
        None => small,
    }
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

/// Proves a flake distribution: area, normals, phase function.
///
/// `pole` is the axis of what is narrow about it; `floor` the relative error
/// of its projected area that the model states (tables).
pub fn prove_flakes(name: &str, flakes: &impl MicroFlake, pole: Vec3, floor: f64) {
    let grid = SphereGrid::new(pole, 20, 24).admitting(1e-4 + floor);
    let n = draws(30_000);
    let seed = 100;
    let mut rng = PathRng::from_seed(seed);
    for w_out in oblique() {
        let say = format!("{name}, w_out {w_out}, seed {seed}");
        let area = f64::from(flakes.projected_area(w_out));
        let by_quadrature = grid.integrate(|m| f64::from(w_out.dot(m).max(0.0) * flakes.ndf(m)));
        assert!(
            (area - by_quadrature).abs() < (floor + 1e-4) * area,
            "{say}: projected area {area} is {by_quadrature} by quadrature"
        );
        let normals = grid.chi_square(
            n,
            || Some(flakes.visible_normal_sample(w_out, &mut rng)),
            |m| f64::from(flakes.visible_normal_pdf(w_out, m)),
        );
        assert!(!fails(normals, 100), "{say}: visible normals {normals:?}");
        let integral = grid.integrate(|w| f64::from(flakes.eval(w_out, w)));
        assert!(
            (integral - 1.0).abs() < floor + 2e-4,
            "{say}: integral {integral}"
        );
        let phase = grid.chi_square(
            n,
            || Some(flakes.sample(w_out, &mut rng)),
            |w| f64::from(flakes.eval(w_out, w)),
        );
        assert!(!fails(phase, 100), "{say}: phase function {phase:?}");
        for w_in in oblique() {
            let there = flakes.projected_area(w_out) * flakes.eval(w_out, w_in);
            let back = flakes.projected_area(w_in) * flakes.eval(w_in, w_out);
            assert!(
                (there - back).abs() <= 1e-4 * there.max(back) || w_in == w_out,
                "{say}: not reciprocal with {w_in}: {there} {back}"
            );
        }
    }
    for w_out in hard_directions(pole) {
        assert!(flakes.projected_area(w_out) > 0.0, "{name}, {w_out}");
        for w_in in hard_directions(pole) {
            let f = flakes.eval(w_out, w_in);
            assert!(f.is_finite() && f >= 0.0, "{name}, {w_out}, {w_in}: {f}");
        }
        let w_in = flakes.sample(w_out, &mut rng);
        assert!((w_in.length() - 1.0).abs() < 1e-5, "{name}, {w_out}");
    }
}

/// Proves a lobe for one `w_out`: density, weight, albedo, finiteness.
pub fn prove_lobe(name: &str, lobe: &impl Lobe, pole: Vec3, w_out: Vec3, tests: usize) {
    let seed = 200;
    let mut rng = PathRng::from_seed(seed);
    let say = format!("{name}, w_out {w_out}, seed {seed}");
    let grid = SphereGrid::new(pole, 20, 24);
    let mut weights = Moments::default();
    let mut drawn = Vec::new();
    let density = grid.chi_square(
        draws(30_000),
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
    assert!(!fails(density, tests), "{say}: density {density:?}");
    let albedo = grid.integrate(|w| f64::from(lobe.eval(w_out, w).0.x));
    // A lobe chosen among others keeps energy only together with them.
    let alone = !name.starts_with("chosen");
    assert!(
        !alone || albedo <= 1.0 + 5e-3,
        "{say}: gains energy, {albedo}"
    );
    // The quadrature is good to 1e-5 relative; a weight without variance is exact.
    let weight = t_test(&weights, albedo);
    assert!(
        !fails(weight, tests) || (weights.mean - albedo).abs() < 2e-4,
        "{say}: mean weight {} albedo {albedo} {weight:?}",
        weights.mean
    );
    for s in drawn {
        let pdf = lobe.pdf(w_out, s.w_in);
        let eval = lobe.eval(w_out, s.w_in);
        assert!((s.pdf - pdf).abs() <= 1e-3 * pdf, "{say}: {s:?} {pdf}");
        let off = (s.weight * pdf - eval).0.abs().max_element();
        assert!(off <= 1e-3 * eval.max_component(), "{say}: {s:?} {eval:?}");
    }
    prove_finite(name, lobe, pole, w_out, &mut rng);
}

/// Every hard pair of directions gives finite, non-negative answers.
pub fn prove_finite(name: &str, lobe: &impl Lobe, axis: Vec3, w_out: Vec3, rng: &mut PathRng) {
    for w_in in hard_directions(axis).into_iter().chain([-w_out, w_out]) {
        let (f, pdf) = (lobe.eval(w_out, w_in), lobe.pdf(w_out, w_in));
        assert!(f.is_valid(), "{name}, {w_out}, {w_in}: {f:?}");
        assert!(
            pdf.is_finite() && pdf >= 0.0,
            "{name}, {w_out}, {w_in}: {pdf}"
        );
    }
    for _ in 0..100 {
        if let Some(s) = lobe.sample(w_out, rng) {
            assert!((s.w_in.length() - 1.0).abs() < 1e-4, "{name}: {s:?}");
            assert!(
                s.weight.is_valid() && s.pdf.is_finite() && s.pdf >= 0.0,
                "{name}: {s:?}"
            );
        }
    }
}

/// An albedo that no clamp hides.
pub const GREY: Rgb = Rgb::splat(0.7);
