// Packed fibres of one flat cloth in voxels: see `packed/fibre_volume.rs`, `packed/flight.rs`
// and `packed/meeting.rs`. Places are in voxels, within the first period.
//
// voxels: bound 8, reach 4, expected axis 10 + 10; then the number of its populations less one 3,
//   the first of them 29
// populations: extinction broadside as a share; material 8, axis 12 + 12; radius 20, code of the
//   end-on ratio 12; yarn
// shares: of each material the packing factors for rays that leave its own yarn, another one,
//   and none

// Reaches are taken to end so much, in voxels, before they do, so that rounding takes no place
// beyond them.
const REACH_BORDER: f32 = 1.0 / 1024.0;
// Room for rounding when the square of an extinction is held against that of its bound.
const BOUND_SLACK: f32 = 1.0 + 4.0e-5;
const BELOW_ONE: f32 = 1.0 - 1.1920929e-7;
const BRICK_LOG2: u32 = 2u;
const NO_YARN: u32 = 0xffffffffu;

struct Flight {
    // Whether the path is among packed fibres.
    is_on: bool,
    at: vec3<f32>,
    period: vec2<f32>,
    direction: vec3<f32>,
    // Way since its start, and where it ends, mm.
    gone: f32,
    end: f32,
    // The yarn that it leaves.
    left_yarn: u32,
    // The first word of the voxel that it is in.
    voxel: u32,
    // The population that it has met, and where across the fibre's width.
    place: u32,
    offset: f32,
}

var<private> flight: Flight;
// Whether the path has met a packed fibre, the tangent of that, and how much more of it is seen
// than it was drawn for.
var<private> site_is_packed: bool;
var<private> met_tangent: vec3<f32>;
var<private> met_weight: f32;

fn load_flight(first: u32) {
    flight.is_on = state(first) != 0u;
    flight.at = state_vector(first + 1u);
    flight.period = vec2<f32>(state_number(first + 4u), state_number(first + 5u));
    flight.direction = state_vector(first + 6u);
    flight.gone = state_number(first + 9u);
    flight.end = state_number(first + 10u);
    flight.left_yarn = state(first + 11u);
    flight.voxel = state(first + 12u);
    met_tangent = state_vector(first + 13u);
    // Not stored: where both differ, a ray has just left an explicit fibre, and nothing asks for
    // what the path has met before it arrives.
    site_is_packed = flight.is_on;
}

fn store_flight(first: u32) {
    keep(first, select(0u, 1u, flight.is_on));
    keep_vector(first + 1u, flight.at);
    keep_number(first + 4u, flight.period.x);
    keep_number(first + 5u, flight.period.y);
    keep_vector(first + 6u, flight.direction);
    keep_number(first + 9u, flight.gone);
    keep_number(first + 10u, flight.end);
    keep(first + 11u, flight.left_yarn);
    keep(first + 12u, flight.voxel);
    keep_vector(first + 13u, met_tangent);
}

fn is_among_packed() -> bool {
    return flight.is_on;
}

fn is_at_packed() -> bool {
    return site_is_packed;
}

fn packed_tangent() -> vec3<f32> {
    return met_tangent;
}

// What the throughput is multiplied by at the event that begins.
fn packed_weight() -> f32 {
    return select(1.0, met_weight, site_is_packed);
}

// Whether the path, which carries so much, goes on among packed fibres: see `packed/switch.rs`.
fn goes_on_packed(carried: f32) -> bool {
    let is_over = path.bounces >= switch_events() && carried < switch_weight();
    flight.is_on = flight.is_on || is_over;
    return flight.is_on;
}

// Index of the voxel with these coordinates: voxels stand in bricks.
fn voxel_index(cell: vec3<u32>) -> u32 {
    let brick = cell >> vec3<u32>(BRICK_LOG2);
    let within = cell & vec3<u32>((1u << BRICK_LOG2) - 1u);
    let number = brick.x + bricks().x * (brick.y + bricks().y * brick.z);
    let row = (within.z << BRICK_LOG2) + within.y;
    return (number << (3u * BRICK_LOG2)) + (row << BRICK_LOG2) + within.x;
}

fn is_outside(at: f32, size: f32) -> bool {
    return at < 0.0 || !(at < size);
}

// Begins a flight at a place that may lie beyond the first period by less than one. What misses has
// come to its end.
fn begin_flight(
    place: vec3<f32>,
    period: vec2<f32>,
    toward: vec3<f32>,
    end: f32,
    left_yarn: u32,
) {
    let size = vec3<f32>(volume_dims());
    let step = toward * voxels_per_mm();
    flight.direction = toward;
    flight.left_yarn = left_yarn;
    flight.gone = 0.0;
    flight.end = 0.0;
    var at = place;
    let first_axis = select(0u, 2u, REPEATS);
    for (var axis = first_axis; axis < 3u; axis++) {
        if is_outside(at[axis], size[axis]) {
            let face = select(size[axis], 0.0, at[axis] < 0.0);
            let way = (face - at[axis]) / not_zero(step[axis]);
            if !(way >= 0.0 && way < end) {
                return;
            }
            flight.gone = max(flight.gone, way);
        }
    }
    if flight.gone > 0.0 {
        at += flight.gone * step;
        for (var axis = first_axis; axis < 3u; axis++) {
            // Rounding may leave it a hair before the face; farther off it misses.
            let inside = clamp(at[axis], 0.0, size[axis] * BELOW_ONE);
            if abs(inside - at[axis]) > 1.0e-3 {
                return;
            }
            at[axis] = inside;
        }
    }
    flight.at = at;
    flight.period = period;
    if REPEATS {
        to_first_period(size);
    }
    flight.end = min(end, flight.gone + most_mm());
    flight.voxel = large_word(voxels_table() + 2u * voxel_index(vec3<u32>(flight.at)));
}

// Brings the flight into the first period.
fn to_first_period(size: vec3<f32>) {
    let whole = floor(flight.at.xy / size.xy);
    flight.period += whole;
    // Rounding may take it a hair beyond either end.
    let within = fma(-whole, size.xy, flight.at.xy);
    flight.at = vec3<f32>(clamp(within, vec2<f32>(0.0), size.xy * BELOW_ONE), flight.at.z);
}

// One flight to a tentative collision, and the look-up there.
fn fly_on(is_shadow: bool) -> u32 {
    if !(flight.gone < flight.end) {
        return LEFT;
    }
    let u = units();
    let size = vec3<f32>(volume_dims());

    // At the bound to the border of what the voxel reaches, then at the greatest there is.
    let d = flight.direction;
    let step = d * voxels_per_mm();
    let per_step = inverse_of_step(step);
    let bound = bound_of_code(flight.voxel >> 24u);
    let half = reach_of_code((flight.voxel >> 20u) & 0xfu) - (0.5 + REACH_BORDER);
    let beside_middle = flight.at - floor(flight.at) - 0.5;
    let ways = half * abs(per_step) - beside_middle * per_step;
    let border = max(min(ways.x, min(ways.y, ways.z)), 0.0);
    let depth = minus_ln(positive(u.x)) / volume_scale_per_mm();
    let depth_there = bound * border;
    var way = depth / bound;
    var majorant = bound;
    if !(depth < depth_there) {
        way = (depth - depth_there) * (1.0 / GREATEST) + border;
        majorant = GREATEST;
    }
    flight.gone += way;
    flight.at += step * way;
    if is_outside(flight.at.z, size.z) || !(flight.gone < flight.end) {
        return LEFT;
    }
    if REPEATS {
        to_first_period(size);
    } else if is_outside(flight.at.x, size.x) || is_outside(flight.at.y, size.y) {
        return LEFT;
    }
    tentative_count += select(1u, 0u, is_shadow);

    // The axis of the fibre that would be met.
    let here = voxel_index(vec3<u32>(flight.at));
    flight.voxel = large_word(voxels_table() + 2u * here);
    var radius = volume_radius_mm();
    if HAS_RADII {
        radius = large_number(radii_table() + here);
    }
    let expected = axis_of_code(flight.voxel, 10u);
    let upright = d - expected * (dot(expected, d) / dot(expected, expected));
    let upright_square = dot(upright, upright);
    var forward = upright * (1.0 / sqrt(max(upright_square, 1.0e-10)));
    if upright_square < 1.0e-10 {
        forward = beside(expected);
    }
    let across_both = cross(expected, forward);
    let side = across_both * (1.0 / sqrt(dot(across_both, across_both)));
    let offset = u.z * 2.0 - 1.0;
    let to_axis = forward * sqrt(max(1.0 - offset * offset, 0.0)) - side * offset;
    var cell = floor(flight.at + to_axis * radius * voxels_per_mm());

    // The populations there; one of them, if there are several.
    if is_outside(cell.z, size.z) {
        return ONWARD;
    }
    if REPEATS {
        // Less than a period beside the first.
        let before = select(vec2<f32>(0.0), size.xy, cell.xy < vec2<f32>(0.0));
        let beyond = select(vec2<f32>(0.0), size.xy, cell.xy + before >= size.xy);
        cell = vec3<f32>(cell.xy + before - beyond, cell.z);
    } else if is_outside(cell.x, size.x) || is_outside(cell.y, size.y) {
        return ONWARD;
    }
    let found = large_word(voxels_table() + 2u * voxel_index(vec3<u32>(cell)) + 1u);
    let count = f32((found >> 29u) + 1u);
    let which = floor(u.y * count);
    let place = (found & 0x1fffffffu) + u32(which);
    let population = large_quad(populations_table() + 4u * place);

    // Squares of extinctions, times that of the axis' length.
    let axis = axis_of_code(population.y, 12u);
    let across = cross(axis, d);
    let square = dot(axis, axis);
    let shown = dot(across, across);
    let area = area_squared(square - shown, shown, end_on_of_code(population.z & 0xfffu));
    var kind = select(1u, 2u, flight.left_yarn == NO_YARN);
    if flight.left_yarn == population.w {
        kind = 0u;
    }
    let share = number(shares_table() + 4u * (population.y >> 24u) + kind);
    let broadside = bitcast<f32>(population.x) * share * count;
    let extinction = broadside * broadside * area;
    let limit = majorant * majorant * square;
    let real = positive(u.y * count - which);
    if limit * BOUND_SLACK < extinction {
        violation_count += 1u;
    }
    if !(real * real * limit < extinction) {
        return ONWARD;
    }
    flight.place = place;
    flight.offset = offset;
    return HIT;
}

// A path begins, among packed fibres if these are met from the camera on.
fn begin_packed(from_mm: vec3<f32>, toward: vec3<f32>, end: f32) {
    flight.is_on = STARTS_PACKED;
    site_is_packed = false;
    if STARTS_PACKED {
        let place = voxel_place(from_mm);
        begin_flight(place.at, place.period, toward, end, NO_YARN);
    }
}

// Sends a ray of the path among packed fibres, from a place of the site's cell or period.
fn send_packed(start: vec3<f32>, toward: vec3<f32>, end: f32) {
    let from_mm = place_of(start);
    let most = min(way_out_mm(from_mm, toward), end);
    var at = start * voxels_per_mm();
    var period = vec2<f32>(site.period);
    var yarn = 0u;
    if site_is_packed {
        yarn = packed_yarn(site.met.piece);
    } else {
        let place = voxel_place(from_mm);
        at = place.at;
        period = place.period;
        yarn = yarn_of_piece(site.met.piece);
    }
    begin_flight(at, period, toward, most, yarn);
}

struct VoxelPlace {
    at: vec3<f32>,
    period: vec2<f32>,
}

// A place of the world in voxels of the first period.
fn voxel_place(from_mm: vec3<f32>) -> VoxelPlace {
    let size = vec3<f32>(volume_dims());
    let at = (from_mm - volume_corner_mm()) * voxels_per_mm();
    if !REPEATS {
        return VoxelPlace(at, vec2<f32>(0.0));
    }
    let period = floor(at.xy / size.xy);
    return VoxelPlace(at - vec3<f32>(period * size.xy, 0.0), period);
}

// The flight has met a fibre: draws which of the population's.
fn arrive_packed() {
    let population = large_quad(populations_table() + 4u * flight.place);
    let axis = packed_axis(flight.place);
    let seen = seen_tangent(axis, population.z & 0xfffu, path.w_out);
    met_weight = seen.weight;
    let tangent = seen.tangent * (1.0 / sqrt(dot(seen.tangent, seen.tangent)));
    met_tangent = tangent;

    // The frame of the fibre, as the event will see it.
    let across = cross(path.w_out, tangent);
    let square = dot(across, across);
    var side = across * (1.0 / sqrt(max(square, 1.0e-14)));
    if square < 1.0e-14 {
        side = beside(tangent);
    }
    let forward = cross(side, tangent);
    let deep = sqrt(max(1.0 - flight.offset * flight.offset, 0.0));
    let normal = side * flight.offset - forward * deep;
    let at_mm = flight.at * voxel_mm();
    site_is_packed = true;
    site.met.piece = flight.place;
    site.met.out = normal * bitcast<f32>(population.z & ~0xfffu);
    site.met.axis_at = at_mm - site.met.out;
    site.period = vec2<i32>(flight.period);
    site.place = packed_place_of(at_mm);
    hit.distance = flight.gone;
}

// The world's place of one that is counted from the least corner of the site's period.
fn packed_place_of(at_mm: vec3<f32>) -> vec3<f32> {
    let moved = vec2<f32>(site.period) * vec2<f32>(volume_dims().xy) * voxel_mm().xy;
    return volume_corner_mm() + vec3<f32>(moved, 0.0) + at_mm;
}

// Unit mean axis of a population.
fn packed_axis(place: u32) -> vec3<f32> {
    let axis = axis_of_code(large_word(populations_table() + 4u * place + 1u), 12u);
    return axis * (1.0 / sqrt(dot(axis, axis)));
}

fn packed_material(place: u32) -> u32 {
    return large_word(populations_table() + 4u * place + 1u) >> 24u;
}

fn packed_yarn(place: u32) -> u32 {
    return large_word(populations_table() + 4u * place + 3u);
}
