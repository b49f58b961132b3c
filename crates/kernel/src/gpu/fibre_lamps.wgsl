// Lamps of environment pictures among explicit fibres.

// The lamp of a number, counted through all pictures.
fn lamp_search(index: u32) -> Search {
    var left = index;
    var sky = skies_table();
    while left >= word(sky + 13u) {
        left -= word(sky + 13u);
        sky += SKY_WORDS;
    }
    let drawn = lamp_sample(sky, word(sky + 14u) + left * LAMP_WORDS);
    return Search(drawn.toward, drawn.irradiance, FAR, NO_PLACE);
}
