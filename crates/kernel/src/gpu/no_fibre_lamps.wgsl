// Explicit fibres without lamps of environment pictures.

fn add_lamps(cell: vec3<i32>, period: vec2<i32>, axis_at: vec3<f32>) {
}
