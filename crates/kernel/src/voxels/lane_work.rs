//! Which sample of which pixel every lane walks, and the next one when a path has ended.

use super::flat_medium::NO_POPULATION;
use super::flat_scene::FlatScene;
use super::voxel_words::VoxelWords;
use super::walk::{Paths, add_lights_in_sight, stored};
use crate::block::Block;
use glam::Vec3;
use organza_film::{Sample, Stats, Tally};
use organza_lanes::math::{LaneRng, V3, pixel_key};
use organza_lanes::{Floats, Ints, MAX_LANES, Mask, SetBits};

/// The samples under way in all lanes.
pub struct LaneWork {
    lanes: [Assignment; MAX_LANES],
    /// Pixels handed out.
    next_turn: usize,
}

impl LaneWork {
    pub fn new() -> LaneWork {
        LaneWork {
            lanes: [Assignment::default(); MAX_LANES],
            next_turn: 0,
        }
    }
}

/// The sample under way in one lane.
#[derive(Clone, Copy, Default)]
struct Assignment {
    /// The pixel; none when there is nothing left to do.
    place: Option<PixelPlace>,
    /// The sample under way.
    sample: u32,
    tally: Tally,
    /// Of direct light, where a film of it is filled.
    direct: Tally,
}

/// A pixel.
#[derive(Clone, Copy)]
struct PixelPlace {
    /// Its number in the block.
    pixel: usize,
    /// Its column and row in the whole picture.
    at: [u32; 2],
    key: (u32, u32),
}

/// Counts the paths that have ended, and begins new ones in their lanes while
/// there are samples left.
#[inline(always)]
pub fn regenerate<F: Floats>(
    scene: &FlatScene,
    block: &mut Block<'_>,
    paths: &mut Paths<F>,
    work: &mut LaneWork,
    ended: F::Mask,
    stats: &mut Stats,
) {
    let radiance = stored(paths.radiance);
    let direct = block.direct.is_some().then(|| stored(paths.direct()));
    let (mut bounces, mut first) = ([0; MAX_LANES], [0; MAX_LANES]);
    paths.bounces.store(&mut bounces);
    paths.first_place.store(&mut first);
    let mut first_depth = [0.0; MAX_LANES];
    paths.first_depth.store(&mut first_depth);

    let length_mm = 1.0 / scene.medium.scale_per_mm;
    let mut names = Names::default();
    let mut begun = 0u32;
    for lane in SetBits(ended.bits()) {
        let assignment = &mut work.lanes[lane];
        if let Some(place) = assignment.place {
            let radiance = radiance.map(|channel| channel[lane]);
            let path = Sample {
                radiance,
                bounces: bounces[lane],
                first: scene
                    .medium
                    .first_event(first[lane], first_depth[lane] * length_mm),
                index: assignment.sample,
            };
            let pixel = &mut block.pixels[place.pixel];
            if assignment.tally.add(&path, &scene.brightness, pixel) {
                for x in radiance {
                    stats.brightest = stats.brightest.max(x);
                }
                if let (Some(found), Some(film)) = (&direct, &mut block.direct) {
                    let radiance = found.map(|channel| channel[lane]);
                    let path = Sample { radiance, ..path };
                    let pixel = &mut film[place.pixel];
                    assignment.direct.add(&path, &scene.brightness, pixel);
                }
            } else {
                stats.rejected += 1;
            }
            let [x, y] = place.at;
            let next = block.next_sample(x, y, assignment.sample + 1, block.samples.end);
            if let Some(sample) = next {
                assignment.sample = sample;
            } else {
                let pixel = &mut block.pixels[place.pixel];
                assignment.tally.flush(&scene.brightness, pixel);
                if let Some(film) = &mut block.direct {
                    let pixel = &mut film[place.pixel];
                    assignment.direct.flush(&scene.brightness, pixel);
                }
                assignment.place = None;
            }
        }
        while assignment.place.is_none() {
            let Some((pixel, x, y)) = block.pixel(work.next_turn) else {
                break;
            };
            work.next_turn += 1;
            let (start, end) = (block.samples.start, block.samples.end);
            if let Some(sample) = block.next_sample(x, y, start, end) {
                let name = u64::from(y) * u64::from(scene.film_width) + u64::from(x);
                assignment.sample = sample;
                assignment.place = Some(PixelPlace {
                    pixel,
                    at: [x, y],
                    key: pixel_key(scene.seed, name),
                });
            }
        }
        if let Some(place) = assignment.place {
            (names.key[0][lane], names.key[1][lane]) = place.key;
            names.sample[lane] = assignment.sample;
            let [x, y] = place.at.map(|x| x as f32);
            (names.at[0][lane], names.at[1][lane]) = (x, y);
            begun |= 1 << lane;
            stats.paths += 1;
        }
    }
    let begun = F::Mask::from_bits(begun);
    if begun.any() {
        begin(scene, paths, &names, begun);
    }
}

/// What names the paths of all lanes: keys of pixels, samples, and places in the picture.
#[derive(Default)]
struct Names {
    key: [[u32; MAX_LANES]; 2],
    sample: [u32; MAX_LANES],
    at: [[f32; MAX_LANES]; 2],
}

/// Begins paths in the lanes of a mask.
#[inline(always)]
fn begin<F: Floats>(scene: &FlatScene, paths: &mut Paths<F>, names: &Names, begun: F::Mask) {
    let [low, high] = &names.key;
    let keys = (F::Ints::load(low), F::Ints::load(high));
    let mut rng = LaneRng::new(keys, F::Ints::load(&names.sample));
    let place = (F::load(&names.at[0]), F::load(&names.at[1]));
    let rays = scene.camera_rays.rays::<F>(
        &scene.medium.cell_grid,
        scene.borders,
        place,
        &mut rng,
        begun,
    );
    let zeros = V3::splat(Vec3::ZERO);
    paths.rng = rng.or_where_not(begun, paths.rng);
    paths.at = rays.at.or_where_not(begun, paths.at);
    let nowhere = F::splat(0.0);
    let [x, y] = paths.beyond;
    paths.beyond = [
        nowhere.or_where_not(begun, x),
        nowhere.or_where_not(begun, y),
    ];
    paths.turn(scene, rays.direction, begun);
    let depth = rays.depth_mm * F::splat(scene.medium.scale_per_mm);
    paths.depth = depth.or_where_not(begun, paths.depth);
    paths.throughput = V3::splat(Vec3::ONE).or_where_not(begun, paths.throughput);
    paths.radiance = zeros.or_where_not(begun, paths.radiance);
    paths.bounces = F::Ints::splat(0).or_where_not(begun, paths.bounces);
    paths.first_place = F::Ints::splat(NO_POPULATION).or_where_not(begun, paths.first_place);
    paths.voxel = VoxelWords::unknown().or_where_not(begun, paths.voxel);
    if scene.has_placed_lights() {
        add_lights_in_sight(scene, paths, begun, false);
    }
    paths.gone = begun & rays.missing;
    paths.flying = paths.flying | (begun & !rays.missing);
}
