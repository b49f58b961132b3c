//! Micro-flakes and virtual fibres in voxels on a processor.

use crate::block::Block;
use crate::engine::{Engine, Lost};
use crate::refusal::Refusal;
use crate::voxels::diffuse_flakes::DiffuseFlakes;
use crate::voxels::flat_scene::FlatScene;
use crate::voxels::lone_flakes::LoneFlakes;
use crate::voxels::mirrors::Mirrors;
use crate::voxels::scattering::Scattering;
use crate::voxels::virtual_fibres::VirtualFibres;
use crate::voxels::walk::walk;
use organza_film::Stats;
use organza_lanes::dispatch::{Job, dispatch_widest};
use organza_lanes::{Backend, Floats};
use std::sync::Arc;

/// Walks voxels on a processor.
pub struct VoxelEngine {
    scene: Arc<FlatScene>,
    backend: Backend,
}

impl VoxelEngine {
    /// An engine for a scene, with the instructions of a back end.
    ///
    /// # Errors
    /// When the processor lacks them.
    pub fn new(scene: Arc<FlatScene>, backend: Backend) -> Result<VoxelEngine, Refusal> {
        Refusal::without(backend)?;
        Ok(VoxelEngine { scene, backend })
    }
}

impl Engine for VoxelEngine {
    fn name(&self) -> &'static str {
        self.backend.name()
    }

    fn memory_bytes(&self) -> u64 {
        self.scene.memory_bytes()
    }

    fn take(&self, block: &mut Block<'_>) -> Result<Stats, Lost> {
        let scene = &*self.scene;
        Ok(dispatch_widest(self.backend, Walk { scene, block }))
    }
}

/// A block to walk.
struct Walk<'a, 'b, 'c> {
    scene: &'a FlatScene,
    block: &'b mut Block<'c>,
}

impl Job for Walk<'_, '_, '_> {
    type Output = Stats;
    #[inline(always)]
    fn run<F: Floats>(self) -> Stats {
        match self.scene.medium.scattering {
            Scattering::Mirrors => walk::<F, Mirrors<F>>(self.scene, self.block),
            Scattering::Diffuse => walk::<F, DiffuseFlakes<F>>(self.scene, self.block),
            Scattering::Flakes(_) => walk::<F, LoneFlakes<F>>(self.scene, self.block),
            Scattering::Fibres => walk::<F, VirtualFibres<F>>(self.scene, self.block),
        }
    }
}
