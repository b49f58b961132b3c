//! The engine for graphics adapters, by way of `wgpu`.
//!
//! One program walks all paths: a lane has a path, and takes the next sample in its place
//! when it ends. Shaders in WGSL mirror the sources of the walk for processors, of which
//! they read the same buffers and draw the same random numbers; the arithmetic of adapters
//! rounds differently, so both agree within the noise, and not in every bit. Shaders use
//! numbers of 32 bits, and neither atomic numbers with a point nor operations of subgroups.
//!
//! Every pixel has slots, and each slot one lane at a time, whose sums are whole numbers:
//! the same adapter and seed give the same bits, however work is divided ([`slots`]).
//! Dispatches are short, and lanes keep their paths in a buffer between them ([`pass`]).

mod adapters;
mod bodies;
mod cell_tables;
mod device;
mod engine;
mod fibre_scene;
mod numbers;
mod pass;
mod program;
mod record;
mod scene_words;
mod slots;
mod tables;
mod voxel_scene;

pub(crate) use adapters::devices;
pub use engine::GpuEngine;
pub use pass::Division;
pub use program::check_source;
pub use record::GPU;
