//! The commands: one file each, with its flags and what it does with them.
//!
//! A new command is a file with a [`clap::Args`] that implements [`Command`],
//! and a line in [`COMMANDS`]. Help, completions and manual pages follow.

mod bake;
mod bench;
mod cache;
mod compare;
mod completions;
mod contact_sheet;
mod denoise;
mod develop;
mod difference;
mod export;
mod fit;
mod info;
mod library;
mod man;
mod measure;
mod merge;
mod render;
mod run;
mod scan;
mod table;
mod view;
mod voxelize;
mod weave;

use anyhow::Result;
use clap::ArgMatches;
use clap::error::ErrorKind;
use organza_requests::{Output, Request};
use organza_work::Context;
use std::ffi::OsString;
use std::path::Path;

/// Every command, in the order in which the help lists them.
const COMMANDS: &[Registration] = &[
    Registration::of::<render::RenderArgs>(),
    Registration::of::<run::RunArgs>(),
    Registration::of::<view::ViewArgs>(),
    Registration::of::<merge::MergeArgs>(),
    Registration::of::<voxelize::VoxelizeArgs>(),
    Registration::of::<scan::ScanArgs>(),
    Registration::of::<measure::MeasureArgs>(),
    Registration::of::<table::TableArgs>(),
    Registration::of::<compare::CompareArgs>(),
    Registration::of::<difference::DifferenceArgs>(),
    Registration::of::<denoise::DenoiseArgs>(),
    Registration::of::<develop::DevelopArgs>(),
    Registration::of::<fit::FitArgs>(),
    Registration::of::<bench::BenchArgs>(),
    Registration::of::<weave::WeaveArgs>(),
    Registration::of::<export::ExportArgs>(),
    Registration::of::<bake::BakeArgs>(),
    Registration::of::<library::LibraryArgs>(),
    Registration::of::<info::InfoArgs>(),
    Registration::of::<cache::CacheCommand>(),
    Registration::of::<completions::CompletionsArgs>(),
    Registration::of::<man::ManArgs>(),
];

/// The flags of one command.
trait Command: clap::Args {
    /// The word after `organza`.
    const NAME: &'static str;

    /// Does what the flags ask for.
    ///
    /// # Errors
    /// [`organza_work::InputError`] where the input is wrong; anything else
    /// failed while running.
    fn run(&self) -> Result<()>;
}

/// Runs a request and writes what it finds to the path, where there is one.
fn run_to<R: Request>(request: &R, path: Option<&Path>, context: Context) -> Result<R::Output> {
    let mut request = request.clone();
    let outputs = path.map(|path| request.prepare_for(path)).transpose()?;
    let found = request.run(&Context {
        outputs: outputs.unwrap_or_default(),
        ..context
    })?;
    if let Some(path) = path {
        found.write(path)?;
    }
    Ok(found)
}

/// A command without its type.
struct Registration {
    name: &'static str,
    define: fn() -> clap::Command,
    run: fn(&ArgMatches) -> Result<Result<()>, clap::Error>,
}

impl Registration {
    const fn of<C: Command>() -> Registration {
        Registration {
            name: C::NAME,
            define: || C::augment_args(clap::Command::new(C::NAME)),
            run: |matches| Ok(C::from_arg_matches(matches)?.run()),
        }
    }
}

/// The definition of the whole command line, from which help, completions and
/// manual pages are made.
pub fn definition() -> clap::Command {
    let program = clap::Command::new("organza")
        .version(env!("CARGO_PKG_VERSION"))
        .about("Volumetric cloth renderer: weave drafts to fibres to light")
        .subcommand_required(true)
        .arg_required_else_help(true)
        .arg(
            clap::Arg::new(VERBOSE)
                .long(VERBOSE)
                .action(clap::ArgAction::SetTrue)
                .help("With --version: print commit, features and engines, too"),
        )
        .after_help("Try first:\n  organza render twill-3-1-s -o twill.png\n  organza render my_draft.wif -o my_draft.png\n  organza weave twill-3-1-s -o draft.png")
        .subcommands(COMMANDS.iter().map(|c| (c.define)()));
    with_negative_numbers(program)
}

/// Name of the flag that goes with `--version`.
const VERBOSE: &str = "verbose";

/// Whether a command line that asks for the version asks for all about the build.
pub fn is_verbose(arguments: &[OsString]) -> bool {
    arguments.iter().any(|a| a == "--verbose")
}

/// Runs the command that was parsed with [`definition`].
///
/// # Errors
/// The outer error is one of the command line, the inner one the command's.
pub fn run(matches: &ArgMatches) -> Result<Result<()>, clap::Error> {
    if matches.get_flag(VERBOSE) {
        return Err(definition().error(
            ErrorKind::ArgumentConflict,
            "--verbose goes with --version; commands print less with --quiet",
        ));
    }
    let (name, matches) = matches.subcommand().unwrap_or(("", matches));
    match COMMANDS.iter().find(|c| c.name == name) {
        Some(command) => (command.run)(matches),
        None => Err(definition().error(
            ErrorKind::InvalidSubcommand,
            format!("{name}: no such command"),
        )),
    }
}

/// A negative number after a flag is a wrong value of that flag, not another
/// flag, so that the message is about the value.
fn with_negative_numbers(command: clap::Command) -> clap::Command {
    let with = |a: clap::Arg| match a.get_action().takes_values() && !a.is_positional() {
        true => a.allow_negative_numbers(true),
        false => a,
    };
    command
        .mut_args(with)
        .mut_subcommands(with_negative_numbers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_definition_is_consistent() {
        definition().debug_assert();
    }

    #[test]
    fn every_command_has_a_description_and_an_example() {
        fn check(command: &clap::Command) {
            let name = command.get_name();
            if command.has_subcommands() {
                return command.get_subcommands().for_each(check);
            }
            assert!(command.get_about().is_some(), "{name}: no description");
            let after = command.get_after_help().map(ToString::to_string);
            let example = after.is_some_and(|text| text.contains("Example"));
            assert!(example, "{name}: no example");
        }
        definition().get_subcommands().for_each(check);
    }
}
