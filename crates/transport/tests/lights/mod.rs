//! Lights against closed forms, and the ways of finding them against each
//! other.

mod pictures;
mod planes;

use crate::scenes::{orthographic, rendered, sun, white_sky};
use glam::{DVec3, UVec2, UVec3, Vec3};
use organza_basis::quadrature::gauss_legendre;
use organza_basis::{Aabb, Moments, PathRng, Ray, Rgb, Sym3};
use organza_transport::{
    AnyMedium, Grid, GridMedium, Hemisphere, ImageEnvironment, ImageLight, Integrator,
    Interpolation, Light, LightSearch, Plane, RectangleLight, Scene, SpotLight, Stats,
};
use std::f64::consts::PI;
use std::sync::Arc;

const SEARCHES: [LightSearch; 3] = [
    LightSearch::Both,
    LightSearch::ShadowRays,
    LightSearch::Walk,
];

/// 0.2 mm of fibres, endless or a box 0.4 mm wide.
fn slab(sigma_t_per_mm: f32, albedo: f32, s: Sym3, repeats: bool) -> AnyMedium {
    let half = if repeats { 0.05 } else { 0.2 };
    let bounds = Aabb::new(Vec3::new(-half, -half, -0.1), Vec3::new(half, half, 0.1));
    let dims = UVec3::new(4, 4, 10);
    let n = dims.element_product() as usize;
    let medium = GridMedium::new(
        bounds,
        repeats,
        Interpolation::Nearest,
        Grid::new(dims, vec![[sigma_t_per_mm]; n]).unwrap(),
        Grid::constant(s.to_array()),
        Grid::constant([albedo; 3]),
    );
    AnyMedium::Grid(medium.unwrap())
}

fn tilted() -> Sym3 {
    Sym3::axial(Vec3::new(0.6, 0.48, 0.64), 1.0, 0.09)
}

/// Orthographic, looking down at the origin from 2 mm above.
fn looking_down(media: Vec<AnyMedium>, lights: Vec<Light>, width_mm: f64) -> Scene {
    Scene {
        media,
        lights,
        camera: orthographic(2.0 * DVec3::Z, DVec3::ZERO, width_mm, 16),
    }
}

/// Samples of a pixel, eight times as many where time allows.
fn full(spp: u64) -> u64 {
    organza_testing::sized(spp, 8 * spp)
}

/// Mean of the first channel and its standard error.
fn mean(
    scene: &Scene,
    integrator: Integrator,
    max_bounces: u32,
    spp: u64,
    seed: u64,
) -> (f64, f64) {
    rendered(scene, integrator, full(spp), max_bounces, seed)
        .0
        .mean()[0]
}

/// Distance of two estimates in standard errors of their difference.
fn apart(a: (f64, f64), b: (f64, f64)) -> f64 {
    (a.0 - b.0).abs() / (a.1.hypot(b.1) + 1e-7)
}

fn rectangle(corner: Vec3, u: Vec3, v: Vec3, search: LightSearch) -> Light {
    Light::from(
        RectangleLight::new(corner, u, v, Rgb::WHITE, false)
            .unwrap()
            .with_search(search),
    )
}

/// A panel 0.8 x 0.3 mm, 0.4 mm behind the slab and to the side, facing it.
const PANEL: [Vec3; 3] = [
    Vec3::new(0.1, -0.2, -0.5),
    Vec3::new(0.8, 0.0, 0.0),
    Vec3::new(0.0, 0.3, 0.0),
];

fn panel(search: LightSearch) -> Light {
    rectangle(PANEL[0], PANEL[1], PANEL[2], search)
}

/// Light of a panel scattered once by isotropic matter, by quadrature over
/// depth and panel, for every search and tracker. The twin forgets the way in.
#[test]
fn a_slab_under_a_rectangle_is_the_quadrature() {
    let (sigma, albedo) = (12.0f64, 0.8f64);
    let rule = gauss_legendre(24);
    let (mut expected, mut twin) = (0.0, 0.0);
    for (x, wx) in &rule {
        let depth = 0.1 * (x + 1.0);
        for (u, wu) in &rule {
            for (v, wv) in &rule {
                let p = PANEL[0].as_dvec3()
                    + 0.5 * (u + 1.0) * PANEL[1].as_dvec3()
                    + 0.5 * (v + 1.0) * PANEL[2].as_dvec3();
                let to = p - DVec3::new(0.0, 0.0, 0.1 - depth);
                let cos = -to.z / to.length();
                let inside = (0.2 - depth) / cos;
                let area = 0.8 * 0.3 / 4.0 * wu * wv;
                let seen = area * cos / to.length_squared() / (4.0 * PI) * albedo;
                let event = 0.1 * wx * sigma * (-sigma * depth).exp() * seen;
                expected += event * (-sigma * inside).exp();
                twin += event;
            }
        }
    }
    for integrator in [Integrator::Woodcock, Integrator::Regular] {
        for (i, search) in SEARCHES.into_iter().enumerate() {
            let medium = slab(sigma as f32, albedo as f32, Sym3::IDENTITY, true);
            let scene = looking_down(vec![medium], vec![panel(search)], 1e-3);
            let seed = 70 + i as u64;
            let got = mean(&scene, integrator, 1, 96, seed);
            let off = |x: f64| (got.0 - x).abs() / got.1;
            assert!(
                off(expected) < 4.0,
                "{integrator:?}, {search:?}, seed {seed}: {got:?} for {expected}"
            );
            assert!(off(twin) > 4.0, "the twin passed: {got:?} for {twin}");
        }
    }
}

/// One scattering event and the panel, by the public interface, with the
/// shares of shadow ray and walk as `shares(light_pdf, walk_pdf)` says.
fn one_event(scene: &Scene, shares: fn(f32, f32) -> (f32, f32), n: u32, seed: u64) -> (f64, f64) {
    let mut stats = Stats::default();
    let light = &scene.lights[0];
    let mut moments = Moments::default();
    for index in 0..n {
        let mut rng = PathRng::new(seed, 0, u64::from(index));
        let (o, d) = scene.camera.ray(UVec2::splat(8), &mut rng);
        let ray = Ray::new(o.as_vec3(), d.as_vec3());
        let mut sum = 0.0;
        let met = scene.first_collision(&ray, Integrator::Woodcock.into(), &mut rng, &mut stats);
        if let Some(collision) = met {
            let (at, w_out) = (ray.at(collision.t), -ray.direction);
            if let Some(to) = light.sample_toward(at.as_vec3(), &mut rng) {
                let share = shares(to.pdf, collision.pdf(w_out, to.w_in)).0;
                let shadow = Ray::new(at, to.w_in);
                let reach = light.distance_along(&shadow).unwrap_or(0.0);
                let tracking = Integrator::Woodcock.into();
                let through = scene.transmittance(&shadow, reach, tracking, &mut rng, &mut stats);
                let scattered = collision.eval(w_out, to.w_in) * to.irradiance;
                sum += share * through * scattered.0.x;
            }
            if let Some(drawn) = collision.sample(w_out, &mut rng) {
                let on = Ray::new(at, drawn.w_in);
                let next =
                    scene.first_collision(&on, Integrator::Woodcock.into(), &mut rng, &mut stats);
                let reach = next.map_or(f64::INFINITY, |c| c.t);
                if light.distance_along(&on).is_some_and(|t| t <= reach) {
                    let light_pdf = light.pdf_toward(at.as_vec3(), on.direction);
                    let share = shares(light_pdf, drawn.pdf).1;
                    let seen = drawn.weight * light.radiance_toward(on.direction);
                    sum += share * seen.0.x;
                }
            }
        }
        moments.add(f64::from(sum));
    }
    (moments.mean, moments.standard_error())
}

/// Any two shares that sum to one give the same light; a pair that does not
/// is rejected.
#[test]
fn shares_of_shadow_ray_and_walk_sum_to_one() {
    let scene = looking_down(
        vec![slab(12.0, 0.8, tilted(), true)],
        vec![panel(LightSearch::Both)],
        1e-3,
    );
    let n = 30_000;
    let balance = |light: f32, walk: f32| (light / (light + walk), walk / (light + walk));
    let power = |light: f32, walk: f32| {
        let (l, w) = (light * light, walk * walk);
        (l / (l + w), w / (l + w))
    };
    // Both weighed by where the shadow ray is good.
    let unequal = |light: f32, walk: f32| (light / (light + walk), light / (light + walk));
    let program = mean(&scene, Integrator::Woodcock, 1, 256, 80);
    let (a, b) = (
        one_event(&scene, balance, n, 81),
        one_event(&scene, power, n, 82),
    );
    assert!(apart(program, a) < 4.0, "seeds 80, 81: {program:?} {a:?}");
    assert!(apart(program, b) < 4.0, "seeds 80, 82: {program:?} {b:?}");
    let twin = one_event(&scene, unequal, n, 83);
    assert!(apart(program, twin) > 4.0, "the twin passed: {twin:?}");
}

/// Unlimited bounces among tilted fibres: three searches, one answer.
#[test]
fn every_search_finds_the_same_light() {
    let got: Vec<_> = SEARCHES
        .into_iter()
        .zip(90u64..)
        .map(|(search, seed)| {
            let medium = slab(30.0, 0.95, tilted(), false);
            let scene = looking_down(vec![medium], vec![panel(search)], 0.4);
            mean(&scene, Integrator::Woodcock, u32::MAX, 32, seed)
        })
        .collect();
    println!("both, shadow rays, walk: {got:?}");
    assert!(apart(got[0], got[1]) < 4.0, "seeds 90, 91: {got:?}");
    assert!(apart(got[0], got[2]) < 4.0, "seeds 90, 92: {got:?}");
}

/// Six panels that close a room around a box of albedo one: whatever the
/// search, every ray sees one. The twin leaves a wall away.
#[test]
fn a_room_of_rectangles_is_a_furnace() {
    let walls = |search, count: usize| -> Vec<Light> {
        let axes = [Vec3::X, Vec3::Y, Vec3::Z];
        let wall = |i: usize| {
            let (n, u, v) = (axes[i % 3], axes[(i + 1) % 3], axes[(i + 2) % 3]);
            // Edges so ordered that every wall shines inwards.
            let corner = |side: f32| 3.0 * (side * n - u - v);
            match i < 3 {
                true => rectangle(corner(-1.0), 6.0 * u, 6.0 * v, search),
                false => rectangle(corner(1.0), 6.0 * v, 6.0 * u, search),
            }
        };
        (0..count).map(wall).collect()
    };
    for (search, seed) in SEARCHES.into_iter().zip(100u64..) {
        let off = |count| {
            let medium = slab(20.0, 1.0, tilted(), false);
            let scene = looking_down(vec![medium], walls(search, count), 0.8);
            let (got, se) = mean(&scene, Integrator::Woodcock, u32::MAX, 16, seed);
            (got - 1.0).abs() / (4.0 * se + 1e-5)
        };
        let closed = off(6);
        // Margin: one is four standard errors, and rounding.
        assert!(closed < 1.0, "{search:?}, seed {seed}: {closed}");
        assert!(off(5) > 1.0, "{search:?}, seed {seed}: the twin passed");
    }
}

/// Cameras see rectangles, whatever is in front or behind, from one side or
/// from both.
#[test]
fn rectangles_are_seen() {
    let seen = |two_sided, from_below: bool| {
        let (mut u, mut v) = (Vec3::X, Vec3::Y);
        if from_below {
            std::mem::swap(&mut u, &mut v);
        }
        let rectangle =
            RectangleLight::new(Vec3::new(-0.5, -0.5, 0.5), u, v, Rgb::WHITE, two_sided).unwrap();
        let light = Light::from(rectangle);
        let scene = looking_down(vec![slab(20.0, 0.0, tilted(), true)], vec![light], 0.1);
        mean(&scene, Integrator::Woodcock, u32::MAX, 4, 160).0
    };
    assert_eq!(seen(false, false), 1.0);
    assert_eq!(seen(false, true), 0.0);
    assert_eq!(seen(true, true), 1.0);
    let skew = RectangleLight::new(Vec3::ZERO, Vec3::X, Vec3::ONE, Rgb::WHITE, false);
    let skew = skew.unwrap_err().to_string();
    assert_eq!(skew, "the edges are not perpendicular");
    let flat = RectangleLight::new(Vec3::ZERO, Vec3::X, Vec3::X, Rgb::WHITE, false);
    assert_eq!(flat.unwrap_err().to_string(), "the edges span no area");
}

/// A point light over a diffuse plane, in closed form: the camera looks at a place
/// beside its foot. The twin stands a twentieth higher.
#[test]
fn a_point_light_falls_off_with_the_square_and_the_cosine() {
    let (height, beside) = (3.0f64, 2.0f64);
    let of = |height: f64, seed| {
        let made = Plane::new(Vec3::ZERO, Vec3::Z, Rgb::splat(0.6), Rgb::BLACK);
        let at = Vec3::new(0.0, beside as f32, height as f32);
        let light = Light::from(SpotLight::point(at, Rgb::splat(50.0)));
        let plane = AnyMedium::Plane(made.unwrap());
        let scene = looking_down(vec![plane], vec![light], 1e-3);
        mean(&scene, Integrator::Woodcock, u32::MAX, 16, seed)
    };
    let square = height * height + beside * beside;
    let expected = 0.6 / PI * 50.0 * height / (square * square.sqrt());
    let off = |got: (f64, f64)| (got.0 - expected).abs() / (4.0 * got.1 + 1e-4 * expected);
    let got = of(height, 160);
    // Margin: one is four standard errors, and rounding.
    assert!(off(got) < 1.0, "seed 160: {got:?} for {expected}");
    let twin = of(1.05 * height, 161);
    assert!(off(twin) > 1.0, "the twin passed: {twin:?} for {expected}");
}

/// A distant point light is parallel light of its irradiance, in a medium as well.
/// The twin is a tenth weaker.
#[test]
fn a_distant_point_light_is_parallel() {
    let toward = Vec3::new(0.48, 0.36, 0.8);
    let distance = 1e4f32;
    let under = |light, seed| {
        let scene = looking_down(vec![slab(20.0, 0.8, tilted(), true)], vec![light], 0.1);
        mean(&scene, Integrator::Woodcock, u32::MAX, 200, seed)
    };
    let point = |scale: f32| {
        let intensity = Rgb::splat(scale * distance * distance);
        Light::from(SpotLight::point(distance * toward, intensity))
    };
    let sun = sun(-toward, 1.0);
    let (sun, near) = (under(sun, 162), under(point(1.0), 163));
    assert!(apart(sun, near) < 4.0, "seeds 162, 163: {sun:?} {near:?}");
    let twin = under(point(0.9), 164);
    assert!(apart(sun, twin) > 4.0, "the twin passed: {sun:?} {twin:?}");
}
