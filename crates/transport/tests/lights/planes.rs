//! Planes that shine, scatter and absorb.

use super::*;

/// A plane that shines is half an environment; a white one below a slab that
/// absorbs nothing is a furnace from the front. The twin absorbs.
#[test]
fn planes_close_the_furnace_from_behind() {
    let plane = |reflectance: f32, radiance: f32| {
        let (r, l) = (Rgb::splat(reflectance), Rgb::splat(radiance));
        AnyMedium::Plane(Plane::new(Vec3::new(0.0, 0.0, -0.3), Vec3::Z, r, l).unwrap())
    };
    let of = |media, lights, seed| {
        let scene = looking_down(media, lights, 0.1);
        mean(&scene, Integrator::Woodcock, u32::MAX, 32, seed)
    };
    let cloth = |albedo| slab(12.0, albedo, tilted(), true);
    let back = of(vec![cloth(0.9)], vec![white_sky(Hemisphere::Back)], 140);
    let table = of(vec![cloth(0.9), plane(0.0, 1.0)], vec![], 141);
    let z = apart(back, table);
    assert!(z < 4.0, "seeds 140, 141: {back:?} {table:?}");
    let front = || vec![white_sky(Hemisphere::Front)];
    let closed = of(vec![cloth(1.0), plane(1.0, 0.0)], front(), 142);
    let twin = of(vec![cloth(1.0), plane(0.9, 0.0)], front(), 143);
    let off = |m: (f64, f64)| (m.0 - 1.0).abs() / (4.0 * m.1 + 1e-5);
    let rounding = 4.0 * f64::from(f32::EPSILON);
    assert!(off(closed) < rounding, "seed 142: {closed:?}");
    assert!(off(twin) > 1.0, "the twin passed: {twin:?}");
}

/// A diffuse plane under parallel light and under a panel, in closed form;
/// nothing of it is first met, and it hides what is behind.
#[test]
fn a_diffuse_plane_scatters_by_lamberts_law() {
    let plane = || {
        let made = Plane::new(Vec3::ZERO, Vec3::Z, Rgb::splat(0.6), Rgb::BLACK);
        AnyMedium::Plane(made.unwrap())
    };
    let from_above = sun(Vec3::new(0.6, 0.0, -0.8), 2.0);
    let scene = looking_down(vec![plane()], vec![from_above], 0.1);
    let got = mean(&scene, Integrator::Woodcock, u32::MAX, 64, 150);
    let expected = 0.6 / PI * 2.0 * 0.8;
    // Margin: four standard errors, and rounding.
    let off = (got.0 - expected).abs();
    assert!(off < 4.0 * got.1 + 1e-5, "seed 150: {got:?} for {expected}");
    let from_below = sun(Vec3::Z, 1.0);
    let scene = looking_down(vec![plane()], vec![from_below], 0.1);
    assert_eq!(mean(&scene, Integrator::Woodcock, u32::MAX, 4, 151).0, 0.0);
    // A panel of 2 x 2 mm facing the plane from 1 mm above: the form factor to
    // a point below its middle is known.
    let a = 1.0f64;
    let s = (1.0 + a * a).sqrt();
    let form_factor = 4.0 / (2.0 * PI) * 2.0 * (a / s * (a / s).atan());
    for (search, seed) in SEARCHES.into_iter().zip(152u64..) {
        let (u, v) = (Vec3::new(0.0, 2.0, 0.0), Vec3::new(2.0, 0.0, 0.0));
        let light = rectangle(Vec3::new(-1.0, -1.0, 1.0), u, v, search);
        let scene = looking_down(vec![plane()], vec![light], 1e-3);
        let got = mean(&scene, Integrator::Woodcock, u32::MAX, 256, seed);
        let expected = 0.6 * form_factor;
        // Margin: four standard errors, and rounding.
        let is_near = (got.0 - expected).abs() < 4.0 * got.1 + 1e-6;
        assert!(is_near, "{search:?}, seed {seed}: {got:?} for {expected}");
    }
}
