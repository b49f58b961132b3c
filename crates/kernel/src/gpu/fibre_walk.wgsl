// The walk among explicit fibres: see `fibres/walk.rs` and `fibres/shade.rs`. Lengths are in
// mm. Where rays go is in `one_body.wgsl` or `bodies.wgsl`.
//
// A lane follows one ray at a time, the path's own or one toward a light, and every function
// of some size is called in one place only: compilers put the whole of it wherever it is
// called.

// Cells that a step looks into.
const CELLS_PER_STEP: u32 = 4u;
// Words of a lane before those of its ray, of its ray, and of where it has come to.
const PATH_WORDS: u32 = 31u;
const RAY_WORDS: u32 = 15u;
const SITE_WORDS: u32 = 16u;

// A path at an event follows a ray toward a light.
const SHADOWED: u32 = 5u;

struct Path {
    phase: u32,
    has_slot: u32,
    slot: u32,
    sample: u32,
    random: vec3<u32>,
    throughput: vec3<f32>,
    radiance: vec3<f32>,
    bounces: u32,
    // The first piece that the path met, its direction there, and how far from the camera.
    first_place: u32,
    first_axis: vec3<f32>,
    first_depth: f32,
    // From the camera to where the first ray began.
    before: f32,
    // Where the direction was drawn, and its density.
    drawn_at: vec3<f32>,
    pdf: f32,
    // Back along the way that led to the event, the next light to look for there, and what
    // the one that is looked for adds.
    w_out: vec3<f32>,
    light: u32,
    light_in: vec3<f32>,
}

// Where a path has come to: a fibre that was met, in the cells of its body, or a plane.
struct Site {
    met: Hit,
    cell: vec3<i32>,
    period: vec2<i32>,
    // In the world.
    place: vec3<f32>,
}

var<private> site: Site;

fn load_path() {
    path.phase = state(0u);
    path.has_slot = state(1u);
    path.slot = state(2u);
    path.sample = state(3u);
    path.random = state_three(4u);
    path.throughput = state_vector(7u);
    path.radiance = state_vector(10u);
    path.bounces = state(13u);
    path.first_place = state(14u);
    path.first_depth = state_number(15u);
    path.before = state_number(16u);
    path.drawn_at = state_vector(17u);
    path.pdf = state_number(20u);
    path.first_axis = state_vector(21u);
    path.w_out = state_vector(24u);
    path.light = state(27u);
    path.light_in = state_vector(28u);
    load_ray(PATH_WORDS);
    let first = PATH_WORDS + RAY_WORDS;
    site.met.piece = state(first);
    site.met.axis_at = state_vector(first + 1u);
    site.met.out = state_vector(first + 4u);
    site.met.along = state_number(first + 7u);
    site.cell = vec3<i32>(state_three(first + 8u));
    site.period = vec2<i32>(i32(state(first + 11u)), i32(state(first + 12u)));
    site.place = state_vector(first + 13u);
    load_way(first + SITE_WORDS);
}

fn store_path() {
    keep(0u, path.phase);
    keep(1u, path.has_slot);
    keep(2u, path.slot);
    keep(3u, path.sample);
    keep_three(4u, path.random);
    keep_vector(7u, path.throughput);
    keep_vector(10u, path.radiance);
    keep(13u, path.bounces);
    keep(14u, path.first_place);
    keep_number(15u, path.first_depth);
    keep_number(16u, path.before);
    keep_vector(17u, path.drawn_at);
    keep_number(20u, path.pdf);
    keep_vector(21u, path.first_axis);
    keep_vector(24u, path.w_out);
    keep(27u, path.light);
    keep_vector(28u, path.light_in);
    store_ray(PATH_WORDS);
    let first = PATH_WORDS + RAY_WORDS;
    keep(first, site.met.piece);
    keep_vector(first + 1u, site.met.axis_at);
    keep_vector(first + 4u, site.met.out);
    keep_number(first + 7u, site.met.along);
    keep_three(first + 8u, vec3<u32>(site.cell));
    keep(first + 11u, u32(site.period.x));
    keep(first + 12u, u32(site.period.y));
    keep_vector(first + 13u, site.place);
    store_way(first + SITE_WORDS);
}

// A step of a lane that has a path: some cells, then perhaps an event.
fn advance() {
    if path.phase != FLYING && path.phase != SHADOWED {
        return;
    }
    var outcome = ONWARD;
    for (var i = 0u; i < CELLS_PER_STEP; i++) {
        outcome = step_on(path.phase == SHADOWED);
        shadow_step_count += select(0u, 1u, path.phase == SHADOWED);
        if outcome != ONWARD {
            break;
        }
    }
    if outcome == ONWARD {
        return;
    }
    if path.phase == SHADOWED {
        if outcome == LEFT {
            path.radiance += path.light_in;
        }
        path.phase = MET;
    } else {
        // What the way has led to: MET, or the end of the path.
        path.phase = select(MET, ENDED, outcome == LEFT);
        arrive(outcome);
        if HAS_PANELS {
            pass_panels(reach_mm());
        }
        if outcome == LEFT {
            leave();
        } else {
            begin_event(outcome);
        }
    }
    if path.phase == MET {
        shade();
    }
}

// Share of a panel that the walk counts: shadow rays find it, too.
fn panel_share(light: u32, distance: f32) -> f32 {
    if path.bounces == 0u {
        return 1.0;
    }
    let facing = abs(dot(path.w_out, vector(light + 19u)));
    let pdf = distance * distance / (number(light + 22u) * max(facing, 1.0e-12));
    return 1.0 / (1.0 + pdf / path.pdf);
}

// What the path sees of panels up to a distance from where its ray was drawn.
fn pass_panels(reach: f32) {
    for (var i = 0u; i < light_count(); i++) {
        let light = lights_table() + i * LIGHT_WORDS;
        if is_panel(light) {
            let t = panel_distance(light, path.drawn_at, -path.w_out);
            if t < FAR && t > -path.before && t <= reach && (path.bounces == 0u || t > 0.0) {
                path.radiance += path.throughput * vector(light + 4u) * panel_share(light, t);
            }
        }
    }
}

// A path has left the matter.
fn leave() {
    let direction = -path.w_out;
    var sky = select(sky_before(), sky_behind(), direction.z < 0.0);
    if HAS_SKIES {
        sky += sky_radiance(direction, path.bounces == 0u);
    }
    path.radiance += path.throughput * sky;
}

// A path has come to a fibre or a plane.
fn begin_event(outcome: u32) {
    if outcome == HIT {
        collision_count += 1u;
        path.throughput *= packed_weight();
        if path.bounces == 0u {
            path.first_place = site.met.piece;
            path.first_depth = path.before + reach_mm();
        }
    } else {
        path.radiance += path.throughput * plane_radiance();
    }
    path.bounces += 1u;
    path.light = 0u;
}

// Light that is looked for from a fibre or a plane.
struct Search {
    toward: vec3<f32>,
    // None where nothing is to be looked for.
    irradiance: vec3<f32>,
    // Density of the direction; FAR where it is not weighed.
    pdf: f32,
    // The panel or spot that the ray ends at; none where the light is far away.
    light: u32,
}

// The light of a number, counted on with the lamps of pictures.
fn search_for(index: u32) -> Search {
    if index >= light_count() {
        return lamp_search(index - light_count());
    }
    let light = lights_table() + index * LIGHT_WORDS;
    let kind = word(light + 7u);
    if HAS_PANELS && kind == 1u {
        let u = units();
        let drawn = vector(light + 10u) + vector(light + 13u) * u.x + vector(light + 16u) * u.y;
        let to = drawn - site.place;
        let square = dot(to, to);
        let toward = to * (1.0 / sqrt(max(square, 1.0e-30)));
        let facing = -dot(toward, vector(light + 19u));
        let shines = facing > 0.0 || (word(light + 9u) != 0u && facing != 0.0);
        let pdf = square / (number(light + 22u) * max(abs(facing), LEAST_NORMAL));
        return Search(toward, select(vec3<f32>(0.0), vector(light + 4u) / pdf, shines), pdf, light);
    }
    if HAS_SPOTS && kind == 2u {
        let to = vector(light + 10u) - site.place;
        let square = max(dot(to, to), 1.0e-30);
        let toward = to * (1.0 / sqrt(square));
        let strength = spot_share(light, toward) / square;
        return Search(toward, vector(light + 4u) * strength, FAR, light);
    }
    return Search(vector(light), vector(light + 4u), FAR, NO_PLACE);
}

// Share of a spot's intensity that it sends against a direction toward it.
fn spot_share(light: u32, toward: vec3<f32>) -> f32 {
    let axis = vector(light + 13u);
    let across = cross(axis, toward);
    let angle = angle_of(sqrt(dot(across, across)), -dot(axis, toward));
    let inside = number(light + 16u) - angle;
    let edge = number(light + 17u);
    if inside >= edge {
        return 1.0;
    }
    let x = max(inside / edge, 0.0);
    return x * x * (3.0 - 2.0 * x);
}

// How far a ray from a place goes to the light that it is to end at; not at all where it misses.
fn distance_to(aim: Search, from_mm: vec3<f32>) -> f32 {
    if aim.light == NO_PLACE {
        return FAR;
    }
    if HAS_PANELS && is_panel(aim.light) {
        let distance = panel_distance(aim.light, from_mm, aim.toward);
        return select(distance, 0.0, distance >= FAR);
    }
    return dot(vector(aim.light + 10u) - from_mm, aim.toward);
}

// An event, from the next light to look for on: sends a ray toward a light, or on.
fn shade() {
    let at_plane = HAS_PLANES && is_at_plane();
    if !at_plane {
        load_material(material_of_site());
        let axis = meet_site();
        if path.bounces == 1u {
            path.first_axis = axis;
        }
    }
    if path.bounces > max_bounces() {
        cut_count += 1u;
        path.bounces -= 1u;
        path.phase = ENDED;
        return;
    }
    var toward = vec3<f32>(0.0);
    var scattered: Scattered;
    var start = vec3<f32>(0.0);
    var end = FAR;
    var is_sent = false;
    var among_packed = is_at_packed();
    while path.light < light_count() + lamp_count() && !is_sent {
        let aim = search_for(path.light);
        path.light += 1u;
        let most = sum_of(aim.irradiance);
        if !(most > 0.0) {
            continue;
        }
        if at_plane {
            scattered.pdf = plane_pdf(aim.toward);
            scattered.value = plane_reflectance() * scattered.pdf;
        } else {
            scattered = scattered_from(in_own_frame(aim.toward));
        }
        var light_in = path.throughput * scattered.value * aim.irradiance;
        if aim.pdf < FAR {
            light_in *= 1.0 / (1.0 + scattered.pdf / aim.pdf);
        }
        let keep = min(sum_of(light_in) / most * SHADOW_SCALE, 1.0);
        let u = units();
        if !(u.x < keep) {
            continue;
        }
        path.light_in = light_in * (1.0 / keep);
        toward = aim.toward;
        var from_mm = site.place;
        if !at_plane {
            start = leaving_place(scattered, u);
            from_mm = place_of(start);
        }
        end = distance_to(aim, from_mm);
        is_sent = end > 0.0;
    }
    if is_sent {
        shadow_ray_count += 1u;
        path.phase = SHADOWED;
    } else {
        end = FAR;
        path.phase = FLYING;
        if at_plane {
            toward = plane_turn();
            scattered.pdf = plane_pdf(toward);
            path.throughput *= plane_reflectance();
        } else {
            let turn = turned();
            toward = in_world(turn.direction);
            scattered = turn.scattered;
            path.throughput *= turn.weight;
            among_packed = goes_on_packed(sum_of(path.throughput) * (1.0 / 3.0));
        }
        let u = units();
        if !survives_roulette(ROULETTE_SCALE, u.x) {
            path.phase = ENDED;
            return;
        }
        if !at_plane {
            start = leaving_place(scattered, u);
        }
        path.drawn_at = site.place;
        path.pdf = scattered.pdf;
        path.before = 0.0;
        path.w_out = -toward;
    }
    if among_packed {
        send_packed(start, toward, end);
    } else {
        send(start, toward, end);
    }
}

fn material_of_site() -> u32 {
    if is_at_packed() {
        return packed_material(site.met.piece);
    }
    return large_word(joints_table() + JOINT_WORDS * site.met.piece + 6u);
}

// Where light leaves the fibre of the event, in its cell.
fn leaving_place(scattered: Scattered, u: vec3<f32>) -> vec3<f32> {
    return site.met.axis_at + exit_normal(scattered, u.y, u.z) * event.radius_mm;
}

fn first_depth_mm() -> f32 {
    return path.first_depth;
}

fn first_axis() -> vec3<f32> {
    return path.first_axis;
}

fn first_yarn() -> u32 {
    if STARTS_PACKED {
        return packed_yarn(path.first_place);
    }
    return yarn_of_piece(path.first_place);
}

fn yarn_of_piece(piece: u32) -> u32 {
    let strand = large_word(joints_table() + JOINT_WORDS * piece + 7u) & ~CUT;
    return word(yarns_table() + strand);
}
