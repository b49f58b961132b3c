//! Engines for processors: one path in each lane of a vector.

mod fibre_engine;
mod fibre_probe;
mod records;
mod voxel_engine;

pub use fibre_engine::FibreEngine;
pub use fibre_probe::{FibreProbe, ProbePaths};
pub use records::{AVX2, AVX512, SCALAR};
pub use voxel_engine::VoxelEngine;
