//! A scene of voxels as a program for a graphics adapter.

use super::numbers::Numbers;
use super::program::ProgramScene;
use super::scene_words::{
    LIGHT_WORDS, PicturePaths, SKY_WORDS, add_picture, filter_constants, panel_words, put, put_map,
};
use super::tables::Tables;
use crate::refusal::Refusal;
use crate::roulette::VOXEL_SCALE;
use crate::voxels::environment::Sky;
use crate::voxels::flat_scene::FlatScene;
use crate::voxels::optical_depth_table::OpticalDepthTable;
use crate::voxels::scattering::Scattering;
use organza_scatter::FAR_ROWS;
use std::sync::Arc;

/// Words that a lane keeps: see `load_path` in `voxel_walk.wgsl`.
const LANE_WORDS: u32 = 28;
/// Words of a lamp: see `skies.wgsl`.
const LAMP_WORDS: usize = 4;

/// The program of a scene.
///
/// # Errors
/// Matter that there is no program for.
pub fn program_scene(scene: &Arc<FlatScene>) -> Result<ProgramScene<'_>, Refusal> {
    let (medium, grid) = (&scene.medium, &scene.medium.cell_grid);
    let mut constants = String::new();
    let mut has = |name: &str, value: bool| ProgramScene::constant(&mut constants, name, value);
    has("REPEATS", grid.repeats());
    has("HAS_BORDERS", scene.borders.is_some());
    has("HAS_PLACES", !medium.places.is_empty());
    has("HAS_MATERIALS", !medium.materials.is_empty());
    has("HAS_YARNS", !medium.yarns.is_empty());
    has("HAS_PANELS", scene.has_placed_lights());
    has("HAS_SKIES", !scene.skies.is_empty());
    has("HAS_LENS", scene.camera_rays.lens_mm.is_some());
    constants += &filter_constants(scene.camera_rays.filter);
    constants += &format!("const ROULETTE_SCALE: f32 = {VOXEL_SCALE:?};\n");

    let mut numbers = Numbers::new("scene_numbers");
    let mut tables = Tables::default();
    let paths = PicturePaths {
        film_width: scene.film_width,
        seed: scene.seed,
        max_bounces: scene.max_bounces,
        brightness: scene.brightness,
    };
    add_picture(&mut numbers, &paths, &scene.camera_rays);
    numbers.three_whole("dims", grid.dims());
    numbers.three("voxel_mm", grid.voxel_mm());
    numbers.number("scale_per_mm", medium.scale_per_mm);
    numbers.three("voxels_per_length", scene.voxels_per_length);
    numbers.number("least_rise", scene.least_rise);
    let borders = scene.borders;
    numbers.two("border_low", borders.map(|b| b.low).unwrap_or_default());
    numbers.two("border_high", borders.map(|b| b.high).unwrap_or_default());
    numbers.whole("words_table", tables.add(&medium.words));
    numbers.whole("places_table", tables.add(&medium.places));
    numbers.whole("materials_table", tables.add(&medium.materials));
    numbers.whole("substances_table", tables.add(&medium.substances));
    numbers.whole("yarns_table", tables.add(&medium.yarns));
    numbers.whole("densest_table", tables.add(&medium.densest));

    numbers.three_whole("node_dims", scene.nodes.dims);
    numbers.number("nodes_per_voxel", scene.nodes.per_voxel as f32);
    numbers.number("residual_scale", scene.residual_scale);
    numbers.whole("depths_table", tables.add(&scene.depths));
    numbers.whole("light_count", scene.lights.len() as u32);
    let lights = scene.lights.iter();
    let lights = lights.flat_map(|light| light_words(light, &mut tables));
    let lights: Vec<u32> = lights.collect();
    numbers.whole("lights_table", tables.add(lights));
    numbers.three("sky_behind", scene.environment[0]);
    numbers.three("sky_before", scene.environment[1]);
    numbers.whole("sky_count", scene.skies.len() as u32);
    let skies = scene.skies.iter();
    let skies: Vec<u32> = skies.flat_map(|sky| sky_words(sky, &mut tables)).collect();
    numbers.whole("skies_table", tables.add(skies));

    let mut parts = vec![
        include_str!("camera_rays.wgsl"),
        include_str!("voxel_codes.wgsl"),
        include_str!("voxel_words.wgsl"),
        include_str!("panels.wgsl"),
        include_str!("direct_lights.wgsl"),
        include_str!("optical_depths.wgsl"),
        include_str!("shadow_rays.wgsl"),
        include_str!("voxel_walk.wgsl"),
    ];
    if scene.skies.is_empty() {
        parts.push(include_str!("no_skies.wgsl"));
        parts.push(include_str!("no_voxel_lamps.wgsl"));
    } else {
        parts.push(include_str!("skies.wgsl"));
        parts.push(include_str!("voxel_lamps.wgsl"));
    }
    match medium.scattering {
        Scattering::Mirrors => parts.push(include_str!("flakes.wgsl")),
        Scattering::Diffuse | Scattering::Flakes(_) => {
            return Err(Refusal::NotYet("this family of micro-flakes"));
        }
        Scattering::Fibres => {
            constants += &format!("const LAST_FAR_ROW: f32 = {}.0;\n", FAR_ROWS - 1);
            numbers.whole("fibres_table", tables.add(&scene.fibres.words));
            numbers.whole("spreads_table", tables.add(&scene.fibres.spreads));
            numbers.whole("shown_table", tables.add(&scene.fibres.shown));
            parts.push(include_str!("spread_fibres.wgsl"));
            parts.push(include_str!("inclinations.wgsl"));
            parts.push(include_str!("virtual_fibres.wgsl"));
        }
    }
    Ok(ProgramScene {
        constants,
        parts,
        numbers,
        tables,
        lane_words: LANE_WORDS,
        film_width: scene.film_width,
        brightness: scene.brightness,
    })
}

fn light_words<'a>(light: &'a OpticalDepthTable, tables: &mut Tables<'a>) -> [u32; LIGHT_WORDS] {
    let mut words = [0; LIGHT_WORDS];
    put(&mut words, 0, light.to_light);
    words[3] = light.residual_floor.to_bits();
    put(&mut words, 4, light.irradiance.0);
    let placed = light.placed.as_ref();
    match placed.and_then(|placed| placed.panel.as_ref()) {
        None => words[8] = tables.add_numbers(&light.extinction_per_mm),
        // Toward the points of a panel there is no table.
        Some(panel) => {
            put(&mut words, 4, panel.radiance);
            let [u, v] = panel.edges_mm;
            panel_words(&mut words, [panel.corner_mm, u, v], panel.is_two_sided);
        }
    }
    words
}

fn sky_words<'a>(sky: &'a Sky, tables: &mut Tables<'a>) -> [u32; SKY_WORDS] {
    let mut words = [0; SKY_WORDS];
    put_map(&mut words, &sky.map);
    words[11] = tables.add(&sky.texels);
    words[12] = sky.whole;
    words[13] = sky.lamps.len() as u32;
    let lamps: Vec<u32> = sky
        .lamps
        .iter()
        .flat_map(|lamp| -> [u32; LAMP_WORDS] {
            [
                tables.add(&lamp.places),
                lamp.count,
                tables.add(&lamp.table.depths),
                lamp.table.residual_floor.to_bits(),
            ]
        })
        .collect();
    words[14] = tables.add(lamps);
    words
}
