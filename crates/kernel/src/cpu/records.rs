//! The engines for processors as they are registered: one for each back end.

use super::fibre_engine::FibreEngine;
use super::voxel_engine::VoxelEngine;
use crate::engine::EngineRecord;
use organza_lanes::Backend;

macro_rules! record {
    ($backend:expr, $summary:literal) => {
        EngineRecord {
            name: $backend.name(),
            summary: $summary,
            needs: $backend.needs(),
            is_available: || $backend.is_available(),
            is_automatic: || $backend.is_available(),
            for_voxels: |scene| Ok(Box::new(VoxelEngine::new(scene, $backend)?)),
            for_fibres: |scene| Ok(Box::new(FibreEngine::new(scene, $backend)?)),
        }
    };
}

/// One lane.
pub const SCALAR: EngineRecord = record!(Backend::Scalar, "The kernel, one path at a time");

/// Lanes of AVX2.
pub const AVX2: EngineRecord = record!(Backend::Avx2, "The kernel, 16 paths at a time");

/// Lanes of AVX-512.
pub const AVX512: EngineRecord = record!(Backend::Avx512, "The kernel, 32 paths at a time");
