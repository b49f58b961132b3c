//! Volumes of fabrics that are kept from run to run.

use crate::error::Result;
use crate::loader::Loader;
use crate::memory::free_memory_bytes;
use organza_basis::{Budget, Watch};
use organza_cache::{Cache, Description, Key};
use organza_volume::ovox::{self, SourceFile};
use organza_volume::{Error, FibreFootprint, Octree, VoxelizeOptions, VoxelizePlan};
use std::io::ErrorKind;
use std::path::Path;

/// The kind of these entries.
const KIND: &str = "volume";

/// A folder of results, and the program whose results they are.
#[derive(Clone, Debug)]
pub struct ResultCache {
    /// The folder.
    pub cache: Cache,
    /// Version and build of the program: other builds may compute other results.
    pub program: String,
}

/// A fabric's voxelization that has not begun.
pub struct VolumePlan<'a> {
    plan: VoxelizePlan<'a>,
    voxel_mm: f32,
    footprint: FibreFootprint,
    wanted_um: Option<f32>,
}

impl<'a> VolumePlan<'a> {
    /// A plan with the options that it was made with, and the voxels' edge that fibres want if
    /// they had to be larger.
    pub(crate) fn new(
        plan: VoxelizePlan<'a>,
        options: &VoxelizeOptions,
        wanted_um: Option<f32>,
    ) -> VolumePlan<'a> {
        VolumePlan {
            plan,
            voxel_mm: options.voxel_mm,
            footprint: options.footprint,
            wanted_um,
        }
    }

    /// Edge of the finest voxels that was asked for, mm.
    pub fn voxel_mm(&self) -> f32 {
        self.voxel_mm
    }

    /// The edge that fibres want if voxels had to be larger, um.
    pub(crate) fn wanted_um(&self) -> Option<f32> {
        self.wanted_um
    }

    /// Levels that the octree will have.
    pub fn level_count(&self) -> u8 {
        self.plan.level_count()
    }

    /// Estimated peak memory, bytes.
    pub fn memory_bytes(&self) -> u64 {
        self.plan.memory_bytes()
    }

    /// Voxelizes; see [`VoxelizePlan::run`].
    pub(crate) fn run(&self, progress: Watch<'_, f32>) -> Result<Octree, Error> {
        self.plan.run(progress)
    }

    /// The key of the volume, which depends on nothing else: not on memory, threads or the
    /// name of the fabric file, whose text comes first.
    fn key(&self, sources: &[SourceFile], program: &str) -> Key {
        let voxel = self.voxel_mm.to_bits().to_le_bytes();
        let shape = [
            self.level_count(),
            match self.footprint {
                FibreFootprint::Covered => 0,
                FibreFootprint::Axis => 1,
            },
        ];
        let mut parts: Vec<&[u8]> = vec![program.as_bytes(), &voxel, &shape];
        for (index, file) in sources.iter().enumerate() {
            let name = if index == 0 { "" } else { &file.name };
            parts.extend([name.as_bytes(), &file.bytes]);
        }
        Key::of(KIND, &parts)
    }

    fn description(&self, path: &Path, program: &str) -> Description {
        let footprint = match self.footprint {
            FibreFootprint::Covered => "covered",
            FibreFootprint::Axis => "axis",
        };
        Description {
            kind: KIND.into(),
            name: path.display().to_string(),
            details: format!(
                "{:.3} um, {} levels, {footprint}",
                self.voxel_mm * 1e3,
                self.level_count()
            ),
            program: program.into(),
        }
    }
}

/// The volume of a plan, from the loader's cache if it has one with this volume, otherwise
/// built and kept there. `build` says whether what it built may be kept. A cache that fails
/// is a warning.
///
/// # Errors
/// Those of `build`.
pub(crate) fn cached(
    sources: &[SourceFile],
    path: &Path,
    plan: &VolumePlan<'_>,
    max_memory_bytes: Option<u64>,
    loader: &Loader<'_>,
    build: impl FnOnce() -> Result<(Octree, bool)>,
) -> Result<Octree> {
    let Some(ResultCache { cache, program }) = loader.cache() else {
        return build().map(|(octree, _)| octree);
    };
    let key = plan.key(sources, program);
    let entry = cache.path(&key);
    let allowed = max_memory_bytes.unwrap_or_else(free_memory_bytes);
    match read(cache, &key, allowed) {
        Ok(Some(octree)) => {
            loader.note_reused(path);
            return Ok(octree);
        }
        Ok(None) => {}
        Err(why) => loader.warn(&entry, format!("{why}; the volume is built anew")),
    }
    let (octree, may_be_kept) = build()?;
    if may_be_kept {
        let about = plan.description(path, program);
        let kept = cache.write(&key, &about, |out| {
            ovox::write(&octree, &[], out).map_err(|e| match e {
                Error::Io(e) => e,
                e => std::io::Error::other(e),
            })
        });
        match kept {
            Ok(true) => {}
            Ok(false) => loader.warn(
                path,
                format!(
                    "its volume is not kept in the cache, whose limit of {} bytes is too small",
                    cache.limit_bytes()
                ),
            ),
            Err(e) => {
                let folder = cache.folder();
                loader.warn(folder, format!("cannot keep a volume in this cache: {e}"));
            }
        }
    }
    Ok(octree)
}

/// The volume of a key. `None` where there is none, or too little memory for it.
///
/// # Errors
/// Says what is wrong with the entry. If it is damaged, it is removed.
fn read(cache: &Cache, key: &Key, allowed: u64) -> Result<Option<Octree>, String> {
    let bytes = match cache.read(key, allowed) {
        Ok(None) => return Ok(None),
        Ok(Some(bytes)) => bytes,
        Err(e) if e.kind() == ErrorKind::InvalidData => return Err(format!("{e}")),
        Err(e) => return Err(format!("cannot be read: {e}")),
    };
    let mut budget = Budget::new(allowed.saturating_sub(bytes.len() as u64));
    match ovox::read(&mut &bytes[..], &mut budget) {
        Ok(stored) => Ok(Some(stored.octree)),
        Err(Error::Budget(_)) => Ok(None),
        Err(e) => {
            cache.remove(key);
            Err(e.to_string())
        }
    }
}
