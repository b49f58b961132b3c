//! The texture of a table: its texels, the paths from them, and its errors.

use super::{TableJob, Work};
use anyhow::{Context, Result};
use glam::{UVec2, Vec2, Vec3};
use organza_basis::{PathRng, SegmentSource, Stopped};
use organza_measure::{
    Effort, Look, PairValue, PatchResponse, PathNames, PathRun, PixelPatch, TexelSums, far_texture,
    held_out_bound, held_out_errors, held_out_pairs, measure_pair_rows, measure_texels,
    texture_rings,
};
use organza_scatter::{Footprint, Surface};
use organza_scene::fabric_file::Fabric;
use organza_scene::far_table::{ERROR_KEY, PIXEL_KEY, PIXELS_KEY};
use organza_scene::patches::AnyPatch;
use organza_surface::table::{FarTable, Texture, TextureLayout, TextureParts};
use organza_transport::Stats;
use organza_work::Progress;
use organza_work::number_journal::{PAIR_NUMBERS, pair_numbers, pair_values};
use rayon::prelude::*;
use serde_json::{Value, json};
use std::sync::atomic::Ordering;

/// Texels to the spacing of threads, if there may be so many.
const TEXELS_ACROSS_THREAD: f32 = 8.0;
/// Most images.
const MOST_IMAGES: usize = 24;
/// Paths that look for the height of the threads.
const LOOKS: u64 = 4096;
/// Their stream of random numbers.
const LOOK_STREAM: u64 = (3 << 57) + (1 << 32);
/// The narrowest pixel at which the error is measured, in spacings of threads; wider ones follow
/// by doubling, up to the period.
const NARROWEST_PIXEL: f32 = 0.25;
/// Places of a pixel, along each side, where the table is read for its mean.
const READS: u32 = 6;

/// The spacing of a fabric's threads, mm, or an eighth of the period where there are none.
pub fn spacing_mm(fabric: &Fabric) -> f32 {
    let period_mm = fabric.cloth.tile().bounds_mm.size().truncate();
    match fabric.thread_spacing_mm() {
        spacing if spacing.is_finite() => spacing,
        _ => period_mm.max_element() / TEXELS_ACROSS_THREAD,
    }
}

/// Texels of a fabric, at most so many; `None` for none.
pub fn layout(fabric: &Fabric, most: u32) -> Option<TextureLayout> {
    let bounds = fabric.cloth.tile().bounds_mm;
    let period_mm = bounds.size().truncate();
    let longer = period_mm.max_element();
    let wanted_mm = spacing_mm(fabric) / TEXELS_ACROSS_THREAD;
    let most_along = most.max(1).next_power_of_two();
    let along = |side: f32| {
        let wanted = (side / wanted_mm).log2().round().exp2();
        wanted.clamp(1.0, most_along as f32) as u32
    };
    let mut size = UVec2::new(along(period_mm.x), along(period_mm.y));
    while size.x * size.y > most.max(1) {
        let texel = period_mm / size.as_vec2();
        let finer_x = size.x > 1 && (size.y == 1 || texel.x <= texel.y);
        size /= match finer_x {
            true => UVec2::new(2, 1),
            false => UVec2::new(1, 2),
        };
    }
    (most > 0 && longer > 0.0 && longer.is_finite()).then(|| TextureLayout {
        size,
        origin_mm: bounds.min.truncate(),
        period_mm,
        heights_mm: [0.0; 2],
    })
}

/// The layout with the height of what is seen from the face; from the back the same is assumed.
/// `None` of a patch without geometry, which is the same everywhere.
pub fn at_height(layout: TextureLayout, patch: &AnyPatch, seed: u64) -> Option<TextureLayout> {
    let names = PathNames::new(seed, LOOK_STREAM, 0..LOOKS);
    let place = |_: u64, rng: &mut PathRng| layout.origin_mm + rng.unit2() * layout.period_mm;
    let (mut sum, mut count) = (0.0f64, 0.0f64);
    let mut stats = Stats::default();
    let mut found = |look: Look| {
        if let Some(first) = look.first.filter(|f| f.height_mm.is_finite()) {
            sum += f64::from(first.height_mm);
            count += 1.0;
        }
    };
    patch.each_look(&place, PathRun::new(&names, &mut stats, &mut found));
    let height = (sum / count) as f32;
    (count > 0.0).then_some(TextureLayout {
        heights_mm: [height, -height],
        ..layout
    })
}

/// Memory while a texture is made, bytes: the sums of all nodes, and their matrix twice.
pub fn memory_bytes(layout: &TextureLayout) -> u64 {
    let [n, m] = texture_rings().map(|r| r.sphere() as u64);
    layout.texels() as u64 * n * m * 12 * 3
}

/// A texture that was made.
pub struct MadeTexture {
    /// Its parts.
    pub parts: TextureParts,
    /// The texture.
    pub texture: Texture,
    /// How far its images stand out of the noise.
    strengths: Vec<f64>,
}

/// Traces the paths of a texture; `None` if there is to be none.
///
/// # Errors
/// Paths that do not end, a journal that cannot be written.
pub fn make(args: &TableJob, work: &mut Work) -> Result<Option<MadeTexture>> {
    let Some(layout) = work.texels else {
        return Ok(None);
    };
    let [eye, light] = &texture_rings();
    let (n, texels) = (eye.sphere(), layout.texels());
    let per_node = args.texel_spp * texels as u64;
    let progress = Progress::new("tracing texels", per_node * n as u64, &args.context);
    let patch = &work.patch;
    let one = |node: usize| {
        let found = measure_texels(
            patch,
            [eye, light],
            &layout,
            node,
            args.texel_spp,
            args.seed,
        );
        Stopped::check(progress.add(per_node))?;
        found
    };
    let found: Vec<_> = (0..n).into_par_iter().map(one).collect::<Result<_, _>>()?;
    let (sums, stats): (Vec<TexelSums>, Vec<Stats>) = found.into_iter().unzip();
    let paths = stats.iter().map(|s| s.paths).sum();
    work.paths.fetch_add(paths, Ordering::Relaxed);
    progress.finish();
    let found = far_texture([eye, light], &layout, &sums, MOST_IMAGES, args.seed);
    let (parts, strengths) = found.context("nodes without texels")?;
    let texture = Texture::new(&parts).context("the measured texture is none")?;
    Ok(Some(MadeTexture {
        parts,
        texture,
        strengths,
    }))
}

/// Description of a texture with its errors, in pixels of several widths at random places, for
/// the held-out pairs of directions.
///
/// # Errors
/// Paths that do not end, a journal that cannot be written.
pub fn errors(
    args: &TableJob,
    work: &mut Work,
    table: &FarTable,
    made: &MadeTexture,
) -> Result<Value> {
    let layout = *made.texture.layout();
    let spacing_mm = work.spacing_mm;
    let pairs = held_out_pairs(args.held_out, args.seed);
    let with_texture = table.clone().with_texture(Some(made.texture.clone()));
    let effort = Effort::new(args.held_out_spp, args.seed);
    let mut widths = Vec::new();
    let doubled = std::iter::successors(Some(NARROWEST_PIXEL * spacing_mm), |w| Some(2.0 * w));
    let period_mm = layout.period_mm.max_element();
    for (index, width_mm) in doubled.take_while(|w| *w < period_mm).enumerate() {
        let middle = |k: usize| {
            let mut rng = PathRng::new(args.seed, LOOK_STREAM + 1 + index as u64, k as u64);
            layout.origin_mm + rng.unit2() * layout.period_mm
        };
        let place = [-3.0, f64::from(width_mm), pairs.len() as f64];
        let patch = &work.patch;
        let list = work.journal.once(&place, PAIR_NUMBERS * pairs.len(), || {
            let one = |k: usize| {
                let pixel = PixelPatch {
                    patch,
                    middle_mm: middle(k),
                    width_mm,
                };
                let found =
                    measure_pair_rows(&pixel, &pairs, k..k + 1, &effort, &|_| args.context.flow())?;
                Ok(pair_numbers(&found.list))
            };
            let all: Result<Vec<Vec<f64>>> = (0..pairs.len()).into_par_iter().map(one).collect();
            Ok(all?.concat())
        })?;
        let truth = pair_values(&pairs, args.held_out_spp, &list);
        let values = |surface: &FarTable| -> Vec<[f64; 3]> {
            let one = |(k, v): (usize, &PairValue)| {
                let (w_in, w_out) = (v.pair.incident.direction(), v.pair.exitant.direction());
                pixel_mean(surface, w_in, w_out, middle(k), width_mm)
            };
            truth.iter().enumerate().map(one).collect()
        };
        let (textured, mean) = (values(&with_texture), values(table));
        widths.push(json!({
            PIXEL_KEY: width_mm,
            ERROR_KEY: held_out_bound(&textured, &truth),
            "errors": held_out_errors(&textured, &truth),
            "errors_of_mean": held_out_errors(&mean, &truth),
        }));
    }
    Ok(json!({
        "texels": [layout.size.x, layout.size.y],
        "paths_per_texel": args.texel_spp,
        "height_mm": layout.heights_mm[0],
        "images": made.strengths,
        PIXELS_KEY: widths,
    }))
}

/// The mean of a surface over a pixel.
fn pixel_mean(
    surface: &FarTable,
    w_in: Vec3,
    w_out: Vec3,
    middle_mm: Vec2,
    width_mm: f32,
) -> [f64; 3] {
    let mut sum = [0.0; 3];
    for y in 0..READS {
        for x in 0..READS {
            let within = (Vec2::new(x as f32, y as f32) + 0.5) / READS as f32 - 0.5;
            let at = Footprint::new(middle_mm + within * width_mm, width_mm);
            let value = surface.eval(w_out, w_in, at).0.to_array();
            sum.iter_mut()
                .zip(value)
                .for_each(|(s, v)| *s += f64::from(v));
        }
    }
    sum.map(|s| s / f64::from(READS * READS))
}
