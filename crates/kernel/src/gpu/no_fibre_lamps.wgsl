// Explicit fibres without lamps of environment pictures.

fn lamp_search(index: u32) -> Search {
    return Search(vec3<f32>(0.0), vec3<f32>(0.0), FAR, NO_PLACE);
}
