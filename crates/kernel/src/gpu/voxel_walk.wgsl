// The walk through voxels: see `voxels/walk.rs`. Extinctions are shares of the medium's
// greatest, lengths are in units of one over that.

// Reaches are taken to end so much, in voxels, before they do, so that rounding takes no
// place beyond them.
const REACH_BORDER: f32 = 1.0 / 1024.0;
// Room for rounding when the square of an extinction is held against that of its bound.
const BOUND_SLACK: f32 = 1.0 + 4.0e-5;
// Matter as dense as there is anywhere, which is known to reach nowhere.
const UNKNOWN_VOXEL: vec2<u32> = vec2<u32>(0u, 0xff000000u);

struct Path {
    phase: u32,
    has_slot: u32,
    slot: u32,
    sample: u32,
    random: vec3<u32>,
    // In voxels, within the first period, and how far that is from the first in x and y.
    at: vec3<f32>,
    beyond: vec2<f32>,
    direction: vec3<f32>,
    // The voxel looked at last, or the population in it that the path met, and where it
    // stands.
    voxel: vec2<u32>,
    place: u32,
    // Way from the camera.
    depth: f32,
    throughput: vec3<f32>,
    radiance: vec3<f32>,
    bounces: u32,
    // The first population that the path met.
    first_place: u32,
    first_depth: f32,
}

fn load_path() {
    path.phase = state(0u);
    path.has_slot = state(1u);
    path.slot = state(2u);
    path.sample = state(3u);
    path.random = vec3<u32>(state(4u), state(5u), state(6u));
    path.at = state_vector(7u);
    path.beyond = vec2<f32>(state_number(10u), state_number(11u));
    path.direction = state_vector(12u);
    path.voxel = vec2<u32>(state(15u), state(16u));
    path.place = state(17u);
    path.depth = state_number(18u);
    path.throughput = state_vector(19u);
    path.radiance = state_vector(22u);
    path.bounces = state(25u);
    path.first_place = state(26u);
    path.first_depth = state_number(27u);
}

fn store_path() {
    keep(0u, path.phase);
    keep(1u, path.has_slot);
    keep(2u, path.slot);
    keep(3u, path.sample);
    keep_three(4u, path.random);
    keep_three(7u, bitcast<vec3<u32>>(path.at));
    keep(10u, bitcast<u32>(path.beyond.x));
    keep(11u, bitcast<u32>(path.beyond.y));
    keep_three(12u, bitcast<vec3<u32>>(path.direction));
    keep(15u, path.voxel.x);
    keep(16u, path.voxel.y);
    keep(17u, path.place);
    keep(18u, bitcast<u32>(path.depth));
    keep_three(19u, bitcast<vec3<u32>>(path.throughput));
    keep_three(22u, bitcast<vec3<u32>>(path.radiance));
    keep(25u, path.bounces);
    keep(26u, path.first_place);
    keep(27u, bitcast<u32>(path.first_depth));
}

fn begin_path(pixel: vec2<f32>) {
    let ray = camera_ray(pixel);
    let step = ray.direction / voxel_mm();
    let inverse = inverse_of_step(step);
    let size = vec3<f32>(dims());
    let in_z = between(ray.crossing.z, inverse.z, 0.0, size.z);
    var near = max(in_z.x, -ray.length_mm);
    var far = in_z.y;
    if HAS_BORDERS {
        let in_x = between(ray.crossing.x, inverse.x, border_low().x, border_high().x);
        let in_y = between(ray.crossing.y, inverse.y, border_low().y, border_high().y);
        near = max(near, max(in_x.x, in_y.x));
        far = min(far, min(in_x.y, in_y.y));
    }
    path.at = ray.crossing + step * near;
    path.beyond = vec2<f32>(0.0);
    path.direction = ray.direction;
    let depth_mm = near + ray.length_mm;
    path.depth = depth_mm * scale_per_mm();
    path.voxel = UNKNOWN_VOXEL;
    path.place = 0u;
    path.phase = FLYING;
    let misses = !(near < far);
    if HAS_PANELS {
        path.radiance = panels_in_sight(-depth_mm, select(0.0, FAR, misses));
    }
    if misses {
        escape();
    }
}

// A step of a lane that has a path: two flights, then an event.
fn advance() {
    if path.phase == FLYING {
        fly();
    }
    if path.phase == FLYING {
        fly();
    }
    if path.phase == MET {
        scatter();
    }
}

// From a place to where it leaves the box of `half` an edge around the middle of its voxel,
// along one axis.
fn way_out(half: f32, at: f32, per_step: f32) -> f32 {
    let beside_middle = at - floor(at) - 0.5;
    return fma(-beside_middle, per_step, half * abs(per_step));
}

// One flight to a tentative collision, and the look-up there.
fn fly() {
    let u = units();
    var step = path.direction * voxels_per_length();
    step.z = select(1.0, -1.0, step.z < 0.0) * max(abs(step.z), least_rise());
    let per_step = inverse_of_step(step);

    // At the bound to the border of what the voxel reaches, then at the greatest there is.
    let known = bound_of(path.voxel);
    let half = reach_of(path.voxel) - (0.5 + REACH_BORDER);
    let of_x = way_out(half, path.at.x, per_step.x);
    let of_y = way_out(half, path.at.y, per_step.y);
    let of_z = way_out(half, path.at.z, per_step.z);
    let border = max(min(min(of_x, of_y), of_z), 0.0);
    let depth = minus_ln(positive(u.x));
    let depth_there = known * border;
    var way = fma(depth - depth_there, 1.0 / GREATEST, border);
    var majorant = GREATEST;
    if depth < depth_there {
        way = depth / known;
        majorant = known;
    }
    path.depth += way;
    var at = path.at + step * way;

    let size = vec3<f32>(dims());
    var outside = !(at.z >= 0.0 && at.z < size.z);
    if REPEATS {
        let periods = floor(at.xy * (1.0 / size.xy)) * size.xy;
        // Rounding may take it a hair beyond either end.
        let most = size.xy * (1.0 - 1.1920929e-7);
        at = vec3<f32>(clamp(at.xy - periods, vec2<f32>(0.0), most), at.z);
        path.beyond += periods;
    }
    if HAS_BORDERS {
        let there = at.xy + path.beyond;
        outside = outside || !(all(there >= border_low()) && all(there < border_high()));
    }
    path.at = at;
    if outside {
        if HAS_PANELS && path.first_place == NO_PLACE {
            path.radiance += panels_in_sight(0.0, FAR);
        }
        escape();
        return;
    }

    // The voxel there; one of its populations, if it has several.
    let cell = vec3<u32>(at);
    let counts = dims();
    let places = places_of(cell.x + counts.x * (cell.y + counts.y * cell.z));
    var place = places.x;
    if HAS_PLACES {
        place += u32(u.z * f32(places.y));
    }
    let voxel = words_at(place);

    // Squares of extinctions, times that of the axis' length.
    let axis = axis_of(voxel);
    let end_on = end_on_of(voxel);
    let beside_way = cross(axis, path.direction);
    let square = dot(axis, axis);
    let across = dot(beside_way, beside_way);
    let broadside = broadside_of(voxel);
    let extinction = broadside * broadside * area_squared(square - across, across, end_on);
    let bound = majorant * majorant * square;
    let chance = positive(u.y);
    tentative_count += 1u;
    if bound * BOUND_SLACK < extinction {
        violation_count += 1u;
    }
    path.voxel = voxel;
    path.place = place;
    if chance * chance * bound < extinction {
        collision_count += 1u;
        path.phase = MET;
    }
}

// The environment, for a path that has left.
fn escape() {
    var sky = select(sky_before(), sky_behind(), path.direction.z < 0.0);
    if HAS_SKIES {
        sky += sky_radiance(path.direction, path.bounces == 0u);
    }
    path.radiance += path.throughput * sky;
    path.phase = ENDED;
}

// An event: light, a new direction, roulette.
fn scatter() {
    if path.first_place == NO_PLACE {
        path.first_place = path.place;
        path.first_depth = path.depth;
    }
    path.phase = ENDED;
    if path.bounces == max_bounces() {
        cut_count += 1u;
        return;
    }
    path.bounces += 1u;
    meet();
    path.throughput *= event.factor;
    let mean = sum_of(path.throughput) * (1.0 / 3.0);
    let corners = corners_around(path.at);
    var light_in = direct_light(mean, corners);
    if HAS_SKIES {
        light_in += lamp_light(mean, corners);
    }
    path.radiance += path.throughput * light_in;

    let turn = turned();
    path.throughput *= turn.weight;
    if survives_roulette(ROULETTE_SCALE, turn.u) {
        path.direction = turn.direction;
        path.phase = FLYING;
    }
}

fn first_depth_mm() -> f32 {
    return path.first_depth / scale_per_mm();
}

// The place that stands for all in its voxel.
fn place_shown() -> u32 {
    if HAS_PLACES {
        return word(densest_table() + path.first_place);
    }
    return path.first_place;
}

fn first_axis() -> vec3<f32> {
    return normalize(axis_of(words_at(place_shown())));
}

fn first_yarn() -> u32 {
    if HAS_YARNS {
        return word(yarns_table() + place_shown());
    }
    return NO_PLACE;
}
