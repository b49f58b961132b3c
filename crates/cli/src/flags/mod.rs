//! Every command and flag; help, completions and man pages come from here.

mod bench;
mod compare;
mod export;
mod fit;
mod manual;
mod measure;
mod render;
mod values;
mod voxelize;
mod weave;

pub use bench::BenchArgs;
pub use compare::CompareArgs;
pub use export::{ExportArgs, ExportTo, MitsubaArgs};
pub use fit::{FitArgs, FitWhat};
pub use manual::{CompletionsArgs, ManArgs};
pub use measure::{LayoutName, MeasureArgs, PatchModel};
pub use render::{BackendName, MergeArgs, RenderArgs};
pub use values::parse_bytes;
pub use voxelize::VoxelizeArgs;
pub use weave::{CurveLevel, InfoArgs, WeaveArgs};

use clap::{Args, CommandFactory, Parser, Subcommand};
use values::{parse_micrometres, whole};

/// Volumetric cloth renderer: weave drafts to fibres to light.
#[derive(Debug, Parser)]
#[command(
    name = "organza",
    version,
    arg_required_else_help = true,
    after_help = "Try first:\n  organza render scenes/first_light.toml -o first_light.png\n  organza weave twill-3-1-s -o twill.png"
)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Path-trace a scene to .exr (linear, with variance and AOVs) or .png
    Render(RenderArgs),
    /// Combine renders of disjoint sample ranges into the unbroken render, exactly
    Merge(MergeArgs),
    /// Turn one tile of a fabric into a volume file
    Voxelize(VoxelizeArgs),
    /// Measure reflection and transmission of a patch of cloth
    Measure(MeasureArgs),
    /// Compare the models of a fabric with each other or with measured values
    Compare(CompareArgs),
    /// Find the surface or the fibres that measured values ask for
    Fit(FitArgs),
    /// Measure speed against error of every choice there is for a cloth
    Bench(BenchArgs),
    /// Draw a draft or a fabric's weave
    Weave(WeaveArgs),
    /// Write a scene for another renderer
    Export(ExportArgs),
    /// Tell what is in a draft, fabric, scene, volume, curve or picture file, and what is wrong with it
    Info(InfoArgs),
    /// Print the completions of a shell
    Completions(CompletionsArgs),
    /// Write the manual pages
    Man(ManArgs),
}

/// The definition of the whole command line.
pub fn command() -> clap::Command {
    let scene = "Override any key of the scene file, e.g. --set render.seed=7 or --set object.0.fabric=my.toml (repeatable)";
    let either = "Override any key of the fabric or scene file, e.g. --set warp.per_cm=30 for a fabric, --set render.seed=7 for a scene (repeatable)";
    let bench = "Override any key of the scenes in which choices are compared, e.g. --set render.max_bounces=64 (repeatable); what a choice is made of stays. For another fabric give its file";
    with_negative_numbers(Arguments::command())
        .mut_subcommand("render", |c| with_help_of_set(c, scene))
        .mut_subcommand("export", |c| {
            c.mut_subcommands(|c| with_help_of_set(c, scene))
        })
        .mut_subcommand("measure", |c| with_help_of_set(c, either))
        .mut_subcommand("info", |c| with_help_of_set(c, either))
        .mut_subcommand("bench", |c| with_help_of_set(c, bench))
}

/// A negative number is a wrong value, to be told so, and no unknown flag.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let with = |a: clap::Arg| match a.get_action().takes_values() && !a.is_positional() {
        true => a.allow_negative_numbers(true),
        false => a,
    };
    command
        .mut_args(with)
        .mut_subcommands(with_negative_numbers)
}

/// Most commands take fabrics; the keys of scenes are others.
fn with_help_of_set(command: clap::Command, help: &'static str) -> clap::Command {
    command.mut_arg("set", |a| a.help(help))
}

/// Flags that every command takes.
#[derive(Debug, Args)]
pub struct CommonArgs {
    /// Threads to use [default: all cores]; the result does not depend on it
    #[arg(long, value_name = "N", value_parser = whole::<u16>(1..=u64::from(u16::MAX)))]
    pub threads: Option<u16>,
    /// Say nothing but errors
    #[arg(long)]
    pub quiet: bool,
    /// Override any key of the fabric file, e.g. --set warp.per_cm=30 (repeatable)
    #[arg(long, value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
}

/// How much memory may be used.
#[derive(Debug, Args)]
pub struct MemoryArgs {
    /// Refuse to use more memory than this, e.g. 2GiB [default: what is free]
    #[arg(long, value_name = "SIZE", allow_hyphen_values = true, value_parser = parse_bytes)]
    pub max_memory: Option<u64>,
}

/// How fine a fabric is voxelized.
#[derive(Debug, Args)]
pub struct VoxelArgs {
    /// Edge of the finest voxels, micrometres [default: the fabric's]
    #[arg(long, value_name = "UM", value_parser = parse_micrometres)]
    pub voxel_um: Option<f32>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        command().debug_assert();
    }
}
