// The two words of a voxel: see `voxels/voxel_words.rs`.

fn bound_of(voxel: vec2<u32>) -> f32 {
    return bound_of_code(voxel.y >> 24u);
}

// In voxels.
fn reach_of(voxel: vec2<u32>) -> f32 {
    return reach_of_code(voxel.x & 0xfu);
}

// Across the fibres, as a share.
fn broadside_of(voxel: vec2<u32>) -> f32 {
    return bitcast<f32>(((voxel.x >> 16u) << 11u) + EXTINCTION_BASE) - LEAST_EXTINCTION;
}

fn end_on_code_of(voxel: vec2<u32>) -> u32 {
    return (voxel.x >> 4u) & 0xfffu;
}

fn end_on_of(voxel: vec2<u32>) -> f32 {
    return end_on_of_code(end_on_code_of(voxel));
}

// Along the fibres; its length is between 3^-1/2 and one.
fn axis_of(voxel: vec2<u32>) -> vec3<f32> {
    return axis_of_code(voxel.y, 12u);
}

fn words_at(place: u32) -> vec2<u32> {
    let at = words_table() + 2u * place;
    return vec2<u32>(word(at), word(at + 1u));
}

// The first place of a voxel in x, the number of its populations in y.
fn places_of(voxel: u32) -> vec2<u32> {
    if !HAS_PLACES {
        return vec2<u32>(voxel, 1u);
    }
    let found = word(places_table() + voxel);
    return vec2<u32>(found & 0x1fffffffu, (found >> 29u) + 1u);
}

// Extinction of a voxel toward a direction, 1/mm: see `FlatMedium::extinction_per_mm`.
fn extinction_per_mm(voxel: u32, w: vec3<f32>) -> f32 {
    let places = places_of(voxel);
    var sum = 0.0;
    for (var i = 0u; i < places.y; i++) {
        let words = words_at(places.x + i);
        if (words.x >> 16u) != 0u {
            let axis = axis_of(words);
            let across = cross(axis, w);
            let square = dot(axis, axis);
            let shown = dot(across, across);
            let area = area_squared(max(square - shown, 0.0), shown, end_on_of(words)) / square;
            sum += broadside_of(words) * sqrt(area);
        }
    }
    return sum * scale_per_mm() / f32(places.y);
}
