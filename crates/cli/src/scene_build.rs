//! From a scene file to media, lights and a camera.

use crate::error::input;
use crate::read;
use crate::scene_file::{
    AlbedoValue, CameraKind, CameraTable, FilterName, GridTable, HemisphereName, IntegratorName,
    InterpolationName, LightTable, ModelName, ObjectTable, SceneFile,
};
use anyhow::Result;
use glam::{DVec3, UVec2, Vec3};
use organza_basis::Rgb;
use organza_transport::{
    AnyMedium, Camera, CameraPose, Grid, GridMedium, Hemisphere, Interpolation, Light, PixelFilter,
    Projection, Scene, aperture_mm,
};
use organza_volume::VolGrid;
use std::path::{Path, PathBuf};

/// What building a scene needs besides the file.
pub struct BuildOptions<'a> {
    /// Where the scene file is: paths inside are relative to its folder.
    pub scene_path: &'a Path,
    /// No progress.
    pub quiet: bool,
    /// Limit on memory; what is free if none.
    pub max_memory_bytes: Option<u64>,
}

/// Builds everything a scene file describes.
///
/// # Errors
/// Names the file and key at fault.
pub fn scene(file: &SceneFile, options: &BuildOptions<'_>) -> Result<Scene> {
    let fail =
        |key: &str, why: &str| input(format!("{}: {key}: {why}", options.scene_path.display()));
    let camera = camera(&file.camera).map_err(|why| fail("camera", &why))?;
    let mut lights = Vec::new();
    for (i, table) in file.light.iter().enumerate() {
        lights.push(light(table).map_err(|why| fail(&format!("light[{i}]"), &why))?);
    }
    let as_fibres = file.render.integrator == IntegratorName::Fibres;
    let mut media = Vec::new();
    for (i, table) in file.object.iter().enumerate() {
        media.push(match table {
            ObjectTable::Grid(_) if as_fibres => {
                let why = "a grid has no fibres for render.integrator = \"fibres\"";
                return Err(fail(&format!("object[{i}]"), why));
            }
            ObjectTable::Grid(t) => AnyMedium::Grid(grid(t, options.scene_path)?),
            ObjectTable::Cloth(t) if as_fibres || t.model == ModelName::Fibres => {
                crate::fabric_file::cloth_fibres(t, options)?
            }
            ObjectTable::Cloth(t) => crate::fabric_file::cloth_medium(t, &file.camera, options)?,
        });
    }
    Ok(Scene {
        media,
        lights,
        camera,
    })
}

fn camera(t: &CameraTable) -> Result<Camera, String> {
    let projection = projection(t)?;
    let pose = CameraPose {
        origin_mm: DVec3::from_array(t.origin_mm),
        target_mm: DVec3::from_array(t.target_mm),
        up: DVec3::from_array(t.up),
    };
    if !(pose.origin_mm.is_finite() && pose.target_mm.is_finite() && pose.up.is_finite()) {
        return Err("origin_mm, target_mm and up must be finite".into());
    }
    let filter = match t.filter {
        FilterName::Box => PixelFilter::Box,
        FilterName::Tent => PixelFilter::Tent,
        FilterName::Gaussian => PixelFilter::Gaussian,
    };
    let resolution = UVec2::from_array(t.resolution);
    if resolution.max_element() > 65_536 {
        return Err("resolution: at most 65536 pixels along an edge".into());
    }
    Camera::new(projection, pose, resolution, filter).map_err(|e| e.to_string())
}

/// Width of the sensor that f-numbers are told for when none is given: the
/// 36 mm of small-picture film.
const SENSOR_WIDTH_MM: f64 = 36.0;

fn projection(t: &CameraTable) -> Result<Projection, String> {
    use CameraKind::{Orthographic, Perspective, ThinLens};
    let keys: [(&str, bool, &[CameraKind]); 6] = [
        ("width_mm", t.width_mm.is_some(), &[Orthographic]),
        ("fov_deg", t.fov_deg.is_some(), &[Perspective, ThinLens]),
        ("aperture_mm", t.aperture_mm.is_some(), &[ThinLens]),
        ("f_number", t.f_number.is_some(), &[ThinLens]),
        ("focus_mm", t.focus_mm.is_some(), &[ThinLens]),
        ("sensor_width_mm", t.sensor_width_mm.is_some(), &[ThinLens]),
    ];
    let name = |kind| match kind {
        Orthographic => "\"orthographic\"",
        Perspective => "\"perspective\"",
        ThinLens => "\"thin-lens\"",
    };
    for (key, given, kinds) in keys {
        if given && !kinds.contains(&t.kind) {
            let kinds: Vec<&str> = kinds.iter().copied().map(name).collect();
            return Err(format!("{key} belongs to kind = {}", kinds.join(" or ")));
        }
    }
    let fov_rad = || Ok::<f64, String>(t.fov_deg.ok_or("fov_deg is missing")?.to_radians());
    Ok(match t.kind {
        Orthographic => Projection::Orthographic {
            width_mm: t.width_mm.ok_or("width_mm is missing")?,
        },
        Perspective => Projection::Perspective {
            fov_rad: fov_rad()?,
        },
        ThinLens => {
            let fov_rad = fov_rad()?;
            let to_target = DVec3::from(t.target_mm) - DVec3::from(t.origin_mm);
            let focus_mm = t.focus_mm.unwrap_or(to_target.length());
            let aperture_mm = match (t.aperture_mm, t.f_number) {
                (Some(d), None) if t.sensor_width_mm.is_none() => d,
                (Some(_), None) => return Err("sensor_width_mm belongs to f_number".into()),
                (None, Some(n)) => {
                    let sensor_mm = t.sensor_width_mm.unwrap_or(SENSOR_WIDTH_MM);
                    if !(sensor_mm > 0.0 && sensor_mm.is_finite()) {
                        return Err("sensor_width_mm must be positive".into());
                    }
                    aperture_mm(n, fov_rad, focus_mm, sensor_mm)
                }
                _ => return Err("a thin lens takes either aperture_mm or f_number".into()),
            };
            Projection::ThinLens {
                fov_rad,
                aperture_mm,
                focus_mm,
            }
        }
    })
}

fn light(t: &LightTable) -> Result<Light, String> {
    let colour = |c: [f32; 3], key: &str| {
        let c = Rgb::from(c);
        if c.is_valid() {
            Ok(c)
        } else {
            Err(format!(
                "{key}: expected three finite numbers of at least 0"
            ))
        }
    };
    match *t {
        LightTable::Directional {
            direction,
            irradiance,
        } => Ok(Light::Directional {
            direction: Vec3::from_array(direction)
                .try_normalize()
                .ok_or("direction: expected a finite vector that is not zero")?,
            irradiance: colour(irradiance, "irradiance")?,
        }),
        LightTable::Environment {
            radiance,
            hemisphere,
        } => Ok(Light::Environment {
            radiance: colour(radiance, "radiance")?,
            hemisphere: match hemisphere {
                HemisphereName::All => Hemisphere::All,
                HemisphereName::Front => Hemisphere::Front,
                HemisphereName::Back => Hemisphere::Back,
            },
        }),
    }
}

/// A `.vol` file and its path, for messages.
fn vol(scene_path: &Path, name: &str) -> Result<(PathBuf, VolGrid)> {
    let path = read::beside(scene_path, name);
    let bytes = read::bytes(&path)?;
    let limit = bytes.len() as u64;
    let grid = VolGrid::read(&mut &bytes[..], limit)
        .map_err(|e| input(format!("{}: {e}", path.display())))?;
    Ok((path, grid))
}

/// The samples of a `.vol` grid that must have `N` channels.
fn channels<const N: usize>(path: &Path, grid: &VolGrid, key: &str) -> Result<Grid<N>> {
    if grid.channels as usize != N {
        return Err(input(format!(
            "{}: has {} channels; `{key}` expects {N}",
            path.display(),
            grid.channels
        )));
    }
    let samples = grid
        .data
        .chunks_exact(N)
        .map(|s| std::array::from_fn(|i| s[i]))
        .collect();
    Grid::new(grid.dims, samples)
        .ok_or_else(|| input(format!("{}: holds no samples", path.display())))
}

fn grid(t: &GridTable, scene_path: &Path) -> Result<GridMedium> {
    let (extinction_path, extinction) = vol(scene_path, &t.extinction)?;
    let bounds_mm = extinction.bounds_mm;
    let same_box = |path: &Path, other: &VolGrid| {
        let slack = 1e-4 * bounds_mm.size().max_element();
        let near = |a: Vec3, b: Vec3| (a - b).abs().max_element() <= slack;
        if near(other.bounds_mm.min, bounds_mm.min) && near(other.bounds_mm.max, bounds_mm.max) {
            Ok(())
        } else {
            Err(input(format!(
                "{}: its box {} .. {} differs from the extinction's {} .. {}",
                path.display(),
                other.bounds_mm.min,
                other.bounds_mm.max,
                bounds_mm.min,
                bounds_mm.max
            )))
        }
    };
    let (sggx_path, sggx) = vol(scene_path, &t.sggx)?;
    same_box(&sggx_path, &sggx)?;
    let albedo = match &t.albedo {
        AlbedoValue::Colour(c) => Grid::constant(*c),
        AlbedoValue::File(name) => {
            let (path, albedo) = vol(scene_path, name)?;
            same_box(&path, &albedo)?;
            channels::<3>(&path, &albedo, "albedo")?
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
    .map_err(|e| input(format!("{}: {e}", extinction_path.display())))
}
