//! The crate from outside.
#![allow(clippy::unwrap_used, clippy::disallowed_methods)] // helpers outside test functions

/// Cloths of blocks show the voxels of their exemplar.
mod blocks;
/// Hand-made cloth to voxelize.
mod cloth;
/// A dense grid of the same data; the density estimate of the course notes.
mod dense;
/// Files give back what was put in and refuse damage.
mod files;
/// What coarse voxels keep of the light.
mod lod;
/// Planted fibres are found where they were put.
mod planted;
/// OpenVDB files.
mod vdb;
