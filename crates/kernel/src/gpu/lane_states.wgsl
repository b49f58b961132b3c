// What lanes know between dispatches, word by word, so that neighbours lie side by side.

// The lane whose words are read and written.
var<private> own_lane: u32;

fn state(k: u32) -> u32 {
    return lane_states[k * lane_count() + own_lane];
}

fn state_number(k: u32) -> f32 {
    return bitcast<f32>(state(k));
}

fn state_three(k: u32) -> vec3<u32> {
    return vec3<u32>(state(k), state(k + 1u), state(k + 2u));
}

fn state_vector(k: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(state_three(k));
}

fn keep(k: u32, x: u32) {
    lane_states[k * lane_count() + own_lane] = x;
}

fn keep_three(k: u32, v: vec3<u32>) {
    keep(k, v.x);
    keep(k + 1u, v.y);
    keep(k + 2u, v.z);
}

fn keep_number(k: u32, x: f32) {
    keep(k, bitcast<u32>(x));
}

fn keep_vector(k: u32, v: vec3<f32>) {
    keep_three(k, bitcast<vec3<u32>>(v));
}
