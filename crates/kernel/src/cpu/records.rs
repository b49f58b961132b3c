//! The engines for processors as they are registered: one for each back end.

use super::fibre_engine::FibreEngine;
use super::voxel_engine::VoxelEngine;
use crate::engine::EngineRecord;
use organza_lanes::Backend;

/// One lane.
pub const SCALAR: EngineRecord = EngineRecord {
    name: Backend::Scalar.name(),
    summary: "The kernel, one path at a time",
    needs: Backend::Scalar.needs(),
    is_available: || Backend::Scalar.is_available(),
    is_automatic: || Backend::Scalar.is_available(),
    for_voxels: |scene| Ok(Box::new(VoxelEngine::new(scene, Backend::Scalar)?)),
    for_fibres: |scene| Ok(Box::new(FibreEngine::new(scene, Backend::Scalar)?)),
};

/// Lanes of AVX2.
pub const AVX2: EngineRecord = EngineRecord {
    name: Backend::Avx2.name(),
    summary: "The kernel, 16 paths at a time",
    needs: Backend::Avx2.needs(),
    is_available: || Backend::Avx2.is_available(),
    is_automatic: || Backend::Avx2.is_available(),
    for_voxels: |scene| Ok(Box::new(VoxelEngine::new(scene, Backend::Avx2)?)),
    for_fibres: |scene| Ok(Box::new(FibreEngine::new(scene, Backend::Avx2)?)),
};

/// Lanes of AVX-512.
pub const AVX512: EngineRecord = EngineRecord {
    name: Backend::Avx512.name(),
    summary: "The kernel, 32 paths at a time",
    needs: Backend::Avx512.needs(),
    is_available: || Backend::Avx512.is_available(),
    is_automatic: || Backend::Avx512.is_available(),
    for_voxels: |scene| Ok(Box::new(VoxelEngine::new(scene, Backend::Avx512)?)),
    for_fibres: |scene| Ok(Box::new(FibreEngine::new(scene, Backend::Avx512)?)),
};
