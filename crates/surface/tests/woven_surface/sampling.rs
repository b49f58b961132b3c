//! The cloth drawn from: what samples give against sums, densities, variance.

use super::*;

/// Reflected and transmitted share by a deterministic sum over directions.
fn share_by_sum(cloth: &WovenSurface, w_out: Vec3, at: Footprint) -> f64 {
    let n = 150;
    let mut sum = 0.0;
    for j in 0..n {
        for i in 0..n {
            let u = Vec2::new(i as f32 + 0.5, j as f32 + 0.5) / n as f32;
            let w = warp::cosine_hemisphere(u);
            for w_in in [w, w * Vec3::new(1.0, 1.0, -1.0)] {
                sum += f64::from(cloth.eval(w_out, w_in, at).mean());
            }
        }
    }
    sum * std::f64::consts::PI / f64::from(n * n)
}

#[test]
fn samples_estimate_what_sums_over_directions_give() {
    const CASES: usize = 6;
    for (k, name) in names().enumerate() {
        let mut spec = preset(name);
        spec.transmission = (k % 2 == 0).then(see_through);
        let cloth = spec.build().unwrap();
        let mut rng = PathRng::from_seed(45);
        let repeat = cloth.period_mm().max_element();
        let (mut ratio, mut variance) = (0.0, 0.0);
        for case in 0..CASES {
            let position_mm = cloth.period_mm() * rng.unit2() * 5.0;
            let width_mm = [f32::INFINITY, 0.0, 0.75 * repeat][case % 3];
            let at = Footprint::new(position_mm, width_mm);
            let mut w_out = warp::cosine_hemisphere(rng.unit2());
            if case >= 3 {
                w_out.z = -w_out.z;
            }
            let exact = share_by_sum(&cloth, w_out, at);
            let mut right = Moments::default();
            for _ in 0..full(10_000) {
                let weight = match cloth.pass_or_sample(w_out, at, &mut rng) {
                    Some(Passage::Scattered(s)) => f64::from(s.weight.mean()),
                    _ => 0.0,
                };
                right.add(weight);
            }
            let bound = 4.0 * right.standard_error() + 3e-3 * exact;
            let off = (right.mean - exact).abs();
            assert!(off < bound, "{name} {case} seed 45: {} {exact}", right.mean);
            ratio += right.mean / exact / CASES as f64;
            variance += (right.standard_error() / exact / CASES as f64).powi(2);
        }
        // Of all cases together, a density that is off by a tenth is found.
        let bound = 4.0 * variance.sqrt() + 3e-3;
        assert!((ratio - 1.0).abs() < bound, "{name} seed 45: {ratio}");
        assert!((ratio / 0.9 - 1.0).abs() > bound, "{name} seed 45: {bound}");
    }
}

#[test]
fn the_density_integrates_to_what_is_drawn() {
    for (k, name) in names().enumerate() {
        let mut spec = preset(name);
        spec.transmission = (k % 2 == 0).then(see_through);
        let cloth = spec.build().unwrap();
        let mut rng = PathRng::from_seed(46);
        for width_mm in [f32::INFINITY, 0.0] {
            let at = Footprint::new(cloth.period_mm() * rng.unit2(), width_mm);
            let w_out = direction(40.0, 70.0);
            // Counts and integral over 32 bands of the sphere, so that a density
            // in the wrong place shows.
            let bins = 32;
            let bin = |w: Vec3| {
                let phi = (w.y.atan2(w.x) / std::f32::consts::TAU + 1.0).fract();
                ((phi * 8.0) as usize).min(7) * 4 + (((w.z + 1.0) * 2.0) as usize).min(3)
            };
            let n = full(15_000);
            let (mut seen, mut expected) = (vec![0.0f64; bins], vec![Moments::default(); bins]);
            for _ in 0..n {
                let drawn = cloth.pass_or_sample(w_out, at, &mut rng);
                if let Some(Passage::Scattered(s)) = drawn {
                    seen[bin(s.w_in)] += 1.0 / n as f64;
                    let pdf = cloth.pdf(w_out, s.w_in, at);
                    assert!((pdf / s.pdf - 1.0).abs() < 4.0 * f32::EPSILON, "{name}");
                }
                let w = warp::uniform_sphere(rng.unit2());
                let pdf = f64::from(cloth.pdf(w_out, w, at)) / f64::from(warp::UNIFORM_SPHERE_PDF);
                let carries = !cloth.eval(w_out, w, at).is_black();
                for (b, m) in expected.iter_mut().enumerate() {
                    m.add(if b == bin(w) && carries { pdf } else { 0.0 });
                }
            }
            for (b, (s, e)) in seen.iter().zip(&expected).enumerate() {
                let sigma = (s * (1.0 - s) / n as f64 + e.standard_error().powi(2)).sqrt();
                let mean = e.mean;
                let is_near = (s - mean).abs() < 4.5 * sigma + 1e-4;
                assert!(is_near, "{name} {width_mm} band {b} seed 46: {s} {mean}");
            }
        }
    }
}

#[test]
fn highlights_are_found_with_fewer_samples_than_by_the_cosine() {
    // Variance of the albedo estimate per sample, over views; the ratio is how
    // many cosine samples one of ours is worth.
    for name in names() {
        let cloth = preset(name).build().unwrap();
        for (label, point) in [("mean", false), ("texture", true)] {
            let mut rng = PathRng::from_seed(48);
            let (mut ours, mut cosine) = (0.0, 0.0);
            for _ in 0..40 {
                let w_out = warp::cosine_hemisphere(rng.unit2());
                let at = if point {
                    Footprint::point(cloth.period_mm() * rng.unit2())
                } else {
                    Footprint::FAR
                };
                let (mut a, mut b) = (Moments::default(), Moments::default());
                for _ in 0..full(800) {
                    let s = cloth.sample(w_out, at, &mut rng);
                    a.add(f64::from(s.map_or(0.0, |s| s.weight.mean())));
                    let w_in = warp::cosine_hemisphere(rng.unit2());
                    let value = cloth.eval(w_out, w_in, at).mean() * std::f32::consts::PI;
                    b.add(f64::from(value));
                }
                ours += a.variance();
                cosine += b.variance();
            }
            println!("{name}, {label}: cosine / ours = {:.1}", cosine / ours);
            assert!(cosine > ours, "{name} seed 48");
        }
    }
}
