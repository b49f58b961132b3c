//! `kind = "volume"`: a volume file, laid where a scene says.

mod grids;
mod materials;

pub use materials::VolumeMaterials;

use super::cloth::ClothTable;
use super::laying::Laying;
use super::{At, ObjectKind};
use crate::build_options::BuildOptions;
use crate::cloth_place::ClothPlace;
use crate::drape::{self, MeshKeys};
use crate::error::{InputError, Result};
use crate::fabric_file::{self, Fabric};
use crate::level::{Levels, Lod, LodName};
use crate::memory::free_memory_bytes;
use crate::optics::OpticsFile;
use crate::read;
use crate::representation::{MICROFLAKE, ModelKey, ShownAs, VoxelBuild};
use crate::scan_file::ScanFile;
use crate::volume_file;
use organza_basis::{Aabb, Budget};
use organza_scatter::{FlakeFamily, FlakeOptics};
use organza_transport::{AnyMedium, Camera, FlakeOctreeMedium};
use organza_volume::format::{self, FORMATS, Format, Volume};
use organza_volume::ovox::Stored;
use organza_volume::{FibreFootprint, GridSet, Octree};
use serde::Deserialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A volume file, laid where the scene says.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VolumeTable {
    /// The file, of any format that is read.
    pub file: String,
    /// Whether it repeats without end in x and y; as the file says if none.
    pub repeat_xy: Option<bool>,
    /// Where a repeated volume is: x and y of two corners; without end if none.
    pub extent_mm: Option<[f32; 4]>,
    /// Millimetres to the file's unit of length; extinction is per that unit. 1 if
    /// none.
    pub scale: Option<f32>,
    /// Factor of the density of fibre; of grids, extinction to the file's unit of density. 1 if
    /// none.
    pub density_scale: Option<f32>,
    /// Single-scattering albedo, where the file has none.
    pub albedo: Option<[f32; 3]>,
    /// The representation; the fabric's own if none, and so is the next.
    pub model: Option<ModelKey>,
    /// Micro-flakes: their family.
    pub flake: Option<FlakeFamily>,
    /// How fibres scatter, before what the file says of it.
    #[serde(default)]
    pub optics: OpticsFile,
    /// Level of detail.
    #[serde(default)]
    pub lod: Lod,
    /// A mesh with texture coordinates to lay the volume over.
    pub mesh: Option<String>,
    /// With `mesh`: length of its units; 1000 for glTF and else 1, if none.
    pub mm_per_unit: Option<f32>,
    /// With `mesh`: cloth to a unit of texture coordinate.
    pub mm_per_uv: Option<f32>,
}

impl VolumeTable {
    /// The keys that a cloth has as well.
    fn mesh_keys(&self) -> MeshKeys<'_> {
        MeshKeys {
            mesh: self.mesh.as_deref(),
            mm_per_unit: self.mm_per_unit,
            mm_per_uv: self.mm_per_uv,
        }
    }

    fn as_cloth(&self) -> ClothTable {
        ClothTable {
            fabric: self.file.clone(),
            model: self.model,
            flake: self.flake,
            local_visibility: false,
            first_events: None,
            while_weight: None,
            optics: self.optics.clone(),
            lod: self.lod,
            tolerance: None,
            mesh: self.mesh.clone(),
            mm_per_unit: self.mm_per_unit,
            mm_per_uv: self.mm_per_uv,
            stroke: Vec::new(),
            crush: None,
            crease: Vec::new(),
            fringe: Vec::new(),
            stitch: Vec::new(),
            voxel_um: None,
            seed: None,
            extent_mm: self.extent_mm,
        }
    }

    /// Refuses what can be refused without opening the file.
    ///
    /// # Errors
    /// `.key: why`.
    fn check_keys(&self, as_fibres: bool, scene_path: &Path) -> Result<(), String> {
        if as_fibres {
            return Err(": a volume has no fibres for render.integrator = \"fibres\"".into());
        }
        let path = read::beside(scene_path, &self.file);
        format_of(&path)?;
        for (key, value) in [("scale", self.scale), ("density_scale", self.density_scale)] {
            if let Some(v) = value.filter(|v| !(*v > 0.0 && v.is_finite())) {
                return Err(format!(".{key}: expected a positive number, found {v}"));
            }
        }
        if let Some(c) = self.albedo
            && !c.iter().all(|c| (0.0..=1.0).contains(c))
        {
            return Err(format!(
                ".albedo: expected three numbers from 0 to 1, found {c:?}"
            ));
        }
        if self.extent_mm.is_some() && self.mesh.is_some() {
            return Err(": extent_mm is for flat volumes and does not go with mesh".into());
        }
        let shown = match self.model {
            Some(ModelKey::Is(r)) => r.voxels().is_some(),
            Some(ModelKey::Auto) => false,
            None => true,
        };
        if !shown {
            return Err(
                ".model: a volume has voxels alone; for this one make an object of kind = \
                 \"cloth\" of its fabric"
                    .into(),
            );
        }
        Ok(())
    }
}

impl ObjectKind for VolumeTable {
    fn check(&self, at: &At<'_>) -> Result<()> {
        self.check_keys(at.as_fibres, at.scene_path)
            .map_err(|why| at.fail(why))
    }

    fn extent_mm(&self) -> Option<[f32; 4]> {
        self.extent_mm
    }

    fn describe(&self, at: &At<'_>, options: &BuildOptions<'_>) -> Result<Value> {
        let allowed = options.max_memory_bytes.unwrap_or_else(free_memory_bytes);
        let object = VolumeObject::new(self, at.index, options);
        let model = object.check(&mut Budget::new(allowed))?;
        Ok(json!({ "file": self.file, "model": model }))
    }

    fn media(
        &self,
        at: &At<'_>,
        camera: &Camera,
        options: &BuildOptions<'_>,
        budget: &mut Budget,
    ) -> Result<Vec<AnyMedium>> {
        let medium = VolumeObject::new(self, at.index, options).medium(camera, budget)?;
        Ok(vec![medium])
    }
}

fn format_of(path: &Path) -> Result<&'static Format, String> {
    format::by_name(&path.to_string_lossy()).ok_or_else(|| {
        let endings: Vec<String> = FORMATS.iter().map(|f| format!(".{}", f.ending)).collect();
        format!(
            ".file: {}: expected a name that ends in {}",
            path.display(),
            endings.join(", ")
        )
    })
}

/// A volume that is a scene's object, opened.
struct VolumeObject<'a> {
    table: &'a VolumeTable,
    index: usize,
    path: PathBuf,
    options: &'a BuildOptions<'a>,
}

/// What there is to render, and how.
enum Content {
    /// A voxelized cloth with its fabric.
    Cloth(Box<Fabric>, Octree, ShownAs, &'static VoxelBuild),
    /// Voxels without a fabric, and how their materials scatter: a scan, or a cloth whose
    /// fabric was not kept.
    Bare(Octree, Vec<FlakeOptics>),
    /// Grids.
    Grids(GridSet),
}

impl<'a> VolumeObject<'a> {
    /// The object of this index.
    pub fn new(
        table: &'a VolumeTable,
        index: usize,
        options: &'a BuildOptions<'a>,
    ) -> VolumeObject<'a> {
        VolumeObject {
            table,
            index,
            path: read::beside(options.scene_path, &table.file),
            options,
        }
    }

    fn fail(&self, why: impl AsRef<str>) -> InputError {
        let key = format!("object[{}]{}", self.index, why.as_ref());
        InputError::keyed(key).in_file(self.options.scene_path)
    }

    /// Reads the file and checks the table against it; says how it will be shown.
    ///
    /// # Errors
    /// Those of [`VolumeObject::medium`].
    pub fn check(&self, budget: &mut Budget) -> Result<String> {
        drape::mesh(self.table.mesh_keys(), self.index, self.options)?;
        Ok(match self.open(budget)? {
            Content::Cloth(_, _, shown, _) => shown.to_string(),
            Content::Bare(..) | Content::Grids(_) => ShownAs::usual(&MICROFLAKE).to_string(),
        })
    }

    /// The medium.
    ///
    /// # Errors
    /// Names the file, or the key at fault.
    pub fn medium(&self, camera: &Camera, budget: &mut Budget) -> Result<AnyMedium> {
        let mesh = drape::mesh(self.table.mesh_keys(), self.index, self.options)?;
        let allowed = self.options.max_memory_bytes;
        let place = |bounds_mm| ClothPlace {
            bounds_mm,
            mesh: mesh.as_ref(),
            max_memory_bytes: allowed.unwrap_or_else(free_memory_bytes),
            loader: self.options.loader,
            scene_path: self.options.scene_path,
        };
        let table = self.table;
        match self.open(budget)? {
            Content::Cloth(fabric, octree, shown, voxels) => Laying {
                fabric: &fabric,
                path: &self.path,
                voxels,
                settings: shown.settings,
                lod: table.lod,
                scale: table.scale.unwrap_or(1.0),
                index: self.index,
                camera,
                options: self.options,
            }
            .medium(place(octree.bounds_mm()), octree),
            Content::Bare(octree, optics) => {
                let octree = match table.scale {
                    None => octree,
                    Some(scale) => octree
                        .scaled(f64::from(scale))
                        .ok_or_else(|| self.fail(".scale: the volume does not stay finite"))?,
                };
                let octree = Arc::new(octree);
                let place = place(octree.bounds_mm());
                let levels = match table.lod {
                    Lod::Level(level) => Levels::only(level),
                    Lod::Name(LodName::Auto) => {
                        let widths = place.footprints_mm(camera);
                        Levels::for_footprints(&octree, 0, f32::INFINITY, None, widths)
                    }
                    Lod::Name(_) => Levels::only(0),
                };
                let volume = |level| {
                    let (octree, optics) = (Arc::clone(&octree), optics.clone());
                    let family = FlakeFamily::SGGX_SPECULAR;
                    let medium = FlakeOctreeMedium::new(octree, level, optics, family);
                    Ok(medium.map(AnyMedium::FlakeOctree))
                };
                levels
                    .medium(&place, None, volume)?
                    .ok_or_else(|| self.no_level(octree.level_count()))
            }
            Content::Grids(set) => {
                let medium = AnyMedium::Grid(self.grids(set)?);
                let bounds_mm = medium.cell_grid().map_or(Aabb::EMPTY, |g| g.bounds_mm());
                let mut medium = Some(medium);
                Levels::only(0)
                    .medium(&place(bounds_mm), None, |_| Ok(medium.take()))?
                    .ok_or_else(|| self.no_level(1))
            }
        }
    }

    fn no_level(&self, count: u8) -> InputError {
        self.fail(format!(
            ".lod: there is no such level; the volume has {count}, from 0"
        ))
    }

    /// Reads the file and settles how it is shown.
    fn open(&self, budget: &mut Budget) -> Result<Content> {
        let format = format_of(&self.path).map_err(|why| self.fail(why))?;
        let volume = volume_file::read(&self.path, self.options.loader, |source| {
            (format.read)(source, budget)
        })?;
        match volume {
            Volume::Octree(stored) => self.octree(stored),
            Volume::Grids(set) => {
                self.check_grids(&set)?;
                Ok(Content::Grids(set))
            }
        }
    }

    fn octree(&self, stored: Stored) -> Result<Content> {
        let table = self.table;
        let octree = match table.repeat_xy {
            Some(repeats) if repeats != stored.octree.repeats() => {
                stored.octree.with_repeats(repeats)
            }
            _ => stored.octree,
        };
        let octree = match table.density_scale {
            None => octree,
            Some(factor) => octree.with_density(f64::from(factor)).ok_or_else(|| {
                self.fail(".density_scale: the density of the volume does not stay finite")
            })?,
        };
        if table.extent_mm.is_some() && !octree.repeats() {
            return Err(self.fail(": extent_mm belongs to repeat_xy = true"));
        }
        let levels = octree.level_count();
        match table.lod {
            Lod::Level(level) if level >= levels => return Err(self.no_level(levels)),
            Lod::Name(LodName::Surface) => {
                let why = ".lod: a volume has no surface; take a level, \"volume\" or \"auto\"";
                return Err(self.fail(why));
            }
            _ => {}
        }
        let keys = table.as_cloth().scattering();
        if stored.files.is_empty() {
            self.check_plain_flakes(
                "the file keeps no materials: voxelize its fabric again for others",
            )?;
            self.check_optics(&[])?;
            let optics = vec![self.flakes(None)?; octree.material_count()];
            return Ok(Content::Bare(octree, optics));
        }
        if let Some(scan) = ScanFile::find(&self.path, &stored.files)? {
            self.check_plain_flakes("the file is a scan, whose fibres are known voxel by voxel")?;
            let optics = scan.flakes(&table.optics, octree.material_count());
            let optics = optics.map_err(|why| self.fail(format!(".optics{why}")))?;
            return Ok(Content::Bare(octree, optics));
        }
        let mut fabric = fabric_file::from_sources(&self.path, &stored.files)?;
        fabric
            .override_optics(&table.optics)
            .map_err(|why| self.fail(format!(".optics{why}")))?;
        let known = fabric.cloth.materials().len();
        if known < octree.material_count() {
            return Err(InputError::of_file(
                &self.path,
                format!(
                    "its voxels have {} materials, its fabric {known}",
                    octree.material_count()
                ),
            ));
        }
        // What the fabric is shown as otherwise may have no voxels.
        let mut own = fabric.file.scattering;
        match own.model {
            Some(ModelKey::Is(r)) if r.voxels().is_none() => own.model = None,
            Some(ModelKey::Auto) => own.model = None,
            _ => {}
        }
        let shown = keys.over(own).map_err(|why| self.fail(why))?;
        let Some(voxels) = shown.representation.voxels() else {
            return Err(self.fail(".model: a volume has voxels alone"));
        };
        if table.density_scale.is_some() && voxels.footprint == FibreFootprint::Axis {
            return Err(self.fail(
                ".density_scale: packed fibres have the density of their yarns; use model = \
                 \"microflake\"",
            ));
        }
        if voxels.footprint != octree.footprint() {
            let name = |f| match f {
                FibreFootprint::Covered => "covered",
                FibreFootprint::Axis => "axis",
            };
            self.options.loader.warn(
                &self.path,
                format!(
                    "it was voxelized with --footprint {}; {shown} needs {}, and outlines of \
                     yarns are off by a fibre's radius",
                    name(octree.footprint()),
                    name(voxels.footprint)
                ),
            );
        } else if octree.footprint() == FibreFootprint::Axis && octree.packing().is_none() {
            self.options.loader.warn(
                &self.path,
                "it has no measured packing factors, and derived ones are used: voxelize its \
                 fabric again",
            );
        }
        Ok(Content::Cloth(Box::new(fabric), octree, shown, voxels))
    }
}
