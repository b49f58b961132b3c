// The walk among explicit fibres: see `fibres/walk.rs` and `fibres/shade.rs`. Lengths are in
// mm, places in the world are counted from the least corner of the first period.

// A shadow ray is traced surely when the light scattered toward the camera is at least a
// tenth of the irradiance, per steradian; fainter light in proportion, and weighed up.
const SHADOW_SCALE: f32 = 10.0;
const ROULETTE_SCALE: f32 = 5.0;
// Cells that a step looks into.
const CELLS_PER_STEP: u32 = 4u;

struct Path {
    phase: u32,
    has_slot: u32,
    slot: u32,
    sample: u32,
    random: vec3<u32>,
    throughput: vec3<f32>,
    radiance: vec3<f32>,
    bounces: u32,
    // The first piece that the path met, where along it, and how far from the camera.
    first_place: u32,
    first_along: f32,
    first_depth: f32,
    // From the camera to where the first ray began.
    before: f32,
    // Where the direction was drawn, and its density.
    drawn_at: vec3<f32>,
    pdf: f32,
}

fn load_path(lane: u32) {
    path.phase = state(lane, 0u);
    path.has_slot = state(lane, 1u);
    path.slot = state(lane, 2u);
    path.sample = state(lane, 3u);
    path.random = vec3<u32>(state(lane, 4u), state(lane, 5u), state(lane, 6u));
    path.throughput = state_vector(lane, 7u);
    path.radiance = state_vector(lane, 10u);
    path.bounces = state(lane, 13u);
    path.first_place = state(lane, 14u);
    path.first_along = state_number(lane, 15u);
    path.first_depth = state_number(lane, 16u);
    path.before = state_number(lane, 17u);
    path.drawn_at = state_vector(lane, 18u);
    path.pdf = state_number(lane, 21u);
    ray.at = state_vector(lane, 22u);
    ray.direction = state_vector(lane, 25u);
    ray.cell = vec3<i32>(
        i32(state(lane, 28u)),
        i32(state(lane, 29u)),
        i32(state(lane, 30u)),
    );
    ray.period = vec2<i32>(i32(state(lane, 31u)), i32(state(lane, 32u)));
    ray.gone = state_number(lane, 33u);
    ray.end = state_number(lane, 34u);
    ray.least = state_number(lane, 35u);
    ray.cells_left = state(lane, 36u);
}

fn store_path(lane: u32) {
    keep(lane, 0u, path.phase);
    keep(lane, 1u, path.has_slot);
    keep(lane, 2u, path.slot);
    keep(lane, 3u, path.sample);
    keep_three(lane, 4u, path.random);
    keep_three(lane, 7u, bitcast<vec3<u32>>(path.throughput));
    keep_three(lane, 10u, bitcast<vec3<u32>>(path.radiance));
    keep(lane, 13u, path.bounces);
    keep(lane, 14u, path.first_place);
    keep(lane, 15u, bitcast<u32>(path.first_along));
    keep(lane, 16u, bitcast<u32>(path.first_depth));
    keep(lane, 17u, bitcast<u32>(path.before));
    keep_three(lane, 18u, bitcast<vec3<u32>>(path.drawn_at));
    keep(lane, 21u, bitcast<u32>(path.pdf));
    keep_three(lane, 22u, bitcast<vec3<u32>>(ray.at));
    keep_three(lane, 25u, bitcast<vec3<u32>>(ray.direction));
    keep_three(lane, 28u, bitcast<vec3<u32>>(ray.cell));
    keep(lane, 31u, u32(ray.period.x));
    keep(lane, 32u, u32(ray.period.y));
    keep(lane, 33u, bitcast<u32>(ray.gone));
    keep(lane, 34u, bitcast<u32>(ray.end));
    keep(lane, 35u, bitcast<u32>(ray.least));
    keep(lane, 36u, ray.cells_left);
}

fn begin_path(pixel: vec2<f32>) {
    let seen = camera_ray(pixel);
    // The crossing is in cells.
    let size = cell_mm();
    let place = seen.crossing * size;
    let inverse = inverse_of_step(seen.direction);
    let in_z = between(place.z, inverse.z, matter_low_mm().z, matter_high_mm().z);
    var near = in_z.x;
    var far = in_z.y;
    if HAS_BORDERS || !REPEATS {
        let in_x = between(place.x, inverse.x, matter_low_mm().x, matter_high_mm().x);
        let in_y = between(place.y, inverse.y, matter_low_mm().y, matter_high_mm().y);
        near = max(near, max(in_x.x, in_y.x));
        far = min(far, min(in_x.y, in_y.y));
    }
    let is_inside = near <= -seen.length_mm;
    near = max(near, -seen.length_mm);
    let misses = !(near < far);
    path.before = select(near + seen.length_mm, 0.0, misses);
    path.first_along = 0.0;
    path.pdf = FAR;
    path.phase = FLYING;
    ray.direction = seen.direction;
    path.drawn_at = place + seen.direction * near;
    if misses {
        path.drawn_at = place - seen.direction * seen.length_mm;
        leave();
        return;
    }
    // The cell there.
    let in_cells = seen.crossing + seen.direction * near / size;
    let counts = vec3<i32>(cell_counts());
    var cell = vec3<i32>(floor(in_cells));
    let from_centre = (in_cells - (vec3<f32>(cell) + 0.5)) * size;
    var period = vec2<i32>(0);
    if REPEATS {
        period = vec2<i32>(floor(vec2<f32>(cell.xy) / vec2<f32>(counts.xy)));
        cell -= vec3<i32>(period * counts.xy, 0);
    }
    var end = FAR;
    if HAS_BORDERS {
        end = far - near;
    }
    // Rounding may take a place on a face a hair beyond it: it belongs to the cell behind.
    let kept = clamp(cell, vec3<i32>(0), counts - 1);
    let moved = from_centre + vec3<f32>(cell - kept) * size;
    let least = select(0.0, start_mm(), is_inside);
    ray.gone = 0.0;
    ray.cell = kept;
    ray.period = period;
    ray.at = clamp(moved, -0.5 * size, 0.5 * size);
    ray.end = end;
    ray.least = least;
    ray.cells_left = u32(counts.x + counts.y + counts.z) * MAX_TILES;
}

// A step of a lane that has a path: some cells, then perhaps an event.
fn advance() {
    if path.phase != FLYING {
        return;
    }
    var outcome = ONWARD;
    for (var i = 0u; i < CELLS_PER_STEP; i++) {
        outcome = visit(false);
        if outcome != ONWARD {
            break;
        }
    }
    if outcome == LEFT {
        leave();
    }
    if outcome == HIT {
        shade();
    }
}

// Share of a panel that the walk counts: shadow rays find it, too.
fn panel_share(light: u32, distance: f32) -> f32 {
    if path.bounces == 0u {
        return 1.0;
    }
    let facing = abs(dot(ray.direction, vector(light + 19u)));
    let pdf = distance * distance / (number(light + 22u) * max(facing, 1.0e-12));
    return 1.0 / (1.0 + pdf / path.pdf);
}

// What the path sees of panels up to a distance from where its ray was drawn.
fn pass_panels(reach: f32) {
    for (var i = 0u; i < light_count(); i++) {
        let light = lights_table() + i * LIGHT_WORDS;
        if is_panel(light) {
            let t = panel_distance(light, path.drawn_at, ray.direction);
            if t < FAR && t > -path.before && t <= reach && (path.bounces == 0u || t > 0.0) {
                path.radiance += path.throughput * vector(light + 4u) * panel_share(light, t);
            }
        }
    }
}

// A path has left the matter.
fn leave() {
    if HAS_PANELS {
        pass_panels(FAR * 0.5);
    }
    var sky = select(sky_before(), sky_behind(), ray.direction.z < 0.0);
    if HAS_SKIES {
        sky += sky_radiance(ray.direction, path.bounces == 0u);
    }
    path.radiance += path.throughput * sky;
    path.phase = ENDED;
}

// Light that is looked for from a fibre.
struct Search {
    toward: vec3<f32>,
    irradiance: vec3<f32>,
    // Density of the direction; FAR where it is not weighed.
    pdf: f32,
    // The panel that the ray ends at; none where the light is far away.
    panel: u32,
}

// What a fibre met sends of a light that was looked for, if nothing is in the way.
fn add_light(aim: Search, cell: vec3<i32>, period: vec2<i32>, axis_at: vec3<f32>) {
    let scattered = scattered_from(aim.toward);
    var light_in = path.throughput * scattered.value * aim.irradiance;
    if aim.pdf < FAR {
        light_in *= 1.0 / (1.0 + scattered.pdf / aim.pdf);
    }
    let keep = min(sum_of(light_in) / sum_of(aim.irradiance) * SHADOW_SCALE, 1.0);
    let u = units();
    if !(u.x < keep) {
        return;
    }
    let start = axis_at + exit_normal(scattered, u.y, u.z) * event.radius_mm;
    let from_mm = world_of(cell, period, start);
    var end = way_out_mm(from_mm, aim.toward);
    if aim.panel != NO_PLACE {
        let distance = panel_distance(aim.panel, from_mm, aim.toward);
        if distance >= FAR || distance <= 0.0 {
            return;
        }
        end = min(end, distance);
    }
    shadow_ray_count += 1u;
    if begin_ray(cell, period, start, aim.toward, start_mm(), end) {
        var outcome = ONWARD;
        loop {
            outcome = visit(true);
            shadow_step_count += 1u;
            if outcome != ONWARD {
                break;
            }
        }
        if outcome == HIT {
            return;
        }
    }
    path.radiance += light_in * (1.0 / keep);
}

// An event: light, a new direction, roulette.
fn shade() {
    collision_count += 1u;
    let met = hit;
    let cell = ray.cell;
    let period = ray.period;
    let direction = ray.direction;
    if HAS_PANELS {
        pass_panels(met.distance);
    }
    if path.bounces == 0u {
        path.first_place = met.piece;
        path.first_along = met.along;
        path.first_depth = path.before + met.distance;
    }
    path.phase = ENDED;
    if path.bounces == max_bounces() {
        cut_count += 1u;
        return;
    }
    path.bounces += 1u;
    load_material(word(joints_table() + JOINT_WORDS * met.piece + 6u));
    meet_fibre(tangent_of(met.piece, met.along), met.out, -direction);
    let place = world_of(cell, period, met.axis_at + met.out);

    for (var i = 0u; i < light_count(); i++) {
        let light = lights_table() + i * LIGHT_WORDS;
        if HAS_PANELS && is_panel(light) {
            let u = units();
            let drawn = vector(light + 10u) + vector(light + 13u) * u.x + vector(light + 16u) * u.y;
            let to = drawn - place;
            let square = dot(to, to);
            let toward = to * (1.0 / sqrt(max(square, 1.0e-30)));
            let facing = -dot(toward, vector(light + 19u));
            let shines = facing > 0.0 || (word(light + 9u) != 0u && facing != 0.0);
            if shines {
                let pdf = square / (number(light + 22u) * abs(facing));
                add_light(Search(toward, vector(light + 4u) / pdf, pdf, light), cell, period, met.axis_at);
            }
        } else {
            add_light(Search(vector(light), vector(light + 4u), FAR, NO_PLACE), cell, period, met.axis_at);
        }
    }
    add_lamps(cell, period, met.axis_at);

    let turn = turned();
    let u = units();
    path.throughput *= turn.weight;
    if !survives_roulette(ROULETTE_SCALE, u.x) {
        return;
    }
    let start = met.axis_at + exit_normal(turn.scattered, u.y, u.z) * event.radius_mm;
    path.drawn_at = place;
    path.pdf = turn.scattered.pdf;
    path.before = 0.0;
    path.phase = FLYING;
    let end = way_out_mm(world_of(cell, period, start), turn.direction);
    if !begin_ray(cell, period, start, turn.direction, start_mm(), end) {
        leave();
    }
}

fn first_depth_mm() -> f32 {
    return path.first_depth;
}

fn first_axis() -> vec3<f32> {
    return tangent_of(path.first_place, path.first_along);
}

fn first_yarn() -> u32 {
    let strand = word(joints_table() + JOINT_WORDS * path.first_place + 7u) & ~CUT;
    return word(yarns_table() + strand);
}
