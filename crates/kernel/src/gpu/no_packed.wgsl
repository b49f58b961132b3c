// Without packed fibres.

fn load_flight(first: u32) {
}

fn store_flight(first: u32) {
}

fn is_among_packed() -> bool {
    return false;
}

fn is_at_packed() -> bool {
    return false;
}

fn goes_on_packed(carried: f32) -> bool {
    return false;
}

fn fly_on(is_shadow: bool) -> u32 {
    return LEFT;
}

fn begin_packed(from_mm: vec3<f32>, toward: vec3<f32>, end: f32) {
}

fn send_packed(start: vec3<f32>, toward: vec3<f32>, end: f32) {
}

fn arrive_packed() {
}

fn packed_place_of(at_mm: vec3<f32>) -> vec3<f32> {
    return at_mm;
}

fn packed_axis(place: u32) -> vec3<f32> {
    return vec3<f32>(0.0);
}

fn packed_tangent() -> vec3<f32> {
    return vec3<f32>(0.0);
}

fn packed_weight() -> f32 {
    return 1.0;
}

fn packed_material(place: u32) -> u32 {
    return 0u;
}

fn packed_yarn(place: u32) -> u32 {
    return 0u;
}
