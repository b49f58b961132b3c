//! `organza render --contact-sheet`: several scenes at a small size on one picture.

use super::render::RenderArgs;
use anyhow::{Result, anyhow};
use organza_picture::contact_sheet::{Cell, Layout};
use organza_requests::{Context, Error, ErrorKind, Render, Request};
use organza_work::{of_file, of_option, output, picture};
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
        return Err(of_file(path, "a contact sheet is written as .png"));
    }
    let first = std::iter::once(&args.render.scene);
    let scenes: Vec<&PathBuf> = first.chain(&args.more_scenes).collect();
    output::check_writable(path)?;
    output::check_not_an_input(path, scenes.iter().copied())?;
    let layout = Layout::new(scenes.len(), cell_px(args));
    let size = layout.size();
    let needed = (u64::from(size.x) * u64::from(size.y)).saturating_mul(BYTES_OF_PIXEL);
    let mut context = Context {
        outputs: vec![path.to_owned()],
        ..args.work.context()
    };
    let allowed = context.memory_bytes();
    let Some(left) = allowed.checked_sub(needed) else {
        let why = format!(
            "a sheet of {} x {} pixels needs {needed} bytes of memory, {allowed} are allowed; use \
             fewer scenes or a smaller --cell-px",
            size.x, size.y
        );
        return Err(of_option("contact_sheet", why));
    };
    context.max_memory_bytes = context.max_memory_bytes.map(|_| left);
    let cells = scenes.iter().map(|scene| cell_of(args, scene, &context));
    let cells = cells.collect::<Result<Vec<Render>>>()?;
    let started = Instant::now();
    let mut drawn = Vec::new();
    for cell in &cells {
        drawn.push(render(args, cell, &context)?);
    }
    let sheet = context.run(|| Ok(layout.draw(&drawn)))?;
    let bits = args.display.png_bits.unwrap_or_default();
    picture::write_shown_png(path, size, &sheet, bits)?;
    let seconds = started.elapsed().as_secs_f64();
    let (name, count) = (path.display(), cells.len());
    let line = format!(
        "{name}: {count} scenes, {} x {}, {seconds:.1} s",
        size.x, size.y
    );
    args.work.note([line]);
    Ok(())
}

/// The render of one scene at the size of its cell. The scene is read and checked.
fn cell_of(args: &RenderArgs, scene: &Path, context: &Context) -> Result<Render> {
    let mut cell = Render {
        scene: scene.to_owned(),
        ..args.render.clone()
    };
    let whole = cell.resolution(context)?;
    let longest = whole[0].max(whole[1]).max(1);
    let scaled = |n: u32| {
        let rounded =
            (u64::from(n) * u64::from(cell_px(args)) + u64::from(longest) / 2) / u64::from(longest);
        rounded.max(1)
    };
    let [width, height] = whole.map(scaled);
    let resolution = format!("camera.resolution=[{width},{height}]");
    cell.set.push(resolution);
    Ok(cell)
}

fn render(args: &RenderArgs, cell: &Render, context: &Context) -> Result<Cell> {
    let started = Instant::now();
    let is_stopped = |failure: &Error| failure.kind == ErrorKind::Stopped;
    let mut picture = match cell.run(context) {
        Ok(picture) if !picture.failure.as_ref().is_some_and(is_stopped) => picture,
        Err(e) if !is_stopped(&e) => return Err(e.into()),
        _ => return Err(anyhow!("interrupted; the contact sheet is not written")),
    };
    picture.display = args.display.over(picture.display);
    let shown = picture.rendered().colours();
    let display = picture.display.resolve(&shown);
    args.work.note([format!(
        "{}: {} x {}, {} samples, exposure {}, white balance {}, {:.1} s",
        cell.scene.display(),
        shown.size.x,
        shown.size.y,
        picture.figures()["samples"],
        display.exposure,
        display.white_balance,
        started.elapsed().as_secs_f64()
    )]);
    let name = cell.scene.file_stem().unwrap_or_default();
    Ok(Cell {
        label: name.to_string_lossy().into_owned(),
        picture: shown,
        display,
    })
}
