//! The cases that break renderers, through every medium and tracker: an answer
//! that is finite, not negative and keeps the light, or a refusal. `docs/hard_cases.md`
//! lists the outcomes.

mod geometry;
mod matter;

use geometry::{fibres, geometries, strewn};
use glam::{DVec3, UVec2, Vec3};
use matter::{Matter, gloss, grids, matters, octree};
use organza_basis::hypothesis::{sidak, z_test};
use organza_basis::{Rgb, unwatched, warp};
use organza_measure::{Angles, Effort, Pair, VolumePatch, measure_pairs};
use organza_transport::{
    AnyMedium, Backend, Camera, CameraPose, DirectionalLight, EnvironmentLight, FlakeFamily,
    FlakeOctreeMedium, FlakeOptics, Hemisphere, Integrator, Light, PixelFilter, Projection,
    RenderSettings, Rendering, Scene, VoxelEngine, flatten,
};
use organza_volume::FibreFootprint;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

const SEED: u64 = 0x4a7d;
const VOXEL_MM: f32 = 0.02;
const SIZE_MM: Vec3 = Vec3::new(0.12, 0.12, 0.08);

fn full(small: u64) -> u64 {
    organza_testing::sized(small, 16 * small)
}

/// Where a camera stands: toward it from the middle, and how far.
fn views() -> [(&'static str, Vec3, f64); 5] {
    let grazing = warp::direction_from_angles(89.9f32.to_radians(), 0.3);
    [
        ("oblique", Vec3::new(0.48, 0.36, 0.8), 3.0),
        ("straight on", Vec3::Z, 3.0),
        ("grazing", grazing, 30.0),
        ("inside", Vec3::new(0.48, 0.36, 0.8), 1e-3),
        ("along the fibres, in a voxel plane", Vec3::X, 0.04),
    ]
}

/// The furnace, or light from where it is hardest: straight from behind what
/// is looked at, grazing, along the fibres in a voxel plane.
fn lights(view: Vec3, is_furnace: bool) -> Vec<Light> {
    let constant = |hemisphere| Light::from(EnvironmentLight::new(Rgb::WHITE, hemisphere));
    let directional = |direction| Light::from(DirectionalLight::new(direction, Rgb::WHITE));
    if is_furnace {
        vec![constant(Hemisphere::All)]
    } else {
        let grazing = warp::direction_from_angles(89.9f32.to_radians(), 3.0);
        vec![
            constant(Hemisphere::Back),
            directional(-view),
            directional(grazing),
            directional(Vec3::X),
            directional(Vec3::Y),
        ]
    }
}

/// The outcome of a tracker in a scene; `None` where it does not support the scene.
fn take(scene: &Scene, tracker: Tracker, spp: u64) -> Option<Outcome> {
    let integrator = match tracker {
        Tracker::Exact => Integrator::Regular,
        _ => Integrator::Woodcock,
    };
    if tracker == Tracker::Exact && !scene.media.iter().all(AnyMedium::is_piecewise_constant) {
        return None;
    }
    let settings = RenderSettings {
        integrator,
        samples: 0..spp,
        max_bounces: 20_000,
        seed: SEED,
        crop: None,
    };
    let mut rendering = Rendering::new(scene, settings.clone()).unwrap();
    if tracker == Tracker::Kernel {
        let flat = flatten(scene, &settings, u64::MAX).ok()?;
        let engine = VoxelEngine::new(Arc::new(flat), Backend::Scalar).unwrap();
        rendering = rendering.with_engine(Box::new(engine));
    }
    let rendering = rendering.take(spp, &|_| ControlFlow::Continue(()));
    Some(rendering.map_or_else(
        |e| Outcome::Failed(e.to_string()),
        |r| {
            let stats = *r.stats();
            let [(mean, se), ..] = r.film().mean();
            let pixels = r.film().pixels();
            let least = pixels.iter().map(|p| p.moments(0).mean);
            Outcome::Picture {
                mean,
                se,
                least: least.fold(f64::INFINITY, f64::min),
                through: pixels
                    .iter()
                    .map(|p| f64::from(p.straight_through()))
                    .sum::<f64>()
                    / pixels.len() as f64,
                events: stats.collisions as f64 / stats.paths.max(1) as f64,
                rejected: stats.rejected,
                cut: stats.cut,
            }
        },
    ))
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Tracker {
    /// Delta and ratio tracking.
    Woodcock,
    /// Exact steps through constant voxels.
    Exact,
    /// The vector kernel.
    Kernel,
}

#[derive(Debug)]
enum Outcome {
    /// With its message.
    Failed(#[allow(dead_code)] String),
    Picture {
        mean: f64,
        se: f64,
        least: f64,
        /// Share of camera rays that met nothing.
        through: f64,
        events: f64,
        rejected: u64,
        cut: u64,
    },
}

/// Every view, light and tracker of one matter, which is given back.
fn survive(case: &str, matter: Matter, wrong: &mut String, pictures: &mut u32) {
    let Matter {
        name,
        medium,
        is_white,
        slack,
    } = matter;
    let lattice = medium.cell_grid().unwrap();
    let bounds = lattice.bounds_mm();
    // In a voxel plane, whatever the number of voxels.
    let middle = (bounds.min + 0.5 * bounds.size()).as_dvec3();
    let mut media = vec![medium];
    for (view, toward, distance) in views() {
        for is_furnace in [true, false] {
            let pose = CameraPose {
                origin_mm: middle + distance * toward.as_dvec3(),
                target_mm: middle,
                up: if toward.z > 0.9 { DVec3::Y } else { DVec3::Z },
            };
            let projection = Projection::Orthographic { width_mm: 0.02 };
            let camera = Camera::new(projection, pose, UVec2::splat(3), PixelFilter::Box);
            let scene = Scene {
                media: std::mem::take(&mut media),
                lights: lights(toward, is_furnace),
                camera: camera.unwrap(),
            };
            // Products of many weights are skewed: their mean takes more paths.
            let spp = full(if is_furnace && is_white { 60 } else { 6 });
            for tracker in [Tracker::Woodcock, Tracker::Exact, Tracker::Kernel] {
                let Some(outcome) = take(&scene, tracker, spp) else {
                    continue;
                };
                *pictures += 1;
                let why = match &outcome {
                    Outcome::Failed(_) => Some("ended in an error"),
                    Outcome::Picture { rejected: 1.., .. } => Some("samples rejected"),
                    Outcome::Picture { cut: 1.., .. } => Some("paths without an end"),
                    Outcome::Picture { mean, .. } if !mean.is_finite() => Some("not finite"),
                    // The kernel's noise may be negative, its value is not.
                    Outcome::Picture { mean, se, .. } if *mean < -5.0 * se => Some("negative"),
                    Outcome::Picture { least, .. }
                        if tracker != Tracker::Kernel && *least < 0.0 =>
                    {
                        Some("a negative pixel")
                    }
                    Outcome::Picture {
                        mean,
                        se,
                        through,
                        events,
                        ..
                    } if is_furnace => {
                        // Near fields conserve light in the mean over offsets; at a single
                        // offset the roughest return 0.91 to 1.41 of it near the axis
                        // (docs/hard_cases.md). Packed events draw offsets evenly: 0.984
                        // was seen. Among explicit fibres those in front hide some
                        // offsets more than others: 1.096. Bounds are 1.5 times that.
                        let is_along = view == "grazing" || view.starts_with("along the fibres");
                        let uneven = match name.as_str() {
                            "clear rough fibres, Packed" if is_along => 0.024,
                            "clear rough fibres, explicit" if is_along => 0.15,
                            _ => 0.0,
                        };
                        let tolerance = 5.0 * se + slack * (1.0 + events) + uneven;
                        let least = if is_white { 1.0 } else { *through };
                        // The gloss of black fibres remains, at most one event of it. It is
                        // known where all fibres are parallel and seen from aside. Fibres that
                        // are seen nearly along themselves reflect all that grazes them, by
                        // Fresnel, so that no bound below 1 holds there.
                        let gloss = if !name.contains("fibres") {
                            0.0
                        } else if case.contains("parallel") && !is_along {
                            gloss(toward)
                        } else {
                            1.0
                        };
                        let most = least + (1.0 - least) * gloss;
                        let off = (least - mean).max(mean - most);
                        (off > tolerance).then_some("light gained or lost")
                    }
                    Outcome::Picture { .. } => None,
                };
                if let Some(why) = why {
                    let _ = writeln!(
                        wrong,
                        "{case}; {name}; {view}; {tracker:?}; furnace {is_furnace}: {why}: {outcome:?}"
                    );
                }
            }
            media = scene.media;
        }
    }
}

#[test]
fn every_medium_and_tracker_survives_every_geometry() {
    let (mut wrong, mut log, mut pictures) = (String::new(), String::new(), 0);
    // In short every eighth of them, others for each of the eight geometries.
    let step = organza_testing::sized(8, 1);
    for (first, (case, source)) in geometries().into_iter().enumerate() {
        let started = Instant::now();
        let _ = writeln!(log, "{case}");
        let all = matters(&source, &mut log);
        let _ = writeln!(log, "    {} kinds of matter", all.len());
        for matter in all.into_iter().skip(first % step).step_by(step) {
            survive(case, matter, &mut wrong, &mut pictures);
        }
        println!("{case}: {:.1} s", started.elapsed().as_secs_f64());
    }
    for matter in grids().into_iter().step_by(organza_testing::sized(5, 1)) {
        survive("grids", matter, &mut wrong, &mut pictures);
    }
    println!("{log}{pictures} pictures");
    assert!(wrong.is_empty(), "seed {SEED:#x}\n{wrong}");
    assert!(
        pictures > organza_testing::sized(400, 2000),
        "only {pictures}"
    );
}

/// Light takes the same way back through a slab of sine-power flakes.
#[test]
fn a_slab_of_sine_power_flakes_is_reciprocal() {
    let source = fibres(
        Vec3::ZERO,
        SIZE_MM,
        true,
        strewn(Vec3::ZERO, 300, 0.4, 0.004),
    );
    let optics = vec![FlakeOptics::new(Rgb::new(0.9, 0.6, 0.98), 0.3)];
    let tree = octree(&source, FibreFootprint::Covered);
    let family = FlakeFamily::named("sin-power").unwrap();
    let medium = FlakeOctreeMedium::new(tree, 0, optics, family).unwrap();
    let media = vec![AnyMedium::FlakeOctree(medium)];
    let patch = VolumePatch::of_media(media, Integrator::Woodcock).unwrap();
    let pairs: Vec<Pair> = [
        [Angles::new(20.0, 10.0), Angles::new(65.0, 200.0)],
        [Angles::new(0.0, 0.0), Angles::new(50.0, 80.0)],
        [Angles::new(30.0, 0.0), Angles::new(140.0, 130.0)],
        [Angles::new(70.0, 300.0), Angles::new(165.0, 20.0)],
    ]
    .into_iter()
    .flat_map(|[a, b]| [[a, b], [b, a]])
    .map(|[incident, exitant]| Pair { incident, exitant })
    .collect();
    let effort = Effort::new(full(20_000), SEED);
    let values = measure_pairs(&patch, &pairs, &effort, &unwatched)
        .unwrap()
        .list;
    let (mut least, mut twin) = (1.0f64, 1.0f64);
    for both in values.chunks_exact(2) {
        for c in 0..3 {
            let [a, b] = [&both[0], &both[1]].map(|v| (v.bsdf.mean[c], v.bsdf.se[c]));
            assert!(a.0 > 0.0 && b.0 > 0.0);
            least = least.min(z_test(a.0, b.0, a.1.hypot(b.1)).p_value);
            // The twin forgets to divide by the cosine of the incident side.
            let [p, q] =
                [&both[0], &both[1]].map(|v| v.pair.incident.theta_deg.to_radians().cos().abs());
            let se = (a.1 * p).hypot(b.1 * q);
            twin = twin.min(z_test(a.0 * p, b.0 * q, se).p_value);
        }
    }
    let limit = sidak(1e-4, 12);
    println!("least p-value {least:.2e}, of the twin {twin:.1e}");
    assert!(least > limit, "seed {SEED:#x}: {least} {values:?}");
    // Margin: the probability at which the twin is rejected.
    assert!(twin < 1e-9, "seed {SEED:#x}: the twin passed, {twin}");
}
