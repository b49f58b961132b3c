//! From a scene file to media, lights and a camera.

use crate::error::{Result, input};
use crate::loader::Loader;
use crate::memory::free_memory_bytes;
use crate::scene_file::{
    AlbedoValue, CameraKind, CameraTable, FilterName, GridTable, IntegratorName, InterpolationName,
    ObjectTable, PlaneTable, SceneFile,
};
use crate::volume_object::VolumeObject;
use crate::{cloth_object, environment_file, read, volume_file};
use glam::{DVec3, UVec2, Vec2, Vec3};
use organza_basis::{Budget, Rgb};
use organza_light::{Light, LightTable, LoadedPicture};
use organza_transport::{
    AnyMedium, Camera, CameraPose, Grid, GridMedium, Interpolation, PixelFilter, Plane, Projection,
    Scene, aperture_mm,
};
use organza_volume::VolGrid;
use std::path::{Path, PathBuf};

/// What building a scene needs besides the file.
pub struct BuildOptions<'a> {
    /// Where the scene file is: paths inside are relative to its folder.
    pub scene_path: &'a Path,
    /// Opens the files that the scene names.
    pub loader: &'a Loader<'a>,
    /// Limit on memory; what is free if none.
    pub max_memory_bytes: Option<u64>,
}

/// Refuses what can be checked without reading or voxelizing anything.
///
/// # Errors
/// Names the file and key at fault.
pub fn check(file: &SceneFile, scene_path: &Path) -> Result<()> {
    let fail = |words: String| input(format!("{}: {words}", scene_path.display()));
    camera(&file.camera).map_err(|why| fail(format!("camera: {why}")))?;
    let as_fibres = file.render.integrator == IntegratorName::Fibres;
    for (i, table) in file.object.iter().enumerate() {
        let refuse = |why: &str| Err(fail(format!("object[{i}]: {why}")));
        let extent_mm = match table {
            ObjectTable::Cloth(t) => {
                let fabric = read::beside(scene_path, &t.fabric);
                if let Some(why) = read::unreachable(&fabric) {
                    return Err(fail(format!("object[{i}].fabric: {why}")));
                }
                if t.extent_mm.is_some() && t.mesh.is_some() {
                    return refuse("extent_mm is for flat cloth and does not go with mesh");
                }
                t.extent_mm
            }
            ObjectTable::Grid(_) if as_fibres => {
                return refuse("a grid has no fibres for render.integrator = \"fibres\"");
            }
            ObjectTable::Grid(t) if t.extent_mm.is_some() && !t.repeat_xy => {
                return refuse("extent_mm belongs to repeat_xy = true");
            }
            ObjectTable::Grid(t) => t.extent_mm,
            ObjectTable::Volume(t) => {
                t.check(as_fibres, scene_path)
                    .map_err(|why| fail(format!("object[{i}]{why}")))?;
                t.extent_mm
            }
            ObjectTable::Plane(t) => {
                plane(t).map_err(|why| fail(format!("object[{i}]: {why}")))?;
                None
            }
        };
        if let Some([x0, y0, x1, y1]) = extent_mm
            && !(x0 < x1 && y0 < y1)
        {
            return Err(fail(format!(
                "object[{i}]: extent_mm: expected x0, y0, x1, y1 with x0 < x1 and y0 < y1, \
                 found {x0}, {y0}, {x1}, {y1}"
            )));
        }
    }
    Ok(())
}

/// Warns of a scene whose picture is black but for what its channels know of the
/// cloth, or shows lights alone: both can be meant.
pub fn warn_of_emptiness(file: &SceneFile, scene_path: &Path, loader: &Loader<'_>) {
    let shines = |t: &ObjectTable| matches!(t, ObjectTable::Plane(t) if t.radiance.is_some());
    if file.object.is_empty() {
        loader.warn(scene_path, "there is no [[object]]");
    }
    if file.light.is_empty() && !file.object.iter().any(shines) {
        loader.warn(scene_path, "there is no [[light]]");
    }
}

/// The lights of a scene file, with the pictures that they name.
///
/// # Errors
/// Names the file and key at fault.
pub fn lights(file: &SceneFile, scene_path: &Path, loader: &Loader<'_>) -> Result<Vec<Light>> {
    let tables = file.light.iter().enumerate();
    let built = tables.map(|(i, table)| {
        light(table, scene_path, loader)
            .map_err(|why| input(format!("{}: light[{i}]: {why}", scene_path.display())))
    });
    built.collect()
}

/// Builds everything a scene file describes.
///
/// # Errors
/// Names the file and key at fault.
pub fn scene(file: &SceneFile, options: &BuildOptions<'_>) -> Result<Scene> {
    let fail =
        |key: &str, why: &str| input(format!("{}: {key}: {why}", options.scene_path.display()));
    check(file, options.scene_path)?;
    let camera = camera(&file.camera).map_err(|why| fail("camera", &why))?;
    let lights = lights(file, options.scene_path, options.loader)?;
    let as_fibres = file.render.integrator == IntegratorName::Fibres;
    let mut media = Vec::new();
    let allowed = options.max_memory_bytes.unwrap_or_else(free_memory_bytes);
    let mut budget = Budget::new(allowed);
    for (i, table) in file.object.iter().enumerate() {
        let fail = |why: &str| fail(&format!("object[{i}]"), why);
        let (mut medium, extent_mm) = match table {
            ObjectTable::Plane(t) => (AnyMedium::Plane(plane(t).map_err(|why| fail(&why))?), None),
            ObjectTable::Grid(t) => {
                let medium = grid(t, options, &mut budget)?;
                (AnyMedium::Grid(medium), t.extent_mm)
            }
            ObjectTable::Volume(t) => {
                let object = VolumeObject::new(t, i, options);
                (object.medium(&camera, &mut budget)?, t.extent_mm)
            }
            ObjectTable::Cloth(t) => {
                let medium = cloth_object::medium(t, i, as_fibres, &camera, options)?;
                (medium, t.extent_mm)
            }
        };
        if let Some([x0, y0, x1, y1]) = extent_mm {
            let (min, max) = (Vec2::new(x0, y0), Vec2::new(x1, y1));
            medium.cut_to(min, max).ok_or_else(|| {
                fail("extent_mm: expected x0, y0, x1, y1 with x0 < x1 and y0 < y1")
            })?;
        }
        media.push(medium);
    }
    Ok(Scene {
        media,
        lights,
        camera,
    })
}

/// The camera of a scene file.
///
/// # Errors
/// `key: why`.
pub fn camera(t: &CameraTable) -> Result<Camera, String> {
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
        let [x, y] = t.resolution;
        return Err(format!(
            "resolution: at most 65536 pixels along an edge, found {x} x {y}"
        ));
    }
    Camera::new(projection, pose, resolution, filter).map_err(|e| e.to_string())
}

/// Width of the sensor that f-numbers refer to by default: the
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
    let name = |kind: CameraKind| format!("{:?}", kind.name());
    for (key, given, kinds) in keys {
        if given && !kinds.contains(&t.kind) {
            let kinds: Vec<String> = kinds.iter().copied().map(name).collect();
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
                (None, Some(n)) if !(n > 0.0 && n.is_finite()) => {
                    return Err(format!("f_number must be positive, found {n}"));
                }
                (None, Some(n)) => {
                    let sensor_mm = t.sensor_width_mm.unwrap_or(SENSOR_WIDTH_MM);
                    if !(sensor_mm > 0.0 && sensor_mm.is_finite()) {
                        return Err(format!(
                            "sensor_width_mm must be positive, found {sensor_mm}"
                        ));
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

/// A vector of a table, as what it must be.
fn colour(c: [f32; 3], key: &str) -> Result<Rgb, String> {
    let c = Rgb::from(c);
    if c.is_valid() {
        Ok(c)
    } else {
        Err(format!(
            "{key}: expected three finite numbers of at least 0, found {:?}",
            c.0.to_array()
        ))
    }
}

fn light(t: &LightTable, scene_path: &Path, loader: &Loader<'_>) -> Result<Light, String> {
    let load = |name: &str| {
        let path = read::beside(scene_path, name);
        let (size, pixels) = environment_file::decode(&path, loader)?;
        Ok(LoadedPicture {
            name: path.display().to_string(),
            size,
            pixels,
        })
    };
    t.build(&load).map_err(|e| e.to_string())
}

fn plane(t: &PlaneTable) -> Result<Plane, String> {
    let black = [0.0; 3];
    let reflectance = colour(t.reflectance.unwrap_or(black), "reflectance")?;
    if reflectance.max_component() > 1.0 {
        return Err(format!(
            "reflectance: expected three numbers from 0 to 1, found {:?}",
            reflectance.0.to_array()
        ));
    }
    let radiance = colour(t.radiance.unwrap_or(black), "radiance")?;
    let normal = Vec3::from_array(t.normal.unwrap_or([0.0, 0.0, 1.0]));
    Plane::new(
        Vec3::from_array(t.position_mm),
        normal,
        reflectance,
        radiance,
    )
    .ok_or_else(|| {
        "position_mm, normal: expected finite vectors, and a normal that is not zero".into()
    })
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

/// The medium of a grid object.
///
/// # Errors
/// Names the file at fault.
pub fn grid(t: &GridTable, options: &BuildOptions<'_>, budget: &mut Budget) -> Result<GridMedium> {
    let (extinction_path, extinction) = vol(&t.extinction, options, budget)?;
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
    let (sggx_path, sggx) = vol(&t.sggx, options, budget)?;
    same_box(&sggx_path, &sggx)?;
    let albedo = match &t.albedo {
        AlbedoValue::Colour(c) => Grid::constant(*c),
        AlbedoValue::File(name) => {
            let (path, albedo) = vol(name, options, budget)?;
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
