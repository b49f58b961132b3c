//! Volume files as arrays.

use crate::array::{Buffer, buffer};
use crate::errors::input;
use glam::UVec3;
use organza_basis::{Budget, MAX_POPULATIONS};
use organza_requests::Results;
use organza_scene::InputError;
use organza_scene::memory::free_memory_bytes;
use organza_volume::format::{self, Source, Volume};
use organza_volume::{GridSet, Octree, VolGrid};
use pyo3::prelude::*;
use std::collections::HashMap;

/// Box of a volume (least corner, greatest corner, mm), whether it repeats in x and y, and how
/// many levels it has.
type About = ([f32; 3], [f32; 3], bool, u8);

/// A level of a volume, whose files are given by their names; `name` is the first of them.
///
/// Arrays have cells as rows (z, y, x). Those of octrees have populations as a further index;
/// a population that is not there has density 0 and material -1. See `organza.Volume`.
pub fn read_volume<'py>(
    py: Python<'py>,
    name: &str,
    files: HashMap<String, Vec<u8>>,
    level: u8,
) -> PyResult<(About, HashMap<String, Buffer<'py>>)> {
    let read = py.detach(|| read(name, &files, level));
    let (about, results) = read.map_err(|why| input(py, &InputError::keyed(why).in_file(name)))?;
    let arrays = results.arrays.iter();
    let buffers = arrays.map(|(name, array)| Ok((name.clone(), buffer(py, array)?)));
    Ok((about, buffers.collect::<PyResult<_>>()?))
}

fn read(
    name: &str,
    files: &HashMap<String, Vec<u8>>,
    level: u8,
) -> Result<(About, Results), String> {
    let format = format::by_name(name).ok_or_else(|| {
        let endings: Vec<String> = format::FORMATS
            .iter()
            .map(|f| format!(".{}", f.ending))
            .collect();
        format!("expected a name that ends in {}", endings.join(", "))
    })?;
    let mut budget = Budget::new(free_memory_bytes());
    let open = |name: &str, _: u64| Ok(files.get(name).cloned());
    let source = Source { name, open: &open };
    let volume = (format.read)(&source, &mut budget).map_err(|e| e.to_string())?;
    match volume {
        Volume::Octree(stored) => {
            let octree = stored.octree;
            let levels = octree.level_count();
            if level >= levels {
                return Err(format!("level: expected one below {levels}, found {level}"));
            }
            let bounds = octree.bounds_mm();
            let about = (
                bounds.min.to_array(),
                bounds.max.to_array(),
                octree.repeats(),
                levels,
            );
            let arrays = of_octree(&octree, level, &mut budget)?;
            Ok((about, arrays))
        }
        Volume::Grids(_) if level > 0 => Err(format!("level: expected 0, found {level}")),
        Volume::Grids(set) => {
            let bounds = set.sigma_t.bounds_mm;
            let about = (bounds.min.to_array(), bounds.max.to_array(), false, 1);
            Ok((about, of_grids(set)))
        }
    }
}

/// The populations of every cell of a level.
fn of_octree(octree: &Octree, level: u8, budget: &mut Budget) -> Result<Results, String> {
    let dims = octree.dims(level);
    let [nx, ny, nz] = dims.to_array().map(|n| n as usize);
    let mut slots = 1;
    octree.for_each_occupied(level, |cell| {
        slots = slots.max(octree.mixture(level, cell).len())
    });
    let count = dims
        .as_u64vec3()
        .element_product()
        .saturating_mul(slots as u64);
    // Eight numbers, each held twice while it is copied.
    budget
        .take_items::<[f32; 16]>(count, "populations")
        .map_err(|e| e.to_string())?;
    let count = count as usize;
    let mut density = vec![0.0f32; count];
    let mut axis = vec![0.0f32; 3 * count];
    let mut spread = vec![0.0f32; count];
    let mut radius = vec![0.0f32; count];
    let mut material = vec![-1i32; count];
    let mut yarn = vec![-1i32; count];
    octree.for_each_occupied(level, |cell: UVec3| {
        let [x, y, z] = cell.to_array().map(|n| n as usize);
        let first = ((z * ny + y) * nx + x) * slots;
        for (slot, p) in octree.mixture(level, cell).iter().enumerate() {
            let at = first + slot;
            density[at] = p.broadside_per_mm();
            axis[3 * at..3 * at + 3].copy_from_slice(&p.axis.to_array());
            spread[at] = p.spread_rad;
            radius[at] = p.radius_mm;
            material[at] = i32::from(p.material);
            yarn[at] = i32::try_from(p.yarn).unwrap_or(i32::MAX);
        }
    });
    debug_assert!(slots <= MAX_POPULATIONS);
    let shape = [nz, ny, nx, slots];
    Ok(Results::default()
        .with_f32("density", &shape, density)
        .with_f32("axis", &[nz, ny, nx, slots, 3], axis)
        .with_f32("spread", &shape, spread)
        .with_f32("radius_mm", &shape, radius)
        .with_i32("materials", &shape, material)
        .with_i32("yarns", &shape, yarn))
}

/// Grids, where the file has them.
fn of_grids(set: GridSet) -> Results {
    let grid = |results: Results, name: &str, grid: VolGrid| {
        let [nx, ny, nz] = grid.dims.to_array().map(|n| n as usize);
        let mut shape = vec![nz, ny, nx];
        if grid.channels > 1 {
            shape.push(grid.channels as usize);
        }
        results.with_f32(name, &shape, grid.data)
    };
    let mut results = grid(Results::default(), "density", set.sigma_t);
    if let Some(axes) = set.axes {
        let [nx, ny, nz] = axes.dims.to_array().map(|n| n as usize);
        let cells = || axes.data.chunks_exact(4);
        let directions = cells().flat_map(|c| [c[0], c[1], c[2]]).collect();
        let spreads = cells().map(|c| c[3]).collect();
        results = results
            .with_f32("axis", &[nz, ny, nx, 3], directions)
            .with_f32("spread", &[nz, ny, nx], spreads);
    }
    for (name, of) in [("sggx", set.sggx), ("albedo", set.albedo)] {
        if let Some(of) = of {
            results = grid(results, name, of);
        }
    }
    results
}
