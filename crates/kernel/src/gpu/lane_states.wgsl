// What lanes know between dispatches, word by word, so that neighbours lie side by side.

fn state(lane: u32, k: u32) -> u32 {
    return lane_states[k * lane_count() + lane];
}

fn state_number(lane: u32, k: u32) -> f32 {
    return bitcast<f32>(state(lane, k));
}

fn state_vector(lane: u32, k: u32) -> vec3<f32> {
    return bitcast<vec3<f32>>(vec3<u32>(state(lane, k), state(lane, k + 1u), state(lane, k + 2u)));
}

fn keep(lane: u32, k: u32, x: u32) {
    lane_states[k * lane_count() + lane] = x;
}

fn keep_three(lane: u32, k: u32, v: vec3<u32>) {
    keep(lane, k, v.x);
    keep(lane, k + 1u, v.y);
    keep(lane, k + 2u, v.z);
}
