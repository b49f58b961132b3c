//! Fitting colour and roughness of the fibres to one picture of the cloth.

use super::fibres::{model, optics_given_way, optics_keys, own_colour, yarns};
use super::{Fit, FitJob, LIGHT, VIEW, check_outputs, finish, options, read_fabric, table};
use crate::triple;
use anyhow::Result;
use glam::UVec2;
use organza_basis::{Rgb, Stopped};
use organza_measure::fit::Determined;
use organza_measure::{
    Angles, Pair, PictureSearch, PictureStatistics, TexelGrid, match_picture, measure_texture,
};
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::patches::{Matter, texel_grid};
use organza_work::Context;
use organza_work::Progress;
use organza_work::building::watched;
use organza_work::{of_file, of_option};
use std::f64::consts::FRAC_1_PI;
use std::path::Path;

/// Texels of the longer side at most: larger pictures are averaged to it.
const MAX_TEXELS: u32 = 128;

/// Relative error of mean and deviation that is near enough.
const TOLERANCE: f64 = 0.01;

/// Most turns of the two searches.
const TURNS: u32 = 12;

/// The brightest colour that a yarn may get.
const BRIGHTEST: f64 = 0.98;

/// The target.
pub(crate) static TARGET: crate::Target = crate::Target {
    name: "picture",
    about: "Colour and roughness of the fibres, from one picture of the cloth",
    example: "scenes/fabrics/denim.toml --data photograph.exr --light 30,0 --width-mm 8 -o fitted.toml",
    fields: &[
        "data", "model", "light", "view", "width_mm", "white", "voxel_um",
    ],
    check: |args| photograph(args).map(drop),
    run,
};

/// The file of the picture.
fn photograph(args: &Fit) -> Result<&Path> {
    let path = args.data.as_deref();
    path.ok_or_else(|| of_option("data", "expected a picture"))
}

fn run(args: &FitJob) -> Result<super::Fitted> {
    let path = photograph(args)?;
    let (fabric, read) = read_fabric(args)?;
    check_outputs(args, &args.context, &read)?;
    let seen = Seen::read(args, path, MAX_TEXELS, args.light.unwrap_or(LIGHT), &fabric)?;
    let none = vec![[0.0; 3]; seen.pixels.len()];
    let target = PictureStatistics::new(&seen.pixels, &none);
    let (shown, fitted) = model(args, &fabric)?;
    let matter = watched(&args.context, |loader| {
        let options = options(args, loader);
        Ok(Matter::new(&fabric, args.fabric_path(), shown, &options)?)
    })?;
    let yarns = yarns(&fabric);
    let given_way = optics_given_way(args, fitted, &yarns)?;
    let key = fitted.roughness;
    // Yarns keep their colours against each other.
    let brightest = (0..3).map(|c| {
        let most = yarns.iter().map(|y| own_colour(&fabric, y)[c]);
        most.fold(1e-3, f64::max)
    });
    let brightest: Vec<f64> = brightest.collect();
    let search = PictureSearch {
        colour: std::array::from_fn(|_| [0.0, BRIGHTEST]),
        width: fitted.range,
        start: fitted.start,
        tolerance: TOLERANCE,
        turns: TURNS,
    };
    let keys = |colour: [f64; 3], rough: f64, fabric: &Fabric| {
        let mut keys = args.set.clone();
        for yarn in &yarns {
            let own = own_colour(fabric, yarn);
            let scaled = std::array::from_fn(|c| own[c] / brightest[c] * colour[c]);
            keys.extend(optics_keys(fitted, yarn, scaled, rough));
        }
        keys
    };
    let progress = Progress::new("fitting", u64::from(TURNS) * 8, &args.context);
    let mut count = 0;
    let unwatched = args.context.loader();
    let mut simulate = |colour: [f64; 3], rough: f64| -> Result<PictureStatistics> {
        count += 1;
        Stopped::check(progress.at(count))?;
        let changed = fabric_file::load_changed(
            args.fabric_path(),
            &given_way,
            &keys(colour, rough, &fabric),
            &unwatched,
        )?;
        let patch = matter.patch(&changed, args.fabric_path(), &options(args, &unwatched))?;
        let watch = |_| args.context.flow();
        let texture = measure_texture(
            &patch,
            seen.pair,
            &seen.grid,
            args.paths(),
            args.seed,
            &watch,
        )?;
        Ok(PictureStatistics::of(&texture))
    };
    let found = match_picture(&target, &search, &mut simulate)?;
    progress.finish();
    let table = table(args, &given_way, &keys(found.colour, found.width, &fabric))?;
    let words = format!(
        "{} after {} turns: mean {}, wanted {}; deviation {:.4}, wanted {:.4} (1/sr).",
        if found.is_met { "Met" } else { "Not met" },
        found.turns,
        triple(found.statistics.mean),
        triple(target.mean),
        found.statistics.deviation,
        target.deviation,
    );
    let mut parameters: Vec<Determined> = ["r", "g", "b"]
        .iter()
        .zip(found.colour)
        .map(|(letter, value)| determined(format!("colour.{letter}"), value, found.is_met))
        .collect();
    parameters.push(determined(key.into(), found.width, found.is_met));
    finish(args, &table, &parameters, &words)
}

/// Within the tolerance of the search, about.
fn determined(name: String, value: f64, is_fixed: bool) -> Determined {
    Determined {
        name,
        value,
        se: TOLERANCE * value,
        is_fixed,
    }
}

/// Linear pixels of a picture, none of them negative.
///
/// # Errors
/// Names the file.
pub fn read_picture(path: &Path, context: &Context) -> Result<(UVec2, Vec<Rgb>)> {
    let allowed = context.memory_bytes();
    let decoded = organza_picture::decode(&context.loader().bytes(path)?, allowed);
    let (picture, _) = decoded.map_err(|e| of_file(path, e))?;
    let positive = |p: Rgb| Rgb::from(p.0.to_array().map(|x| if x < 0.0 { 0.0 } else { x }));
    Ok((
        picture.size,
        picture.pixels.into_iter().map(positive).collect(),
    ))
}

/// A picture of the cloth, and how it was taken.
pub struct Seen {
    /// Its texels, 1/sr.
    pub pixels: Vec<[f32; 3]>,
    /// Where on the cloth they are.
    pub grid: TexelGrid,
    /// Directions towards light and camera.
    pub pair: Pair,
}

impl Seen {
    /// Reads a picture under a light, averaged to so many texels of its longer side.
    ///
    /// # Errors
    /// Names the file.
    pub fn read(
        args: &FitJob,
        path: &Path,
        most: u32,
        light: [f64; 2],
        fabric: &Fabric,
    ) -> Result<Seen> {
        let (size, pixels) = read_picture(path, &args.context)?;
        let (size, pixels) = shrunk(size, &pixels, most);
        // White sends 1/pi of the light on it into every direction.
        let white = FRAC_1_PI as f32 / args.white.unwrap_or(1.0) as f32;
        let mut grid = texel_grid(fabric, 1);
        grid.texels = size;
        if let Some(width_mm) = args.width_mm {
            grid.size_mm = size.as_vec2() * (width_mm as f32 / size.x as f32);
        }
        let angles = |[theta_deg, phi_deg]: [f64; 2]| Angles { theta_deg, phi_deg };
        Ok(Seen {
            pixels: pixels.iter().map(|p| (*p * white).0.to_array()).collect(),
            grid,
            pair: Pair::new(angles(light), angles(args.view.unwrap_or(VIEW))),
        })
    }
}

/// Averages over squares of pixels until the longer side has at most so many.
fn shrunk(size: UVec2, pixels: &[Rgb], most: u32) -> (UVec2, Vec<Rgb>) {
    let factor = size.max_element().div_ceil(most).max(1);
    let small = size / factor;
    let texel = |x: u32, y: u32| {
        let mut sum = Rgb::BLACK;
        for j in 0..factor {
            for i in 0..factor {
                let at = (y * factor + j) * size.x + x * factor + i;
                sum += pixels.get(at as usize).copied().unwrap_or(Rgb::BLACK);
            }
        }
        sum * (1.0 / (factor * factor) as f32)
    };
    let rows = (0..small.y).flat_map(|y| (0..small.x).map(move |x| (x, y)));
    (small, rows.map(|(x, y)| texel(x, y)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_pictures_keep_their_mean() {
        let size = UVec2::new(512, 256);
        let pixels: Vec<Rgb> = (0..512 * 256)
            .map(|k| Rgb::splat((k % 512) as f32))
            .collect();
        let (small, list) = shrunk(size, &pixels, MAX_TEXELS);
        assert_eq!(small, UVec2::new(128, 64));
        assert_eq!(list[0], Rgb::splat(1.5));
        assert_eq!(list[127], Rgb::splat(509.5));
    }
}
