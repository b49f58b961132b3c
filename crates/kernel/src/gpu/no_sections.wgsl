// Fibres that are all round.

fn is_section() -> bool {
    return false;
}

fn section_shares(cos_of: f32) -> vec4<f32> {
    return vec4<f32>(0.0);
}

fn section_light(mean_cos: f32, azimuth: f32) -> SectionLight {
    let dark = vec3<f32>(0.0);
    return SectionLight(Lobes(dark, dark, dark, dark), vec4<f32>(0.0));
}

fn section_azimuth(lobe: u32, mean_cos: f32) -> f32 {
    return 0.0;
}
