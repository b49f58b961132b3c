//! One path: the random walk from the camera against the light.

use crate::{Collision, Escape, FirstEvent, Integrator, Light, PathSample, Scene, Stats, Tracking};
use glam::{DVec3, UVec2, Vec3};
use organza_basis::{PathRng, Ray, Rgb};
use organza_kernel::roulette::survivor;

/// A shadow ray is traced surely when the light scattered toward the camera is
/// at least a tenth of the irradiance, per steradian; fainter light is traced
/// in proportion and weighed up.
const SHADOW_SCALE: f32 = 10.0;

/// The same for light that a sheet scatters. A shadow ray through volumes or among fibres costs
/// as much as many steps of the walk, so that faint light is better traced rarely. One past
/// sheets is cheap, and leaving it out cost more in noise than it saved.
const SHADOW_SCALE_OF_SHEETS: f32 = 100.0;

/// No path has more events, whatever is asked for: a path that is never absorbed and
/// cannot get out would not end. In lossless matter at most a thousandth of the paths
/// get as far, however thick it is; they count as cut.
pub const MAX_EVENTS: u32 = 1 << 20;

/// Events in a row at one place, to single precision, after which a path ends: matter
/// there is denser than places are apart. It counts as cut.
const MAX_EVENTS_IN_PLACE: u32 = 1000;

/// Traces path `rng` of a pixel.
pub fn trace_path(
    scene: &Scene,
    pixel: UVec2,
    integrator: Integrator,
    max_bounces: u32,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> PathSample {
    let ray = scene.camera.ray(pixel, rng);
    let tracking = scene.tracking(integrator, ray, rng);
    trace_from(scene, &scene.lights, ray, tracking, max_bounces, rng, stats)
}

/// Traces one path from an origin in mm along a unit direction, under `lights`
/// in place of the scene's own; the camera plays no part. An [`Integrator`]
/// alone meets the finest representation of everything.
///
/// [`Light`] describes how each kind of light is sampled. Densities are those
/// of directions at the event, so that light may leave matter elsewhere than
/// it came in.
pub fn trace_from(
    scene: &Scene,
    lights: &[Light],
    (origin_mm, direction): (DVec3, DVec3),
    tracking: impl Into<Tracking>,
    max_bounces: u32,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> PathSample {
    let mut tracking = tracking.into();
    let max_bounces = max_bounces.min(MAX_EVENTS);
    stats.paths += 1;
    // The path starts near what it meets first, so that a far camera costs no precision.
    let start_mm = scene.near_start(lights, origin_mm, direction);
    let mut ray = Ray::new(
        origin_mm + start_mm * direction,
        direction.as_vec3().normalize(),
    );
    let mut sample = PathSample::default();
    let mut throughput = Rgb::WHITE;
    // Where the ray's direction was drawn, and how densely; none by a camera.
    let mut drawn: Option<(DVec3, f32)> = None;
    let mut events_in_place = 0;
    loop {
        let collision = scene.first_collision(&ray, tracking, rng, stats);
        let reach = collision.as_ref().map_or(f64::INFINITY, |c| c.t);
        for light in lights {
            if light.distance_along(&ray).is_some_and(|t| t <= reach) {
                let share = drawn.map_or(1.0, |(from, pdf)| {
                    light.walk_share(from.as_vec3(), ray.direction, pdf)
                });
                find(
                    &mut sample,
                    share * throughput * light.radiance_toward(ray.direction),
                );
            }
        }
        let Some(collision) = collision else {
            sample.escape = Some(Escape {
                direction: ray.direction,
                throughput,
            });
            return sample;
        };
        let w_out = -ray.direction;
        find(&mut sample, throughput * collision.emitted(w_out));
        if sample.bounces == 0 {
            sample.first = collision.info().map(|info| FirstEvent {
                info,
                depth_mm: start_mm + collision.t,
            });
        }
        let at = ray.at(collision.t);
        let is_in_place = drawn.is_some_and(|(from, _)| from.as_vec3() == at.as_vec3());
        events_in_place = if is_in_place { events_in_place + 1 } else { 0 };
        if sample.bounces == max_bounces || events_in_place == MAX_EVENTS_IN_PLACE {
            stats.cut += 1;
            return sample;
        }
        sample.bounces += 1;
        let event = Event {
            at,
            w_out,
            throughput,
            collision: &collision,
            is_first: sample.bounces == 1,
        };
        for light in lights {
            let light_in = event.light_from(light, scene, tracking, rng, stats);
            find(&mut sample, light_in);
        }
        let Some(scatter) = collision.sample(w_out, rng) else {
            sample.absorbed += throughput;
            return sample;
        };
        sample.absorbed += throughput * (Rgb::WHITE - scatter.weight);
        tracking.progress.events = sample.bounces;
        let least = tracking.progress.least_weight;
        tracking.progress.least_weight = least.min((throughput * scatter.weight).mean());
        let Some(carried) = survivor(throughput * scatter.weight, rng) else {
            return sample;
        };
        throughput = carried;
        drawn = Some((event.at, scatter.pdf));
        ray = Ray::new(event.start(scatter.w_in, rng), scatter.w_in).leaving(collision.yarn());
    }
}

/// Adds light that a path has found: direct light before its second event.
fn find(sample: &mut PathSample, light: Rgb) {
    sample.radiance += light;
    if sample.bounces <= 1 {
        sample.direct += light;
    }
}

/// A scattering event of a walk.
struct Event<'a> {
    at: DVec3,
    w_out: Vec3,
    throughput: Rgb,
    collision: &'a Collision<'a>,
    is_first: bool,
}

impl Event<'_> {
    /// Where a ray toward `w_in` starts.
    fn start(&self, w_in: Vec3, rng: &mut PathRng) -> DVec3 {
        self.at + self.collision.exit_mm(self.w_out, w_in, rng).as_dvec3()
    }

    /// What a shadow ray to a light adds to the path.
    fn light_from(
        &self,
        light: &Light,
        scene: &Scene,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Rgb {
        let Some(toward) = light.sample_toward(self.at.as_vec3(), rng) else {
            return Rgb::BLACK;
        };
        let w_in = toward.w_in;
        let scattered = self.collision.eval(self.w_out, w_in);
        if scattered.is_black() {
            return Rgb::BLACK;
        }
        let share = light.shadow_share(&toward, &|| self.collision.pdf(self.w_out, w_in));
        let unshadowed = share * self.throughput * scattered * toward.irradiance;
        let scale = if self.collision.is_on_sheet() {
            SHADOW_SCALE_OF_SHEETS
        } else {
            SHADOW_SCALE
        };
        let keep = (scale * unshadowed.mean() / toward.irradiance.mean()).min(1.0);
        if !(keep > 0.0 && (keep == 1.0 || rng.unit() < keep)) {
            return Rgb::BLACK;
        }
        let local = if self.is_first {
            self.collision.local_visibility(self.at, self.w_out, w_in)
        } else {
            None
        };
        let (visible, start) = match local {
            Some((visible, skip_mm)) => (visible, self.at + f64::from(skip_mm) * w_in.as_dvec3()),
            None => (1.0, self.start(w_in, rng)),
        };
        let shadow = Ray::new(start, w_in).leaving(self.collision.yarn());
        let Some(reach) = light.distance_along(&shadow) else {
            return Rgb::BLACK;
        };
        let through = scene.transmittance(&shadow, reach, tracking, rng, stats);
        unshadowed * (visible * through / keep)
    }
}
