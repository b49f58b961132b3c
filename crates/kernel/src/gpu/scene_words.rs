//! What scenes of voxels and of explicit fibres tell shaders alike.

use super::numbers::Numbers;
use crate::voxels::camera_rays::CameraRays;
use glam::Vec3;
use organza_film::{Brightness, PixelFilter};
use organza_light::PictureMap;

/// Words of a light and of a picture: see `panels.wgsl`, `skies.wgsl`.
pub const LIGHT_WORDS: usize = 24;
pub const SKY_WORDS: usize = 16;

/// Writes a vector as bits.
pub fn put(words: &mut [u32], at: usize, v: Vec3) {
    words[at..at + 3].copy_from_slice(&v.to_array().map(f32::to_bits));
}

/// Writes a rectangle of that corner and those edges, mm, into the words of a light.
pub fn panel_words(words: &mut [u32; LIGHT_WORDS], [corner, u, v]: [Vec3; 3], is_two_sided: bool) {
    let across = u.cross(v);
    let area = across.length();
    words[7] = 1;
    words[9] = u32::from(is_two_sided);
    put(words, 10, corner);
    put(words, 13, u);
    put(words, 16, v);
    put(words, 19, across / area);
    words[22] = area.to_bits();
}

/// Which filter spreads samples over pixels.
pub fn filter_constants(filter: PixelFilter) -> String {
    let number = match filter {
        PixelFilter::Box => 0,
        PixelFilter::Tent => 1,
        PixelFilter::Gaussian => 2,
    };
    format!(
        "const FILTER_TENT: u32 = 1u;\nconst FILTER_GAUSSIAN: u32 = 2u;\n\
         const FILTER: u32 = {number}u;\n"
    )
}

/// What names the paths of a picture and sums their samples.
pub struct PicturePaths {
    pub film_width: u32,
    pub seed: u64,
    pub max_bounces: u32,
    pub brightness: Brightness,
}

/// The numbers of a picture and of its camera.
pub fn add_picture(numbers: &mut Numbers, paths: &PicturePaths, camera: &CameraRays) {
    numbers.whole("film_width", paths.film_width);
    numbers.whole("seed_low", paths.seed as u32);
    numbers.whole("seed_high", (paths.seed >> 32) as u32);
    numbers.whole("max_bounces", paths.max_bounces);
    numbers.signed("brightness_exponent", paths.brightness.exponent());
    numbers.number("brightest_summed", paths.brightness.most());
    let [half_columns, half_rows] = camera.half_size;
    numbers.number("half_columns", half_columns);
    numbers.number("half_rows", half_rows);
    numbers.number("film_scale", camera.scale);
    let [crossing, crossing_x, crossing_y] = camera.crossing;
    let [way, way_x, way_y] = camera.way_mm;
    let [lens_x, lens_y] = camera.lens_mm.unwrap_or_default();
    for (name, v) in [
        ("crossing", crossing),
        ("crossing_x", crossing_x),
        ("crossing_y", crossing_y),
        ("way_mm", way),
        ("way_x_mm", way_x),
        ("way_y_mm", way_y),
        ("lens_x_mm", lens_x),
        ("lens_y_mm", lens_y),
    ] {
        numbers.three(name, v);
    }
}

/// The first words of a picture: its size and frame.
pub fn put_map(words: &mut [u32; SKY_WORDS], map: &PictureMap) {
    [words[0], words[1]] = map.size.as_vec2().to_array().map(f32::to_bits);
    put(words, 2, map.centre);
    put(words, 5, map.left);
    put(words, 8, map.up);
}
