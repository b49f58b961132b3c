// Lamps of environment pictures in voxels: by tables of optical depths, and exact rays.

// Light from all of them that is scattered back along the way, over the throughput.
fn lamp_light(mean: f32, corners: Corners) -> vec3<f32> {
    var light_in = vec3<f32>(0.0);
    for (var i = 0u; i < sky_count(); i++) {
        let sky = skies_table() + i * SKY_WORDS;
        for (var j = 0u; j < word(sky + 13u); j++) {
            let lamp = word(sky + 14u) + j * LAMP_WORDS;
            let drawn = lamp_sample(sky, lamp);
            let scattered = scattered_toward(drawn.toward);
            var aim: Aim;
            aim.toward = drawn.toward;
            aim.grey = sum_of(scattered) * (1.0 / 3.0);
            aim.mean = mean;
            aim.distance_mm = FAR;
            aim.depth = table_depth(word(lamp + 2u), 1u, 0u, corners);
            aim.residual_floor = number(lamp + 3u);
            aim.extinctions = NO_TABLE;
            aim.u = drawn.u;
            light_in += drawn.irradiance * scattered * transmittance(aim);
        }
    }
    return light_in;
}
