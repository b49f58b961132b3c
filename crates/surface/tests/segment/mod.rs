//! One segment against numbers made elsewhere and against itself.

mod reference;

use organza_basis::quadrature::integrate;
use organza_basis::{PathRng, warp};
use organza_surface::quadrature::Rule;
use organza_surface::real::{Direction, Real};
use organza_surface::segment::{Fit, Pair, SegmentParameters, YarnSegment};
use organza_testing::sized;

fn direction<T: Real>(theta_deg: f64, phi_deg: f64) -> Direction<T> {
    let (t, p) = (theta_deg.to_radians(), phi_deg.to_radians());
    Direction::new(
        T::of(t.sin() * p.cos()),
        T::of(t.sin() * p.sin()),
        T::of(t.cos()),
    )
}

/// psi, u_max (degrees), kappa, w, l, alpha, beta, delta.
fn parameters(p: [f64; 8]) -> SegmentParameters {
    SegmentParameters {
        twist_rad: p[0].to_radians(),
        u_max_rad: p[1].to_radians(),
        kappa: p[2],
        width_mm: p[3],
        length_mm: p[4],
        alpha: p[5],
        beta: p[6],
        smoothing: p[7],
        highlight_width: 0.5,
        fit: Fit::Refuse,
    }
}

/// Segments and pairs of directions all over the range of the model.
fn random_case(rng: &mut PathRng) -> (SegmentParameters, Pair<f64>) {
    let mut u = || f64::from(rng.unit());
    let u_max = 0.1 + 1.1 * u();
    let width = 0.2 + u();
    let p = SegmentParameters {
        twist_rad: (0.15 + 1.0 * u()) * if u() < 0.5 { -1.0 } else { 1.0 },
        u_max_rad: u_max,
        kappa: if u() < 0.5 { 0.0 } else { 2.0 * u() - 0.8 },
        width_mm: width,
        length_mm: width * (u_max.sin() + 0.1 + 3.0 * u()),
        alpha: 0.01,
        beta: 4.0,
        smoothing: 0.5,
        highlight_width: 0.5,
        fit: Fit::Refuse,
    };
    let wide = |w: glam::Vec3| {
        let w = w.as_dvec3().normalize();
        Direction::new(w.x, w.y, w.z)
    };
    let w_in = wide(warp::cosine_hemisphere(rng.unit2()));
    (
        p,
        Pair::new(w_in, wide(warp::cosine_hemisphere(rng.unit2()))),
    )
}

/// The highlight's integral over the segment in panels of equal length, each by
/// adaptive quadrature of the texture along the middle of the yarn.
fn panels(p: &SegmentParameters, pair: &Pair<f64>, count: usize) -> Vec<f64> {
    let whole = SegmentParameters {
        highlight_width: 1.0,
        ..*p
    };
    let segment = YarnSegment::<f64>::new(&whole).unwrap();
    let step = p.length_mm / count as f64;
    let tolerance = 1e-11 * step;
    (0..count)
        .map(|i| {
            let from = i as f64 * step - 0.5 * p.length_mm;
            let along = |y| segment.texture(pair, 0.0, y);
            p.width_mm * integrate(from, from + step, tolerance, along)
        })
        .collect()
}

#[test]
fn every_visible_stretch_is_integrated() {
    // The case that was lost: visible on [-0.7520, 0.2027] and [0.6488, 0.6599].
    let p = SegmentParameters {
        twist_rad: -0.971513018,
        u_max_rad: 0.751977659,
        kappa: -0.207709739,
        width_mm: 0.584556274,
        length_mm: 1.95771426,
        alpha: 0.0388800107,
        beta: 4.22713997,
        smoothing: 0.0,
        highlight_width: 0.5,
        fit: Fit::Refuse,
    };
    let pair = Pair::new(
        Direction::new(0.455696007, 0.701911835, 0.547412938),
        Direction::new(-0.311787127, -0.940527959, 0.134892349),
    );
    let segment = YarnSegment::<f64>::new(&p).unwrap();
    for (accuracy, tolerance) in [(1e-3, 1e-4), (1e-9, 1e-6)] {
        let got = segment.reflectance(&pair, &Rule::for_accuracy(accuracy));
        assert!((got / 0.027_481_65 - 1.0).abs() < tolerance, "{got}");
    }
    let rules = [1e-3, 1e-9].map(Rule::<f64>::for_accuracy);
    let mut rng = PathRng::from_seed(35);
    let (mut errors, mut lost_part) = ([Vec::new(), Vec::new()], Vec::new());
    let count = sized(2_000, 10_000);
    for case in 0..count {
        let (p, pair) = random_case(&mut rng);
        let segment = YarnSegment::new(&p).unwrap();
        let got = rules
            .each_ref()
            .map(|rule| segment.reflectance(&pair, rule));
        let floor = 1e-2 * 0.02 * p.width_mm * p.length_mm;
        let mut parts = panels(&p, &pair, 64);
        let mut exact: f64 = parts.iter().sum();
        if (got[1] - exact).abs() > 1e-6 * exact.max(floor) {
            // A stretch between two nodes of the panels.
            parts = panels(&p, &pair, 4096);
            exact = parts.iter().sum();
        }
        let scale = exact.max(floor);
        for (errors, got) in errors.iter_mut().zip(got) {
            errors.push(((got - exact).abs() / scale, case));
        }
        // What one interval would have: from the first dark panel behind light on,
        // there is light again.
        let first = parts.iter().position(|&x| x > 0.0).unwrap_or(0);
        let dark = parts[first..].iter().position(|&x| x <= 0.0);
        let rest: f64 = dark.map_or(0.0, |k| parts[first + k..].iter().sum());
        if rest > 0.0 {
            lost_part.push((case, rest.min(exact - rest) / scale));
        }
    }
    // Ends of short stretches are found to the rule's accuracy of the interval, not of
    // the stretch, so few cases of a coarse rule are worse. Limits of the last two ranks
    // are twice what was seen; a lost stretch is up to 0.15.
    let limits = [[1e-3, 2.6e-3, 1.3e-2], [1e-6, 2.7e-6, 1.1e-5]];
    for (errors, rule) in errors.iter_mut().zip([1e-3, 1e-9]) {
        errors.sort_by(|a, b| a.0.total_cmp(&b.0));
        let worst: Vec<_> = errors[count - 10..].iter().rev().collect();
        println!("accuracy {rule:.0e}: worst {worst:?}");
    }
    for (errors, limits) in errors.iter().zip(limits) {
        let ranks = [count - count / 100, count - count / 1000, count - 1];
        for (rank, limit) in ranks.into_iter().zip(limits) {
            let (error, case) = errors[rank];
            assert!(error < limit, "seed 35, case {case}: {error:.1e}");
        }
    }
    // Without their smaller stretch these are found wrong.
    println!("{} cases of two stretches: {lost_part:?}", lost_part.len());
    let found = lost_part.iter().filter(|(_, part)| *part > 1e-6).count();
    assert!(found >= sized(2, 10), "seed 35: {found}");
}

#[test]
fn the_rule_keeps_its_accuracy() {
    let judge = Rule::<f64>::for_accuracy(1e-10);
    for accuracy in [1e-2, 1e-3, 1e-4, 1e-6, 1e-8] {
        let rule = Rule::for_accuracy(accuracy);
        let mut rng = PathRng::from_seed(31);
        let mut errors = Vec::new();
        for _ in 0..4000 {
            let (p, pair) = random_case(&mut rng);
            let segment = YarnSegment::new(&p).unwrap();
            let exact = segment.reflectance(&pair, &judge);
            let got = segment.reflectance(&pair, &rule);
            let scale = exact.max(1e-2 * 0.02 * p.width_mm * p.length_mm);
            errors.push((got - exact).abs() / scale);
        }
        errors.sort_by(f64::total_cmp);
        println!(
            "accuracy {accuracy:.0e}, {} nodes: median {:.1e}, 99 of 100 {:.1e}, largest {:.1e}",
            rule.node_count(),
            errors[2000],
            errors[3960],
            errors[3999]
        );
        assert!(errors[3960] < accuracy, "seed 31");
    }
}

#[test]
fn the_mean_of_the_texture_is_the_reflectance() {
    let rule = Rule::for_accuracy(1e-9);
    let mut rng = PathRng::from_seed(32);
    for case in 0..300 {
        let (mut p, pair) = random_case(&mut rng);
        // Every third segment is filament yarn; widths over the whole range.
        if case % 3 == 0 {
            p.twist_rad = 0.0;
        }
        p.highlight_width = [0.125, 0.25, 0.5, 1.0][case % 4];
        let segment = YarnSegment::<f64>::new(&p).unwrap();
        // The band covers whole cells of the grid in the one direction, so
        // that only the smooth integral along the highlight errs.
        let is_third = case % 3 == 0;
        let (across, along) = if is_third { (4096, 16) } else { (16, 4096) };
        let mut sum = 0.0;
        for i in 0..across {
            for j in 0..along {
                let x = ((f64::from(i) + 0.5) / f64::from(across) - 0.5) * p.width_mm;
                let y = ((f64::from(j) + 0.5) / f64::from(along) - 0.5) * p.length_mm;
                sum += segment.texture(&pair, x, y);
            }
        }
        let mean = sum / f64::from(across * along) * segment.area_mm2();
        let exact = segment.reflectance(&pair, &rule);
        let most = 2e-4 * exact + 1e-6 * p.width_mm * p.length_mm;
        let is_near = (mean - exact).abs() < most;
        assert!(is_near, "seed 32, case {case}: {mean} {exact} {p:?}");
    }
}

#[test]
fn planes_of_symmetry_are_not_special() {
    // Both directions in one plane with the yarn, across it, equal to each
    // other: the value is that of directions next to them.
    let rule = Rule::for_accuracy(1e-6);
    for psi in [0.0, 30.0] {
        let p = parameters([psi, 40.0, 0.5, 0.3, 1.0, 0.01, 4.0, 0.5]);
        let segment = YarnSegment::<f64>::new(&p).unwrap();
        for (i, o) in [
            ([20.0, 90.0], [0.0, 0.0]),
            ([20.0, 90.0], [35.0, 270.0]),
            ([20.0, 0.0], [50.0, 180.0]),
            ([40.0, 0.0], [0.0, 0.0]),
            ([30.0, 30.0], [30.0, 30.0]),
            ([0.0, 0.0], [0.0, 0.0]),
        ] {
            let at = |d: f64| {
                let pair = Pair::new(direction(i[0], i[1]), direction(o[0] + d, o[1] + d));
                segment.reflectance(&pair, &rule)
            };
            let exact = at(0.0);
            assert!(exact > 0.0);
            for step in [1e-12, 1e-9, 1e-7, 1e-5] {
                let is_exact = (at(step) / exact - 1.0).abs() < 4.0 * f64::from(f32::EPSILON);
                assert!(is_exact, "{psi} {i:?} {o:?} {step}");
            }
        }
    }
}

#[test]
fn swapping_directions_changes_nothing() {
    let rule = Rule::for_accuracy(1e-9);
    let mut rng = PathRng::from_seed(33);
    for case in 0..500 {
        let (mut p, pair) = random_case(&mut rng);
        if case % 2 == 0 {
            p.twist_rad = 0.0;
        }
        let segment = YarnSegment::<f64>::new(&p).unwrap();
        let (w_in, w_out) = pair.directions();
        let there = segment.reflectance(&pair, &rule);
        let back = segment.reflectance(&Pair::new(w_out, w_in), &rule);
        let rounding = 4.0 * f64::EPSILON * there.abs();
        assert!((there - back).abs() <= rounding, "seed 33");
    }
}

#[test]
fn single_precision_follows_double() {
    let (rule, narrow) = (
        Rule::<f64>::for_accuracy(1e-3),
        Rule::<f32>::for_accuracy(1e-3),
    );
    let mut rng = PathRng::from_seed(34);
    let (mut errors, mut drawn) = (Vec::new(), Vec::new());
    for case in 0..4000 {
        let (mut p, pair) = random_case(&mut rng);
        if case % 2 == 0 {
            p.twist_rad = 0.0;
        }
        let cut = |w: Direction<f64>| Direction::new(w.x as f32, w.y as f32, w.z as f32);
        let (w_in, w_out) = pair.directions();
        let wide = YarnSegment::<f64>::new(&p).unwrap();
        let single = YarnSegment::<f32>::new(&p).unwrap();
        let cut_pair = Pair::new(cut(w_in), cut(w_out));
        let exact = wide.reflectance(&pair, &rule);
        let got = single.reflectance(&cut_pair, &narrow);
        // The texture, whose scale is the mean's over the area.
        let (x, y) = (rng.unit() - 0.5, rng.unit() - 0.5);
        let (x, y) = (x * p.width_mm as f32, y * p.length_mm as f32);
        let there = wide.texture(&pair, x.into(), y.into());
        let here = f64::from(single.texture(&cut_pair, x, y));
        drawn.push((here - there).abs() / there.max(1e-2 * 0.02));
        let scale = exact.max(1e-2 * 0.02 * p.width_mm * p.length_mm);
        errors.push((f64::from(got) - exact).abs() / scale);
    }
    errors.sort_by(f64::total_cmp);
    println!(
        "f32: median {:.1e}, 99 of 100 {:.1e}",
        errors[2000], errors[3960]
    );
    let most = 32.0 * f64::from(f32::EPSILON);
    assert!(errors[3960] < most, "seed 34: {:.1e}", errors[3960]);
    drawn.sort_by(f64::total_cmp);
    println!(
        "f32 texture: median {:.1e}, 99 of 100 {:.1e}",
        drawn[2000], drawn[3960]
    );
    let most = 32.0 * f64::from(f32::EPSILON);
    assert!(drawn[3960] < most, "seed 34: {:.1e}", drawn[3960]);
}

#[test]
fn hard_cases_are_finite_and_not_negative() {
    let rule = Rule::<f32>::for_accuracy(1e-3);
    let directions = [
        (0.0, 0.0),
        (89.9, 0.0),
        (89.9, 90.0),
        (89.9, 180.0),
        (89.9, 37.0),
        (89.999_9, 90.0),
        (45.0, 90.0),
        (12.0, 201.0),
    ];
    for psi in [0.0, 1e-6, 1e-3, -30.0, 89.9] {
        for u_max in [1e-4, 0.1, 30.0, 89.9] {
            for kappa in [-0.999_999, -0.5, 0.0, 1e3] {
                for (alpha, beta) in [(0.01, 0.0), (0.01, 4.0), (1e6, 500.0), (0.0, 1e6)] {
                    for delta in [0.0, 0.5, 1.0] {
                        let p = parameters([psi, u_max, kappa, 0.3, 1.0, alpha, beta, delta]);
                        let segment = YarnSegment::<f32>::new(&p).unwrap();
                        for i in directions {
                            for o in directions {
                                let pair = Pair::new(direction(i.0, i.1), direction(o.0, o.1));
                                let f = segment.reflectance(&pair, &rule);
                                assert!(f.is_finite() && f >= 0.0, "{p:?} {i:?} {o:?}: {f}");
                                for (x, y) in [(0.0, 0.0), (0.15, 0.5), (-0.15, 0.1)] {
                                    let t = segment.texture(&pair, x, y);
                                    assert!(t.is_finite() && t >= 0.0, "{p:?} {i:?} {o:?}: {t}");
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// What single precision would not hold is refused by name.
#[test]
fn parameters_beyond_all_bounds_are_refused() {
    let refused = |change: &dyn Fn(&mut SegmentParameters)| {
        let mut p = parameters([30.0, 20.0, 0.0, 0.3, 1.0, 0.01, 4.0, 0.0]);
        change(&mut p);
        YarnSegment::<f32>::new(&p).err().unwrap().to_string()
    };
    for value in [1e308, f64::INFINITY, f64::NAN] {
        assert!(refused(&|p| p.kappa = value).contains("kappa"));
        assert!(refused(&|p| p.alpha = value).contains("alpha"));
        assert!(refused(&|p| p.beta = value).contains("beta"));
    }
}

#[test]
fn staple_yarn_turns_into_filament_yarn() {
    // As psi goes to zero the two integrals, over u and over v, must meet.
    let rule = Rule::for_accuracy(1e-9);
    let pair = Pair::new(direction(30.0, 100.0), direction(20.0, 250.0));
    let at = |psi: f64| {
        let p = parameters([psi, 30.0, 0.4, 0.5, 2.0, 0.01, 4.0, 0.0]);
        YarnSegment::<f64>::new(&p)
            .unwrap()
            .reflectance(&pair, &rule)
    };
    let limit = at(0.0);
    for psi in [1.0, 0.1, 0.01, 1e-4, 1e-6] {
        let error = (at(psi) / limit - 1.0).abs();
        assert!(error < 0.02 * psi + 1e-7, "{psi}: {error:e}");
    }
}

#[test]
fn yarn_that_does_not_fit_is_refused_or_narrowed() {
    let mut p = parameters([-30.0, 36.0, 0.0, 2.0, 1.0, 0.01, 4.0, 0.0]);
    let message = YarnSegment::<f64>::new(&p).unwrap_err().to_string();
    assert!(message.contains("under 30.0"), "{message}");
    p.fit = Fit::Narrow;
    let bead = YarnSegment::<f64>::new(&p).unwrap();
    let expected = 0.5 / 36f64.to_radians().sin();
    assert!((bead.tube_radius_mm() - expected).abs() < 4.0 * f64::EPSILON);
    let pair = Pair::new(direction(30.0, 40.0), direction(20.0, 200.0));
    assert!(bead.reflectance(&pair, &Rule::for_accuracy(1e-3)) > 0.0);
    for (key, index, value) in [
        ("psi_deg", 0, 90.0),
        ("u_max_deg", 1, 0.0),
        ("kappa", 2, -1.0),
        ("width_mm", 3, f64::NAN),
        ("length_mm", 4, 0.0),
        ("alpha", 5, -1.0),
        ("beta", 6, f64::INFINITY),
        ("smoothing", 7, 1.5),
    ] {
        let mut p = [-30.0, 36.0, 0.0, 0.5, 1.0, 0.01, 4.0, 0.0];
        p[index] = value;
        let message = YarnSegment::<f64>::new(&parameters(p))
            .unwrap_err()
            .to_string();
        assert!(message.contains(key), "{message}");
    }
}
