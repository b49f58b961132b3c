//! Asking for memory before it is needed.

#[cfg(target_arch = "x86_64")]
pub use super::vector::prefetch;

/// Processors without a vector back end fetch when they need to.
#[cfg(not(target_arch = "x86_64"))]
pub fn prefetch<T>(_: &[T], _: usize) {}
