//! The crate from outside. Each module describes itself.
#![allow(clippy::unwrap_used, clippy::print_stdout)] // helpers outside test functions

mod closed_forms;
mod draped;
mod draped_fibres;
mod explicit_fibres;
mod fibre_models;
mod flake_media;
mod furnace;
mod kernel;
mod lights;
mod outlines;
mod scenes;
mod virtual_fibre_medium;
