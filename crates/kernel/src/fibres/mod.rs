//! Explicit fibres: sorted into cells, and walked by waves of paths.
//!
//! Every fibre is a chain of cylinders (or cones, where it tapers). A ray leaves
//! the surface of one and meets the next after a few radii, so that a grid of
//! cells, each with copies of what reaches into it, is walked faster than a
//! hierarchy is descended ([`cells`]). Sixteen pieces are held against one ray at
//! a time ([`block`]), every ray of a wave looks into one cell in turn ([`walk`]),
//! and the events of a wave are computed lane by lane ([`organza_scatter::near`]).
//!
//! A fibre is met where a ray enters it from outside; what starts inside a fibre
//! leaves it freely. Pieces of one radius meet in the plane that halves their
//! bend, up to which their sides go on; other joints and ends are round.

pub(crate) mod block;
pub(crate) mod body;
mod branches;
pub(crate) mod cache;
mod cell_ray;
mod cell_search;
pub(crate) mod cells;
mod copies;
pub mod exhaustive;
pub(crate) mod fibre_scene;
mod grid;
#[cfg(test)]
mod hit_tests;
pub(crate) mod hull;
mod importance;
mod joint_table;
pub(crate) mod lists;
pub(crate) mod matter;
pub(crate) mod met_fibres;
mod own_frame;
mod paths;
mod plane;
mod reached;
mod several;
pub(crate) mod shade;
mod shadows;
mod strands;
mod trip;
pub(crate) mod walk;
pub(crate) mod work;

pub use body::FibreBody;
pub use cache::{CacheMode, CachePlan, CacheReport, ErrorMap, KeptLight, LearnWatch, Stopped};
pub use cells::Unfit;
pub use fibre_scene::FibreScene;
pub use matter::{FibreEntry, FibreMatter};
pub use plane::{LIFT, Plane};
pub use strands::{Joint, Strand, Strands};
