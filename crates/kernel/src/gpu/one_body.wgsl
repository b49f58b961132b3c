// One flat cloth: a ray's way is one stretch through its cells. Places of the world are
// counted from the least corner of the first period.

fn repeats() -> bool {
    return REPEATS;
}

fn is_cut() -> bool {
    return HAS_BORDERS;
}

fn load_way(first: u32) {
    load_flight(first);
}

fn store_way(first: u32) {
    store_flight(first);
}

fn begin_path(pixel: vec2<f32>) {
    let seen = camera_ray(pixel);
    // The crossing is in cells.
    let size = cell_mm();
    let place = seen.crossing * size;
    let inside_matter = part_of_matter(place, seen.direction);
    var near = inside_matter.x;
    let far = inside_matter.y;
    let is_inside = near <= -seen.length_mm;
    near = max(near, -seen.length_mm);
    let misses = !(near < far);
    path.before = select(near + seen.length_mm, 0.0, misses);
    path.pdf = FAR;
    path.phase = FLYING;
    path.w_out = -seen.direction;
    ray.direction = seen.direction;
    path.drawn_at = place + seen.direction * near;
    let end = select(FAR, far - near, HAS_BORDERS);
    begin_packed(path.drawn_at, seen.direction, select(end, 0.0, misses));
    if misses {
        path.drawn_at = place - seen.direction * seen.length_mm;
        ray.cells_left = 0u;
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

fn step_on(any_will_do: bool) -> u32 {
    if is_among_packed() {
        return fly_on(any_will_do);
    }
    if ray.cells_left == 0u {
        return LEFT;
    }
    return visit(any_will_do);
}

// What the way has led to.
fn arrive(outcome: u32) {
    if outcome == HIT && is_among_packed() {
        arrive_packed();
    } else if outcome == HIT {
        site.met = hit;
        site.cell = ray.cell;
        site.period = ray.period;
        site.place = from_corner(ray.cell, ray.period, hit.axis_at + hit.out);
    } else {
        hit.distance = 0.5 * FAR;
    }
}

// How far from its start the way has led.
fn reach_mm() -> f32 {
    return hit.distance;
}

// The event at the fibre that was met; gives the direction that the picture shows.
fn meet_site() -> vec3<f32> {
    if is_at_packed() {
        meet_fibre(packed_tangent(), site.met.out, path.w_out);
        return packed_axis(site.met.piece);
    }
    let tangent = tangent_of(site.met.piece, site.met.along);
    meet_fibre(tangent, site.met.out, path.w_out);
    return tangent;
}

fn in_own_frame(w: vec3<f32>) -> vec3<f32> {
    return w;
}

fn in_world(w: vec3<f32>) -> vec3<f32> {
    return w;
}

// A place of the site's cell, or of its period among packed fibres, in the world.
fn place_of(start: vec3<f32>) -> vec3<f32> {
    if is_at_packed() {
        return packed_place_of(start);
    }
    return from_corner(site.cell, site.period, start);
}

// Sends a ray from a place of the site's cell.
fn send(start: vec3<f32>, toward: vec3<f32>, end: f32) {
    let most = min(way_out_mm(place_of(start), toward), end);
    if !begin_ray(site.cell, site.period, start, toward, start_mm(), most) {
        ray.cells_left = 0u;
    }
}

// There are no planes.
fn is_at_plane() -> bool {
    return false;
}

fn plane_radiance() -> vec3<f32> {
    return vec3<f32>(0.0);
}

fn plane_reflectance() -> vec3<f32> {
    return vec3<f32>(0.0);
}

fn plane_pdf(w_in: vec3<f32>) -> f32 {
    return 0.0;
}

fn plane_turn() -> vec3<f32> {
    return vec3<f32>(0.0);
}
