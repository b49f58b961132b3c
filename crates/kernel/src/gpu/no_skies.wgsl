// Without environment pictures.

fn sky_radiance(direction: vec3<f32>, whole: bool) -> vec3<f32> {
    return vec3<f32>(0.0);
}
