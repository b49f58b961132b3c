//! Scene and fabric files: reading, checking and building them.
//!
//! This crate opens the files that scenes and fabrics name. It prints nothing and
//! keeps no state of its own: a [`loader::Loader`] records the files it read, holds
//! the warnings and reports progress.
#![allow(clippy::disallowed_methods)] // opens the files that scenes and fabrics name

pub mod auto;
pub mod bare_fabric;
mod blocks;
mod build_options;
pub mod camera;
pub mod cloth_place;
pub mod crease;
pub mod crush;
mod curl;
pub mod draft_folder;
mod draft_picture;
pub mod drape;
pub mod environment_file;
mod error;
mod exemplar_voxels;
pub mod fabric_file;
mod fabric_table;
mod fabric_volume;
pub mod far_table;
mod fibre_model;
pub mod file_kind;
mod finish_optics;
pub mod fringe;
mod given_files;
mod large_design;
pub mod level;
pub mod light_pictures;
mod loaded_scene;
pub mod loader;
pub mod memory;
pub mod mitsuba;
pub mod object;
pub mod optics;
pub mod overrides;
pub mod patches;
pub mod ply_table;
mod print_file;
pub mod read;
pub mod representation;
pub mod scan_file;
pub mod scattering;
pub mod scene_build;
pub mod scene_file;
pub mod stitch;
pub mod stroke;
pub mod studio;
pub mod subject;
mod toml_reader;
pub mod usd_curves;
mod volume_cache;
pub mod volume_file;
mod woven_volume;

pub use build_options::BuildOptions;
pub use error::{InputError, Result};
pub use given_files::GivenFiles;
pub use loaded_scene::{LoadedScene, from_str, load};
pub use volume_cache::{ResultCache, VolumePlan};
