//! Paths among several bodies and planes: where their rays go on, and what happens at
//! planes.

use super::cell_ray::CellRay;
use super::grid::GridPoint;
use super::matter::FibreMatter;
use super::paths::{Paths, State, get, put};
use super::plane::Plane;
use super::shade::{SHADOW_SCALE, Shading};
use super::shadows::Shadows;
use super::trip::{TripEnd, TripStart};
use crate::roulette::{FIBRE_SCALE, survivors};
use glam::{DVec3, Vec3};
use organza_basis::{PathRng, Ray, Rgb};
use organza_film::Stats;
use organza_lanes::math::V3;
use organza_lanes::one;
use organza_light::{Light, LightSearch};

/// Sends the path of a slot off along its direction.
pub fn begin_trip(
    matter: &FibreMatter,
    paths: &mut Paths,
    slot: usize,
    (origin_mm, direction): (DVec3, DVec3),
    start: Option<TripStart>,
) {
    let ray = (origin_mm, direction);
    paths.trips[slot].begin(matter, ray, start, f64::INFINITY);
    continue_trip(matter, paths, slot);
}

/// The next stretch of the path of a slot, or what its ray has met.
pub fn continue_trip(matter: &FibreMatter, paths: &mut Paths, slot: usize) {
    let trip = &mut paths.trips[slot];
    if let Some(ray) = trip.next(matter) {
        ray.prepare_head(matter);
        paths.rays[slot] = ray;
        paths.state[slot] = State::Flying;
        return;
    }
    paths.rays[slot] = CellRay::none();
    let whole_mm = trip.reach_mm().max(0.0);
    match trip.met() {
        TripEnd::Nothing => {
            paths.state[slot] = State::Left;
            return;
        }
        TripEnd::Plane(_) => paths.state[slot] = State::MetPlane,
        TripEnd::Fibre(met) => {
            matter.joints.prefetch(met.hit.piece);
            paths.met.put(slot, &met.hit);
            paths.met.put_frame(slot, met);
            paths.state[slot] = State::Met;
        }
    }
    if paths.bounces[slot] == 0 {
        paths.before_mm[slot] = whole_mm;
        paths.met.distance[slot] = 0.0;
    } else {
        paths.met.distance[slot] = whole_mm as f32;
    }
}

/// A place in the cells of the body that the path of a slot has met, in the world.
pub fn point_mm(matter: &FibreMatter, paths: &Paths, slot: usize, at: &GridPoint) -> DVec3 {
    let Some(trip) = paths.trips.get(slot) else {
        return matter.bodies[0].cells.grid.world_mm(at);
    };
    let TripEnd::Fibre(met) = trip.met() else {
        return trip.end_mm();
    };
    let body = &matter.bodies[usize::from(met.body)];
    if body.shell.is_none() {
        return body.cells.grid.world_mm(at);
    }
    let from_met = at.at_mm - (met.hit.axis_at_mm + met.hit.out_mm);
    trip.end_mm() + (met.stretch * from_met).as_dvec3()
}

/// A ray that starts at the fibre that the path of a slot has met, from a place in its cells.
pub fn start_at(paths: &Paths, slot: usize, at: GridPoint) -> TripStart {
    let (body, part) = match paths.trips.get(slot).map(|trip| trip.met()) {
        Some(TripEnd::Fibre(met)) => (met.body, met.part),
        _ => (0, 0),
    };
    TripStart { body, at, part }
}

/// The event of a path that has met a plane.
pub fn meet_plane(
    shading: &Shading<'_>,
    paths: &mut Paths,
    slot: usize,
    shadows: &mut Shadows,
    stats: &mut Stats,
) {
    let matter = shading.matter;
    let TripEnd::Plane(number) = *paths.trips[slot].met() else {
        return;
    };
    let plane = &matter.planes[usize::from(number)];
    let at_mm = paths.trips[slot].end_mm();
    let w_out = -get(&paths.direction, slot);
    let carried = Rgb(get(&paths.throughput, slot));
    paths.find_light(slot, (carried * plane.emitted(w_out)).0);
    if paths.bounces[slot] == shading.max_bounces {
        stats.cut += 1;
        paths.state[slot] = State::Ended;
        return;
    }
    paths.bounces[slot] += 1;
    let mut names = paths.rng::<one::F>(slot);
    let [low, high, chance] = names.bits(true);
    let mut rng = PathRng::from_seed(u64::from(low.0) | u64::from(high.0) << 32);
    paths.put_rng::<one::F>(slot, &names);
    let event = PlaneEvent {
        plane,
        at_mm,
        w_out,
        carried,
    };
    for light in shading.lights {
        if let Some((ray, most_mm, light_in)) = event.light_from(light, &mut rng) {
            shadows.send(matter, ray, None, most_mm, (slot, light_in.0));
        }
    }
    let w_in = plane.draw(w_out, &mut rng);
    let pdf = plane.pdf(w_out, w_in);
    let weight = if pdf > 0.0 {
        plane.reflectance
    } else {
        Rgb::BLACK
    };
    let kept = carried * weight;
    let absorbed = get(&paths.absorbed, slot) + (carried.0 - kept.0);
    put(&mut paths.absorbed, slot, absorbed);
    let chance = (chance.0 >> 8) as f32 * (1.0 / 16_777_216.0);
    let (lives, on) = survivors::<one::F>(V3::splat(kept.0), FIBRE_SCALE, one::F(chance), true);
    if !lives {
        paths.state[slot] = State::Ended;
        return;
    }
    let onward = Vec3::new(on.x.0, on.y.0, on.z.0);
    put(&mut paths.throughput, slot, onward);
    put(&mut paths.direction, slot, w_in);
    paths.pdf[slot] = pdf;
    paths.drawn_at_mm[slot] = at_mm.as_vec3();
    let from = plane.start_mm(at_mm, w_in);
    paths.sent_from_mm[slot] = from;
    begin_trip(matter, paths, slot, (from, w_in.as_dvec3()), None);
}

struct PlaneEvent<'a> {
    plane: &'a Plane,
    at_mm: DVec3,
    w_out: Vec3,
    carried: Rgb,
}

impl PlaneEvent<'_> {
    /// A shadow ray, how far it goes, and what it adds if nothing is in its way.
    fn light_from(&self, light: &Light, rng: &mut PathRng) -> Option<((DVec3, DVec3), f64, Rgb)> {
        if light.search() == LightSearch::Walk {
            return None;
        }
        let drawn = light.sample_toward(self.at_mm.as_vec3(), rng)?;
        let pdf = self.plane.pdf(self.w_out, drawn.w_in);
        let scattered = pdf * self.plane.reflectance;
        if scattered.is_black() {
            return None;
        }
        let share = light.shadow_share(&drawn, &|| pdf);
        let light_in = share * self.carried * scattered * drawn.irradiance;
        let keep = (SHADOW_SCALE * light_in.mean() / drawn.irradiance.mean()).min(1.0);
        if !(keep > 0.0 && (keep == 1.0 || rng.unit() < keep)) {
            return None;
        }
        let from = self.plane.start_mm(self.at_mm, drawn.w_in);
        let most = light.distance_along(&Ray::new(from, drawn.w_in))?;
        let ray = (from, drawn.w_in.as_dvec3());
        Some((ray, most, light_in / keep))
    }
}
