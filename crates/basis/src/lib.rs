//! The foundation of every organza crate: vectors in frames, rays and boxes,
//! colour, random numbers, quadrature, curve segments and running moments.
//!
//! # Conventions
//! - Lengths are millimetres and names say so (`_mm`), extinction is per
//!   millimetre (`_per_mm`), angles are radians (`_rad`). Files use degrees.
//! - The fabric frame is right-handed: x along the weft, y along the warp, z
//!   out of the face of the cloth.
//! - Directions are unit vectors that point away from the point they belong to.
//! - Colour is linear Rec.709 in `f32`.
//! - Nothing here reads a file or prints.

pub mod aabb;
pub mod alias_table;
pub mod budget;
pub mod cell_grid;
pub mod curve;
pub mod frame;
pub mod hypothesis;
pub mod mixture;
pub mod moments;
pub mod nearest_name;
pub mod quadrature;
pub mod ray;
pub mod rgb;
pub mod rng;
pub mod spread;
pub mod sym3;
pub mod warp;
pub mod watch;

pub use aabb::Aabb;
pub use alias_table::AliasTable;
pub use budget::{Budget, OverBudget};
pub use cell_grid::{CellGrid, CellSpan, Cells, LocalRay, MAX_PERIODS};
pub use curve::{Segment, SegmentSource, Tile};
pub use frame::Frame;
pub use mixture::{FibrePopulation, MAX_POPULATIONS, MergedFlakes, Mixture};
pub use moments::Moments;
pub use nearest_name::nearest_name;
pub use ray::Ray;
pub use rgb::Rgb;
pub use rng::{PathRng, mix64};
pub use sym3::Sym3;
pub use watch::{Stopped, Watch, unwatched};
