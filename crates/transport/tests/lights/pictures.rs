//! Environment pictures against constant environments, parallel light and their density.

use super::*;

fn picture(size: UVec2, search: LightSearch, pixel: impl Fn(u32, u32) -> f32) -> Light {
    Light::from(image_light(size, search, pixel))
}

fn image_light(size: UVec2, search: LightSearch, pixel: impl Fn(u32, u32) -> f32) -> ImageLight {
    let pixels = (0..size.y)
        .flat_map(|y| (0..size.x).map(move |x| (x, y)))
        .map(|(x, y)| Rgb::splat(pixel(x, y)))
        .collect();
    let up = Vec3::new(0.1, 1.0, 0.2);
    let image = ImageEnvironment::new(size, pixels, up, Vec3::NEG_Z).unwrap();
    ImageLight {
        image: Arc::new(image),
        search,
    }
}

/// A constant picture is a constant environment: the furnace, by every search,
/// and a slab that absorbs. The twin is a picture
/// of a tenth less.
#[test]
fn a_constant_picture_is_a_constant_environment() {
    let size = UVec2::new(32, 16);
    let environment = white_sky(Hemisphere::All);
    let under = |light, albedo, seed| {
        let scene = looking_down(vec![slab(20.0, albedo, tilted(), true)], vec![light], 0.1);
        mean(&scene, Integrator::Woodcock, u32::MAX, 32, seed)
    };
    let constant = under(environment, 0.8, 110);
    for (search, seed) in SEARCHES.into_iter().zip(111u64..) {
        let white = under(picture(size, search, |_, _| 1.0), 1.0, seed);
        let off = |x: f64| (white.0 - x).abs() / (4.0 * white.1 + 1e-5);
        // Margin: one is four standard errors, and rounding.
        assert!(off(1.0) < 1.0, "{search:?}, seed {seed}: {white:?}");
        assert!(off(0.9) > 1.0, "{search:?}, seed {seed}: the twin passed");
        let grey = under(picture(size, search, |_, _| 1.0), 0.8, seed + 10);
        let z = apart(grey, constant);
        assert!(z < 4.0, "{search:?}: {grey:?} {constant:?}");
    }
}

/// A picture with one bright pixel is parallel light from there.
#[test]
fn one_bright_pixel_is_a_directional_light() {
    let size = UVec2::new(512, 256);
    let bright = UVec2::new(200, 150);
    let light = image_light(size, LightSearch::Both, |x, y| {
        f32::from(UVec2::new(x, y) == bright) * 1e4
    });
    let (image, light) = (Arc::clone(&light.image), Light::from(light));
    // Irradiance and mean direction by adding up the interpolated picture
    // around the pixel.
    let map = image.map();
    let [up, centre, left] = [map.up, map.centre, map.left].map(|v| v.as_dvec3());
    let (steps, reach) = (64, 1.5);
    let (mut vector, mut irradiance) = (DVec3::ZERO, 0.0);
    for i in 0..steps {
        for j in 0..steps {
            let across = |k: i32| (f64::from(k) + 0.5) / f64::from(steps) * 2.0 * reach - reach;
            let x = f64::from(bright.x) + 0.5 + across(i);
            let y = f64::from(bright.y) + 0.5 + across(j);
            let (theta, phi) = (
                PI * y / f64::from(size.y),
                2.0 * PI * (0.5 - x / f64::from(size.x)),
            );
            let w = theta.sin() * (phi.cos() * centre + phi.sin() * left) + theta.cos() * up;
            let cell = (2.0 * reach / f64::from(steps)).powi(2);
            let solid_angle =
                cell * PI / f64::from(size.y) * 2.0 * PI / f64::from(size.x) * theta.sin();
            let e = solid_angle * f64::from(image.radiance_toward(w.as_vec3()).0.x);
            irradiance += e;
            vector += e * w;
        }
    }
    let sun = |scale: f64| sun(-vector.as_vec3(), (scale * irradiance) as f32);
    let under = |light, seed| {
        let scene = looking_down(vec![slab(20.0, 0.8, tilted(), true)], vec![light], 0.1);
        mean(&scene, Integrator::Woodcock, u32::MAX, 100, seed)
    };
    let (a, b) = (under(light.clone(), 120), under(sun(1.0), 121));
    // 0.7 degrees of width change the slab by less than a thousandth.
    let off = |b: (f64, f64)| (a.0 - b.0).abs() / (4.0 * a.1.hypot(b.1) + 1e-3 * b.0);
    println!("pixel {a:?}, sun {b:?}");
    // Margin: one is four standard errors, and a thousandth for the pixel's size.
    assert!(off(b) < 1.0, "seeds 120, 121: {a:?} {b:?}");
    let twin = under(sun(1.1), 122);
    assert!(off(twin) > 1.0, "the twin passed: {a:?} {twin:?}");
}

/// Directions come as often as their density says, in every octant.
#[test]
fn directions_of_a_picture_follow_their_density() {
    let size = UVec2::new(24, 12);
    let light = picture(size, LightSearch::Both, |x, y| {
        ((x * 7 + y * 13) % 11) as f32 + if x == 3 && y == 4 { 200.0 } else { 0.0 }
    });
    let octant =
        |w: Vec3| usize::from(w.x > 0.0) + 2 * usize::from(w.y > 0.0) + 4 * usize::from(w.z > 0.0);
    let mut rng = PathRng::from_seed(130);
    let n = 200_000;
    let (mut drawn, mut total) = (vec![0.0; 8], Moments::default());
    let mut uniform = vec![0.0f64; 8];
    for _ in 0..n {
        let to = light.sample_toward(Vec3::ZERO, &mut rng).unwrap();
        drawn[octant(to.w_in)] += 1.0 / f64::from(n);
        total.add(f64::from(to.irradiance.0.x));
        let w = organza_basis::warp::uniform_sphere(rng.unit2());
        let share = light.walk_share(Vec3::ZERO, w, 1.0);
        // The share is 1 / (1 + pdf).
        let pdf = f64::from(1.0 / share - 1.0);
        uniform[octant(w)] += pdf * 4.0 * PI / f64::from(n);
    }
    for (a, b) in drawn.iter().zip(&uniform) {
        let most = 0.01 + 0.05 * b;
        assert!((a - b).abs() < most, "seed 130: {drawn:?} {uniform:?}");
    }
    assert!(
        total.standard_error() < 2e-3 * total.mean,
        "by luminance, nearly without noise"
    );
}
