//! `kind = "grid"`: a medium from Mitsuba `.vol` grids.

use super::{At, ObjectKind};
use crate::build_options::BuildOptions;
use crate::error::{InputError, Result};
use crate::memory::free_memory_bytes;
use crate::{read, volume_file};
use glam::Vec3;
use organza_basis::Budget;
use organza_transport::{AnyMedium, Camera, Grid, GridMedium, GridMediumError, Interpolation};
use organza_volume::VolGrid;
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A medium from Mitsuba `.vol` grids.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GridTable {
    /// File of the extinction, one channel, 1/mm.
    pub extinction: String,
    /// File of the matrices, six channels: xx yy zz xy xz yz.
    pub sggx: String,
    /// Single-scattering albedo.
    pub albedo: AlbedoValue,
    /// Between the samples of the grids.
    #[serde(default)]
    pub interpolation: InterpolationName,
    /// Whether it repeats without end in x and y.
    #[serde(default)]
    pub repeat_xy: bool,
    /// Where a repeated grid is: x and y of two corners; without end if none.
    pub extent_mm: Option<[f32; 4]>,
}

/// A colour, or the file of a three-channel grid.
#[derive(Clone, Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "expected three numbers from 0 to 1, or the name of a 3-channel .vol file"
)]
pub enum AlbedoValue {
    /// One colour everywhere.
    Colour([f32; 3]),
    /// A file of three channels.
    File(String),
}

/// `interpolation` of a grid.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum InterpolationName {
    /// Constant in a cell.
    #[default]
    Nearest,
    /// Linear between the centres of cells.
    Trilinear,
}

impl ObjectKind for GridTable {
    fn check(&self, at: &At<'_>) -> Result<()> {
        if at.as_fibres {
            return Err(at.fail(": a grid has no fibres for render.integrator = \"fibres\""));
        }
        if self.extent_mm.is_some() && !self.repeat_xy {
            return Err(at.fail(": extent_mm belongs to repeat_xy = true"));
        }
        Ok(())
    }

    fn extent_mm(&self) -> Option<[f32; 4]> {
        self.extent_mm
    }

    fn describe(&self, _: &At<'_>, options: &BuildOptions<'_>) -> Result<Value> {
        let allowed = options.max_memory_bytes.unwrap_or_else(free_memory_bytes);
        grid(self, options, &mut Budget::new(allowed))?;
        Ok(json!({ "extinction": self.extinction, "sggx": self.sggx }))
    }

    fn media(
        &self,
        _: &At<'_>,
        _: &Camera,
        options: &BuildOptions<'_>,
        budget: &mut Budget,
    ) -> Result<Vec<AnyMedium>> {
        grid(self, options, budget).map(|grid| vec![AnyMedium::Grid(grid)])
    }
}

/// A `.vol` file and its path, for messages.
fn vol(name: &str, options: &BuildOptions<'_>, budget: &mut Budget) -> Result<(PathBuf, VolGrid)> {
    let path = read::beside(options.scene_path, name);
    let grid = volume_file::read(&path, options.loader, |source| {
        source.read(budget, |bytes, budget| {
            VolGrid::read(&mut &bytes[..], budget)
        })
    })?;
    Ok((path, grid))
}

/// The samples of a `.vol` grid that must have `N` channels.
pub(crate) fn channels<const N: usize>(path: &Path, grid: &VolGrid, key: &str) -> Result<Grid<N>> {
    if grid.channels as usize != N {
        return Err(InputError::of_file(
            path,
            format!("has {} channels; `{key}` expects {N}", grid.channels),
        ));
    }
    let samples = grid
        .data
        .chunks_exact(N)
        .map(|s| std::array::from_fn(|i| s[i]))
        .collect();
    Grid::new(grid.dims, samples).ok_or_else(|| InputError::of_file(path, "holds no samples"))
}

/// The medium of a grid object.
///
/// # Errors
/// Names the file at fault.
fn grid(t: &GridTable, options: &BuildOptions<'_>, budget: &mut Budget) -> Result<GridMedium> {
    let (extinction_path, extinction) = vol(&t.extinction, options, budget)?;
    let bounds_mm = extinction.bounds_mm;
    let same_box = |path: &Path, other: &VolGrid| {
        let slack = 1e-4 * bounds_mm.size().max_element();
        let near = |a: Vec3, b: Vec3| (a - b).abs().max_element() <= slack;
        if near(other.bounds_mm.min, bounds_mm.min) && near(other.bounds_mm.max, bounds_mm.max) {
            Ok(())
        } else {
            Err(InputError::of_file(
                path,
                format!(
                    "its box {} .. {} differs from the extinction's {} .. {}",
                    other.bounds_mm.min, other.bounds_mm.max, bounds_mm.min, bounds_mm.max
                ),
            ))
        }
    };
    let (sggx_path, sggx) = vol(&t.sggx, options, budget)?;
    same_box(&sggx_path, &sggx)?;
    let mut albedo_path = None;
    let albedo = match &t.albedo {
        AlbedoValue::Colour(c) => Grid::constant(*c),
        AlbedoValue::File(name) => {
            let (path, albedo) = vol(name, options, budget)?;
            same_box(&path, &albedo)?;
            let samples = channels::<3>(&path, &albedo, "albedo")?;
            albedo_path = Some(path);
            samples
        }
    };
    let interpolation = match t.interpolation {
        InterpolationName::Nearest => Interpolation::Nearest,
        InterpolationName::Trilinear => Interpolation::Trilinear,
    };
    GridMedium::new(
        bounds_mm,
        t.repeat_xy,
        interpolation,
        channels::<1>(&extinction_path, &extinction, "extinction")?,
        channels::<6>(&sggx_path, &sggx, "sggx")?,
        albedo,
    )
    .map_err(|e| {
        let path = match e {
            GridMediumError::Indefinite { .. } | GridMediumError::Value { grid: "sggx", .. } => {
                &sggx_path
            }
            GridMediumError::Value { grid: "albedo", .. } => {
                albedo_path.as_ref().unwrap_or(&extinction_path)
            }
            _ => &extinction_path,
        };
        InputError::of_file(path, e)
    })
}
