//! Numbers of one path, or of many side by side: a formula is written once, over [`Floats`].
//!
//! - [`lanes`], [`one`]: what lanes can do; two vectors as one; one lane.
//! - [`math`]: vectors in space, elementary functions, random numbers.
//! - [`Backend`], [`dispatch`]: which instructions there are, and entering their code.

#![allow(missing_docs)] // of the operations of lanes, which the traits describe

pub mod backend;
pub mod dispatch;
pub mod lanes;
pub mod math;
#[cfg(test)]
mod math_tests;
pub mod one;
mod prefetch;
#[cfg(target_arch = "x86_64")]
mod vector;
mod words;

pub use backend::Backend;
pub use lanes::{Floats, Ints, MAX_LANES, Mask, SetBits};
pub use math::V3;
pub use prefetch::prefetch;
pub use words::{vector_of, word_of};
