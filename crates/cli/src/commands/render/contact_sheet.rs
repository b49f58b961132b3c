//! `organza render --contact-sheet`: several scenes at a small size on one picture.

use super::{Prepared, RenderArgs, made_scene, prepare, scene, tracing};
use crate::building::watched;
use crate::commands::with_threads;
use crate::error::{of_file, of_option};
use crate::flags::MemoryArgs;
use crate::output;
use crate::output::note;
use crate::picture;
use crate::schedule::Stop;
use anyhow::{Result, anyhow};
use organza_picture::contact_sheet::{Cell, Layout};
use organza_picture::{Attributes, Picture, Rendered};
use organza_scene::memory::free_memory_bytes;
use organza_scene::{scene_build, scene_file};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Flags that a contact sheet does not take.
pub const CONFLICTS: [&str; 10] = [
    "outfile",
    "crop",
    "samples",
    "checkpoint",
    "denoise",
    "display_server",
    "stats",
    "json",
    "save_light",
    "load_light",
];

/// Memory of a pixel of the sheet: display values and the bytes of the file.
const BYTES_OF_PIXEL: u64 = 12 + 6;

/// Longer edge of a picture, pixels.
fn cell_px(args: &RenderArgs) -> u32 {
    args.cell_px.unwrap_or(256)
}

/// Renders all scenes, after all were read and checked, and writes the sheet.
///
/// # Errors
/// A scene that is wrong or cannot be rendered, a sheet that is too large for the memory or
/// cannot be written; then nothing is written.
pub fn run(args: &RenderArgs, path: &Path) -> Result<()> {
    if picture::is_linear(path) || picture::format(path).is_err() {
        let why = "a contact sheet is written as .png";
        return Err(of_file(path, why));
    }
    let scenes: Vec<&PathBuf> = std::iter::once(&args.scene)
        .chain(&args.more_scenes)
        .collect();
    output::check_writable(path)?;
    output::check_not_an_input(path, scenes.iter().copied())?;
    let layout = Layout::new(scenes.len(), cell_px(args));
    let size = layout.size();
    let needed = (u64::from(size.x) * u64::from(size.y)).saturating_mul(BYTES_OF_PIXEL);
    let allowed = args.memory.max_memory.unwrap_or_else(free_memory_bytes);
    let Some(left) = allowed.checked_sub(needed) else {
        return Err(of_option(
            "contact_sheet",
            format!(
                "a sheet of {} x {} pixels needs {needed} bytes of memory, {allowed} are allowed; \
                 use fewer scenes or a smaller --cell-px",
                size.x, size.y
            ),
        ));
    };
    let cells = scenes
        .iter()
        .map(|scene| cell_args(args, path, scene, left));
    let cells = cells.collect::<Result<Vec<_>>>()?;
    let started = Instant::now();
    with_threads(&args.common, || {
        let drawn = cells.iter().map(render).collect::<Result<Vec<_>>>()?;
        let sheet = layout.draw(&drawn);
        let bits = args.display.png_bits.unwrap_or_default();
        picture::write_shown_png(path, size, &sheet, bits)
    })?;
    if !args.common.quiet {
        let seconds = started.elapsed().as_secs_f64();
        let count = cells.len();
        note!(
            "{}: {count} scenes, {} x {}, {seconds:.1} s",
            path.display(),
            size.x,
            size.y
        );
    }
    Ok(())
}

/// The flags of one scene's render, at the size of its cell. The scene is read and checked.
fn cell_args(args: &RenderArgs, sheet: &Path, scene: &Path, max_memory: u64) -> Result<RenderArgs> {
    let named = RenderArgs {
        scene: scene.to_owned(),
        more_scenes: Vec::new(),
        outfile: sheet.to_owned(),
        contact_sheet: None,
        memory: MemoryArgs {
            max_memory: args.memory.max_memory.map(|_| max_memory),
        },
        ..args.clone()
    };
    let mut cell = made_scene::in_studio(&named)?.unwrap_or(named);
    let loader = cell.common.host.loader();
    let scene = &cell.scene;
    let file = scene_file::load(scene, &cell.common.set, &loader)?;
    let whole = file.camera(scene)?.resolution;
    scene_build::check(&file, scene, &loader)?;
    let longest = whole[0].max(whole[1]).max(1);
    let scaled = |n: u32| {
        let rounded =
            (u64::from(n) * u64::from(cell_px(args)) + u64::from(longest) / 2) / u64::from(longest);
        rounded.max(1)
    };
    let [width, height] = whole.map(scaled);
    let resolution = format!("camera.resolution=[{width},{height}]");
    cell.common.set.push(resolution);
    Ok(cell)
}

fn render(args: &RenderArgs) -> Result<Cell> {
    let started = Instant::now();
    let built = watched(&args.common, &args.cache, |loader| {
        scene::build(args, loader)
    })?;
    let Prepared {
        rendering,
        identity,
        ..
    } = prepare(args, &built)?;
    let (rendering, stop) = tracing::trace(args, &identity, rendering, started, None)?;
    if stop == Stop::Interrupted {
        return Err(anyhow!("interrupted; the contact sheet is not written"));
    }
    let attributes = Attributes::default();
    let rendered = Rendered::new(
        rendering.film(),
        args.display.over(built.file.render.display()),
        &attributes,
    );
    let picture: Picture = rendered.colours();
    let display = rendered.display.resolve(&picture);
    if !args.common.quiet {
        note!(
            "{}: {} x {}, {} samples, exposure {}, white balance {}, {:.1} s",
            args.scene.display(),
            picture.size.x,
            picture.size.y,
            rendering.taken().end,
            display.exposure,
            display.white_balance,
            started.elapsed().as_secs_f64()
        );
    }
    let name = args.scene.file_stem().unwrap_or_default();
    Ok(Cell {
        label: name.to_string_lossy().into_owned(),
        picture,
        display,
    })
}
