//! The fabric file: one cloth, its geometry, its optics and its voxels.

use crate::error::input;
use crate::fibre_optics;
use crate::progress::Progress;
use crate::read;
use crate::scene_build::BuildOptions;
use crate::scene_file::{CameraKind, CameraTable, ClothTable, EventName, Lod, LodName, ModelName};
use anyhow::Result;
use organza_basis::{Rgb, SegmentSource, nearest_name};
use organza_scatter::Fibre;
use organza_surface::{SurfaceSpec, WovenSurface, weave::Weave};
use organza_transport::{
    AnyMedium, ClothMedium, ExplicitFibres, FibreEvent, FibreMedium, FlakeOptics, LocalVisibility,
};
use organza_volume::{Footprint, Octree, VoxelizeOptions, voxelize};
use organza_weave::{
    Cloth, Draft, FabricGeometry, Material,
    spec::{DraftSpec, RelaxationSpec, ThreadSetSpec, TileSpec, YarnSpec},
};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::Path;

/// A whole fabric file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FabricFile {
    /// Name, for people.
    pub name: Option<String>,
    pub draft: DraftSpec,
    #[serde(default)]
    pub warp: ThreadSetSpec,
    #[serde(default)]
    pub weft: ThreadSetSpec,
    #[serde(default)]
    pub yarn: BTreeMap<String, YarnSpec>,
    #[serde(default)]
    pub relaxation: RelaxationSpec,
    #[serde(default)]
    pub tile: TileSpec,
    /// How the fibres of a yarn scatter light, by the yarn's name.
    #[serde(default)]
    pub optics: BTreeMap<String, OpticsTable>,
    #[serde(default)]
    pub voxel: VoxelTable,
    /// The cloth as a surface, where there is one to compare with.
    pub surface: Option<SurfaceSpec>,
    /// Seed of everything random in the geometry.
    #[serde(default)]
    pub seed: u64,
}

/// `[optics.YARN]`: micro-flakes read the first two keys, virtual scattering the
/// others.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OpticsTable {
    /// Single-scattering albedo of the fibres. Without it the thread's colour
    /// in the draft is taken for the colour of a thick heap of its fibres.
    pub albedo: Option<[f32; 3]>,
    /// Ratio of end-on to broadside extinction of a straight bundle: how rough
    /// single fibres are.
    pub end_on_ratio: f32,
    /// Index of refraction of the fibres.
    pub ior: Option<f32>,
    /// Colour of a thick heap of the fibres: that of the thread, if none.
    pub colour: Option<[f32; 3]>,
    /// Absorption inside the fibres, instead of `colour`.
    pub absorption_per_mm: Option<[f32; 3]>,
    /// Width of highlights along the fibres.
    pub longitudinal_deg: Option<f32>,
    /// Width of the lobes about the fibres.
    pub azimuthal_deg: Option<f32>,
    /// A fibre fitted to photographs, instead of all that.
    pub fitted: Option<String>,
}

/// Estimated: the width of the highlight of a dyed staple fibre, about 6
/// degrees, seen as the end-on ratio of its flakes.
const DEFAULT_END_ON_RATIO: f32 = 0.1;

/// Estimated: the colour of undyed bleached cloth.
pub const UNDYED: Rgb = Rgb::splat(0.8);

impl Default for OpticsTable {
    fn default() -> OpticsTable {
        OpticsTable {
            albedo: None,
            end_on_ratio: DEFAULT_END_ON_RATIO,
            ior: None,
            colour: None,
            absorption_per_mm: None,
            longitudinal_deg: None,
            azimuthal_deg: None,
            fitted: None,
        }
    }
}

/// `[voxel]`
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct VoxelTable {
    /// Edge of the finest voxels.
    pub size_um: f32,
}

impl Default for VoxelTable {
    fn default() -> VoxelTable {
        VoxelTable { size_um: 10.0 }
    }
}

/// A fabric file with the cloth it describes.
pub struct Fabric {
    /// The file.
    pub file: FabricFile,
    /// The cloth.
    pub cloth: Cloth,
}

/// Reads a fabric file and relaxes its yarns.
///
/// # Errors
/// Names the file and the key at fault.
pub fn load(path: &Path, overrides: &[String]) -> Result<Fabric> {
    let file: FabricFile = read::toml(path, overrides)?;
    let geometry = FabricGeometry {
        draft: file.draft.clone(),
        warp: file.warp.clone(),
        weft: file.weft.clone(),
        yarn: file.yarn.clone(),
        relaxation: file.relaxation,
        tile: file.tile,
    };
    let open = |name: &str| read::bytes_or_why(&read::beside(path, name));
    let cloth = Cloth::build(&geometry, &open, file.seed)
        .map_err(|e| input(format!("{}: {e}", path.display())))?;
    for (yarn, optics) in &file.optics {
        check_optics(path, yarn, optics, cloth.materials())?;
    }
    Ok(Fabric { file, cloth })
}

fn check_optics(
    path: &Path,
    yarn: &str,
    optics: &OpticsTable,
    materials: &[Material],
) -> Result<()> {
    let fail = |why: String| Err(input(format!("{}: optics.{yarn}{why}", path.display())));
    let names: Vec<&str> = materials.iter().map(|m| m.yarn.as_str()).collect();
    if !names.contains(&yarn) {
        let near = nearest_name(yarn, names.iter().copied())
            .map_or(String::new(), |n| format!("; did you mean `{n}`?"));
        return fail(format!(": no yarn of the cloth has this name{near}"));
    }
    let in_range = |c: &f32| (0.0..=1.0).contains(c);
    if optics.albedo.is_some_and(|a| !a.iter().all(in_range)) {
        return fail(".albedo: expected three numbers from 0 to 1".into());
    }
    if !in_range(&optics.end_on_ratio) {
        return fail(".end_on_ratio: expected a number from 0 to 1".into());
    }
    fibre_optics::check(optics).or_else(fail)
}

impl Fabric {
    /// How each material of the cloth scatters.
    pub fn optics(&self) -> Vec<FlakeOptics> {
        self.cloth
            .materials()
            .iter()
            .map(|m| {
                let table = self.optics_of(m);
                let albedo = table
                    .albedo
                    .map_or_else(|| albedo_for_colour(m.colour.unwrap_or(UNDYED)), Rgb::from);
                FlakeOptics {
                    albedo,
                    end_on_ratio: table.end_on_ratio,
                }
            })
            .collect()
    }

    /// The surface model of the cloth. Draft and spacing are the cloth's own
    /// unless `[surface.weave]` says otherwise; a preset supplies the yarns. The
    /// system that covers more hides all but the threads of the other.
    ///
    /// # Errors
    /// No `[surface]` section, or the key in it that is at fault.
    pub fn surface(&self, path: &Path) -> Result<WovenSurface> {
        let mut spec = self.file.surface.clone().ok_or_else(|| {
            input(format!(
                "{}: has no [surface] section, which the surface model needs",
                path.display()
            ))
        })?;
        let tile_mm = self.cloth.tile().bounds_mm.size();
        let figures = self.cloth.figures();
        let weave_of = |draft: &Draft| {
            let repeat = draft.smallest_repeat();
            let row = |pick| {
                (0..repeat.ends())
                    .map(|e| repeat.warp_up(e, pick))
                    .collect()
            };
            let rows: Vec<Vec<bool>> = (0..repeat.picks()).map(row).collect();
            let pitch = |length: f32, threads| f64::from(length) / threads as f64;
            let (warp, weft) = (draft.ends(), draft.picks());
            let mut weave =
                Weave::from_warp_up(&rows, pitch(tile_mm.x, warp), pitch(tile_mm.y, weft));
            if let (Some(warp), Some(weft)) = (&figures.warp, &figures.weft) {
                // Side by side, threads of the denser system hide all but the
                // width of the others.
                if warp.cover_factor > weft.cover_factor {
                    weave.weft_width_mm = Some(weft.width_mm.min(weave.weft_pitch_mm));
                } else if weft.cover_factor > warp.cover_factor {
                    weave.warp_width_mm = Some(warp.width_mm.min(weave.warp_pitch_mm));
                }
            }
            weave
        };
        spec.weave = spec.weave.or_else(|| self.cloth.draft().map(weave_of));
        spec.build()
            .map_err(|e| input(format!("{}: surface: {e}", path.display())))
    }

    fn optics_of(&self, material: &Material) -> OpticsTable {
        let table = self.file.optics.get(&material.yarn);
        table.cloned().unwrap_or_default()
    }

    /// The fibres of each material of the cloth.
    ///
    /// # Errors
    /// Names the yarn at fault.
    pub fn fibres(&self, path: &Path) -> Result<Vec<Fibre>> {
        let fibre = |m: &Material| {
            fibre_optics::fibre(&self.optics_of(m), m)
                .map_err(|why| input(format!("{}: optics.{}: {why}", path.display(), m.yarn)))
        };
        self.cloth.materials().iter().map(fibre).collect()
    }

    /// Every fibre of the cloth, to be traced.
    ///
    /// # Errors
    /// A cloth without fibres, optics that make no sense, or more memory needed
    /// than allowed.
    pub fn explicit_fibres(
        &self,
        path: &Path,
        max_memory_bytes: Option<u64>,
        quiet: bool,
    ) -> Result<AnyMedium> {
        self.trace_fibres(path, max_memory_bytes, quiet)
            .map(AnyMedium::Explicit)
    }

    fn trace_fibres(
        &self,
        path: &Path,
        max_memory_bytes: Option<u64>,
        quiet: bool,
    ) -> Result<ExplicitFibres> {
        let allowed = max_memory_bytes.unwrap_or_else(free_memory_bytes);
        let progress = Progress::new("gathering fibres", 1000, quiet);
        let traced = ExplicitFibres::new(&self.cloth, self.fibres(path)?, Some(allowed), &|done| {
            progress.at((done * 1000.0) as u64);
        })
        .map_err(|e| input(format!("{}: {e}", path.display())))?;
        progress.finish();
        Ok(traced)
    }

    /// The octree of the cloth's fibres.
    ///
    /// # Errors
    /// A voxel size out of range, or more memory needed than allowed.
    pub fn voxelize(
        &self,
        path: &Path,
        voxel_um: Option<f32>,
        levels: Option<u8>,
        max_memory_bytes: Option<u64>,
        quiet: bool,
    ) -> Result<Octree> {
        let covered = Footprint::Covered;
        self.voxelize_as(path, covered, voxel_um, levels, max_memory_bytes, quiet)
    }

    /// The same with the length of thick fibres where `footprint` says.
    ///
    /// # Errors
    /// As [`Fabric::voxelize`].
    pub fn voxelize_as(
        &self,
        path: &Path,
        footprint: Footprint,
        voxel_um: Option<f32>,
        levels: Option<u8>,
        max_memory_bytes: Option<u64>,
        quiet: bool,
    ) -> Result<Octree> {
        let size_um = voxel_um.unwrap_or(self.file.voxel.size_um);
        if !(size_um.is_finite() && size_um > 0.0) {
            return Err(input(format!(
                "{}: voxel size: expected a positive number of micrometres, found {size_um}",
                path.display()
            )));
        }
        let options = VoxelizeOptions {
            voxel_mm: size_um * 1e-3,
            levels,
            footprint,
            max_memory_bytes: Some(max_memory_bytes.unwrap_or_else(free_memory_bytes)),
        };
        let progress = Progress::new("voxelizing", 1000, quiet);
        let octree = voxelize(&self.cloth, &options, &|done| {
            progress.at((done * 1000.0) as u64);
        })
        .map_err(|e| input(format!("{}: {e}", path.display())))?;
        progress.finish();
        Ok(octree)
    }
}

/// Memory that the machine has free, where it tells (Linux does); else no limit.
pub fn free_memory_bytes() -> u64 {
    let from_kernel = || {
        let text = std::fs::read_to_string("/proc/meminfo").ok()?;
        let line = text.lines().find_map(|l| l.strip_prefix("MemAvailable:"))?;
        let kib: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
        kib.checked_mul(1024)
    };
    from_kernel().unwrap_or(u64::MAX)
}

/// The single-scattering albedo at which a half-space of isotropic scatterers
/// has the diffuse albedo `colour`.
///
/// Van de Hulst's fit R = (1 - s)(1 - 0.139 s) / (1 + 1.17 s) with
/// s = sqrt(1 - albedo) [vanDeHulst1980], solved for s.
/// Cloth is neither thick nor isotropic, so this is an estimate of what was
/// dyed, not a fit of a measurement.
pub fn albedo_for_colour(colour: Rgb) -> Rgb {
    let channel = |r: f32| {
        let r = r.clamp(0.0, 1.0);
        // 0.139 s^2 - (1.139 + 1.17 R) s + (1 - R) = 0, the smaller root.
        let b = 1.139 + 1.17 * r;
        let s = (b - (b * b - 4.0 * 0.139 * (1.0 - r)).max(0.0).sqrt()) / (2.0 * 0.139);
        (1.0 - s * s).clamp(0.0, 1.0)
    };
    Rgb::from(<[f32; 3]>::from(colour).map(channel))
}

/// A cloth object of a scene.
///
/// # Errors
/// Names the file and the key at fault.
pub fn cloth_medium(
    table: &ClothTable,
    camera: &CameraTable,
    options: &BuildOptions<'_>,
) -> Result<AnyMedium> {
    let path = read::beside(options.scene_path, &table.fabric);
    let event = fibre_event(table).map_err(|why| {
        input(format!(
            "{}: object.event: {why}",
            options.scene_path.display()
        ))
    })?;
    if table.local_visibility && event.is_none() {
        return Err(input(format!(
            "{}: object.local_visibility: belongs to model = \"virtual-scattering\"",
            options.scene_path.display()
        )));
    }
    let own_seed: Vec<String> = table.seed.iter().map(|s| format!("seed={s}")).collect();
    let fabric = load(&path, &own_seed)?;
    let packed = event == Some(FibreEvent::Packed);
    let octree = fabric.voxelize_as(
        &path,
        if packed {
            Footprint::Axis
        } else {
            Footprint::Covered
        },
        table.voxel_um,
        None,
        options.max_memory_bytes,
        options.quiet,
    )?;
    let level = match table.lod {
        Lod::Level(level) => level,
        Lod::Name(LodName::Volume) => 0,
        Lod::Name(LodName::Auto) => {
            let level = level_for_camera(&octree, camera);
            if packed {
                level.max(fibre_optics::level_for_packed(
                    &octree,
                    fabric.cloth.materials(),
                ))
            } else {
                level
            }
        }
    };
    let levels = octree.level_count();
    let medium = match event {
        None => ClothMedium::new(octree, level, fabric.optics()).map(AnyMedium::Cloth),
        Some(event) => {
            let local = if table.local_visibility && level < levels {
                let materials = octree.material_count();
                let (corner, voxel_mm) = (octree.bounds_mm().min, octree.voxel_mm(level));
                let fibres = fabric.trace_fibres(&path, options.max_memory_bytes, options.quiet)?;
                let seed = fabric.file.seed;
                let counted = LocalVisibility::count(&fibres, materials, corner, voxel_mm, seed);
                Some(counted.map_err(|e| input(format!("{}: {e}", path.display())))?)
            } else {
                None
            };
            FibreMedium::new(octree, level, fabric.fibres(&path)?, event).map(|medium| {
                AnyMedium::Fibres(match local {
                    Some(local) => medium.with_local_visibility(local),
                    None => medium,
                })
            })
        }
    };
    medium.ok_or_else(|| {
        input(format!(
            "{}: object.lod: level {level} does not exist; the cloth has {levels}, from 0",
            options.scene_path.display()
        ))
    })
}

/// A cloth object of a scene as explicit fibres.
///
/// # Errors
/// Names the file and the key at fault.
pub fn cloth_fibres(table: &ClothTable, options: &BuildOptions<'_>) -> Result<AnyMedium> {
    let virtual_only = [
        ("event", table.event.is_some()),
        ("local_visibility", table.local_visibility),
    ];
    let misplaced = virtual_only.iter().find(|k| k.1);
    if let Some((key, _)) = misplaced.filter(|_| table.model != ModelName::VirtualScattering) {
        return Err(input(format!(
            "{}: object.{key}: belongs to model = \"virtual-scattering\"",
            options.scene_path.display()
        )));
    }
    let path = read::beside(options.scene_path, &table.fabric);
    let own_seed: Vec<String> = table.seed.iter().map(|s| format!("seed={s}")).collect();
    let fabric = load(&path, &own_seed)?;
    fabric.explicit_fibres(&path, options.max_memory_bytes, options.quiet)
}

/// The event of virtual scattering; `None` for micro-flakes.
fn fibre_event(table: &ClothTable) -> Result<Option<FibreEvent>, &'static str> {
    match (table.model, table.event) {
        (ModelName::Microflake, None) => Ok(None),
        (ModelName::Microflake | ModelName::Fibres, Some(_)) => {
            Err("belongs to model = \"virtual-scattering\"")
        }
        (ModelName::Fibres, None) => Ok(None),
        (ModelName::VirtualScattering, Some(EventName::Plain)) => Ok(Some(FibreEvent::Plain)),
        (ModelName::VirtualScattering, _) => Ok(Some(FibreEvent::Packed)),
    }
}

/// The coarsest level whose voxels are at most half a pixel wide where the
/// camera looks.
fn level_for_camera(octree: &Octree, camera: &CameraTable) -> u8 {
    let pixels = f64::from(camera.resolution[0].max(1));
    let width_mm = match camera.kind {
        CameraKind::Orthographic => camera.width_mm.unwrap_or(0.0),
        CameraKind::Perspective | CameraKind::ThinLens => {
            let distance = (glam::DVec3::from(camera.target_mm)
                - glam::DVec3::from(camera.origin_mm))
            .length();
            2.0 * distance * (0.5 * camera.fov_deg.unwrap_or(0.0).to_radians()).tan()
        }
    };
    let pixel_mm = (width_mm / pixels) as f32;
    (0..octree.level_count())
        .rev()
        .find(|&l| octree.voxel_mm(l).max_element() <= 0.5 * pixel_mm)
        .unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where explicit fibres overlap they are one body, and less than the volume
    /// that stands for them: how much less is a property of our yarns.
    #[test]
    fn fibres_of_the_projects_fabrics_overlap_little() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/fabrics/");
        for (name, most) in [("denim", 0.2), ("organza", 0.2)] {
            let path = Path::new(folder).join(name).with_extension("toml");
            let fabric = load(&path, &[]).unwrap();
            let fibres = fabric.trace_fibres(&path, None, true).unwrap();
            let overlap = fibres.measure_overlap(100_000, 1);
            let shared = 1.0 - overlap.union / overlap.sum;
            println!(
                "{name}: {} pieces, {} bytes, {overlap:?}, {shared:.3} of it shared",
                fibres.piece_count(),
                fibres.memory_bytes()
            );
            assert!(shared < most, "seed 1, {name}: {overlap:?}");
        }
    }

    #[test]
    fn colours_and_albedos_invert_each_other() {
        for i in 0..=20 {
            let r = i as f32 / 20.0;
            let albedo = albedo_for_colour(Rgb::splat(r)).0.x;
            let s = (1.0 - albedo).sqrt();
            let back = (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s);
            assert!((back - r).abs() < 1e-4, "{r}: {albedo} gives {back}");
        }
    }
}
