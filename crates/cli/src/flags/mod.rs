//! Flags that several commands share. The flags of one command stand in its
//! own file below `commands`.

pub mod display;
pub mod patch_model;
pub mod set_help;
pub mod studio;
pub mod values;

use crate::host::{Host, Watch};
use clap::Args;
use std::ffi::OsString;
use values::{parse_bytes, parse_micrometres, whole};

/// Flags that every command takes.
#[derive(Clone, Debug, Args)]
pub struct CommonArgs {
    /// Threads to use [default: all cores]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = whole::<u16>(1..=u64::from(u16::MAX)))]
    pub threads: Option<u16>,
    /// Print only errors
    #[arg(long)]
    pub quiet: bool,
    /// Override any key of the fabric file, e.g. --set warp.per_cm=30 (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Who runs the command.
    #[arg(skip)]
    pub host: Host,
}

impl<'a> From<&'a CommonArgs> for Watch<'a> {
    fn from(common: &'a CommonArgs) -> Watch<'a> {
        Watch {
            is_quiet: common.quiet,
            host: Some(&common.host),
        }
    }
}

/// How much memory may be used.
#[derive(Clone, Debug, Args)]
pub struct MemoryArgs {
    /// Refuse to use more memory than this, e.g. 2GiB [default: what is free]
    #[arg(long, value_name = "SIZE", allow_hyphen_values = true, value_parser = parse_bytes)]
    pub max_memory: Option<u64>,
}

/// Where results are kept from run to run.
#[derive(Clone, Debug, Default, Args)]
pub struct CacheArgs {
    /// Keep built volumes in this folder, and take them from there: a folder, "auto" (the user's cache folder) or "off" [default: the variable ORGANZA_CACHE, off without it]; see `organza cache`
    #[arg(long, value_name = "FOLDER")]
    pub cache: Option<OsString>,
}

/// How fine a fabric is voxelized.
#[derive(Debug, Args)]
pub struct VoxelArgs {
    /// Edge of the finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM", value_parser = parse_micrometres)]
    pub voxel_um: Option<f32>,
}
