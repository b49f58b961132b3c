//! The files of a scan, opened.

use super::{Scan, ScanJob, failed};
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

fn is_vti(path: &Path) -> bool {
    ending(path) == "vti"
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

/// Refuses files that are no scans, by their names, and keys that these files do not have.
pub fn check(request: &Scan, files: &[PathBuf]) -> Result<()> {
    let name = name_of(&request.files);
    let fail = |key, why| {
        let e = InputError::after_option(key, why);
        Err(e.in_file(&name).into())
    };
    let is_raw = request.raw_size.is_some();
    let [path] = files else {
        if is_raw {
            return fail("raw_size", "belongs to a single file");
        }
        if request.array.is_some() {
            return fail("array", "belongs to a single .vti");
        }
        let why = "expected .tif, .tiff or .png: slices in several files are TIFF or PNG";
        return match files.iter().find(|path| !is_slice(path)) {
            Some(other) => Err(missing(other).unwrap_or_else(|| of_file(other, why))),
            None => Ok(()),
        };
    };
    if request.array.is_some() && is_raw {
        return fail("array", "cannot be combined with --raw-size");
    }
    if request.array.is_some() && !is_vti(path) {
        return fail("array", "belongs to a .vti");
    }
    if is_raw || is_vti(path) || is_slice(path) {
        return Ok(());
    }
    let why = "expected .tif, .tiff, .png, .vti, a folder of slices, or raw data with --raw-size \
               and --raw-type";
    Err(missing(path).unwrap_or_else(|| of_file(&name, why)))
}

/// The error of a file that is not there: a name without the right ending is often a misspelt one.
fn missing(path: &Path) -> Option<anyhow::Error> {
    let why = read::unreachable(path).filter(|why| why.is_missing);
    why.map(anyhow::Error::from)
}

/// Opens the volume of files that were checked.
pub fn open(args: &ScanJob, files: &[PathBuf], budget: &mut Budget) -> Result<Box<dyn Slices>> {
    let name = name_of(&args.files);
    if let [path] = files {
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
            _ if is_vti(path) => {
                VtiSlices::new(file, args.array.as_deref(), budget).map(|s| Box::new(s) as _)
            }
            _ if is_png(path) => PngSlices::new(file, budget).map(|s| Box::new(s) as _),
            _ => TiffSlices::new(file, budget).map(|s| Box::new(s) as _),
        };
        return opened.map_err(|e| failed(&name, e));
    }
    for path in files {
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
