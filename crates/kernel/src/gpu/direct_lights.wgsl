// Parallel lights and panels in voxels, which shadow rays find: see `voxels/panel.rs`.

// The path's place from the corner of the first period.
fn place_mm() -> vec3<f32> {
    return (path.at + vec3<f32>(path.beyond, 0.0)) * voxel_mm();
}

// Light from all of them that is scattered back along the way, over the throughput.
fn direct_light(mean: f32, corners: Corners) -> vec3<f32> {
    var light_in = vec3<f32>(0.0);
    var three = vec3<f32>(0.0);
    for (var i = 0u; i < light_count(); i++) {
        if i % 3u == 0u {
            three = units();
        }
        let light = lights_table() + i * LIGHT_WORDS;
        var aim: Aim;
        aim.u = three[i % 3u];
        aim.mean = mean;
        aim.toward = vector(light);
        aim.distance_mm = FAR;
        aim.extinctions = word(light + 8u);
        aim.residual_floor = number(light + 3u);
        var strength = 1.0;
        if HAS_PANELS && is_panel(light) {
            let u = units();
            let drawn = vector(light + 10u) + vector(light + 13u) * u.x + vector(light + 16u) * u.y;
            let to = drawn - place_mm();
            let square = dot(to, to);
            aim.distance_mm = sqrt(square);
            aim.toward = to * (1.0 / aim.distance_mm);
            aim.extinctions = NO_TABLE;
            var facing = -dot(aim.toward, vector(light + 19u));
            if word(light + 9u) != 0u {
                facing = abs(facing);
            }
            strength = number(light + 22u) * max(facing, 0.0) / square;
        }
        let scattered = scattered_toward(aim.toward);
        aim.grey = sum_of(scattered) * (1.0 / 3.0);
        aim.depth = table_depth(depths_table(), light_count(), i, corners);
        let through = transmittance(aim);
        light_in += vector(light + 4u) * scattered * (through * strength);
    }
    return light_in;
}

// What a camera ray sees of panels between two distances from the path's place, mm.
fn panels_in_sight(from_mm: f32, to_mm: f32) -> vec3<f32> {
    var seen = vec3<f32>(0.0);
    for (var i = 0u; i < light_count(); i++) {
        let light = lights_table() + i * LIGHT_WORDS;
        if is_panel(light) {
            let t = panel_distance(light, place_mm(), path.direction);
            if t < FAR && t > from_mm && t <= to_mm {
                seen += vector(light + 4u);
            }
        }
    }
    return seen;
}
