//! The crate from outside. Each module describes itself.

mod presets;
mod segment;
mod table_precision;
mod woven_surface;
