//! One path: the random walk from the camera against the light.

use crate::{Light, Scene, SiteInfo, Stats};
use glam::{DVec3, UVec2, Vec3};
use organza_basis::{PathRng, Ray, Rgb};

/// How distances and transmittances are found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Integrator {
    /// Delta tracking for collisions, ratio tracking for shadow rays.
    #[default]
    Woodcock,
    /// Exact stepping through constant voxels, with closed-form transmittance
    /// (Algorithm 6 of [Schroeder2012], corrected).
    Regular,
}

/// The first event of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FirstEvent {
    /// What is there.
    pub info: SiteInfo,
    /// Distance from the camera.
    pub depth_mm: f64,
}

/// How a path left the matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Escape {
    /// Unit direction in which it went.
    pub direction: Vec3,
    /// What it still carried.
    pub throughput: Rgb,
}

/// What one path found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathSample {
    /// Radiance toward the camera.
    pub radiance: Rgb,
    /// Scattering events along the path.
    pub bounces: u32,
    /// Its first event, `None` when the camera saw straight through.
    pub first: Option<FirstEvent>,
    /// Estimate of the share that was absorbed along the way.
    pub absorbed: Rgb,
    /// How it left the matter, unless it ended inside.
    pub escape: Option<Escape>,
}

/// Survival probability of Russian roulette over the mean throughput. A path
/// lives on surely until it carries a fifth of what it began with, which cost
/// against variance left flat between 3 and 8.
const ROULETTE_SCALE: f32 = 5.0;

/// A shadow ray is traced surely when the light scattered toward the camera is
/// at least a tenth of the irradiance, per steradian; fainter light is traced
/// in proportion and weighed up.
const SHADOW_SCALE: f32 = 10.0;

/// Traces path `rng` of a pixel.
pub fn trace_path(
    scene: &Scene,
    pixel: UVec2,
    integrator: Integrator,
    max_bounces: u32,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> PathSample {
    let (origin_mm, direction) = scene.camera.ray(pixel, rng);
    trace_from(
        scene,
        &scene.lights,
        (origin_mm, direction),
        integrator,
        max_bounces,
        rng,
        stats,
    )
}

/// Traces one path from an origin in mm along a unit direction, under `lights`
/// in place of the scene's own; the camera plays no part.
///
/// Light of one direction is gathered at every event through a shadow ray;
/// the environment by escaping, because for light from everywhere a shadow
/// ray in a random direction is the worse estimate.
pub fn trace_from(
    scene: &Scene,
    lights: &[Light],
    (origin_mm, direction): (DVec3, DVec3),
    integrator: Integrator,
    max_bounces: u32,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> PathSample {
    stats.paths += 1;
    // The path goes on in f32 from a point near the matter, so that a far
    // camera costs no precision.
    let start_mm = scene.near_start(origin_mm, direction);
    let mut ray = Ray::new(
        (origin_mm + start_mm * direction).as_vec3(),
        direction.as_vec3().normalize(),
    );
    let mut sample = PathSample {
        radiance: Rgb::BLACK,
        bounces: 0,
        first: None,
        absorbed: Rgb::BLACK,
        escape: None,
    };
    let mut throughput = Rgb::WHITE;
    loop {
        let Some(collision) = scene.first_collision(&ray, integrator, rng, stats) else {
            let background = lights
                .iter()
                .fold(Rgb::BLACK, |sum, l| sum + l.radiance_toward(ray.direction));
            sample.radiance += throughput * background;
            sample.escape = Some(Escape {
                direction: ray.direction,
                throughput,
            });
            return sample;
        };
        if sample.first.is_none() {
            sample.first = Some(FirstEvent {
                info: collision.info(),
                depth_mm: start_mm + f64::from(collision.t),
            });
        }
        if sample.bounces == max_bounces {
            stats.cut += 1;
            return sample;
        }
        sample.bounces += 1;
        let at = ray.at(collision.t);
        let w_out = -ray.direction;
        for light in lights {
            if let Light::Directional {
                direction,
                irradiance,
            } = *light
            {
                let scattered = throughput * collision.eval(w_out, -direction) * irradiance;
                let keep = (SHADOW_SCALE * scattered.mean() / irradiance.mean()).min(1.0);
                if keep > 0.0 && (keep == 1.0 || rng.unit() < keep) {
                    let from = at + collision.exit_mm(w_out, -direction, rng);
                    let shadow = Ray::new(from, -direction);
                    let through = scene.transmittance(&shadow, integrator, rng, stats);
                    sample.radiance += scattered * (through / keep);
                }
            }
        }
        let Some(scatter) = collision.sample(w_out, rng) else {
            sample.absorbed += throughput;
            return sample;
        };
        sample.absorbed += throughput * (Rgb::WHITE - scatter.weight);
        throughput *= scatter.weight;
        let survival = ROULETTE_SCALE * throughput.mean();
        if survival < 1.0 {
            if rng.unit() >= survival {
                return sample;
            }
            throughput *= 1.0 / survival;
        }
        let from = at + collision.exit_mm(w_out, scatter.w_in, rng);
        ray = Ray::new(from, scatter.w_in);
    }
}
