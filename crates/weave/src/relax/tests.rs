use super::*;
use organza_basis::PathRng;

fn system(n: usize, spacing_mm: f64, radius_mm: f64, stiffness: f64) -> System {
    System {
        position_mm: (0..n).map(|i| (i as f64 + 0.5) * spacing_mm).collect(),
        period_mm: n as f64 * spacing_mm,
        half_height_mm: vec![radius_mm; n],
        stiffness: vec![stiffness; n],
        stacked: Vec::new(),
    }
}

/// Integral of the squared slope of a curve, by Gauss-Legendre quadrature
/// that is exact for its degree.
fn squared_slope(curve: &Hermite) -> f64 {
    let node = 0.5 * (0.6f64).sqrt();
    let points = [
        (0.5 - node, 5.0 / 18.0),
        (0.5, 8.0 / 18.0),
        (0.5 + node, 5.0 / 18.0),
    ];
    (0..curve.height_mm.len())
        .flat_map(|k| points.map(|(t, w)| (k, t, w)))
        .map(|(k, t, w)| w * curve.interval(k).0 * curve.at(k, t).1.powi(2))
        .sum()
}

fn random_system(n: usize, rng: &mut PathRng) -> System {
    let mut s = system(n, 1.0, 0.2, 1.0);
    let mut at = 0.0;
    for x in &mut s.position_mm {
        *x = at;
        at += 0.3 + f64::from(rng.unit());
    }
    s.period_mm = at;
    s
}

#[test]
fn the_closed_form_strain_is_that_of_the_curve_and_the_least() {
    let mut rng = PathRng::from_seed(11);
    for n in [1, 2, 3, 8] {
        let strain = Strain::new(&random_system(n, &mut rng));
        let h: Vec<f64> = (0..n).map(|_| f64::from(rng.unit())).collect();
        let curve = strain.curve(&h);
        let (closed, quadrature) = (
            strain.add(&h, 1.0, &mut vec![0.0; n]),
            squared_slope(&curve),
        );
        assert!(
            (closed - quadrature).abs() < 4.0 * f64::EPSILON * (1.0 + closed),
            "{n}: {closed} {quadrature}"
        );
        // Moving any free knot or slope costs energy.
        for i in 0..2 * n {
            for step in [-1e-3, 1e-3] {
                let mut other = curve.clone();
                other.slope[i] += step;
                assert!(squared_slope(&other) > quadrature);
                if i % 2 == 1 {
                    let mut other = curve.clone();
                    other.height_mm[i] += step;
                    assert!(squared_slope(&other) > quadrature);
                }
            }
        }
    }
}

#[test]
fn segment_strain_follows_the_published_closed_form() {
    let (d, h0, h1, a0, a1) = (0.7, 0.1, 0.45, -0.3, 0.9);
    let curve = Hermite {
        knots_mm: vec![0.0, d, 2.0 * d].into(),
        height_mm: vec![h0, h1],
        slope: vec![a0, a1],
    };
    let one = |d: f64, rise: f64, a0: f64, a1: f64| {
        (36.0 * rise * rise - 6.0 * d * rise * (a0 + a1)
            + d * d * (4.0 * a0 * a0 - 2.0 * a0 * a1 + 4.0 * a1 * a1))
            / (30.0 * d)
    };
    let both = one(d, h1 - h0, a0, a1) + one(d, h0 - h1, a1, a0);
    assert!((squared_slope(&curve) - both).abs() < 4.0 * f64::EPSILON);
}

#[test]
fn the_gradient_agrees_with_finite_differences() {
    let mut rng = PathRng::from_seed(5);
    let draft = Draft::from_drawdown(&["XX.X.", ".X.XX", "X..X.", "..XXX"]).unwrap();
    let (mut warp, mut weft) = (random_system(5, &mut rng), random_system(4, &mut rng));
    warp.half_height_mm[2] = 0.5;
    weft.stiffness[1] = 3.0;
    warp.stacked.push(Stacked {
        threads: [1, 3],
        order: vec![1, 0, -1, 1],
        apart_mm: vec![0.3, 0.3, 0.1, 0.0],
        above_mm: vec![0.4; 4],
    });
    let weave = Weave::new(&draft, &warp, &weft, None);
    // Gaps on both sides of contact, some inside the expansion.
    let h: Vec<f64> = weave
        .start()
        .iter()
        .map(|h| h * (0.3 + 0.9 * f64::from(rng.unit())))
        .collect();
    let mut gradient = vec![0.0; h.len()];
    weave.energy(&h, &mut gradient);
    for i in 0..h.len() {
        let at = |step: f64| {
            let mut h = h.clone();
            h[i] += step;
            weave.energy(&h, &mut vec![0.0; h.len()])
        };
        let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
        let error = (difference - gradient[i]).abs();
        assert!(
            error < 1e-5 * (1.0 + difference.abs()),
            "{i}: {difference} {}",
            gradient[i]
        );
    }
}

#[test]
fn the_collision_potential_is_smooth_and_convex() {
    let (mut last_value, mut last_slope) = contact(-2.0);
    for i in 1..=4000 {
        let (value, slope) = contact(-2.0 + f64::from(i) * 1e-3);
        assert!(value <= last_value && slope >= last_slope);
        assert!((value - last_value - 0.5e-3 * (slope + last_slope)).abs() < 1e-4 * (1.0 + value));
        (last_value, last_slope) = (value, slope);
    }
    assert_eq!(contact(1.0), (0.0, 0.0));
    assert!((contact(0.5).0 - 2.25).abs() < 4.0 * f64::EPSILON);
}

fn amplitude(curve: &Hermite) -> f64 {
    let h = &curve.height_mm;
    0.5 * (h.iter().copied().fold(f64::NEG_INFINITY, f64::max)
        - h.iter().copied().fold(f64::INFINITY, f64::min))
}

#[test]
fn a_symmetric_plain_weave_shares_its_crimp() {
    let draft = Draft::named("plain").unwrap();
    let s = system(2, 0.5, 0.1, 1.0);
    let r = relax(&draft, &s, &s, None, 1000).unwrap();
    let (warp, weft) = (amplitude(&r.warp[0]), amplitude(&r.weft[0]));
    assert!(
        (warp - weft).abs() < 4.0 * f64::from(f32::EPSILON),
        "{warp} {weft}"
    );
    // The force balance in closed form has them touch.
    assert!((warp / 0.1 - 1.0).abs() < 4.0 * f64::EPSILON, "{warp}");
    assert!(r.compression.abs() < 4.0 * f64::from(f32::EPSILON));
}

#[test]
fn spheres_are_larger_by_what_a_plain_weave_presses_them() {
    assert!((REST - (2.0 * CONTACT / (2.0 * CONTACT + 2.25)).powf(0.25)).abs() < 1e-6);
    assert!((2.25 * REST + CONTACT * contact(REST).1).abs() < 1e-4);
}

#[test]
fn stiff_warp_straightens_and_the_weft_takes_its_crimp() {
    let draft = Draft::named("plain").unwrap();
    let weft = system(2, 0.5, 0.1, 1.0);
    let mut last = 1.0;
    for stiffness in [1.0, 3.0, 10.0, 100.0] {
        let warp = system(2, 0.5, 0.1, stiffness);
        let r = relax(&draft, &warp, &weft, None, 1000).unwrap();
        let share = amplitude(&r.warp[0]) / (amplitude(&r.warp[0]) + amplitude(&r.weft[0]));
        assert!(share < last);
        // Springs in series share a given gap by the inverse of stiffness.
        assert!(
            (share - 1.0 / (1.0 + stiffness)).abs() < 1e-3,
            "{stiffness}: {share}"
        );
        last = share;
    }
}

#[test]
fn no_weave_interpenetrates_more_than_three_percent_at_its_crossings() {
    for name in [
        "plain",
        "twill-3-1-s",
        "satin-8-3",
        "basket-2-2",
        "herringbone",
        "warp-rib-3",
    ] {
        let draft = Draft::named(name).unwrap();
        let warp = system(draft.ends(), 0.4, 0.15, 1.0);
        let weft = system(draft.picks(), 0.6, 0.1, 2.0);
        let r = relax(&draft, &warp, &weft, None, 2000).unwrap();
        assert!(r.compression < 0.03, "{name}: {}", r.compression);
    }
}
