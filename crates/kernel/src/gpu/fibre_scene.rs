//! A scene of explicit fibres as a program for a graphics adapter.

use super::device::Limits;
use super::numbers::Numbers;
use super::program::ProgramScene;
use super::scene_words::{LIGHT_WORDS, SKY_WORDS, add_camera, filter_constants, panel_words, put};
use super::tables::Tables;
use crate::fibres::block::{BLOCK, Block};
use crate::fibres::body::Body;
use crate::fibres::cells::Cells;
use crate::fibres::fibre_scene::FibreScene;
use crate::fibres::hull::HullBlock;
use crate::fibres::matter::FibreMatter;
use crate::refusal::Refusal;
use crate::voxels::camera_rays::CameraRays;
use crate::voxels::environment::{Parts, lamp_places, texel_words};
use glam::{DVec3, Vec3};
use organza_film::{FirstEvent, SiteInfo};
use organza_light::{Hemisphere, ImageEnvironment, KernelLight, Light};
use std::sync::Arc;

/// Words that a lane keeps: see `load_path` in `fibre_walk.wgsl`.
const LANE_WORDS: u32 = 37;
/// Words of a cell's head, of a plain piece and of a hull: see `cells.wgsl`.
const HEAD_WORDS: usize = 3;
const PIECE_WORDS: usize = 10;
const HULL_WORDS: usize = 15;
/// What stands for infinity: infinite numbers are none of the shading language.
const FAR_MM: f64 = 1e30;

/// The program of a scene.
///
/// # Errors
/// A scene that it does not support, or too large for the limits.
pub fn program_scene(
    scene: &Arc<FibreScene>,
    limits: &Limits,
) -> Result<ProgramScene<'static>, Refusal> {
    let matter = &scene.matter;
    let body = only_body(matter)?;
    let cells = &body.cells;
    let needed = bytes(body, matter);
    let most = limits.words_per_buffer() * 4 * u64::from(limits.table_buffers);
    if needed > most {
        return Err(Refusal::Binding(needed, most));
    }
    let lights = Lights::of(&scene.lights)?;
    let grid = &cells.grid;
    let corner = grid.corner_mm();
    let size = grid.cell_mm() * grid.dims.as_dvec3();
    let per_cell = 1.0 / grid.cell_mm();
    let camera = CameraRays::in_frame(&scene.camera, corner, per_cell, corner + 0.5 * size);

    let mut constants = String::new();
    let mut has = |name: &str, value: bool| ProgramScene::constant(&mut constants, name, value);
    has("REPEATS", grid.repeats);
    has("HAS_BORDERS", body.is_cut);
    has("HAS_PANELS", lights.has_panels);
    has("HAS_SKIES", !lights.pictures.is_empty());
    has("HAS_LENS", camera.lens_mm.is_some());
    constants += &filter_constants(camera.filter);

    let mut numbers = Numbers::new("scene_numbers");
    let mut tables = Tables::default();
    let film_width = scene.camera.resolution().x;
    numbers.whole("film_width", film_width);
    numbers.whole("seed_low", scene.seed as u32);
    numbers.whole("seed_high", (scene.seed >> 32) as u32);
    numbers.whole("max_bounces", scene.max_bounces);
    numbers.signed("brightness_exponent", scene.brightness.exponent());
    numbers.number("brightest_summed", scene.brightness.most());
    add_camera(&mut numbers, &camera);
    numbers.three("cell_mm", grid.cell_mm().as_vec3());
    numbers.three_whole("cell_counts", grid.dims.as_uvec3());
    numbers.number("lead_mm", cells.lead_mm);
    numbers.number("slack_mm", cells.slack_mm);
    numbers.number("min_edge_mm", cells.min_edge_mm);
    numbers.number("start_mm", body.start_mm);
    let place = |world: DVec3| {
        let from_corner = world - corner;
        let far = DVec3::splat(FAR_MM);
        from_corner.clamp(-far, far).as_vec3()
    };
    numbers.three("matter_low_mm", place(body.low_mm));
    numbers.three("matter_high_mm", place(body.high_mm));
    let sorted = Sorted::of(cells);
    numbers.whole("heads_table", tables.add(sorted.heads));
    numbers.whole("pieces_table", tables.add(sorted.pieces));
    numbers.whole("hulls_table", tables.add(sorted.hulls));
    numbers.whole("joints_table", tables.add(matter.joints.words.clone()));
    numbers.whole("yarns_table", tables.add(matter.joints.yarns()));
    numbers.whole("optics_table", tables.add(matter.optics.words.clone()));

    numbers.whole("light_count", (lights.words.len() / LIGHT_WORDS) as u32);
    let corner_words = lights.words_from(corner);
    numbers.whole("lights_table", tables.add(corner_words));
    numbers.three("sky_behind", lights.environment[0]);
    numbers.three("sky_before", lights.environment[1]);
    numbers.whole("sky_count", lights.pictures.len() as u32);
    let skies: Vec<u32> = lights
        .pictures
        .iter()
        .flat_map(|image| sky_words(image, &mut tables))
        .collect();
    numbers.whole("skies_table", tables.add(skies));

    let of_skies = match lights.pictures.is_empty() {
        true => [
            include_str!("no_skies.wgsl"),
            include_str!("no_fibre_lamps.wgsl"),
        ],
        false => [include_str!("skies.wgsl"), include_str!("fibre_lamps.wgsl")],
    };
    let mut parts = vec![
        include_str!("camera_rays.wgsl"),
        include_str!("panels.wgsl"),
        include_str!("cells.wgsl"),
        include_str!("near_field.wgsl"),
        include_str!("fibre_walk.wgsl"),
    ];
    parts.extend(of_skies);
    let own = Arc::clone(scene);
    Ok(ProgramScene {
        constants,
        parts,
        numbers,
        tables,
        lane_words: LANE_WORDS,
        film_width,
        brightness: scene.brightness,
        first_event: Box::new(move |piece, depth| first_event(&own.matter, piece, depth)),
    })
}

/// What a film notes of a piece that was met first: the tangent where it begins.
fn first_event(matter: &FibreMatter, piece: u32, depth_mm: f32) -> Option<FirstEvent> {
    (piece != u32::MAX).then(|| FirstEvent {
        info: SiteInfo {
            axis: matter.joints.tangent(piece, 0.0),
            yarn: Some(matter.joints.yarn(piece)),
        },
        depth_mm: f64::from(depth_mm),
    })
}

/// The only body of matter that the shaders take.
fn only_body(matter: &FibreMatter) -> Result<&Body, Refusal> {
    if matter.has_packed() {
        return Err(Refusal::NotYet("packed fibres"));
    }
    if matter.has_lists() {
        return Err(Refusal::NotYet("lists of fibres in place of copies"));
    }
    if matter.optics.has_sections {
        return Err(Refusal::NotYet("fibres that are not round"));
    }
    match &matter.bodies[..] {
        [body] if matter.is_one_body() => Ok(body),
        _ => Err(Refusal::NotYet(
            "several cloths, cloths over meshes, or planes",
        )),
    }
}

/// Bytes of the largest tables, at most.
fn bytes(body: &Body, matter: &FibreMatter) -> u64 {
    let cells = &body.cells;
    let heads = cells.heads.len() * HEAD_WORDS;
    let pieces = cells.blocks.len() * BLOCK * PIECE_WORDS;
    let hulls = cells.hulls.len() * BLOCK * HULL_WORDS;
    4 * (heads + pieces + hulls + matter.joints.words.len()) as u64
}

/// Pieces one after the other, cell by cell, without the empty places of blocks.
struct Sorted {
    heads: Vec<u32>,
    pieces: Vec<u32>,
    hulls: Vec<u32>,
}

impl Sorted {
    fn of(cells: &Cells) -> Sorted {
        let mut sorted = Sorted {
            heads: Vec::with_capacity(HEAD_WORDS * cells.heads.len()),
            pieces: Vec::with_capacity(PIECE_WORDS * BLOCK * cells.blocks.len()),
            hulls: Vec::with_capacity(HULL_WORDS * BLOCK * cells.hulls.len()),
        };
        for head in &cells.heads {
            let first = (sorted.pieces.len() / PIECE_WORDS) as u32;
            let first_hull = (sorted.hulls.len() / HULL_WORDS) as u32;
            let (block, hull) = (head.blocks as usize, head.hulls as usize);
            for block in &cells.blocks[block..block + usize::from(head.block_count)] {
                sorted.add_block(block);
            }
            for hull in &cells.hulls[hull..hull + usize::from(head.hull_count)] {
                sorted.add_hulls(hull);
            }
            let count = (sorted.pieces.len() / PIECE_WORDS) as u32 - first;
            let hulls = (sorted.hulls.len() / HULL_WORDS) as u32 - first_hull;
            let numbers = count.min(0xffff) | hulls.min(0xffff) << 16;
            sorted.heads.extend([first, first_hull, numbers]);
        }
        sorted
    }

    fn add_block(&mut self, block: &Block) {
        for i in 0..BLOCK {
            // Whatever nothing can meet has a negative square of its radius.
            if block.radius_squared[i] < 0.0 {
                continue;
            }
            let foot = block.foot.map(|x| x[i].to_bits());
            let axis = block.axis.map(|x| x[i].to_bits());
            self.pieces.extend(foot.into_iter().chain(axis));
            let rest = [block.radius_squared[i], block.low[i], block.high[i]];
            self.pieces.extend(rest.map(f32::to_bits));
            self.pieces.push(block.piece[i]);
        }
    }

    fn add_hulls(&mut self, hull: &HullBlock) {
        for i in 0..BLOCK {
            let squares = [hull.start_squared[i], hull.end_squared[i]];
            let has_side = hull.low[i] < hull.high[i];
            if !has_side && squares.iter().all(|&square| square < 0.0) {
                continue;
            }
            let foot = hull.foot.map(|x| x[i].to_bits());
            let axis = hull.axis.map(|x| x[i].to_bits());
            self.hulls.extend(foot.into_iter().chain(axis));
            let ends = [hull.start[i], hull.end[i]];
            let side = [hull.narrowing[i], hull.wide[i], hull.low[i], hull.high[i]];
            let rest = ends.into_iter().chain(squares).chain(side);
            self.hulls.extend(rest.map(f32::to_bits));
            self.hulls.push(hull.piece[i]);
        }
    }
}

/// The lights of a scene, sorted by how they are found.
struct Lights<'a> {
    /// Parallel light and panels, with corners in the world.
    words: Vec<u32>,
    corners_mm: Vec<Option<Vec3>>,
    has_panels: bool,
    environment: [Vec3; 2],
    pictures: Vec<&'a ImageEnvironment>,
}

impl<'a> Lights<'a> {
    fn of(lights: &'a [Light]) -> Result<Lights<'a>, Refusal> {
        let mut all = Lights {
            words: Vec::new(),
            corners_mm: Vec::new(),
            has_panels: false,
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
                    all.corners_mm.push(None);
                }
                KernelLight::Panel(rectangle) => {
                    let [corner, u, v] = rectangle.corner_and_edges_mm();
                    panel_words(&mut words, [corner, u, v], rectangle.is_two_sided());
                    put(&mut words, 4, rectangle.radiance().0);
                    all.words.extend(words);
                    all.corners_mm.push(Some(corner));
                    all.has_panels = true;
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
                KernelLight::Walk(what) => return Err(Refusal::NotYet(what)),
            }
        }
        Ok(all)
    }

    /// The words, with corners counted from the least corner of the first period.
    fn words_from(&self, corner: DVec3) -> Vec<u32> {
        let mut words = self.words.clone();
        for (words, at) in words.chunks_exact_mut(LIGHT_WORDS).zip(&self.corners_mm) {
            if let Some(at) = at {
                put(words, 10, (at.as_dvec3() - corner).as_vec3());
            }
        }
        words
    }
}

/// An environment picture: its sky and its lamps, so that neither is found twice.
fn sky_words(image: &ImageEnvironment, tables: &mut Tables<'_>) -> [u32; SKY_WORDS] {
    let parts = Parts::of(image);
    let [up, centre, left] = image.frame();
    let size = image.size().as_vec2();
    let (texels, whole) = texel_words(image, &parts);
    let mut words = [0; SKY_WORDS];
    [words[0], words[1]] = [size.x, size.y].map(f32::to_bits);
    put(&mut words, 2, centre);
    put(&mut words, 5, left);
    put(&mut words, 8, up);
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
