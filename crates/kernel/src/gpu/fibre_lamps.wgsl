// Lamps of environment pictures among explicit fibres: a shadow ray for each.

fn add_lamps(cell: vec3<i32>, period: vec2<i32>, axis_at: vec3<f32>) {
    for (var i = 0u; i < sky_count(); i++) {
        let sky = skies_table() + i * SKY_WORDS;
        for (var j = 0u; j < word(sky + 13u); j++) {
            let drawn = lamp_sample(sky, word(sky + 14u) + j * LAMP_WORDS);
            let aim = Search(drawn.toward, drawn.irradiance, FAR, NO_PLACE);
            add_light(aim, cell, period, axis_at);
        }
    }
}
