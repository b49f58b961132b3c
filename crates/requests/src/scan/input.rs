//! The files of a scan, opened.

use super::{ScanJob, failed};
use anyhow::Result;
use organza_basis::Budget;
use organza_scan::ScanError;
use organza_scan::input::Slices;
use organza_scan::input::png::PngSlices;
use organza_scan::input::raw::{RawLayout, RawSlices};
use organza_scan::input::stack::{Stack, natural_order};
use organza_scan::input::tiff::TiffSlices;
use organza_scan::input::vti::VtiSlices;
use organza_scene::read;
use organza_work::{InputError, of_file, of_io};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};

/// Most files of a folder that are looked at.
const MAX_FILES: usize = 1 << 20;

/// The files in their order; those of a folder by the numbers in their names.
pub fn files(given: &[PathBuf]) -> Result<Vec<PathBuf>> {
    let [folder] = given else {
        return Ok(given.to_vec());
    };
    if !folder.is_dir() {
        return Ok(given.to_vec());
    }
    let fail = |why: String| of_file(folder, why);
    let entries = std::fs::read_dir(folder).map_err(|e| fail(read::io_message(&e)))?;
    let mut names = Vec::new();
    for entry in entries.take(MAX_FILES) {
        let entry = entry.map_err(|e| fail(read::io_message(&e)))?;
        let path = entry.path();
        if is_slice(&path) && path.is_file() {
            names.push(path);
        }
    }
    if names.is_empty() {
        return Err(fail("the folder holds no .tif, .tiff or .png".into()));
    }
    names.sort_by(|a, b| natural_order(&a.to_string_lossy(), &b.to_string_lossy()));
    Ok(names)
}

/// What messages call the input.
pub fn name_of(given: &[PathBuf]) -> String {
    match given {
        [one] => one.display().to_string(),
        [first, .., last] => format!("{} to {}", first.display(), last.display()),
        [] => String::new(),
    }
}

fn ending(path: &Path) -> String {
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    ending.to_lowercase()
}

fn is_tiff(path: &Path) -> bool {
    let format = organza_picture::format_of_ending(&ending(path));
    format.is_some_and(|f| f.name == "TIFF")
}

fn is_png(path: &Path) -> bool {
    ending(path) == "png"
}

/// Whether a file may be one slice of several.
fn is_slice(path: &Path) -> bool {
    is_tiff(path) || is_png(path)
}

fn open_file(path: &Path) -> Result<BufReader<File>> {
    // Asked before: to open a pipe is to wait for who writes to it.
    if let Some(why) = read::unreachable(path) {
        return Err(why.into());
    }
    let named = |e| of_io(path, &e);
    let file = File::open(path).map_err(named)?;
    Ok(BufReader::with_capacity(1 << 16, file))
}

/// Opens the volume.
pub fn open(args: &ScanJob, files: &[PathBuf], budget: &mut Budget) -> Result<Box<dyn Slices>> {
    let name = name_of(&args.files);
    if let [path] = files {
        let is_vti = ending(path) == "vti";
        if args.array.is_some() && !is_vti {
            return Err(InputError::after_option("array", "belongs to a .vti")
                .in_file(&name)
                .into());
        }
        let file = open_file(path)?;
        let opened: Result<Box<dyn Slices>, ScanError> = match (args.raw_size, args.raw_type) {
            (Some(dims), Some(kind)) => {
                let layout = RawLayout {
                    dims,
                    sample: kind.sample(),
                    header_bytes: args.raw_header,
                    big_endian: args.raw_big_endian,
                };
                RawSlices::new(file, layout, budget).map(|s| Box::new(s) as _)
            }
            _ if is_vti => {
                VtiSlices::new(file, args.array.as_deref(), budget).map(|s| Box::new(s) as _)
            }
            _ if is_tiff(path) => TiffSlices::new(file, budget).map(|s| Box::new(s) as _),
            _ if is_png(path) => PngSlices::new(file, budget).map(|s| Box::new(s) as _),
            _ => {
                return Err(of_file(
                    &name,
                    "expected .tif, .tiff, .png, .vti, a folder of slices, or raw data with \
                     --raw-size and --raw-type",
                ));
            }
        };
        return opened.map_err(|e| failed(&name, e));
    }
    if args.raw_size.is_some() || args.array.is_some() {
        return Err(
            InputError::after_option("raw_size", "and --array belong to a single file")
                .in_file(&name)
                .into(),
        );
    }
    for path in files {
        if !is_slice(path) {
            return Err(of_file(
                path,
                "expected .tif, .tiff or .png: slices in several files are TIFF or PNG",
            ));
        }
        // Missing ones are reported before anything is computed.
        open_file(path)?;
    }
    let paths = files.to_vec();
    let names = paths.iter().map(|p| p.display().to_string()).collect();
    let stack = Stack::new(
        names,
        Box::new(move |i, budget| {
            let file = File::open(&paths[i])?;
            let file = BufReader::with_capacity(1 << 16, file);
            if is_png(&paths[i]) {
                return PngSlices::new(file, budget).map(|s| Box::new(s) as _);
            }
            TiffSlices::new(file, budget).map(|s| Box::new(s) as _)
        }),
        budget,
    );
    match stack {
        Ok(stack) => Ok(Box::new(stack)),
        Err(e) => Err(failed(&name, e)),
    }
}
