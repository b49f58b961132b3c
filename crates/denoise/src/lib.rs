//! Removes noise from renders by Intel Open Image Denoise [Afra2019], a library that is loaded
//! where it is installed.
//!
//! - [`places`] lists where the library may be, [`Library::open`] loads it.
//! - [`Guides::of_film`] makes what helps it to tell fibres from noise.
//! - [`Library::denoise`] gives the picture without noise.
//!
//! `unsafe` stands in the file `library.rs` alone, beside its proof.
#![allow(clippy::disallowed_methods)] // looks for a library

mod guides;
mod library;
mod places;

pub use guides::Guides;
pub use library::{DenoiseError, Library, Settings};
pub use places::{Variables, places};
