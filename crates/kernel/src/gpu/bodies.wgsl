// Several cloths, cloths over meshes, and planes: a ray's way from stretch to stretch, each
// through the cells of one body. See `fibres/trip.rs`. Places of the world are counted from a
// point among the matter.
//
// words of a body: 0 corner of its cells 3, in the world unless it is over a mesh, 3 edges of
//   a cell 3, 6 cells 3, 9 lead, 10 slack, 11 least edge, 12 start, 13 least corner of the
//   matter 3 and 16 greatest, from the corner of its cells, 19 1 of cells that repeat,
//   20 1 of matter that is cut, 21 heads, 22 plain pieces, 23 hulls, 24 boxes, 25 their
//   number, none of a flat body, 26 ends of plain pieces
// words of a box: 0 least corner 3, 3 the next box for rays that miss it, 4 greatest corner 3,
//   7 first tetrahedron and, in the uppermost four bits, number of tetrahedra
// words of a tetrahedron: 0 weights of its second to fourth corner from the world, three
//   columns with the first corner below them 12, 12 cloth from world with the corner in the
//   cloth, from the centre of its cell, below 12, 24 that cell 3, 27 1 where no other
//   tetrahedron fills any of its room, 28 period of the cell 2, 32 turn to the world in
//   columns of four 12, 44 stretch to the world likewise 12, 56 neighbours 4
// words of a plane: 0 place 3, 3 normal 3, 6 reflectance 3, 9 radiance 3

const PLANE: u32 = 3u;
const BODY_WORDS: u32 = 28u;
const BOX_WORDS: u32 = 8u;
const TETRAHEDRON_WORDS: u32 = 60u;
const PLANE_WORDS: u32 = 12u;
// Farther than any matter.
const FAR_AWAY: f32 = 1.0e30;
const ROUNDING: f32 = 1.1920929e-7;
// A stretch is looked at so much beyond its ends, in roundings of its length and of the places
// of its ends: what is met at a face belongs to one of its sides at least.
const FACE_ROUNDINGS: f32 = 16.0;
const PLACE_ROUNDINGS: f32 = 4.0;
// How far a ray has come through the shell of a body.
const NO_SHELL: u32 = 0u;
const AT_BODY: u32 = 1u;
const AT_SHELL: u32 = 2u;
const IN_SHELL: u32 = 3u;

struct Body {
    corner: vec3<f32>,
    cell: vec3<f32>,
    counts: vec3<u32>,
    lead: f32,
    slack: f32,
    least_edge: f32,
    start: f32,
    low: vec3<f32>,
    high: vec3<f32>,
    repeats: bool,
    is_cut: bool,
    heads: u32,
    pieces: u32,
    hulls: u32,
    boxes: u32,
    box_count: u32,
    ends: u32,
}

struct Trip {
    origin: vec3<f32>,
    direction: vec3<f32>,
    // What is met counts between these distances from the origin.
    low: f32,
    reach: f32,
    // What lies at the end, and the plane if it is one; at first that where the ray starts.
    found: u32,
    plane: u32,
    // Where it starts, if in a body.
    start_body: u32,
    start_tetrahedron: u32,
    // How many bodies have been looked at, and the one that is walked now.
    turn: u32,
    body: u32,
    // The part of the shell that is walked now; those of lesser distances are done.
    shell: u32,
    tetrahedron: u32,
    // The face through which it leaves there.
    exit: u32,
    done: f32,
    // From the origin to where the ray through cells begins, and mm of the world per mm of it.
    before: f32,
    mm_per_own: f32,
}

// The part of the way in a tetrahedron, and the face where it leaves.
struct Part {
    t0: f32,
    t1: f32,
    exit: u32,
}

// A stretch through the cells of a body.
struct Stretch {
    is_one: bool,
    cell: vec3<i32>,
    period: vec2<i32>,
    place: vec3<f32>,
    way: vec3<f32>,
    least: f32,
    most: f32,
}

// The body that is loaded.
var<private> body: Body;
var<private> loaded_body: u32;
var<private> trip: Trip;
// Beside the site: its body, tetrahedron and plane, and the ray's way in the places of the body,
// unit.
var<private> site_body: u32;
var<private> site_part: u32;
var<private> site_plane: u32;
var<private> site_way: vec3<f32>;
var<private> part: Part;
var<private> begins_here: bool;
// The frame of the site's cloth in the world.
var<private> turn_to_world: mat3x3<f32>;
var<private> stretch_to_world: mat3x3<f32>;

fn load_body(index: u32) {
    loaded_body = index;
    let at = bodies_table() + BODY_WORDS * index;
    body.corner = vector(at);
    body.cell = vector(at + 3u);
    body.counts = vec3<u32>(word(at + 6u), word(at + 7u), word(at + 8u));
    body.lead = number(at + 9u);
    body.slack = number(at + 10u);
    body.least_edge = number(at + 11u);
    body.start = number(at + 12u);
    body.low = vector(at + 13u);
    body.high = vector(at + 16u);
    body.repeats = word(at + 19u) != 0u;
    body.is_cut = word(at + 20u) != 0u;
    body.heads = word(at + 21u);
    body.pieces = word(at + 22u);
    body.hulls = word(at + 23u);
    body.boxes = word(at + 24u);
    body.box_count = word(at + 25u);
    body.ends = word(at + 26u);
}

fn cell_mm() -> vec3<f32> {
    return body.cell;
}

fn cell_counts() -> vec3<u32> {
    return body.counts;
}

fn lead_mm() -> f32 {
    return body.lead;
}

fn slack_mm() -> f32 {
    return body.slack;
}

fn min_edge_mm() -> f32 {
    return body.least_edge;
}

fn matter_low_mm() -> vec3<f32> {
    return body.low;
}

fn matter_high_mm() -> vec3<f32> {
    return body.high;
}

fn repeats() -> bool {
    return body.repeats;
}

fn is_cut() -> bool {
    return body.is_cut;
}

fn heads_table() -> u32 {
    return body.heads;
}

fn pieces_table() -> u32 {
    return body.pieces;
}

fn ends_table() -> u32 {
    return body.ends;
}

fn hulls_table() -> u32 {
    return body.hulls;
}

// Three columns of four numbers, of which the last are a place.
struct Frame {
    turn: mat3x3<f32>,
    place: vec3<f32>,
}

fn frame_at(at: u32) -> Frame {
    let x = four(at);
    let y = four(at + 4u);
    let z = four(at + 8u);
    return Frame(mat3x3<f32>(x.xyz, y.xyz, z.xyz), vec3<f32>(x.w, y.w, z.w));
}

fn tetrahedron_at(index: u32) -> u32 {
    return tetrahedra_table() + TETRAHEDRON_WORDS * index;
}

fn is_alone(index: u32) -> bool {
    return word(tetrahedron_at(index) + 27u) != 0u;
}

// Starts at a place along a unit direction. The plane that the ray starts at is not met.
fn begin_trip(from_mm: vec3<f32>, direction: vec3<f32>, low: f32, reach: f32, left: u32) {
    trip.origin = from_mm;
    trip.direction = direction;
    trip.low = low;
    trip.reach = min(reach, FAR_AWAY);
    trip.found = LEFT;
    trip.plane = left;
    trip.start_body = NO_PLACE;
    trip.start_tetrahedron = NO_PLACE;
    trip.turn = 0u;
    trip.shell = NO_SHELL;
    trip.tetrahedron = NO_PLACE;
    ray.cells_left = 0u;
}

// The next stretch: ONWARD, or what lies at the end where none is left.
fn next_stretch() -> u32 {
    if HAS_PLANES && trip.turn == 0u {
        meet_planes();
    }
    loop {
        var stretch: Stretch;
        if trip.shell == AT_BODY {
            if trip.body != loaded_body {
                // The next step loads it.
                return ONWARD;
            }
            trip.shell = NO_SHELL;
            if body.box_count > 0u {
                trip.shell = AT_SHELL;
                trip.tetrahedron = NO_PLACE;
                trip.done = -FAR_AWAY;
            } else {
                stretch = through_flat();
            }
        } else if trip.shell != NO_SHELL {
            if next_part() {
                stretch = through_part();
            } else {
                trip.shell = NO_SHELL;
            }
        } else if trip.turn >= body_count() {
            break;
        } else {
            // The body in which the ray starts comes first.
            var next = trip.turn;
            if trip.start_body != NO_PLACE && next <= trip.start_body {
                next = select(next - 1u, trip.start_body, next == 0u);
            }
            trip.turn += 1u;
            trip.body = next;
            trip.shell = AT_BODY;
        }
        if stretch.is_one {
            let s = stretch;
            if begin_ray(s.cell, s.period, s.place, s.way, s.least, s.most) {
                return ONWARD;
            }
        }
    }
    return trip.found;
}

// Looks for the nearest plane, but for the one that the ray starts at.
fn meet_planes() {
    let left = trip.plane;
    for (var k = 0u; k < plane_count(); k++) {
        let at = planes_table() + PLANE_WORDS * k;
        let normal = vector(at + 3u);
        let facing = dot(trip.direction, normal);
        if k != left && abs(facing) > 1.0e-20 {
            let t = dot(vector(at) - trip.origin, normal) / facing;
            if t > trip.low && t < trip.reach {
                trip.reach = t;
                trip.found = PLANE;
                trip.plane = k;
            }
        }
    }
}

// The part of the trip in a tetrahedron; t0 >= t1 where there is none.
fn part_in(index: u32) -> Part {
    let weights = frame_at(tetrahedron_at(index));
    let w = weights.turn * (trip.origin - weights.place);
    let s = weights.turn * trip.direction;
    let all = vec4<f32>(1.0 - sum_of(w), w);
    let slopes = vec4<f32>(-sum_of(s), s);
    var found = Part(trip.low, FAR_AWAY, 4u);
    for (var k = 0u; k < 4u; k++) {
        let slope = slopes[k];
        if slope > 0.0 {
            found.t0 = max(found.t0, -all[k] / slope);
        } else if slope < 0.0 {
            let t = -all[k] / slope;
            if t < found.t1 {
                found.t1 = t;
                found.exit = k;
            }
        } else if all[k] < 0.0 {
            found.t1 = -FAR_AWAY;
        }
    }
    return found;
}

// Whether a part comes after those that are done.
fn is_later(t0: f32, index: u32) -> bool {
    let is_same = t0 == trip.done && trip.tetrahedron != NO_PLACE && index > trip.tetrahedron;
    return index != trip.start_tetrahedron && (t0 > trip.done || is_same);
}

// The next part of the shell: false when none begins before what was met.
fn next_part() -> bool {
    begins_here = trip.shell == AT_SHELL && trip.turn == 1u && trip.start_tetrahedron != NO_PLACE;
    var next = NO_PLACE;
    if begins_here {
        next = trip.start_tetrahedron;
    } else if trip.shell == IN_SHELL && trip.exit < 4u && is_alone(trip.tetrahedron) {
        // Through a face to the neighbour, where nothing else can be.
        next = word(tetrahedron_at(trip.tetrahedron) + 56u + trip.exit);
        if next != NO_PLACE && !is_alone(next) {
            next = NO_PLACE;
        }
    }
    trip.shell = IN_SHELL;
    if next != NO_PLACE {
        let there = part_in(next);
        if begins_here || (there.t0 < there.t1 && is_later(there.t0, next)) {
            part = there;
            trip.tetrahedron = next;
            trip.exit = there.exit;
            if begins_here {
                part.t0 = 0.0;
                part.t1 = max(part.t1, 0.0);
                return true;
            }
            trip.done = there.t0;
            return there.t0 < trip.reach;
        }
    }
    let inverse = inverse_of_step(trip.direction);
    var nearest = NO_PLACE;
    part.t0 = trip.reach;
    var i = 0u;
    while i < body.box_count {
        let at = body.boxes + BOX_WORDS * i;
        let least = quad(at);
        let greatest = quad(at + 4u);
        let a = (bitcast<vec3<f32>>(least.xyz) - trip.origin) * inverse;
        let b = (bitcast<vec3<f32>>(greatest.xyz) - trip.origin) * inverse;
        let low = min(a, b);
        let high = max(a, b);
        let near = max(max(low.x, low.y), max(low.z, trip.low));
        let far = min(min(high.x, high.y), high.z);
        if near > far || near > part.t0 || far < trip.done {
            i = least.w;
            continue;
        }
        let first = greatest.w & 0x0fffffffu;
        for (var k = first; k < first + (greatest.w >> 28u); k++) {
            let there = part_in(k);
            let is_nearer = there.t0 < part.t0 || (there.t0 == part.t0 && k < nearest);
            if there.t0 < there.t1 && is_nearer && is_later(there.t0, k) {
                part = there;
                nearest = k;
            }
        }
        i += 1u;
    }
    if nearest == NO_PLACE {
        return false;
    }
    trip.tetrahedron = nearest;
    trip.exit = part.exit;
    trip.done = part.t0;
    return true;
}

// The stretch through the cells of a tetrahedron.
fn through_part() -> Stretch {
    var stretch: Stretch;
    let at = tetrahedron_at(trip.tetrahedron);
    let cloth = frame_at(at + 12u);
    let step = cloth.turn * trip.direction;
    let own_per_mm = sqrt(dot(step, step));
    if !(own_per_mm > 0.0) {
        return stretch;
    }
    let own_way = nearly_unit(step * (1.0 / own_per_mm));
    trip.mm_per_own = 1.0 / own_per_mm;
    let inside = (part.t1 - part.t0) * own_per_mm;
    let places = max(abs(trip.origin.x), max(abs(trip.origin.y), abs(trip.origin.z))) + abs(part.t0);
    let slack = ROUNDING * (FACE_ROUNDINGS * inside + PLACE_ROUNDINGS * places);
    let back = select(0.0, slack, part.t0 > trip.low);
    var least = 0.0;
    if trip.low == 0.0 {
        // A ray that starts among fibres has left its own.
        least = max(body.start - part.t0 * own_per_mm + back, 0.0);
    }
    // A ray from a fibre has its start in the cells of its body.
    var cell = ray.cell;
    var period = ray.period;
    var place = ray.at;
    if !begins_here {
        cell = vec3<i32>(quad(at + 24u).xyz);
        period = vec2<i32>(quad(at + 28u).xy);
        let corner = vec3<f32>(number(at + 3u), number(at + 7u), number(at + 11u));
        let beside = cloth.turn * (trip.origin - corner) + part.t0 * step;
        place = cloth.place + beside - back * own_way;
    }
    let inside_matter = part_of_matter(from_corner(cell, period, place), own_way);
    let near = max(inside_matter.x, 0.0);
    let length = back + inside + slack;
    if !(near < inside_matter.y) || near >= length {
        return stretch;
    }
    trip.before = part.t0 + (near - back) * trip.mm_per_own;
    var most = min((trip.reach - trip.before) * own_per_mm, length - near);
    if body.is_cut {
        most = min(most, inside_matter.y - near);
    }
    place += near * own_way;
    return Stretch(true, cell, period, place, own_way, max(least - near, 0.0), most);
}

// The stretch through the cells of a flat body.
fn through_flat() -> Stretch {
    var stretch: Stretch;
    trip.tetrahedron = NO_PLACE;
    trip.mm_per_own = 1.0;
    let d = trip.direction;
    if trip.turn == 1u && trip.start_body != NO_PLACE {
        trip.before = 0.0;
        let most = way_out_mm(from_corner(ray.cell, ray.period, ray.at), d);
        return Stretch(true, ray.cell, ray.period, ray.at, d, body.start, min(most, trip.reach));
    }
    let from_mm = trip.origin - body.corner;
    let inside_matter = part_of_matter(from_mm, d);
    let near = max(inside_matter.x, trip.low);
    if !(near < inside_matter.y) || near >= trip.reach {
        return stretch;
    }
    trip.before = near;
    var most = trip.reach - near;
    if body.is_cut {
        most = min(most, inside_matter.y - near);
    }
    let least = select(0.0, body.start, inside_matter.x <= trip.low);
    let place = from_mm + d * near - 0.5 * body.cell;
    return Stretch(true, vec3<i32>(0), vec2<i32>(0), place, d, least, most);
}

// Something was met on the stretch that is walked.
fn note_met() {
    let t = trip.before + hit.distance * trip.mm_per_own;
    if t < trip.reach {
        trip.reach = t;
        trip.found = HIT;
        site.met = hit;
        site.cell = ray.cell;
        site.period = ray.period;
        site_body = trip.body;
        site_part = trip.tetrahedron;
        site_way = ray.direction;
    }
    if trip.shell != NO_SHELL && is_alone(trip.tetrahedron) {
        // Nothing else in the shell is nearer.
        trip.shell = NO_SHELL;
    }
}

// Cells that one step visits at most: while a lane visits cells, the other lanes of its group may
// search for a stretch, which takes as long as many cells.
const CELLS_AT_ONCE: u32 = 16u;

fn step_on(any_will_do: bool) -> u32 {
    if trip.body != loaded_body {
        load_body(trip.body);
    }
    if ray.cells_left > 0u {
        var outcome = ONWARD;
        var count = 0u;
        while outcome == ONWARD && count < CELLS_AT_ONCE {
            outcome = visit(any_will_do);
            count += 1u;
        }
        shadow_step_count += select(0u, count - 1u, any_will_do);
        if outcome == ONWARD || (any_will_do && outcome == HIT) {
            return outcome;
        }
        if outcome == HIT {
            note_met();
        }
        ray.cells_left = 0u;
    }
    return next_stretch();
}

fn begin_path(pixel: vec2<f32>) {
    let seen = camera_ray(pixel);
    path.before = seen.length_mm;
    path.pdf = FAR;
    path.phase = FLYING;
    path.w_out = -seen.direction;
    path.drawn_at = seen.crossing;
    begin_trip(seen.crossing, seen.direction, -seen.length_mm, FAR_AWAY, NO_PLACE);
}

// What the way has led to.
fn arrive(outcome: u32) {
    site.place = trip.origin + trip.reach * trip.direction;
    site_plane = select(NO_PLACE, trip.plane, outcome == PLANE);
}

// How far from its start the way has led.
fn reach_mm() -> f32 {
    return trip.reach;
}

// The event, as light along a direction of the world finds it. The map of a shell turns the
// places along a ray otherwise than directions, so that the offset at which light meets a
// fibre is that of the way through the places. Gives the fibre's direction in the world.
fn meet_site() -> vec3<f32> {
    let tangent = tangent_of(site.met.piece, site.met.along);
    var out = site.met.out;
    turn_to_world = mat3x3<f32>(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    stretch_to_world = turn_to_world;
    if site_part != NO_PLACE {
        let at = tetrahedron_at(site_part);
        turn_to_world = frame_at(at + 32u).turn;
        stretch_to_world = frame_at(at + 44u).turn;
        out = seen_out(tangent, out, in_own_frame(path.w_out));
    }
    meet_fibre(tangent, out, in_own_frame(path.w_out));
    return in_world(tangent);
}

fn seen_out(tangent: vec3<f32>, out: vec3<f32>, w: vec3<f32>) -> vec3<f32> {
    let along = dot(tangent, out);
    let across = out - tangent * along;
    let height = sqrt(dot(across, across));
    let beside_w = beside_of(tangent, w);
    let offset = clamp(dot(across, beside_of(tangent, -site_way)), -height, height);
    let depth = sqrt(max(height * height - offset * offset, 0.0));
    return beside_w * offset + cross(tangent, beside_w) * depth + tangent * along;
}

// A unit vector across a tangent and a direction.
fn beside_of(tangent: vec3<f32>, w: vec3<f32>) -> vec3<f32> {
    let aside = cross(w, tangent);
    let square = dot(aside, aside);
    if square <= 1.0e-14 {
        return beside(tangent);
    }
    return aside * (1.0 / sqrt(square));
}

fn in_own_frame(w: vec3<f32>) -> vec3<f32> {
    return w * turn_to_world;
}

fn in_world(w: vec3<f32>) -> vec3<f32> {
    return nearly_unit(turn_to_world * w);
}

// A place of the site's cell in the world.
fn place_of(start: vec3<f32>) -> vec3<f32> {
    return site.place + stretch_to_world * (start - (site.met.axis_at + site.met.out));
}

// Sends a ray from a place of the site's cell, or from its plane.
fn send(start: vec3<f32>, toward: vec3<f32>, end: f32) {
    let at_plane = is_at_plane();
    var from_mm = site.place;
    if !at_plane {
        from_mm = place_of(start);
    }
    begin_trip(from_mm, toward, 0.0, end, site_plane);
    if !at_plane {
        trip.start_body = site_body;
        trip.start_tetrahedron = site_part;
        ray.cell = site.cell;
        ray.period = site.period;
        ray.at = start;
    }
}

fn is_at_plane() -> bool {
    return site_plane != NO_PLACE;
}

fn plane_at() -> u32 {
    return planes_table() + PLANE_WORDS * site_plane;
}

// The normal of the site's plane, on the side of the path.
fn plane_normal() -> vec3<f32> {
    let normal = vector(plane_at() + 3u);
    return normal * select(-1.0, 1.0, dot(path.w_out, normal) > 0.0);
}

fn plane_reflectance() -> vec3<f32> {
    return vector(plane_at() + 6u);
}

// What the plane sends along the path.
fn plane_radiance() -> vec3<f32> {
    let is_front = dot(path.w_out, vector(plane_at() + 3u)) > 0.0;
    return select(vec3<f32>(0.0), vector(plane_at() + 9u), is_front);
}

// Density with which a plane draws directions of light: none beyond it.
fn plane_pdf(w_in: vec3<f32>) -> f32 {
    return max(dot(w_in, plane_normal()), 0.0) * (1.0 / PI);
}

// Draws where light comes to the plane from.
fn plane_turn() -> vec3<f32> {
    let u = units();
    let s = sin_cos_of_turns(u.x);
    let normal = plane_normal();
    let aside = beside(normal);
    let across = aside * s.y + cross(normal, aside) * s.x;
    return nearly_unit(across * sqrt(u.y) + normal * sqrt(max(1.0 - u.y, 0.0)));
}

// Words of a lane behind those of its ray.
fn load_way(first: u32) {
    trip.origin = state_vector(first);
    trip.direction = state_vector(first + 3u);
    trip.low = state_number(first + 6u);
    trip.reach = state_number(first + 7u);
    trip.found = state(first + 8u);
    trip.plane = state(first + 9u);
    trip.start_body = state(first + 10u);
    trip.start_tetrahedron = state(first + 11u);
    trip.turn = state(first + 12u);
    trip.body = state(first + 13u);
    trip.shell = state(first + 14u);
    trip.tetrahedron = state(first + 15u);
    trip.done = state_number(first + 16u);
    trip.before = state_number(first + 17u);
    trip.mm_per_own = state_number(first + 18u);
    trip.exit = state(first + 19u);
    site_body = state(first + 20u);
    site_part = state(first + 21u);
    site_plane = state(first + 22u);
    site_way = state_vector(first + 23u);
    loaded_body = NO_PLACE;
}

fn store_way(first: u32) {
    keep_vector(first, trip.origin);
    keep_vector(first + 3u, trip.direction);
    keep_number(first + 6u, trip.low);
    keep_number(first + 7u, trip.reach);
    keep(first + 8u, trip.found);
    keep(first + 9u, trip.plane);
    keep(first + 10u, trip.start_body);
    keep(first + 11u, trip.start_tetrahedron);
    keep(first + 12u, trip.turn);
    keep(first + 13u, trip.body);
    keep(first + 14u, trip.shell);
    keep(first + 15u, trip.tetrahedron);
    keep_number(first + 16u, trip.done);
    keep_number(first + 17u, trip.before);
    keep_number(first + 18u, trip.mm_per_own);
    keep(first + 19u, trip.exit);
    keep(first + 20u, site_body);
    keep(first + 21u, site_part);
    keep(first + 22u, site_plane);
    keep_vector(first + 23u, site_way);
}
