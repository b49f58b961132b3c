//! Many paths at once through matter laid out as plain buffers.
//!
//! Matter that is described by the trait [`Matter`], with lights and a camera, becomes a
//! [`FlatScene`]; explicit fibres become a [`fibres::FibreScene`]. Both are data and
//! know no back end. An [`Engine`] fills films with their paths. [`ENGINES`] lists the
//! engines. Those for processors walk one path in each lane of a vector; with the feature
//! `gpu` there is one for graphics adapters. The source of a walk is written once for every [`Backend`], so the back end
//! makes no difference to any bit of the picture.
//!
//! The kernel knows neither the general walk nor its media. What it cannot render is a
//! [`Refusal`]. The general walk is its oracle: both estimate the same picture with
//! other random numbers.
//!
//! In voxels, parallel light and the light of what has a place come from tables of optical depths,
//! which an occasional exact shadow ray corrects; environments are found by paths that
//! escape, and bright parts of environment pictures by shadow rays.
//!
//! # Modules
//! - [`cpu`]: the engines for processors; their lanes are [`organza_lanes`].
//! - [`gpu`]: the engine for graphics adapters, with the feature `gpu`.
//! - [`fibres`]: explicit fibres in cells, and the walk of waves of paths among them.
//! - [`voxels`]: micro-flakes and virtual fibres in voxels, and the walk of lanes
//!   through them.
//! - [`packed`]: packed fibres in voxels, whose events are those of explicit fibres.
//! - [`proofs`]: scenes that are wrong on purpose, for tests.

mod block;
mod catalogue;
#[allow(missing_docs)]
mod cpu;
mod devices;
mod drawn_light;
mod engine;
pub mod fibres;
#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(not(feature = "gpu"))]
mod gpu_absent;
mod laid_out;
mod matter;
pub mod packed;
pub mod proofs;
mod refusal;
mod reserve;
pub mod roulette;
mod voxels;

pub use block::{Block, Takes};
pub use catalogue::{CPU_ENGINES, ENGINES, devices, engine_named};
pub use cpu::{FibreEngine, FibreProbe, ProbePaths, VoxelEngine};
pub use devices::{DeviceKind, DeviceSummary};
pub use engine::{Engine, EngineRecord, Lost, MadeEngine};
pub use laid_out::LaidOut;
pub use matter::{
    MAX_DIM, Matter, MatterBlocks, NO_YARN, Population, Scatterers, Substance, Unsuited,
};
pub use organza_lanes::Backend;
pub use refusal::Refusal;
pub use reserve::Reserve;
pub use voxels::fibre_tables::end_on_ratio;
pub use voxels::flat_scene::{FlatScene, View};
