//! Patches to measure: what stands for the cloth of a fabric file.

use crate::error::{Result, input};
use crate::fabric_file::Fabric;
use crate::loader::Loader;
use crate::scattering::{ScatteringModel, ScatteringTable};
use glam::{DVec3, UVec2, Vec2};
use organza_basis::SegmentSource;
use organza_measure::{PatchResponse, SurfacePatch, TexelGrid, VolumePatch};
use organza_transport::{
    AnyMedium, Camera, CameraPose, FibreEvent, Integrator, PixelFilter, Projection, Scene,
};
use organza_volume::Octree;
use std::path::Path;
use std::sync::Arc;

/// A patch of whatever kind.
pub type AnyPatch = Box<dyn PatchResponse>;

/// How to make the volume.
#[derive(Clone, Copy, Debug)]
pub struct PatchOptions<'a> {
    /// Reports progress.
    pub loader: &'a Loader<'a>,
    /// Edge of the finest voxels; the fabric's own if none.
    pub voxel_um: Option<f32>,
    /// Level of detail.
    pub level: u8,
    /// Limit on memory.
    pub max_memory_bytes: Option<u64>,
}

/// What stands for a cloth that is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PatchModel {
    /// Its fibres as the fabric's `[scattering]` says, micro-flakes if nothing.
    Volume,
    /// Every fibre of the fabric, as it is: the ground truth of the others.
    Fibres,
    /// Virtual scattering off fibres among others.
    Packed,
    /// Virtual scattering off points, in the far field.
    Plain,
    /// The reflectance model of the fabric's `[surface]` section.
    Surface,
}

impl PatchModel {
    /// All of them.
    pub const ALL: [PatchModel; 5] = [
        PatchModel::Volume,
        PatchModel::Fibres,
        PatchModel::Packed,
        PatchModel::Plain,
        PatchModel::Surface,
    ];

    /// The model of a name.
    pub fn named(name: &str) -> Option<PatchModel> {
        PatchModel::ALL.into_iter().find(|m| m.name() == name)
    }

    /// What it is, for the help of the command line.
    pub fn help(self) -> &'static str {
        match self {
            PatchModel::Volume => {
                "Its fibres as the fabric's [scattering] says, micro-flakes if nothing"
            }
            PatchModel::Fibres => {
                "Every fibre of the fabric, as it is: the ground truth of the others"
            }
            PatchModel::Packed => "Virtual scattering off fibres among others",
            PatchModel::Plain => "Virtual scattering off points, in the far field",
            PatchModel::Surface => "The reflectance model of the fabric's [surface] section",
        }
    }

    /// Its name in files and reports.
    pub fn name(self) -> &'static str {
        match self {
            PatchModel::Volume => "volume",
            PatchModel::Fibres => "fibres",
            PatchModel::Packed => "packed",
            PatchModel::Plain => "plain",
            PatchModel::Surface => "surface",
        }
    }
}

/// What stands for a cloth, whatever its fibres' colour and roughness.
pub enum Matter {
    /// A surface model.
    Surface,
    /// Every fibre by itself.
    Fibres,
    /// Voxels, what their fibres scatter like, and their level.
    Voxels(Arc<Octree>, ScatteringModel, u8),
}

impl Matter {
    /// The matter of a fabric; voxels are made here.
    ///
    /// # Errors
    /// Names the file and the key at fault.
    pub fn new(
        fabric: &Fabric,
        path: &Path,
        model: PatchModel,
        options: &PatchOptions<'_>,
    ) -> Result<Matter> {
        let scattering = match model {
            PatchModel::Surface => return Ok(Matter::Surface),
            PatchModel::Fibres => return Ok(Matter::Fibres),
            PatchModel::Volume => ScatteringTable::default()
                .over(fabric.file.scattering)
                .map_err(|why| input(format!("{}: scattering{why}", path.display())))?,
            PatchModel::Plain => ScatteringModel::Fibres(FibreEvent::Plain),
            PatchModel::Packed => ScatteringModel::Fibres(FibreEvent::Packed),
        };
        if scattering == ScatteringModel::Explicit {
            return Ok(Matter::Fibres);
        }
        let octree = fabric.voxelize(
            path,
            scattering.footprint(),
            options.voxel_um,
            None,
            options.max_memory_bytes,
            options.loader,
        )?;
        let (level, levels) = (options.level, octree.level_count());
        if level >= levels {
            return Err(input(format!(
                "--level {level}: the octree has {levels} levels, from 0"
            )));
        }
        Ok(Matter::Voxels(octree.into(), scattering, level))
    }

    /// The endless cloth with the optics of a fabric of the same geometry.
    ///
    /// # Errors
    /// Names the file and the key at fault.
    pub fn patch(
        &self,
        fabric: &Fabric,
        path: &Path,
        options: &PatchOptions<'_>,
    ) -> Result<AnyPatch> {
        let medium = match self {
            Matter::Surface => return Ok(Box::new(SurfacePatch(fabric.surface(path)?.surface))),
            Matter::Fibres => {
                fabric.explicit_fibres(path, options.max_memory_bytes, options.loader)?
            }
            Matter::Voxels(octree, scattering, level) => {
                let medium = scattering.medium(fabric, path, octree.clone(), *level)?;
                medium.ok_or_else(|| input(format!("{}: no voxels", path.display())))?
            }
        };
        volume_patch(path, medium)
    }
}

/// The endless cloth of a fabric.
///
/// # Errors
/// Names the file and the key at fault.
pub fn fabric_patch(
    fabric: &Fabric,
    path: &Path,
    model: PatchModel,
    options: &PatchOptions<'_>,
) -> Result<AnyPatch> {
    Matter::new(fabric, path, model, options)?.patch(fabric, path, options)
}

fn volume_patch(path: &Path, medium: AnyMedium) -> Result<AnyPatch> {
    // A goniometer has no camera, but every scene does.
    let pose = CameraPose {
        origin_mm: DVec3::Z,
        target_mm: DVec3::ZERO,
        up: DVec3::Y,
    };
    let projection = Projection::Orthographic { width_mm: 1.0 };
    let scene = Scene {
        media: vec![medium],
        lights: Vec::new(),
        camera: Camera::new(projection, pose, UVec2::ONE, PixelFilter::Box)
            .map_err(|e| input(format!("{}: {e}", path.display())))?,
    };
    let patch = VolumePatch::new(scene, Integrator::Woodcock)
        .map_err(|e| input(format!("{}: {e}", path.display())))?;
    Ok(Box::new(patch))
}

/// Texels over one tile of a fabric, `longer` of them along its longer side.
pub fn texel_grid(fabric: &Fabric, longer: u32) -> TexelGrid {
    let bounds = fabric.cloth.tile().bounds_mm;
    let size: Vec2 = bounds.size().truncate();
    let texels = (size / size.max_element() * longer as f32).round();
    TexelGrid {
        low_mm: bounds.min.truncate(),
        size_mm: size,
        texels: texels.as_uvec2().max(UVec2::ONE),
    }
}
