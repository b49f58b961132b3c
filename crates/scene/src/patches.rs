//! Patches to measure: the representations of a fabric file's cloth.

use crate::error::{InputError, Result};
use crate::fabric_file::Fabric;
use crate::loader::Loader;
use crate::representation::plies::{fibres_and_hairs, parameters};
use crate::representation::{Build, ModelKey, Representation, ShownAs, VoxelSource};
use crate::scattering::ScatteringTable;
use glam::{UVec2, Vec2};
use organza_basis::SegmentSource;
use organza_measure::{PatchResponse, SurfacePatch, TexelGrid, VolumePatch};
use organza_transport::{AnyMedium, ExplicitFibres, Integrator, Plies};
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

/// Which representation of a cloth is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PatchModel {
    /// The one that the fabric's `[scattering]` names; micro-flakes if none.
    Own,
    /// One with settings by default, but for a flake that `[scattering]` names.
    Is(&'static Representation),
}

impl PatchModel {
    /// How the cloth of a fabric is shown.
    ///
    /// # Errors
    /// Keys of `[scattering]` that contradict each other; names the file.
    pub fn of(self, fabric: &Fabric, path: &Path) -> Result<ShownAs> {
        let named = ScatteringTable {
            model: match self {
                PatchModel::Own => None,
                PatchModel::Is(representation) => Some(ModelKey::Is(representation)),
            },
            ..ScatteringTable::default()
        };
        named
            .over(fabric.file.scattering)
            .map_err(|why| InputError::keyed(format!("scattering{why}")).in_file(path))
    }
}

/// What stands for a cloth, whatever its fibres' colour and roughness.
pub enum Matter {
    /// A surface.
    Surface(ShownAs),
    /// Explicit fibres.
    Fibres(Box<ExplicitFibres>, ShownAs),
    /// Plies.
    Plies(Box<Plies>, ShownAs),
    /// Voxels, how they scatter, and their level.
    Voxels(Arc<Octree>, ShownAs, u8),
}

impl Matter {
    /// The matter of a fabric; voxels are made and fibres are gathered here.
    ///
    /// # Errors
    /// Names the file and the key at fault.
    pub fn new(
        fabric: &Fabric,
        path: &Path,
        shown: ShownAs,
        options: &PatchOptions<'_>,
    ) -> Result<Matter> {
        let voxels = match &shown.representation.build {
            Build::Surface(_) => return Ok(Matter::Surface(shown)),
            Build::ExplicitFibres(trace) => {
                let fibres = trace(fabric, path, options.max_memory_bytes, options.loader)?;
                return Ok(Matter::Fibres(Box::new(fibres), shown));
            }
            Build::Plies(trace) => {
                let plies = trace(fabric, path, options.max_memory_bytes, options.loader)?;
                return Ok(Matter::Plies(Box::new(plies), shown));
            }
            Build::Voxels(voxels) => voxels,
        };
        let octree = fabric.voxelize(
            path,
            voxels.footprint,
            options.voxel_um,
            None,
            options.max_memory_bytes,
            options.loader,
        )?;
        let (level, levels) = (options.level, octree.level_count());
        if level >= levels {
            return Err(InputError::after_option(
                "level",
                format!("{level}: the octree has {levels} levels, from 0"),
            ));
        }
        Ok(Matter::Voxels(octree.into(), shown, level))
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
            Matter::Surface(shown) => match &shown.representation.build {
                Build::Surface(surface) => {
                    return Ok(Box::new(SurfacePatch(
                        surface(fabric, path, options.loader)?.surface,
                    )));
                }
                _ => None,
            },
            Matter::Fibres(fibres, _) => {
                let scattering = fabric.fibre_models(path)?;
                let fibres = fibres.with_scattering(scattering);
                let fibres = fibres.map_err(|e| InputError::of_file(path, e))?;
                Some(AnyMedium::ExplicitFibres(fibres))
            }
            Matter::Plies(plies, _) => {
                let fibres = fibres_and_hairs(fabric, path)?;
                let plies = plies.with_scattering(&parameters(fabric), fibres);
                let plies = plies.map_err(|e| InputError::of_file(path, e))?;
                Some(AnyMedium::Plies(plies))
            }
            Matter::Voxels(octree, shown, level) => match shown.representation.voxels() {
                Some(voxels) => (voxels.medium)(&VoxelSource {
                    fabric,
                    path,
                    octree: Arc::clone(octree),
                    level: *level,
                    settings: shown.settings,
                    max_memory_bytes: options.max_memory_bytes,
                    loader: options.loader,
                })?,
                None => None,
            },
        };
        let medium = medium.ok_or_else(|| InputError::of_file(path, "no voxels"))?;
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
    shown: ShownAs,
    options: &PatchOptions<'_>,
) -> Result<AnyPatch> {
    Matter::new(fabric, path, shown, options)?.patch(fabric, path, options)
}

fn volume_patch(path: &Path, medium: AnyMedium) -> Result<AnyPatch> {
    let patch = VolumePatch::of_media(vec![medium], Integrator::Woodcock)
        .map_err(|e| InputError::of_file(path, e))?;
    Ok(Box::new(patch))
}

/// Texels over one tile of a fabric, `longer` of them along its longer side.
pub fn texel_grid(fabric: &Fabric, longer: u32) -> TexelGrid {
    let bounds = fabric.cloth.tile().bounds_mm;
    let size: Vec2 = fabric.tile_mm();
    let texels = (size / size.max_element() * longer as f32).round();
    TexelGrid {
        low_mm: bounds.min.truncate(),
        size_mm: size,
        texels: texels.as_uvec2().max(UVec2::ONE),
    }
}
