//! Near and far fields against the same formulas in double precision.

use super::*;

/// The near field once more in double precision, from the formulas alone; its
/// balance is taken from the model.
fn near_in_f64(f: &Fibre, p: &DielectricParameters, w_out: Vec3, w_in: Vec3, h: f64) -> f64 {
    let t = TANGENT.as_dvec3().normalize();
    let (wo, wi) = (w_out.as_dvec3().normalize(), w_in.as_dvec3().normalize());
    let (so, si) = (t.dot(wo), t.dot(wi));
    let (to, ti) = (so.asin(), si.asin());
    let travel = (-(wo - t * so)).normalize();
    let side = t.cross(travel);
    let across: DVec3 = wi - t * si;
    let azimuth = across.dot(side).atan2(across.dot(travel));
    let eta = f64::from(p.ior);
    let td = 0.5 * (to - ti);
    let index = (eta * eta - td.sin().powi(2)).sqrt() / td.cos();
    let (gi, gt) = (h.asin(), (h / index).asin());
    let ci = td.cos() * gi.cos();
    let ct = (1.0 - (1.0 - ci * ci) / (eta * eta)).sqrt();
    let fresnel = 0.5
        * (((ci - eta * ct) / (ci + eta * ct)).powi(2)
            + ((eta * ci - ct) / (eta * ci + ct)).powi(2));
    let inside = 2.0 * gt.cos() / (1.0 - (td.sin() / eta).powi(2)).sqrt();
    let through = (-f64::from(p.absorption_radii.0.x) * inside).exp();
    let pi = std::f64::consts::PI;
    let gauss = |x: f64, s: f64| (-0.5 * (x / s).powi(2)).exp() / (s * (2.0 * pi).sqrt());
    let beta = f64::from(p.longitudinal_rad);
    let widths = [beta, 0.5 * beta, 2.0 * beta, 2.0 * beta];
    let mut sum = 0.0;
    for (lobe, s) in widths.into_iter().enumerate() {
        let a = match lobe {
            0 => fresnel,
            k => {
                let a = (1.0 - fresnel).powi(2) * through * (fresnel * through).powi(k as i32 - 1);
                let all = a / (1.0 - fresnel * through);
                if lobe == 3 { all } else { a }
            }
        };
        let k = gauss(ti + to, s) + gauss(pi - ti + to, s) + gauss(-pi - ti + to, s);
        let centre = pi - 2.0 * gi - lobe as f64 * (pi - 2.0 * gt);
        let n = if lobe == 3 {
            0.5 / pi
        } else {
            let s = f64::from(p.azimuthal_rad);
            (-3..=3)
                .map(|k| gauss(azimuth - centre + 2.0 * pi * f64::from(k), s))
                .sum()
        };
        sum += a * k * n;
    }
    let c = |theta: f64| f64::from(f.balance().at(theta.cos() as f32).scale.x);
    c(to) * c(ti) * ti.cos() * sum
}

#[test]
fn single_precision_follows_double() {
    let mut rng = PathRng::from_seed(53);
    let fibre = dielectric(1.55, 0.2, 8.0, 15.0);
    let parameters = parameters(1.55, 0.2, 8.0, 15.0);
    for _ in 0..3000 {
        let w_out = warp::uniform_sphere(rng.unit2());
        let h = 2.0 * rng.unit() - 1.0;
        let near = fibre.near_field(FibreFrame::new(TANGENT, w_out), h);
        let Some(s) = near.sample(w_out, &mut rng) else {
            continue;
        };
        let exact = near_in_f64(&fibre, &parameters, w_out, s.w_in, f64::from(h));
        let got = f64::from(near.eval(w_out, s.w_in).0.x);
        let is_near = (got - exact).abs() < 2e-3 * exact + 1e-5;
        assert!(is_near, "seed 53, {w_out} {h} {s:?}: {got} {exact}");
    }
}

/// Worst relative error of a far field against `exact`, over directions that
/// are drawn and directions that are hard; values below 1e-4 of the greatest
/// count as that.
fn far_error(fibre: &Fibre, exact: impl Fn(Vec3, Vec3) -> f64) -> f64 {
    let far = fibre.far_field(TANGENT);
    let mut rng = PathRng::from_seed(57);
    let mut pairs: Vec<(Vec3, Vec3)> = (0..150)
        .filter_map(|_| {
            let w_out = warp::uniform_sphere(rng.unit2());
            Some((w_out, far.sample(w_out, &mut rng)?.w_in))
        })
        .collect();
    for w_out in hard_directions(TANGENT) {
        pairs.push((w_out, -w_out));
        let others = hard_directions(TANGENT).into_iter().step_by(3);
        pairs.extend(others.map(|w_in| (w_out, w_in)));
    }
    // At a degree from the fibre a table of energies has nothing to hold on to.
    pairs.retain(|(a, b)| {
        [a, b]
            .into_iter()
            .all(|w| TANGENT.cross(*w).length() > 0.02)
    });
    let value = |(a, b)| [f64::from(far.eval(a, b).0.x), exact(a, b)];
    let values: Vec<[f64; 2]> = pairs.into_iter().map(value).collect();
    let greatest = values.iter().map(|v| v[1]).fold(0.0, f64::max);
    let error = |v: &[f64; 2]| (v[0] - v[1]).abs() / v[1].max(1e-4 * greatest);
    values.iter().map(error).fold(0.0, f64::max)
}

/// A dielectric's far field is the mean over offsets of its near field, both in
/// double precision: what tables and single precision leave of it.
#[test]
fn dielectric_far_fields_follow_double_precision() {
    for (absorption, longitudinal_deg, azimuthal_deg, limit) in [
        (0.2, 8.0, 15.0, 0.02),
        (0.0, 3.0, 20.0, 0.02),
        (1.0, 15.0, 40.0, 0.02),
    ] {
        let fibre = dielectric(1.55, absorption, longitudinal_deg, azimuthal_deg);
        let parameters = parameters(1.55, absorption, longitudinal_deg, azimuthal_deg);
        let error = far_error(&fibre, |w_out, w_in| {
            const N: u32 = 400;
            let at = |i: u32| std::f64::consts::PI * ((f64::from(i) + 0.5) / f64::from(N) - 0.5);
            let near = |g: f64| {
                let near = near_in_f64(&fibre, &parameters, w_out, w_in, g.sin());
                near * g.cos()
            };
            let sum: f64 = (0..N).map(|i| near(at(i))).sum();
            0.5 * sum * std::f64::consts::PI / f64::from(N)
        });
        println!("{absorption} {longitudinal_deg} {azimuthal_deg}: {error:.2e}");
        assert!(error < limit, "seed 57, {longitudinal_deg}: {error}");
    }
}

/// The fitted far field from its formulas alone; the balance is the model's.
#[test]
fn fitted_far_fields_follow_double_precision() {
    let pi = std::f64::consts::PI;
    let gauss = |x: f64, s: f64| (-0.5 * (x / s).powi(2)).exp() / (s * (2.0 * pi).sqrt());
    for name in PRESETS {
        let fibre = fitted(name);
        let p = FittedParameters::preset(name).unwrap();
        let error = far_error(&fibre, |w_out, w_in| {
            let t = TANGENT.as_dvec3().normalize();
            let (wo, wi) = (w_out.as_dvec3().normalize(), w_in.as_dvec3().normalize());
            let (to, ti) = (t.dot(wo).asin(), t.dot(wi).asin());
            let travel = (-(wo - t * t.dot(wo))).normalize();
            let across = wi - t * t.dot(wi);
            let azimuth = across.dot(t.cross(travel)).atan2(across.dot(travel));
            let r = f64::from(p.colour_r.0.x);
            let r = r + (1.0 - r) * (1.0 - (0.5 * (to - ti)).cos()).powi(5);
            let along = |s: f32| {
                let s = f64::from(s.max(crate::longitudinal::MIN_BLUR_RAD));
                gauss(ti + to, s) + gauss(pi - ti + to, s) + gauss(-pi - ti + to, s)
            };
            let s = f64::from(p.azimuthal_tt_rad.max(crate::longitudinal::MIN_BLUR_RAD));
            let about: f64 = (-3..=3)
                .map(|k| gauss(azimuth + 2.0 * pi * f64::from(k), s))
                .sum();
            let tt = (1.0 - r) * f64::from(p.colour_tt.0.x);
            let lobes = r * along(p.longitudinal_r_rad) / (2.0 * pi)
                + tt * along(p.longitudinal_tt_rad) * about;
            let c = |theta: f64| f64::from(fibre.balance().at(theta.cos() as f32).scale.x);
            c(to) * c(ti) * ti.cos() * lobes
        });
        println!("{name}: {error:.2e}");
        assert!(error < 0.01, "seed 57, {name}: {error}");
    }
}
