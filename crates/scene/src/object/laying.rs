//! A cloth or volume in voxels, laid out in the levels of detail that a scene asks for.

use crate::build_options::BuildOptions;
use crate::cloth_place::ClothPlace;
use crate::error::{InputError, Result};
use crate::fabric_file::Fabric;
use crate::far_table::far_sheet;
use crate::level::{Levels, Lod, LodName};
use crate::representation::{Settings, VoxelBuild, VoxelSource};
use organza_transport::{AnyMedium, Camera};
use organza_volume::Octree;
use std::path::Path;
use std::sync::Arc;

/// A cloth in voxels, to be laid out.
pub(crate) struct Laying<'a> {
    /// The fabric.
    pub fabric: &'a Fabric,
    /// The file that the voxels are from.
    pub path: &'a Path,
    /// What is built from them.
    pub voxels: &'a VoxelBuild,
    /// Values of the representation's own keys.
    pub settings: Settings,
    /// Level of detail.
    pub lod: Lod,
    /// How many times as large as its fabric it is.
    pub scale: f32,
    /// The object's index.
    pub index: usize,
    /// Who looks at it.
    pub camera: &'a Camera,
    /// Files and limits.
    pub options: &'a BuildOptions<'a>,
}

impl Laying<'_> {
    /// The medium of an octree in the fabric's own size. Its box becomes that of
    /// `place`.
    ///
    /// # Errors
    /// Names the file and the key at fault.
    pub fn medium(&self, mut place: ClothPlace<'_>, octree: Octree) -> Result<AnyMedium> {
        let Laying {
            fabric,
            path,
            voxels,
            lod,
            scale,
            options,
            ..
        } = *self;
        let fail = |why: &str| {
            let index = self.index;
            InputError::keyed(format!("object[{index}]{why}")).in_file(options.scene_path)
        };
        if place.mesh.is_some() && !octree.repeats() {
            return Err(fail(".mesh: needs a cloth that repeats; this one does not"));
        }
        let finest = (voxels.finest_level)(&octree, fabric.cloth.materials());
        let octree = if scale == 1.0 {
            octree
        } else {
            let scaled = octree.scaled(f64::from(scale));
            scaled.ok_or_else(|| fail(".scale: the cloth does not stay finite"))?
        };
        let octree = Arc::new(octree);
        place.bounds_mm = octree.bounds_mm();
        let sheet = match lod {
            // A surface model has the size of its fabric.
            Lod::Name(LodName::Auto) if scale == 1.0 => far_sheet(fabric, path, options.loader)?,
            _ => None,
        };
        let (name, levels) = match lod {
            Lod::Level(level) => (format!("level {level}"), Levels::only(level)),
            Lod::Name(LodName::Auto) => {
                let repeat_mm = sheet.as_ref().map(|s| s.repeat_mm);
                let widths = place.footprints_mm(self.camera);
                let spacing_mm = scale * fabric.thread_spacing_mm();
                let levels = Levels::for_footprints(&octree, finest, spacing_mm, repeat_mm, widths);
                ("auto".into(), levels)
            }
            Lod::Name(_) => ("volume".into(), Levels::only(0)),
        };
        let volume = |level| {
            (voxels.medium)(&VoxelSource {
                fabric,
                path,
                octree: Arc::clone(&octree),
                level,
                settings: self.settings,
                max_memory_bytes: options.max_memory_bytes,
                loader: options.loader,
            })
        };
        levels.medium(&place, sheet, volume)?.ok_or_else(|| {
            let levels = octree.level_count();
            fail(&format!(
                ".lod: {name} does not exist; the cloth has {levels}, from 0"
            ))
        })
    }
}
