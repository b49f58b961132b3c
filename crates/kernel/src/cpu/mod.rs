//! Lanes of processors: one path in each, and the numbers they compute with.

mod backend;
mod dispatch;
mod fibre_engine;
mod fibre_probe;
pub mod lanes;
pub mod math;
#[cfg(test)]
mod math_tests;
#[cfg(target_arch = "x86_64")]
pub mod vector;

pub use backend::Backend;
pub use dispatch::dispatch;
pub use fibre_engine::FibreEngine;
pub use fibre_probe::{FibreProbe, ProbePaths};
#[cfg(target_arch = "x86_64")]
pub use vector::prefetch;

/// Processors without a vector back end fetch when they need to.
#[cfg(not(target_arch = "x86_64"))]
pub fn prefetch<T>(_: &[T], _: usize) {}
