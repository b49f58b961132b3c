//! A scene of explicit fibres as a program for a graphics adapter.

use super::bodies::{FAR_MM, add_bodies, middle_mm, place_from};
use super::cell_tables::CellTables;
use super::numbers::Numbers;
use super::program::ProgramScene;
use super::scene_words::{
    LIGHT_WORDS, PicturePaths, SKY_WORDS, add_picture, filter_constants, panel_words, put, put_map,
};
use super::tables::Tables;
use crate::fibres::body::Body;
use crate::fibres::fibre_scene::FibreScene;
use crate::fibres::matter::FibreMatter;
use crate::fibres::shade::SHADOW_SCALE;
use crate::packed::PackedPart;
use crate::refusal::Refusal;
use crate::roulette::FIBRE_SCALE;
use crate::voxels::camera_rays::CameraRays;
use crate::voxels::environment::{Parts, lamp_places, texel_words};
use crate::voxels::population_tables::populations;
use glam::{DVec3, Vec3};
use organza_light::{Hemisphere, ImageEnvironment, KernelLight, Light};
use organza_scatter::FAR_ROWS;
use std::sync::Arc;

/// Words that a lane keeps: see `load_path` in `fibre_walk.wgsl`, `load_way` in `bodies.wgsl`
/// and `load_flight` in `packed.wgsl`.
const LANE_WORDS: u32 = 62;
const WAY_WORDS: u32 = 26;
const FLIGHT_WORDS: u32 = 16;
/// Parts of a program with packed fibres.
const PACKED_PARTS: [&str; 3] = [
    include_str!("voxel_codes.wgsl"),
    include_str!("spread_fibres.wgsl"),
    include_str!("packed.wgsl"),
];

/// The program of a scene.
///
/// # Errors
/// A scene that it does not support.
pub fn program_scene(scene: &Arc<FibreScene>) -> Result<ProgramScene<'_>, Refusal> {
    let matter = &scene.matter;
    let packed = matter.packed.as_ref();
    let lights = Lights::of(&scene.lights)?;
    let only = matter.bodies.first().filter(|_| matter.is_one_body());
    // From where places of the world are counted.
    let point_mm = match only {
        Some(body) => body.cells.grid.corner_mm(),
        None => middle_mm(matter),
    };

    let mut constants = String::new();
    let mut has = |name: &str, value: bool| ProgramScene::constant(&mut constants, name, value);
    has("HAS_PLANES", !matter.planes.is_empty());
    has("HAS_PANELS", lights.has_panels);
    has("HAS_SPOTS", lights.has_spots);
    has("HAS_SKIES", !lights.pictures.is_empty());
    let mut numbers = Numbers::new("scene_numbers");
    let mut tables = Tables::default();
    let camera = match only {
        Some(body) => {
            has("REPEATS", body.cells.grid.repeats);
            has("HAS_BORDERS", body.is_cut);
            add_body(body, &mut numbers, &mut tables)?;
            let grid = &body.cells.grid;
            let size = grid.cell_mm() * grid.dims.as_dvec3();
            let per_cell = 1.0 / grid.cell_mm();
            CameraRays::in_frame(&scene.camera, point_mm, per_cell, point_mm + 0.5 * size)
        }
        None => {
            add_bodies(matter, point_mm, &mut numbers, &mut tables)?;
            CameraRays::in_frame(&scene.camera, point_mm, DVec3::ONE, point_mm)
        }
    };
    has("HAS_LENS", camera.lens_mm.is_some());
    constants += &format!(
        "const SECTION_ROWS: u32 = {FAR_ROWS}u;\nconst SHADOW_SCALE: f32 = {SHADOW_SCALE:?};\n\
         const ROULETTE_SCALE: f32 = {FIBRE_SCALE:?};\n"
    );
    constants += &filter_constants(camera.filter);

    let paths = PicturePaths {
        film_width: scene.camera.resolution().x,
        seed: scene.seed,
        max_bounces: scene.max_bounces,
        brightness: scene.brightness,
    };
    add_picture(&mut numbers, &paths, &camera);
    let starts_packed = packed.is_some_and(|part| part.switch.is_over(0, 1.0));
    ProgramScene::constant(&mut constants, "STARTS_PACKED", starts_packed);
    if let Some(part) = packed {
        add_packed(part, point_mm, &mut constants, &mut numbers, &mut tables);
    }
    numbers.whole("joints_table", tables.add_large(&matter.joints.words));
    numbers.whole("yarns_table", tables.add(matter.joints.yarns()));
    numbers.whole("optics_table", tables.add(&matter.optics.words));

    numbers.whole("light_count", (lights.words.len() / LIGHT_WORDS) as u32);
    numbers.whole("lights_table", tables.add(lights.words_from(point_mm)));
    numbers.three("sky_behind", lights.environment[0]);
    numbers.three("sky_before", lights.environment[1]);
    numbers.whole("sky_count", lights.pictures.len() as u32);
    let skies = lights.pictures.iter();
    let skies = skies.flat_map(|image| sky_words(image, &mut tables));
    let skies: Vec<u32> = skies.collect();
    let lamps = skies.chunks(SKY_WORDS).map(|sky| sky[13]);
    numbers.whole("lamp_count", lamps.sum());
    numbers.whole("skies_table", tables.add(skies));

    Ok(ProgramScene {
        constants,
        parts: parts_of(matter, &lights),
        numbers,
        tables,
        lane_words: LANE_WORDS
            + match (packed, only) {
                (Some(_), _) => FLIGHT_WORDS,
                (None, Some(_)) => 0,
                (None, None) => WAY_WORDS,
            },
        film_width: paths.film_width,
        brightness: scene.brightness,
    })
}

/// The sources that matter and lights need.
fn parts_of(matter: &FibreMatter, lights: &Lights<'_>) -> Vec<&'static str> {
    let mut parts = vec![
        include_str!("camera_rays.wgsl"),
        include_str!("panels.wgsl"),
        include_str!("cells.wgsl"),
        include_str!("inclinations.wgsl"),
        include_str!("near_field.wgsl"),
        include_str!("fibre_walk.wgsl"),
    ];
    parts.extend(match lights.pictures.is_empty() {
        true => [
            include_str!("no_skies.wgsl"),
            include_str!("no_fibre_lamps.wgsl"),
        ],
        false => [include_str!("skies.wgsl"), include_str!("fibre_lamps.wgsl")],
    });
    parts.extend(match matter.packed {
        Some(_) => &PACKED_PARTS[..],
        None => &[include_str!("no_packed.wgsl")],
    });
    parts.push(match matter.optics.has_sections {
        true => include_str!("sections.wgsl"),
        false => include_str!("no_sections.wgsl"),
    });
    parts.push(match matter.is_one_body() {
        true => include_str!("one_body.wgsl"),
        false => include_str!("bodies.wgsl"),
    });
    parts
}

/// Adds the numbers and tables of a flat body that is alone: see `one_body.wgsl`.
fn add_body<'a>(
    body: &'a Body,
    numbers: &mut Numbers,
    tables: &mut Tables<'a>,
) -> Result<(), Refusal> {
    let (cells, grid) = (&body.cells, &body.cells.grid);
    numbers.three("cell_mm", grid.cell_mm().as_vec3());
    numbers.three_whole("cell_counts", grid.dims.as_uvec3());
    numbers.number("lead_mm", cells.lead_mm);
    numbers.number("slack_mm", cells.slack_mm);
    numbers.number("min_edge_mm", cells.min_edge_mm);
    numbers.number("start_mm", body.start_mm);
    let corner = grid.corner_mm();
    numbers.three("matter_low_mm", place_from(corner, body.low_mm));
    numbers.three("matter_high_mm", place_from(corner, body.high_mm));
    let of_cells = CellTables::add(cells, tables)?;
    numbers.whole("heads_table", of_cells.heads);
    numbers.whole("pieces_table", of_cells.pieces);
    numbers.whole("ends_table", of_cells.ends);
    numbers.whole("hulls_table", of_cells.hulls);
    Ok(())
}

/// Adds the constants, numbers and tables of packed fibres: see `packed.wgsl`.
fn add_packed<'a>(
    part: &'a PackedPart,
    corner_mm: DVec3,
    constants: &mut String,
    numbers: &mut Numbers,
    tables: &mut Tables<'a>,
) {
    let (volume, grid) = (&part.volume, &part.volume.cell_grid);
    ProgramScene::constant(constants, "HAS_RADII", !volume.radii.is_empty());
    let corner = grid.bounds_mm().min.as_dvec3() - corner_mm;
    numbers.three("volume_corner_mm", corner.as_vec3());
    numbers.three_whole("volume_dims", grid.dims());
    numbers.three("voxel_mm", grid.voxel_mm());
    numbers.three("voxels_per_mm", grid.voxels_per_mm());
    numbers.three_whole("bricks", volume.bricks);
    numbers.number("volume_scale_per_mm", volume.scale_per_mm);
    numbers.number("volume_radius_mm", volume.radius_mm);
    numbers.number("most_mm", grid.most_mm().min(FAR_MM) as f32);
    numbers.whole("switch_events", part.switch.first_events);
    numbers.number("switch_weight", part.switch.while_weight.min(FAR_MM as f32));
    numbers.whole("voxels_table", tables.add_large(&volume.voxels));
    numbers.whole("radii_table", tables.add_large(&volume.radii));
    numbers.whole("populations_table", tables.add_large(&volume.words));
    numbers.whole("shares_table", tables.add(&volume.shares));
    let populations = populations();
    numbers.whole("spreads_table", tables.add(&populations.spreads));
    numbers.whole("shown_table", tables.add(&populations.shown));
}

/// The lights of a scene, sorted by how they are found.
struct Lights<'a> {
    /// Parallel light, panels and spots, with places in the world.
    words: Vec<u32>,
    places_mm: Vec<Option<Vec3>>,
    has_panels: bool,
    has_spots: bool,
    environment: [Vec3; 2],
    pictures: Vec<&'a ImageEnvironment>,
}

impl<'a> Lights<'a> {
    fn of(lights: &'a [Light]) -> Result<Lights<'a>, Refusal> {
        let mut all = Lights {
            words: Vec::new(),
            places_mm: Vec::new(),
            has_panels: false,
            has_spots: false,
            environment: [Vec3::ZERO; 2],
            pictures: Vec::new(),
        };
        for light in lights {
            let mut words = [0; LIGHT_WORDS];
            match light.for_kernel() {
                KernelLight::Parallel {
                    direction,
                    irradiance,
                } => {
                    put(&mut words, 0, -direction);
                    put(&mut words, 4, irradiance.0);
                    all.words.extend(words);
                    all.places_mm.push(None);
                }
                KernelLight::Panel(rectangle) => {
                    let [corner, u, v] = rectangle.corner_and_edges_mm();
                    panel_words(&mut words, [corner, u, v], rectangle.is_two_sided());
                    put(&mut words, 4, rectangle.radiance().0);
                    all.words.extend(words);
                    all.places_mm.push(Some(corner));
                    all.has_panels = true;
                }
                KernelLight::Spot(spot) => {
                    words[7] = 2;
                    put(&mut words, 4, spot.intensity.0);
                    put(&mut words, 13, spot.axis);
                    words[16] = spot.half_angle_rad.to_bits();
                    words[17] = spot.falloff_rad.to_bits();
                    all.words.extend(words);
                    all.places_mm.push(Some(spot.position_mm));
                    all.has_spots = true;
                }
                KernelLight::Sky {
                    radiance,
                    hemisphere,
                } => {
                    if hemisphere != Hemisphere::Front {
                        all.environment[0] += radiance.0;
                    }
                    if hemisphere != Hemisphere::Back {
                        all.environment[1] += radiance.0;
                    }
                }
                KernelLight::Picture(image) => all.pictures.push(image),
                KernelLight::Placed { .. } => {
                    return Err(Refusal::NotYet("lights other than rectangles and spots"));
                }
            }
        }
        Ok(all)
    }

    /// The words, with places counted from a point.
    fn words_from(&self, point_mm: DVec3) -> Vec<u32> {
        let mut words = self.words.clone();
        for (words, at) in words.chunks_exact_mut(LIGHT_WORDS).zip(&self.places_mm) {
            if let Some(at) = at {
                put(words, 10, (at.as_dvec3() - point_mm).as_vec3());
            }
        }
        words
    }
}

/// An environment picture: its sky and its lamps, so that neither is found twice.
fn sky_words(image: &ImageEnvironment, tables: &mut Tables<'_>) -> [u32; SKY_WORDS] {
    let parts = Parts::of(image);
    let (texels, whole) = texel_words(image, &parts);
    let mut words = [0; SKY_WORDS];
    put_map(&mut words, image.map());
    words[11] = tables.add(texels);
    words[12] = whole;
    let mut lamps = Vec::new();
    for texels in &parts.lamps {
        if let Some((places, count)) = lamp_places(image, texels) {
            lamps.extend([tables.add(places), count, 0, 0]);
            words[13] += 1;
        }
    }
    words[14] = tables.add(lamps);
    words
}
