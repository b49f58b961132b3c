//! The trackers against answers known in closed form, each with a wrong twin
//! that the same test must reject.

use crate::scenes::{direction, orthographic, rendered, sun, white_sky};
use glam::{DVec3, UVec3, Vec2, Vec3};
use organza_basis::{Aabb, Moments, PathRng, Ray, Sym3};
use organza_transport::{
    AnyMedium, Film, Grid, GridMedium, Hemisphere, Integrator, Interpolation, Light, Medium, Scene,
    Stats, exact_transmittance, sample_collision, sample_collision_exactly, stopped_transmittance,
    transmittance,
};

const AXIS: Vec3 = Vec3::new(0.6, 0.48, 0.64);
const END_ON: f32 = 0.3;

/// A slab 0.2 mm thick of tilted fibres, cut into voxels so that spans of
/// several bricks are met, endless in x and y.
fn slab(sigma_t_per_mm: f32, albedo: f32, s: Sym3, interpolation: Interpolation) -> GridMedium {
    let bounds = Aabb::new(Vec3::new(0.0, 0.0, -0.1), Vec3::new(0.1, 0.1, 0.1));
    let dims = UVec3::new(3, 5, 20);
    let n = (dims.x * dims.y * dims.z) as usize;
    GridMedium::new(
        bounds,
        true,
        interpolation,
        Grid::new(dims, vec![[sigma_t_per_mm]; n]).unwrap(),
        Grid::constant(s.to_array()),
        Grid::constant([albedo; 3]),
    )
    .unwrap()
}

fn tilted() -> Sym3 {
    Sym3::axial(AXIS, 1.0, END_ON * END_ON)
}

fn looking_down(media: Vec<AnyMedium>, lights: Vec<Light>, pixels: u32) -> Scene {
    Scene {
        media,
        lights,
        camera: orthographic(DVec3::new(1.0, 0.5, 3.0), DVec3::ZERO, 0.1, pixels),
    }
}

fn picture(scene: &Scene, integrator: Integrator, spp: u64, seed: u64) -> Film {
    rendered(scene, integrator, spp, u32::MAX, seed).0
}

/// The furnace: albedo one under uniform light of one is one, whatever the
/// medium, the tracker and the tilt. Without absorption roulette never acts
/// and every path returns one exactly, so the mean is exact too.
#[test]
fn white_furnace() {
    let light = white_sky(Hemisphere::All);
    for integrator in [Integrator::Woodcock, Integrator::Regular] {
        let medium = slab(20.0, 1.0, tilted(), Interpolation::Nearest);
        let scene = looking_down(vec![AnyMedium::Grid(medium)], vec![light.clone()], 16);
        for (mean, se) in picture(&scene, integrator, 64, 1).mean() {
            let tolerance = 4.0 * se + 1e-5;
            let off = (mean - 1.0).abs();
            assert!(off < tolerance, "{integrator:?}, seed 1: {mean} +- {se}");
        }
    }
}

/// Light in is light out for one direction too: the slab's whole reflected and
/// transmitted light, albedo one, is measured by escaping paths under a
/// furnace split in halves, which must add to one.
#[test]
fn front_and_back_furnace_add_to_one() {
    let half = |hemisphere, seed| {
        let light = white_sky(hemisphere);
        let medium = slab(20.0, 1.0, tilted(), Interpolation::Nearest);
        let scene = looking_down(vec![AnyMedium::Grid(medium)], vec![light], 16);
        picture(&scene, Integrator::Woodcock, 64, seed).mean()[0]
    };
    let (front, back) = (half(Hemisphere::Front, 2), half(Hemisphere::Back, 3));
    let se = front.1.hypot(back.1);
    assert!(front.0 > 0.05 && back.0 > 0.05);
    let off = (front.0 + back.0 - 1.0).abs();
    assert!(off < 4.0 * se, "seeds 2, 3: {front:?} {back:?}");
}

/// Beer-Lambert: transmittance is exp(-sigma_t sqrt(w S w) length) at every
/// angle to the fibre. The twin forgets the projected area.
#[test]
fn beer_lambert_at_every_angle_to_the_fibre() {
    let sigma_t = 12.0;
    for interpolation in [Interpolation::Nearest, Interpolation::Trilinear] {
        let medium = slab(sigma_t, 0.5, tilted(), interpolation);
        let mut stats = Stats::default();
        let mut twin_rejected = 0;
        for (k, theta) in [0.0f32, 20.0, 40.0, 55.0, 70.0].iter().enumerate() {
            for phi in [0.0f32, 45.0, 140.0, 250.0] {
                let w = -direction(*theta, phi);
                let ray = Ray::new(Vec3::new(0.03, 0.02, 0.0) - 5.0 * w, w);
                let local = medium.cell_grid().clip(&ray, f64::INFINITY).unwrap();
                let mut rng = PathRng::new(4, k as u64, phi as u64);
                let got: Moments = (0..20_000)
                    .map(|_| f64::from(transmittance(&medium, &local, &mut rng, &mut stats)))
                    .collect();
                let length = 0.2 / theta.to_radians().cos();
                let area = tilted().quadratic(w).sqrt();
                let expected = f64::from((-sigma_t * area * length).exp());
                let allowed = 4.0 * got.standard_error() + 1e-6;
                assert!(
                    (got.mean - expected).abs() < allowed,
                    "seed 4, {theta} {phi}: {} +- {} against {expected}",
                    got.mean,
                    got.standard_error()
                );
                let forgotten = f64::from((-sigma_t * length).exp());
                twin_rejected += u32::from((got.mean - forgotten).abs() > allowed);
            }
        }
        assert!(
            twin_rejected >= 15,
            "the wrong law was rejected {twin_rejected} of 20 times"
        );
        assert_eq!(stats.majorant_violations, 0);
    }
}

/// Exact stepping that stops early has the mean of exact stepping, thick or
/// thin; without the roulette's weight it would lose light.
#[test]
fn stopping_early_is_unbiased() {
    let w = Vec3::new(0.2, -0.1, -0.9).normalize();
    let ray = Ray::new(Vec3::new(0.03, 0.02, 1.0), w);
    let mut stats = Stats::default();
    for (sigma, seed) in [(3.0, 31), (14.0, 32), (30.0, 33)] {
        let medium = slab(sigma, 0.5, tilted(), Interpolation::Nearest);
        let local = medium.cell_grid().clip(&ray, f64::INFINITY).unwrap();
        let exact = f64::from(exact_transmittance(&medium, &local, &mut stats));
        let mut rng = PathRng::from_seed(seed);
        let (mut got, mut twin) = (Moments::default(), Moments::default());
        for _ in 0..40_000 {
            let t = stopped_transmittance(&medium, &local, &mut rng, &mut stats);
            got.add(f64::from(t));
            twin.add(if t > 0.0 { exact } else { 0.0 });
        }
        let allowed = |m: &Moments| 4.0 * m.standard_error() + 1e-6;
        let off = (got.mean - exact).abs();
        assert!(off < allowed(&got), "seed {seed}: {} for {exact}", got.mean);
        let ended = exact < 0.09;
        let is_rejected = (twin.mean - exact).abs() > allowed(&twin);
        assert_eq!(is_rejected, ended, "seed {seed}: the twin");
    }
}

/// Free paths of delta tracking and of exact stepping are exponential with
/// mean 1/sigma: mean and mean square against closed form, in a medium too
/// thick to leave (e^-60).
#[test]
fn mean_free_path() {
    let medium = slab(300.0, 0.5, tilted(), Interpolation::Nearest);
    let w = Vec3::new(0.0, 0.0, -1.0);
    let sigma = 300.0 * f64::from(tilted().quadratic(w).sqrt());
    let ray = Ray::new(Vec3::new(0.01, 0.02, 1.0), w);
    let local = medium.cell_grid().clip(&ray, f64::INFINITY).unwrap();
    let mut stats = Stats::default();
    let mut rng = PathRng::from_seed(5);
    for exact in [false, true] {
        let mut length = Moments::default();
        let mut square = Moments::default();
        for _ in 0..50_000 {
            let hit = if exact {
                sample_collision_exactly(&medium, &local, &mut rng, &mut stats)
            } else {
                sample_collision(&medium, &local, &mut rng, &mut stats)
            };
            let x = f64::from(hit.expect("e^-50 of the light passes").0) * sigma;
            length.add(x);
            square.add(x * x);
        }
        for (m, expected) in [(&length, 1.0), (&square, 2.0)] {
            let error = m.standard_error();
            assert!((m.mean - expected).abs() < 4.0 * error, "seed 5");
        }
    }
}

/// Two media in one place are one medium of the summed extinction.
#[test]
fn superposed_media_add() {
    let scene = |parts: &[f32]| {
        let media = parts
            .iter()
            .map(|&p| AnyMedium::Grid(slab(p, 0.8, tilted(), Interpolation::Nearest)))
            .collect();
        let light = sun(Vec3::new(0.3, 0.1, -0.9), 1.0);
        looking_down(media, vec![light], 16)
    };
    let mean = |parts: &[f32], integrator, seed| {
        let scene = scene(parts);
        picture(&scene, integrator, 128, seed).mean()[0]
    };
    let whole = mean(&[12.0], Integrator::Woodcock, 6);
    let split = mean(&[5.0, 7.0], Integrator::Woodcock, 7);
    let exact = mean(&[5.0, 7.0], Integrator::Regular, 8);
    let wrong = mean(&[5.0], Integrator::Woodcock, 9);
    let far = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).abs() / a.1.hypot(b.1);
    assert!(far(whole, split) < 4.0, "seeds 6, 7: {whole:?} {split:?}");
    assert!(far(whole, exact) < 4.0, "seeds 6, 8: {whole:?} {exact:?}");
    assert!(
        far(whole, wrong) > 4.0,
        "the twin that forgets one of them passed: {wrong:?}"
    );
}

/// The picture does not depend on the number of threads, to the bit.
#[test]
fn same_bits_on_one_and_two_threads() {
    let medium = slab(20.0, 0.7, tilted(), Interpolation::Trilinear);
    let light = sun(Vec3::NEG_Z, 1.0);
    let scene = looking_down(vec![AnyMedium::Grid(medium)], vec![light], 24);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| picture(&scene, Integrator::Woodcock, 20, 10))
    };
    assert!(on(1) == on(2));
}

/// Far from the origin, seen from far away, looked at along the fibre, from
/// inside: finite, and the same light as near the origin where the scene is
/// the same.
#[test]
fn a_camera_ten_metres_away_sees_the_same() {
    let light = white_sky(Hemisphere::Back);
    let at = |distance: f64, seed| {
        let medium = slab(20.0, 0.9, tilted(), Interpolation::Nearest);
        let direction = DVec3::new(1.0, 0.5, 3.0).normalize();
        let scene = Scene {
            media: vec![AnyMedium::Grid(medium)],
            lights: vec![light.clone()],
            camera: orthographic(distance * direction, DVec3::ZERO, 0.1, 16),
        };
        picture(&scene, Integrator::Woodcock, 128, seed).mean()[0]
    };
    let (near, far) = (at(3.0, 11), at(1e4, 12));
    let inside = at(0.0001, 13);
    // Margin: four standard errors.
    let off = (near.0 - far.0).abs();
    assert!(off < 4.0 * near.1.hypot(far.1), "seeds 11, 12");
    assert!(inside.0.is_finite() && inside.0 > 0.0);
}

/// A tile repeated and cut to a rectangle is the grid cut out by hand, ray by
/// ray: voxels that the cut divides are divided by hand too. A cut half a
/// voxel off is rejected.
#[test]
fn a_cut_edge_is_the_grid_cut_by_hand() {
    // Tile 3 x 2 x 2 voxels of 0.1 mm; the cut runs through the middle of
    // voxels in x and between them in y, over a corner of several periods.
    let tile = UVec3::new(3, 2, 2);
    let density = |x: u32, y: u32, z: u32| [3.0 + ((x % 3) + 3 * (y % 2) + 6 * z) as f32];
    let medium = |bounds, repeats, dims: UVec3, at: &dyn Fn(UVec3) -> [f32; 1]| {
        let cells = (0..dims.z).flat_map(|z| {
            (0..dims.y).flat_map(move |y| (0..dims.x).map(move |x| UVec3::new(x, y, z)))
        });
        let grid = Grid::new(dims, cells.map(at).collect()).unwrap();
        GridMedium::new(
            bounds,
            repeats,
            Interpolation::Nearest,
            grid,
            Grid::constant(tilted().to_array()),
            Grid::constant([0.5; 3]),
        )
        .unwrap()
    };
    let bounds = Aabb::new(Vec3::ZERO, Vec3::new(0.3, 0.2, 0.2));
    let (min, max) = (Vec2::new(-0.35, 0.1), Vec2::new(0.45, 0.7));
    let cut_to = |min, max| {
        let tile = medium(bounds, true, tile, &|c| density(c.x, c.y, c.z));
        let mut cut = AnyMedium::Grid(tile);
        cut.cut_to(min, max).unwrap();
        assert!(!cut.cell_grid().unwrap().is_endless());
        cut
    };
    // By hand, in half voxels along x.
    let by_hand = AnyMedium::Grid(medium(
        Aabb::new(min.extend(0.0), max.extend(0.2)),
        false,
        UVec3::new(16, 6, 2),
        &|c| density((c.x + 5) / 2, c.y + 1, c.z),
    ));
    let seen = |medium: AnyMedium| {
        let scene = looking_down(vec![medium], vec![], 1);
        let mut rng = PathRng::from_seed(20);
        let mut stats = Stats::default();
        let mut through = Vec::new();
        for _ in 0..2000 {
            let p = Vec3::new(rng.unit() - 0.4, 0.9 * rng.unit(), 0.2 * rng.unit());
            let w = organza_basis::warp::uniform_sphere(rng.unit2());
            let ray = Ray::new(p - 2.0 * w, w);
            let regular = Integrator::Regular.into();
            let t = scene.transmittance(&ray, f64::INFINITY, regular, &mut rng.clone(), &mut stats);
            // The walk's start from far away belongs to the same box.
            let start = scene.near_start(&[], ray.origin, w.as_dvec3());
            through.push(t + start as f32);
        }
        through
    };
    let expected = seen(by_hand);
    let off = |medium| {
        let got = seen(medium);
        let pairs = got.iter().zip(&expected);
        let far = pairs.filter(|(a, b)| (*a - *b).abs() > 1e-4);
        far.count()
    };
    // A ray along an edge may fall on either side of it.
    assert!(off(cut_to(min, max)) <= 2, "seed 20");
    let shifted = Vec2::new(0.05, 0.0);
    let twin = cut_to(min + shifted, max + shifted);
    assert!(off(twin) > 500, "the twin passed");
    assert!(cut_to(min, max).cut_to(max, max + 1.0).is_none());
}
