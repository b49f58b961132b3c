// Voxels without lamps of environment pictures.

fn lamp_light(mean: f32, corners: Corners) -> vec3<f32> {
    return vec3<f32>(0.0);
}
