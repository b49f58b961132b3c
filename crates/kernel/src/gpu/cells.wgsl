// Explicit fibres in cells, and a ray on its way through them: see `fibres/cell_ray.rs`.
//
// heads: for every cell its first plain piece, its first hull, and their numbers 16 | 16
// plain pieces: 0 foot 3, 3 square of the radius, 4 axis 3, 7 low
// ends of plain pieces: 0 high, 1 code
// hulls: 0 foot 3, 3 start, 4 axis 3, 7 end, 8 their squares 2, 10 narrowing, 11 wide,
//   12 low, 13 high, 14 code

const HEAD_WORDS: u32 = 4u;
const PIECE_WORDS: u32 = 8u;
const END_WORDS: u32 = 2u;
const HULL_WORDS: u32 = 16u;
const JOINT_WORDS: u32 = 8u;
const CUT: u32 = 0x80000000u;
// Copies of the tile that a ray may pass without meeting a fibre: MAX_PERIODS.
const MAX_TILES: u32 = 256u;

const ONWARD: u32 = 0u;
const HIT: u32 = 1u;
const LEFT: u32 = 2u;

struct CellRay {
    // From the centre of its cell, mm.
    at: vec3<f32>,
    direction: vec3<f32>,
    cell: vec3<i32>,
    period: vec2<i32>,
    // Way since its start, and where it ends, mm.
    gone: f32,
    end: f32,
    // It meets nothing up to this distance from its start, mm.
    least: f32,
    cells_left: u32,
}

struct Hit {
    piece: u32,
    // From the ray's start, mm.
    distance: f32,
    // The point of the axis nearest to the place, from the centre of the cell, and from there
    // to the surface.
    axis_at: vec3<f32>,
    out: vec3<f32>,
    // From the mitre before the piece's first joint to there, along the axis.
    along: f32,
}

var<private> ray: CellRay;
var<private> hit: Hit;

// Begins a ray at a place near a cell; false when it begins beyond a face of the grid and
// goes on away from it.
fn begin_ray(
    cell: vec3<i32>,
    period: vec2<i32>,
    place: vec3<f32>,
    direction: vec3<f32>,
    least: f32,
    end: f32,
) -> bool {
    ray.cell = cell;
    ray.period = period;
    ray.at = place;
    ray.direction = direction;
    ray.gone = 0.0;
    ray.end = end;
    ray.least = least;
    let counts = vec3<i32>(cell_counts());
    ray.cells_left = u32(counts.x + counts.y + counts.z) * MAX_TILES;
    let size = cell_mm();
    for (var axis = 0u; axis < 3u; axis++) {
        if abs(ray.at[axis]) <= 0.5 * size[axis] {
            continue;
        }
        let cells = floor((ray.at[axis] + 0.5 * size[axis]) / size[axis]);
        var next = ray.cell[axis] + i32(cells);
        ray.at[axis] -= cells * size[axis];
        let count = counts[axis];
        if next < 0 || next >= count {
            if repeats() && axis < 2u {
                let by = i32(floor(f32(next) / f32(count)));
                ray.period[axis] += by;
                next -= by * count;
            } else {
                // A hair beyond the last cell: as if in it.
                let kept = clamp(next, 0, count - 1);
                ray.at[axis] += f32(next - kept) * size[axis];
                if (next > kept) == (direction[axis] >= 0.0) {
                    return false;
                }
                next = kept;
            }
        }
        ray.cell[axis] = next;
    }
    return true;
}

fn per_component(d: f32) -> f32 {
    if abs(d) > 1.0e-12 {
        return 1.0 / d;
    }
    return with_sign_of(1.0e12, d);
}

// Looks into the ray's cell, and goes on to the next unless something is met there; `any`
// stops at whatever is found first.
fn visit(any_will_do: bool) -> u32 {
    let half = 0.5 * cell_mm();
    let d = ray.direction;
    let faces = vec3<f32>(
        with_sign_of(half.x, d.x),
        with_sign_of(half.y, d.y),
        with_sign_of(half.z, d.z),
    );
    let ways = (faces - ray.at)
        * vec3<f32>(per_component(d.x), per_component(d.y), per_component(d.z));
    let span = max(min(ways.x, min(ways.y, ways.z)), 0.0);
    let counts = vec3<i32>(cell_counts());
    let index = u32((ray.cell.z * counts.y + ray.cell.y) * counts.x + ray.cell.x);
    let head = large_quad(heads_table() + HEAD_WORDS * index);
    if head.z != 0u {
        if search(head, span, any_will_do) {
            return HIT;
        }
    }
    ray.gone += span;
    ray.cells_left -= 1u;
    if ray.gone >= ray.end || ray.cells_left == 0u {
        return LEFT;
    }
    ray.at += span * d;
    var axis = 2u;
    if ways.x <= ways.y && ways.x <= ways.z {
        axis = 0u;
    } else if ways.y <= ways.z {
        axis = 1u;
    }
    ray.at[axis] = -faces[axis];
    let forth = select(-1, 1, faces[axis] > 0.0);
    let next = ray.cell[axis] + forth;
    if next >= 0 && next < counts[axis] {
        ray.cell[axis] = next;
    } else if repeats() && axis < 2u {
        ray.cell[axis] = select(counts[axis] - 1, 0, forth > 0);
        ray.period[axis] += forth;
    } else {
        return LEFT;
    }
    return ONWARD;
}

// A piece of a cell: a cylinder, or a hull of two spheres.
struct Piece {
    is_hull: bool,
    // The point of the axis nearest to the centre of the cell; the square of a cylinder's radius, or
    // where a hull's axis starts.
    foot: vec4<f32>,
    // The axis; the low end of a cylinder, or where a hull's axis ends.
    line: vec4<f32>,
    low: f32,
    high: f32,
    code: u32,
}

// The nearest entry, or any, among the pieces of a cell. Plain pieces and hulls take turns in one
// loop, so that what happens to both stands once: compilers put every function where it is called.
fn search(head: vec4<u32>, span: f32, any_will_do: bool) -> bool {
    let least = max(ray.least - ray.gone, -lead_mm());
    var most = min(span, ray.end - ray.gone);
    var found = false;
    var best = 0u;
    var best_code = 0u;
    var best_is_hull = false;
    let plain = head.z & 0xffffu;
    let count = plain + (head.z >> 16u);
    tentative_count += count;
    for (var i = 0u; i < count; i++) {
        var piece: Piece;
        piece.is_hull = i >= plain;
        var at = pieces_table() + PIECE_WORDS * (head.x + i);
        if piece.is_hull {
            at = hulls_table() + HULL_WORDS * (head.y + i - plain);
        }
        piece.foot = large_four(at);
        piece.line = large_four(at + 4u);
        var t = FAR;
        // Along the axis of a cylinder.
        var place = 0.0;
        if piece.is_hull {
            let rest = large_four(at + 8u);
            let last = large_quad(at + 12u);
            piece.low = bitcast<f32>(last.x);
            piece.high = bitcast<f32>(last.y);
            piece.code = last.z;
            t = hull_distance(piece, rest);
        } else {
            let entered = cylinder_entry(piece);
            t = entered.x;
            place = entered.y;
        }
        let is_nearer = least < t && t < FAR && select(t <= most, t < most, found);
        if !is_nearer {
            continue;
        }
        if !piece.is_hull {
            let end = end_of(head.x + i);
            piece.low = piece.line.w;
            piece.high = bitcast<f32>(end.x);
            piece.code = end.y;
        }
        if (piece.is_hull || place <= piece.high) && is_kept(piece, t) {
            found = true;
            best = at;
            best_code = piece.code;
            best_is_hull = piece.is_hull;
            most = t;
            if any_will_do {
                return true;
            }
        }
    }
    if found {
        note_hit(best, best_code, best_is_hull, most);
    }
    return found;
}

// High end and code of a plain piece.
fn end_of(index: u32) -> vec2<u32> {
    let at = ends_table() + END_WORDS * index;
    let both = large_quad(at & ~3u);
    return select(both.xy, both.zw, (at & 2u) != 0u);
}

// Where the ray enters a cylinder from its low end on, FAR where it does not, and how far along the
// axis that is.
fn cylinder_entry(piece: Piece) -> vec2<f32> {
    let axis = piece.line.xyz;
    // Across the axis: without the cancellation of 1 - cos^2 for rays along it.
    let along = dot(ray.direction, axis);
    let across = ray.direction - axis * along;
    let from_foot = ray.at - piece.foot.xyz;
    let height = dot(from_foot, axis);
    let aside = from_foot - axis * height;
    let a = dot(across, across);
    let b = dot(aside, across);
    let c = dot(aside, aside) - piece.foot.w;
    let discriminant = fma(b, b, -(a * c));
    if discriminant <= 0.0 {
        return vec2<f32>(FAR, 0.0);
    }
    let t = -(b + sqrt(discriminant)) / a;
    let place = fma(along, t, height);
    return vec2<f32>(select(FAR, t, place >= piece.line.w), place);
}

// Where the ray enters a hull of two spheres; FAR where it does not.
fn hull_distance(piece: Piece, rest: vec4<f32>) -> f32 {
    let axis = piece.line.xyz;
    let along = dot(ray.direction, axis);
    let across = ray.direction - axis * along;
    let from_foot = ray.at - piece.foot.xyz;
    let height = dot(from_foot, axis);
    let aside = from_foot - axis * height;
    let s = rest.z;
    let c_squared = 1.0 - s * s;
    let wide = rest.w - s * height;
    let tilt = s * along;
    let a = c_squared * dot(across, across) - tilt * tilt;
    let b = fma(c_squared, dot(aside, across), tilt * wide);
    let c = c_squared * dot(aside, aside) - wide * wide;
    let discriminant = fma(b, b, -(a * c));
    if discriminant >= 0.0 && abs(a) > 1.0e-30 {
        let side = -(b + sqrt(discriminant)) / a;
        let place = fma(along, side, height);
        if piece.low < place && place < piece.high {
            return side;
        }
    }
    let first = sphere_distance(from_foot - axis * piece.foot.w, rest.x);
    let last = sphere_distance(from_foot - axis * piece.line.w, rest.y);
    var nearest = FAR;
    if first < FAR && fma(along, first, height) <= piece.low {
        nearest = first;
    }
    if last < nearest && fma(along, last, height) >= piece.high {
        nearest = last;
    }
    return nearest;
}

// Where the ray, from a place, enters a sphere about the origin; FAR where it does not.
fn sphere_distance(from_middle: vec3<f32>, radius_squared: f32) -> f32 {
    let square = dot(ray.direction, ray.direction);
    let b = dot(from_middle, ray.direction);
    let across = from_middle - ray.direction * (b / square);
    let room = radius_squared - dot(across, across);
    if room < 0.0 {
        return FAR;
    }
    return -(b / square) - sqrt(room / square);
}

fn joint_of(code: u32) -> u32 {
    return joints_table() + JOINT_WORDS * (code & 0x1fffffffu);
}

// Whether a hit lies between the planes that cut a piece.
fn is_kept(piece: Piece, t: f32) -> bool {
    let kind = piece.code >> 29u;
    if kind == 0u {
        return true;
    }
    let axis = piece.line.xyz;
    let from_foot = ray.at + t * ray.direction - piece.foot.xyz;
    let along = dot(from_foot, axis);
    if kind < 5u {
        // Twice the greatest extension of its class: 2^-8, 2^-6, 2^-4, 2^-2 of an edge.
        let margin = bitcast<f32>((127u - 10u + 2u * kind) << 23u) * min_edge_mm();
        if along - piece.low > margin && piece.high - along > margin {
            return true;
        }
    }
    let out = from_foot - along * axis;
    let joint = joint_of(piece.code);
    // The joints at both ends of the piece.
    let first = large_four(joint);
    let of_first = large_quad(joint + 4u);
    let second = large_four(joint + JOINT_WORDS);
    let of_second = large_quad(joint + JOINT_WORDS + 4u);
    var start = piece.low + bitcast<f32>(of_first.x);
    var end = piece.high - second.w;
    if piece.is_hull {
        start = piece.foot.w;
        end = piece.line.w;
    }
    if (of_first.w & CUT) != 0u {
        if dot(out + (along - start) * axis, first.xyz) < -slack_mm() {
            return false;
        }
    }
    if (of_second.w & CUT) != 0u {
        if dot(out + (along - end) * axis, second.xyz) > slack_mm() {
            return false;
        }
    }
    return true;
}

fn note_hit(at: u32, code: u32, is_hull: bool, t: f32) {
    let start = large_four(at);
    let line = large_four(at + 4u);
    let foot = start.xyz;
    let axis = line.xyz;
    let from_foot = ray.at + t * ray.direction - foot;
    let along = dot(from_foot, axis);
    let out = from_foot - along * axis;
    // Where the side of the piece would begin; no look-up for most.
    var nearest = along;
    var low = line.w;
    if is_hull {
        nearest = clamp(along, start.w, line.w);
        low = start.w - large_number(joint_of(code) + 4u);
    }
    hit.piece = code & 0x1fffffffu;
    hit.distance = ray.gone + t;
    hit.axis_at = foot + nearest * axis;
    hit.out = out + (along - nearest) * axis;
    hit.along = nearest - low;
}

// The unit tangent of a piece so far from the mitre before its first joint.
fn tangent_of(piece: u32, along: f32) -> vec3<f32> {
    let joint = joints_table() + JOINT_WORDS * piece;
    let lengths = large_four(joint + 4u);
    let share = clamp((along - lengths.x) * lengths.y, 0.0, 1.0);
    let start = large_four(joint).xyz;
    let middle = mix(start, large_four(joint + JOINT_WORDS).xyz, share);
    let square = dot(middle, middle);
    if square <= 1.0e-12 {
        return start;
    }
    return middle * (1.0 / sqrt(square));
}

// A place in a cell from the least corner of the first period, mm.
fn from_corner(cell: vec3<i32>, period: vec2<i32>, place: vec3<f32>) -> vec3<f32> {
    let counts = vec3<i32>(cell_counts());
    let cells = vec3<f32>(cell + vec3<i32>(period * counts.xy, 0)) + 0.5;
    return cells * cell_mm() + place;
}

// Where a line passes the matter, from a place counted from the corner of the cells.
fn part_of_matter(from_mm: vec3<f32>, direction: vec3<f32>) -> vec2<f32> {
    let inverse = inverse_of_step(direction);
    let low = matter_low_mm();
    let high = matter_high_mm();
    var found = between(from_mm.z, inverse.z, low.z, high.z);
    if is_cut() || !repeats() {
        let in_x = between(from_mm.x, inverse.x, low.x, high.x);
        let in_y = between(from_mm.y, inverse.y, low.y, high.y);
        found.x = max(found.x, max(in_x.x, in_y.x));
        found.y = min(found.y, min(in_x.y, in_y.y));
    }
    return found;
}

// How far a ray from a place, mm, may go before it leaves matter that is cut.
fn way_out_mm(from_mm: vec3<f32>, direction: vec3<f32>) -> f32 {
    if !is_cut() {
        return FAR;
    }
    let d = vec3<f32>(not_zero(direction.x), not_zero(direction.y), not_zero(direction.z));
    let border = select(matter_low_mm(), matter_high_mm(), d > vec3<f32>(0.0));
    let way = (border - from_mm) / d;
    return max(min(way.x, min(way.y, way.z)), 0.0);
}

fn load_ray(first: u32) {
    ray.at = state_vector(first);
    ray.direction = state_vector(first + 3u);
    ray.cell = vec3<i32>(state_three(first + 6u));
    ray.period = vec2<i32>(i32(state(first + 9u)), i32(state(first + 10u)));
    ray.gone = state_number(first + 11u);
    ray.end = state_number(first + 12u);
    ray.least = state_number(first + 13u);
    ray.cells_left = state(first + 14u);
}

fn store_ray(first: u32) {
    keep_vector(first, ray.at);
    keep_vector(first + 3u, ray.direction);
    keep_three(first + 6u, vec3<u32>(ray.cell));
    keep(first + 9u, u32(ray.period.x));
    keep(first + 10u, u32(ray.period.y));
    keep_number(first + 11u, ray.gone);
    keep_number(first + 12u, ray.end);
    keep_number(first + 13u, ray.least);
    keep(first + 14u, ray.cells_left);
}
