//! Engines for processors: one path in each lane of a vector, and the numbers that lanes
//! compute with.

mod backend;
pub(crate) mod dispatch;
mod fibre_engine;
mod fibre_probe;
pub mod lanes;
pub mod math;
#[cfg(test)]
mod math_tests;
mod number;
mod prefetch;
mod records;
#[cfg(target_arch = "x86_64")]
pub mod vector;
mod voxel_engine;

pub use backend::Backend;
pub use fibre_engine::FibreEngine;
pub use fibre_probe::{FibreProbe, ProbePaths};
pub use prefetch::prefetch;
pub use records::{AVX2, AVX512, SCALAR};
pub use voxel_engine::VoxelEngine;
