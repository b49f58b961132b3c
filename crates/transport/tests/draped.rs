//! Cloth over meshes and sheets: against flat cloth, and in the furnace.

use crate::scenes::{mesh, orthographic, rendered, sun, white_sky};
use glam::{DVec3, UVec2, UVec3, Vec2, Vec3};
use organza_basis::{Aabb, Moments, PathRng, Rgb, Sym3, warp};
use organza_mesh::{DrapedMesh, Mesh, Shell, Vertex};
use organza_scatter::{Footprint, LobeSample, Surface};
use organza_transport::{
    AnyMedium, Camera, CameraPose, CellGrid, Draping, EnvironmentLight, Film, Grid, GridMedium,
    Hemisphere, Integrator, Interpolation, LevelSteps, LevelledCloth, Light, PixelFilter,
    Projection, Scene, Stats, trace_from,
};
use std::f32::consts::FRAC_1_PI;

const HALF_MM: f32 = 0.15;

/// A tile with two kinds of fibre side by side, so that a picture shows where
/// it lies and which way its fibres run.
fn tile(albedo: f32) -> AnyMedium {
    let bounds = Aabb::new(Vec3::new(0.0, 0.0, -HALF_MM), Vec3::new(1.0, 0.7, HALF_MM));
    let dims = UVec3::new(4, 2, 3);
    let along = |axis: Vec3| Sym3::axial(axis.normalize(), 1.0, 0.05).to_array();
    let fibres = (0..dims.element_product()).map(|i| match i % 4 {
        0 | 1 => along(Vec3::new(1.0, 0.2, 0.1)),
        _ => along(Vec3::new(-0.1, 1.0, 0.3)),
    });
    let density = (0..dims.element_product()).map(|i| [if i % 4 == 3 { 1.0 } else { 9.0 }]);
    let medium = GridMedium::new(
        bounds,
        true,
        Interpolation::Nearest,
        Grid::new(dims, density.collect()).unwrap(),
        Grid::new(dims, fibres.collect()).unwrap(),
        Grid::constant([albedo; 3]),
    );
    AnyMedium::Grid(medium.unwrap())
}

fn over(mesh: Mesh, volume: AnyMedium) -> AnyMedium {
    let shell = Shell::new(&mesh, -HALF_MM, HALF_MM).unwrap();
    let draping = Draping::new(DrapedMesh::new(mesh), Some(shell));
    let cloth = LevelledCloth::draped(vec![volume], None, LevelSteps::default(), draping);
    AnyMedium::Levelled(Box::new(cloth.unwrap()))
}

fn scene(media: Vec<AnyMedium>, lights: Vec<Light>) -> Scene {
    let pose = CameraPose::new(DVec3::new(0.6, -1.5, 4.0), DVec3::ZERO, DVec3::Y);
    let projection = Projection::Perspective { fov_rad: 0.5 };
    Scene {
        media,
        lights,
        camera: Camera::new(projection, pose, UVec2::splat(24), PixelFilter::Box).unwrap(),
    }
}

fn picture(scene: &Scene, integrator: Integrator, seed: u64) -> Film {
    let samples = organza_testing::sized(128, 2048);
    rendered(scene, integrator, samples, 40, seed).0
}

fn lamps() -> Vec<Light> {
    vec![
        sun(Vec3::new(0.4, 0.3, -0.87), 2.0),
        Light::from(EnvironmentLight::new(
            Rgb::new(0.3, 0.2, 0.1),
            Hemisphere::Back,
        )),
    ]
}

/// Mean square of the difference of two pictures in standard errors, over all
/// pixels and two channels; one in the mean for equal ones.
fn chi_square(a: &Film, b: &Film) -> f64 {
    let mut sum = Moments::default();
    for (p, q) in a.pixels().iter().zip(b.pixels()) {
        for channel in [0, 2] {
            let (x, y) = (p.moments(channel), q.moments(channel));
            let variance = x.variance() / x.count as f64 + y.variance() / y.count as f64;
            if variance > 0.0 {
                sum.add((x.mean - y.mean).powi(2) / variance);
            }
        }
    }
    sum.mean
}

/// Two triangles under the shell map are the flat patch; the known-bad twin has
/// its fibres a quarter turn off.
#[test]
fn a_flat_mesh_is_the_flat_patch() {
    let flat = scene(vec![tile(0.8)], lamps());
    let plane = |uv: Vec2| (uv.extend(0.0), Vec3::Z);
    let draped = |bend: &dyn Fn(Vec2) -> (Vec3, Vec3)| {
        let wide = mesh(Vec2::splat(16.0), UVec2::ONE, bend);
        scene(vec![over(wide, tile(0.8))], lamps())
    };
    for integrator in [Integrator::Woodcock, Integrator::Regular] {
        let reference = picture(&flat, integrator, 1);
        let same = chi_square(&reference, &picture(&draped(&plane), integrator, 2));
        // 1152 correlated values near one: deviation at most 0.06.
        // Margin: four of these deviations.
        let off = (same - 1.0).abs();
        assert!(off < 0.25, "{integrator:?}, seeds 1 and 2: {same}");
        let turned = |uv: Vec2| (Vec3::new(-uv.y, uv.x, 0.0), Vec3::Z);
        let other = chi_square(&reference, &picture(&draped(&turned), integrator, 2));
        assert!(other > 2.0, "{integrator:?}: the turned twin has {other}");
    }
}

/// What is seen in a furnace of radiance one from a point toward random
/// directions.
fn furnace(scene: &Scene, paths: u64, seed: u64) -> Moments {
    let mut stats = Stats::default();
    let mut moments = Moments::default();
    for index in 0..paths {
        let mut rng = PathRng::new(seed, 0, index);
        let w = warp::uniform_sphere(rng.unit2()).as_dvec3();
        let aim = DVec3::new(0.0, 0.0, 0.3) * f64::from(rng.unit());
        let sample = trace_from(
            scene,
            &scene.lights,
            (aim - 10.0 * w, w.normalize()),
            Integrator::Woodcock,
            10_000,
            &mut rng,
            &mut stats,
        );
        moments.add(f64::from(sample.radiance.0.x));
    }
    assert_eq!(stats.majorant_violations, 0);
    moments
}

fn cylinder(radius_mm: f32) -> impl Fn(Vec2) -> (Vec3, Vec3) {
    move |uv: Vec2| {
        let (s, c) = (uv.x / radius_mm).sin_cos();
        let n = Vec3::new(s, 0.0, c);
        (radius_mm * n + Vec3::new(0.0, uv.y, -radius_mm), n)
    }
}

/// Bent tightly enough that the shell's two sides differ by a third.
#[test]
fn a_bent_patch_conserves_energy() {
    let bent = |albedo| {
        let bent = mesh(Vec2::new(6.0, 4.0), UVec2::new(24, 4), &cylinder(2.0));
        scene(
            vec![over(bent, tile(albedo))],
            vec![white_sky(Hemisphere::All)],
        )
    };
    let seen = furnace(&bent(1.0), 4000, 5);
    let se = seen.standard_error();
    let off = (seen.mean - 1.0).abs();
    assert!(off < 4.0 * se + 1e-6, "seed 5: {} +- {se}", seen.mean);
    let lossy = furnace(&bent(0.99), 4000, 5);
    let most = 1.0 - 4.0 * lossy.standard_error();
    assert!(lossy.mean < most, "{}", lossy.mean);
}

/// Grey paper with holes: returns a share, passes a share, absorbs none.
struct Paper {
    gap: f32,
    back: f32,
}

impl Surface for Paper {
    fn gap(&self, _: Vec3, _: Footprint) -> f32 {
        self.gap
    }
    fn eval(&self, w_out: Vec3, w_in: Vec3, _: Footprint) -> Rgb {
        let share = if w_out.z * w_in.z > 0.0 {
            self.back
        } else {
            1.0 - self.back
        };
        Rgb::splat((1.0 - self.gap) * share * FRAC_1_PI)
    }
    fn sample(&self, w_out: Vec3, at: Footprint, rng: &mut PathRng) -> Option<LobeSample> {
        let side = if rng.unit() < self.back { 1.0 } else { -1.0 };
        let w = warp::cosine_hemisphere(rng.unit2());
        let w_in = Vec3::new(w.x, w.y, w.z * side * w_out.z.signum());
        let pdf = self.pdf(w_out, w_in, at);
        Some(LobeSample::new(w_in, Rgb::WHITE, pdf))
    }
    fn pdf(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> f32 {
        self.eval(w_out, w_in, at).0.x * w_in.z.abs()
    }
    fn axis(&self, _: Footprint) -> Vec3 {
        Vec3::X
    }
}

fn paper(gap: f32, back: f32, over: Option<Mesh>) -> AnyMedium {
    let sheet = Some(Box::new(Paper { gap, back }) as Box<dyn Surface>);
    let steps = LevelSteps::default();
    let cloth = match over {
        None => {
            let bounds = Aabb::new(Vec3::new(0.0, 0.0, -0.2), Vec3::new(1.0, 1.0, 0.4));
            let cell_grid = CellGrid::new(bounds, UVec3::ONE, true).unwrap();
            LevelledCloth::new(Vec::new(), sheet, steps, cell_grid)
        }
        Some(mesh) => {
            let draping = Draping::new(DrapedMesh::new(mesh), None);
            LevelledCloth::draped(Vec::new(), sheet, steps, draping)
        }
    };
    AnyMedium::Levelled(Box::new(cloth.unwrap()))
}

#[test]
fn sheets_conserve_energy_flat_and_over_a_mesh() {
    // Faces with normals of their own: no interpolated normal hides light.
    let gutter = |uv: Vec2| (Vec3::new(uv.x, uv.y, 0.4 * uv.x.abs()), Vec3::ZERO);
    let smooth = mesh(Vec2::splat(4.0), UVec2::new(2, 1), &gutter);
    let faces: Vec<_> = smooth.triangles().to_vec();
    let faces = faces.into_iter().map(|f| {
        f.map(|v| Vertex {
            normal: Vec3::ZERO,
            ..v
        })
    });
    let apart: Vec<[u32; 3]> = (0..4).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let faceted = Mesh::new(faces.collect(), &apart).unwrap();
    for over in [None, Some(faceted)] {
        let seen = furnace(
            &scene(
                vec![paper(0.3, 0.6, over)],
                vec![white_sky(Hemisphere::All)],
            ),
            2000,
            7,
        );
        let rounding = 4.0 * f64::from(f32::EPSILON);
        assert!((seen.mean - 1.0).abs() < rounding, "seed 7: {}", seen.mean);
        assert!(seen.variance() < 4.0 * f64::from(f32::EPSILON));
    }
}

/// A directional light on flat paper, through shadow rays: reflected, passed on
/// and straight through have closed forms.
#[test]
fn lit_paper_has_its_closed_form() {
    let (gap, back) = (0.25, 0.6);
    let lamp = sun(Vec3::new(0.6, 0.0, -0.8), 3.0);
    let flat = scene(vec![paper(gap, back, None)], vec![lamp.clone()]);
    let plane = |uv: Vec2| (uv.extend(0.1), Vec3::Z);
    let wide = mesh(Vec2::splat(40.0), UVec2::ONE, &plane);
    let draped = scene(vec![paper(gap, back, Some(wide))], vec![lamp.clone()]);
    for scene in [&flat, &draped] {
        for (from, share) in [(1.0, back), (-1.0, 1.0 - back)] {
            // Seen with 1 - gap; nothing comes back to the sheet.
            let expected = f64::from((1.0 - gap) * share * FRAC_1_PI * 3.0 * 0.8);
            let mut seen = Moments::default();
            let mut stats = Stats::default();
            for index in 0..20_000 {
                let mut rng = PathRng::new(9, 1, index);
                let ray = (
                    DVec3::new(0.3, 0.2, 8.0 * from),
                    DVec3::new(0.0, 0.0, -from),
                );
                let by = Integrator::Woodcock;
                let s = trace_from(scene, &scene.lights, ray, by, 50, &mut rng, &mut stats);
                assert_eq!(s.first.is_some(), s.bounces > 0);
                seen.add(f64::from(s.radiance.0.x));
            }
            let se = seen.standard_error();
            let off = (seen.mean - expected).abs();
            let mean = seen.mean;
            assert!(off < 4.0 * se, "seed 9: {mean} for {expected} +- {se}");
        }
    }
}

/// A path meets one representation; the mean over paths is their blend.
#[test]
fn levels_blend_by_the_width_of_the_pixel() {
    let bounds = Aabb::new(Vec3::new(0.0, 0.0, -0.2), Vec3::ONE);
    let cell_grid = CellGrid::new(bounds, UVec3::ONE, true).unwrap();
    let camera = |width_mm| orthographic(5.0 * DVec3::Z, DVec3::ZERO, width_mm, 16);
    // All straight through, then a sheet that hides half of what is behind.
    let empty = AnyMedium::Grid(
        GridMedium::new(
            bounds,
            true,
            Interpolation::Nearest,
            Grid::constant([0.0]),
            Grid::constant(Sym3::axial(Vec3::X, 1.0, 0.5).to_array()),
            Grid::constant([0.0; 3]),
        )
        .unwrap(),
    );
    let sheet: Box<dyn Surface> = Box::new(Paper {
        gap: 0.5,
        back: 1.0,
    });
    let steps = LevelSteps::new(vec![(0.1, 0.4)]).unwrap();
    let cloth = LevelledCloth::new(vec![empty], Some(sheet), steps, cell_grid).unwrap();
    let media = vec![AnyMedium::Levelled(Box::new(cloth))];
    let mut scene = Scene {
        media,
        lights: vec![white_sky(Hemisphere::Back)],
        camera: camera(1.0),
    };
    for (pixel_mm, weight) in [(0.05, 0.0), (0.2, 0.5), (0.5, 1.0)] {
        scene.camera = camera(16.0 * pixel_mm);
        let (mean, se) = picture(&scene, Integrator::Woodcock, 4).mean()[0];
        let expected = 1.0 - 0.5 * weight;
        let off = (mean - expected).abs();
        let is_near = off < 4.0 * se + 1e-9;
        assert!(is_near, "seed 4, {pixel_mm}: {mean} for {expected} +- {se}");
    }
}
