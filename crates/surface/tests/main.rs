//! The crate from outside. Each module describes itself.
#![allow(clippy::unwrap_used)] // helpers outside test functions

mod presets;
mod segment;
mod table_precision;
mod woven_surface;
