//! Events of a wave: light, a new direction, roulette.

use super::branches::divide;
use super::cache::CacheUse;
use super::cell_ray::CellRay;
use super::grid::GridPoint;
use super::importance::Importance;
use super::matter::FibreMatter;
use super::met_fibres::{
    LeavingPoint, MetFibres, leaving_point, met_fibres, packed_ray, world_mm, yarn,
};
use super::own_frame::OwnFrame;
use super::paths::{Paths, State, get, load, put, store};
use super::several::{begin_trip, point_mm, start_at};
use super::shadows::Shadows;
use super::trip::TripEnd;
use super::work::WAVE;
use crate::drawn_light::DrawnLight;
use crate::packed::PackedPart;
use crate::packed::volume_ray::VolumeRay;
use crate::roulette::{FIBRE_SCALE, survivors, survivors_by};
use glam::Vec3;
use organza_basis::Ray;
use organza_film::{FirstEvent, SiteInfo, Stats};
use organza_lanes::math::{LaneRng, V3};
use organza_lanes::{Floats, Ints, Mask, SetBits};
use organza_light::{KernelLight, Light, LightSearch};
use organza_scatter::near::Event;
use organza_scatter::near::event::Scattered;

/// A shadow ray is traced surely when the light scattered toward the camera is at
/// least a tenth of the irradiance, per steradian; fainter light is traced in
/// proportion and weighed up.
pub const SHADOW_SCALE: f32 = 10.0;

/// With the cache a shadow ray is traced surely when it adds at least half of the mean of
/// the picture, since what it adds is most of the noise then.
const KEPT_PER_MEAN: f32 = 2.0;

/// What events need to know.
pub struct Shading<'a> {
    pub matter: &'a FibreMatter,
    pub lights: &'a [Light],
    pub max_bounces: u32,
    /// Whether some light is found by walks and shadow rays both.
    pub weighs: bool,
    /// Whether some light has a place.
    pub has_places: bool,
    /// Whether some cloth is draped, with directions of its own.
    pub is_draped: bool,
    /// What paths are divided and ended by, beside what they carry.
    pub importance: Option<&'a Importance>,
    pub cache: CacheUse<'a>,
}

/// The events of the lanes from slot `first` on.
#[inline(always)]
pub fn shade<F: Floats>(
    shading: &Shading<'_>,
    paths: &mut Paths,
    first: usize,
    shadows: &mut Shadows,
    stats: &mut Stats,
) {
    let Arrived { met, new, packed } = arrive(shading, paths, (first, F::LANES), stats);
    if met == 0 {
        return;
    }
    let mask = F::Mask::from_bits(met);
    let new = F::Mask::from_bits(new);
    let packed = F::Mask::from_bits(packed);
    let optics = &shading.matter.optics;
    let direction = load::<F>(&paths.direction, first);
    let w_out = direction.scaled(F::splat(-1.0));
    let mut rng = paths.rng::<F>(first);
    let own = OwnFrame::<F>::new(paths, first, shading.is_draped);
    let MetFibres {
        there,
        mut axis_at,
        material,
        weight,
    } = met_fibres::<F>(
        shading.matter,
        paths,
        first,
        (w_out, &own),
        packed,
        &mut rng,
    );
    let material = optics.materials::<F>(material);
    let event = Event::new(optics, material, (there.frame, there.offset), mask);
    let tangent = there.frame.tangent;
    let mut radius_mm = there.out_mm.dot(there.out_mm).sqrt();
    let part = shading.matter.packed.as_ref();
    if part.is_some_and(|p| p.starts_at_entry) {
        radius_mm = F::splat(0.0);
        axis_at = axis_at + there.out_mm;
    }
    let arrived = load::<F>(&paths.throughput, first);
    let mut throughput = arrived.scaled(weight);

    for light in shading.lights {
        let Some(aim) = aim::<F>(light, shading, paths, first, &mut rng, new) else {
            continue;
        };
        let scattered = event.toward(optics, own.own(aim.toward), new);
        let mut light_in = throughput.times(scattered.value).times(aim.irradiance);
        if aim.is_weighed {
            let share = F::splat(1.0) / (F::splat(1.0) + scattered.pdf / aim.pdf);
            light_in = light_in.scaled(share);
        }
        let keep = match shading.cache.picture_mean {
            Some(mean) => light_in.sum() * F::splat(KEPT_PER_MEAN / (3.0 * mean)),
            None => light_in.sum() / aim.irradiance.sum() * F::splat(SHADOW_SCALE),
        };
        let keep = keep.min(F::splat(1.0));
        let [u, v, w] = rng.units(new);
        let sent = new & aim.seen & u.below(keep) & F::splat(0.0).below(keep);
        if !sent.any() {
            continue;
        }
        let light_in = light_in.scaled(F::splat(1.0) / keep);
        let start = start(&event, &scattered, (axis_at, radius_mm), [v, w]);
        let names = if packed.any() {
            rng.bits(packed & sent)
        } else {
            [<F::Ints as Ints>::splat(0); 3]
        };
        send(
            shading, light, paths, first, sent, &aim, light_in, start, names, shadows,
        );
    }

    if let Some(importance) = shading.importance {
        let way = (tangent, direction, throughput);
        throughput = divide(importance, paths, first, way, &mut rng, new);
    }
    let turn = event.turn(optics, &mut rng, mask);
    let [u, v, w] = rng.units(mask);
    let start = start(&event, &turn.scattered, (axis_at, radius_mm), [v, w]);
    let kept = throughput.times(turn.weight);
    let absorbed = load::<F>(&paths.absorbed, first) + (arrived - kept);
    let (survives, carried) = match shading.importance {
        None => survivors(kept, FIBRE_SCALE, u, mask),
        Some(importance) => {
            let lamps = importance.of_lamps(tangent, turn.direction);
            let survival = kept.sum() * F::splat(FIBRE_SCALE / 3.0);
            let survival = survival * (importance.base::<F>() + lamps);
            survivors_by(kept, survival, u, mask)
        }
    };
    let absorbed = absorbed.or_where_not(mask, load(&paths.absorbed, first));
    store(&mut paths.absorbed, first, absorbed);
    let carried = carried.or_where_not(survives, arrived);
    store(&mut paths.throughput, first, carried);
    let turned = own.world(turn.direction);
    let turned = turned.or_where_not(survives, direction);
    store(&mut paths.direction, first, turned);
    let pdf = F::load(&paths.pdf[first..]);
    let pdf = turn.scattered.pdf.or_where_not(survives, pdf);
    pdf.store(&mut paths.pdf[first..]);
    paths.put_rng::<F>(first, &rng);
    let mut starts = [[0.0; WAVE]; 3];
    store(&mut starts, 0, start);
    let mut carries = [0.0; WAVE];
    (kept.sum() * F::splat(1.0 / 3.0)).store(&mut carries);
    for lane in SetBits(met) {
        let slot = first + lane;
        if survives.bits() & 1 << lane == 0 {
            paths.state[slot] = State::Ended;
            continue;
        }
        go_onward(shading, paths, slot, get(&starts, lane), carries[lane]);
    }
}

/// Lanes at fibres, as bits.
#[derive(Default)]
struct Arrived {
    met: u32,
    /// Those of `met` that were not divided from other paths.
    new: u32,
    /// Those of `new` among packed fibres.
    packed: u32,
}

/// Counts the fibres that the paths of some lanes meet, and ends those paths that go no farther.
#[inline(always)]
fn arrive(
    shading: &Shading<'_>,
    paths: &mut Paths,
    (first, lanes): (usize, usize),
    stats: &mut Stats,
) -> Arrived {
    let mut arrived = Arrived::default();
    for lane in 0..lanes {
        let slot = first + lane;
        if paths.state[slot] != State::Met {
            continue;
        }
        if std::mem::take(&mut paths.branches.resumed[slot]) {
            arrived.met |= 1 << lane;
            continue;
        }
        stats.collisions += 1;
        if paths.bounces[slot] == 0 {
            paths.first[slot] = Some(first_event(shading.matter, paths, slot));
        }
        let order = paths.fibres_met[slot];
        paths.fibres_met[slot] += 1;
        if let Some(rest) = shading.cache.at_fibre(shading.matter, paths, slot, order) {
            let seen = get(&paths.radiance, slot) + rest;
            put(&mut paths.radiance, slot, seen);
            paths.state[slot] = State::Ended;
            continue;
        }
        if paths.bounces[slot] == shading.max_bounces {
            stats.cut += 1;
            paths.state[slot] = State::Ended;
            continue;
        }
        paths.bounces[slot] += 1;
        arrived.met |= 1 << lane;
        arrived.new |= 1 << lane;
        arrived.packed |= u32::from(paths.in_volume[slot]) << lane;
    }
    arrived
}

/// Sends the path of a slot off from where it leaves a fibre, with what it carries.
#[inline(always)]
fn go_onward(shading: &Shading<'_>, paths: &mut Paths, slot: usize, start: Vec3, carried: f32) {
    if shading.weighs {
        paths.drawn_at_mm[slot] = place_mm(shading.matter, paths, slot);
    }
    let from = leaving_point(paths, slot, start);
    if shading.has_places {
        paths.sent_from_mm[slot] = world_mm(shading.matter, paths, slot, &from);
    }
    let toward = get(&paths.direction, slot);
    let part = shading.matter.packed.as_ref();
    let goes_on_packed = |part: &&PackedPart| {
        paths.in_volume[slot] || part.switch.is_over(paths.bounces[slot], carried)
    };
    if let Some(part) = part.filter(goes_on_packed) {
        // Its random numbers are the slot's, which the walk hands over.
        let way = (&from, toward, f32::INFINITY);
        let ray = packed_ray(shading.matter, part, paths, slot, way, [0; 3]);
        paths.state[slot] = State::of_ray(&ray);
        paths.in_volume[slot] = true;
        paths.volume_rays[slot] = ray.unwrap_or(VolumeRay::none());
        return;
    }
    let LeavingPoint::Explicit(from) = from else {
        return;
    };
    if !paths.trips.is_empty() {
        let origin = point_mm(shading.matter, paths, slot, &from);
        let start = Some(start_at(paths, slot, from));
        let ray = (origin, toward.as_dvec3());
        begin_trip(shading.matter, paths, slot, ray, start);
        return;
    }
    let ray = ray(shading.matter, &from, toward, f32::INFINITY);
    paths.state[slot] = State::of_ray(&ray);
    paths.rays[slot] = ray.unwrap_or(CellRay::none());
    paths.rays[slot].prepare_head(shading.matter);
}

/// Where light leaves a fibre, from the centre of the cell.
#[inline(always)]
fn start<F: Floats>(
    event: &Event<F>,
    toward: &Scattered<F>,
    (axis_at, radius_mm): (V3<F>, F),
    units: [F; 2],
) -> V3<F> {
    let normal = event.exit_normal(toward, units);
    normal.scaled_add(radius_mm, axis_at)
}

/// A ray that starts at a fibre of the only body.
#[inline]
fn ray(matter: &FibreMatter, from: &GridPoint, toward: Vec3, max_mm: f32) -> Option<CellRay> {
    let body = &matter.bodies[0];
    let end = body.way_out_mm(from, toward).min(max_mm);
    CellRay::new(&body.cells.grid, from, toward, body.start_mm, end)
}

/// Where a path met its fibre, in the world.
pub(super) fn place_mm(matter: &FibreMatter, paths: &Paths, slot: usize) -> Vec3 {
    if let Some(part) = matter.packed.as_ref().filter(|_| paths.in_volume[slot]) {
        let ray = &paths.volume_rays[slot];
        return part.volume.world_mm(ray.at(), ray.period()).as_vec3();
    }
    let at = get(&paths.met.axis_at, slot) + get(&paths.met.out, slot);
    let at = leaving_point(paths, slot, at);
    world_mm(matter, paths, slot, &at).as_vec3()
}

fn first_event(matter: &FibreMatter, paths: &Paths, slot: usize) -> FirstEvent {
    let axis = match &matter.packed {
        Some(part) if paths.in_volume[slot] => part.volume.axis(paths.volume_rays[slot].place),
        _ => {
            let piece = paths.met.piece[slot];
            matter.joints.tangent(piece, paths.met.along[slot])
        }
    };
    let axis = match paths.trips.get(slot).map(|trip| trip.met()) {
        Some(TripEnd::Fibre(met)) => met.world_from_own * axis,
        _ => axis,
    };
    FirstEvent {
        info: SiteInfo::new(axis, Some(yarn(matter, paths, slot))),
        depth_mm: paths.before_mm[slot] + f64::from(paths.met.distance[slot]),
    }
}

/// Light that lanes look for.
struct Aim<F: Floats> {
    toward: V3<F>,
    irradiance: V3<F>,
    pdf: F,
    seen: F::Mask,
    is_weighed: bool,
}

/// Where a light is; `None` of one that only walks find.
#[inline(always)]
fn aim<F: Floats>(
    light: &Light,
    shading: &Shading<'_>,
    paths: &Paths,
    first: usize,
    rng: &mut LaneRng<F::Ints>,
    mask: F::Mask,
) -> Option<Aim<F>> {
    if light.search() == LightSearch::Walk {
        return None;
    }
    match light.for_kernel() {
        KernelLight::Parallel {
            direction,
            irradiance,
        } => Some(Aim {
            toward: V3::splat(-direction),
            irradiance: V3::splat(irradiance.0),
            pdf: F::splat(f32::INFINITY),
            seen: mask,
            is_weighed: false,
        }),
        _ => {
            let from = |lane| place_mm(shading.matter, paths, first + lane);
            let drawn = DrawnLight::new(light, from, rng, mask);
            Some(Aim {
                toward: drawn.toward,
                irradiance: drawn.irradiance,
                pdf: drawn.pdf,
                seen: drawn.seen,
                is_weighed: light.search() == LightSearch::Both,
            })
        }
    }
}

/// Whether a light has a place, from which distances are measured.
pub fn has_place(light: &Light) -> bool {
    light.for_kernel().bounds_mm().is_some()
}

/// Shadow rays of the lanes of a mask.
#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn send<F: Floats>(
    shading: &Shading<'_>,
    light: &Light,
    paths: &Paths,
    first: usize,
    sent: F::Mask,
    aim: &Aim<F>,
    light_in: V3<F>,
    start: V3<F>,
    names: [F::Ints; 3],
    shadows: &mut Shadows,
) {
    let (mut adds, mut starts, mut ways) = ([[0.0; WAVE]; 3], [[0.0; WAVE]; 3], [[0.0; WAVE]; 3]);
    store(&mut adds, 0, light_in);
    store(&mut starts, 0, start);
    store(&mut ways, 0, aim.toward);
    let mut words = [[0; WAVE]; 3];
    for (column, names) in words.iter_mut().zip(names) {
        names.store(column);
    }
    let matter = shading.matter;
    let is_placed = has_place(light);
    for lane in SetBits(sent.bits()) {
        let slot = first + lane;
        let from = leaving_point(paths, slot, get(&starts, lane));
        let toward = get(&ways, lane);
        let mut most = f32::INFINITY;
        if is_placed {
            let origin = world_mm(matter, paths, slot, &from);
            let Some(distance) = light.distance_along(&Ray::new(origin, toward)) else {
                continue;
            };
            most = distance as f32;
        }
        let from = match (from, &matter.packed) {
            (LeavingPoint::Explicit(from), _) => from,
            (from, Some(part)) => {
                let (way, name) = ((&from, toward, most), words.map(|w| w[lane]));
                match packed_ray(matter, part, paths, slot, way, name) {
                    Some(ray) => shadows.push_packed(ray, slot, get(&adds, lane)),
                    None => shadows.push(None, slot, get(&adds, lane)),
                }
                continue;
            }
            (_, None) => continue,
        };
        if !paths.trips.is_empty() {
            let origin = point_mm(matter, paths, slot, &from);
            let start = Some(start_at(paths, slot, from));
            let ray = (origin, toward.as_dvec3());
            let added = (slot, get(&adds, lane));
            shadows.send(matter, ray, start, f64::from(most), added);
            continue;
        }
        let ray = ray(matter, &from, toward, most);
        if let Some(ray) = &ray {
            ray.prepare_head(matter);
        }
        shadows.push(ray, slot, get(&adds, lane));
    }
}
