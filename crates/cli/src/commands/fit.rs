//! `organza fit`

use super::{Command, run_to};
use crate::flags::WorkArgs;
use crate::terminal;
use anyhow::Result;
use clap::error::ErrorKind;
use clap::{ArgMatches, Args, FromArgMatches};
use organza_requests::Fit;
use organza_requests::requests::{TARGETS, Target, TargetName};
use std::path::PathBuf;

/// The flags of every target.
#[derive(Debug, Args)]
struct TargetArgs {
    #[command(flatten)]
    fit: Fit,
    /// Fabric or scene file to write, with the fitted values
    #[arg(short, long)]
    outfile: PathBuf,
    /// Print the figures as JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    work: WorkArgs,
}

/// `organza fit`: a command for each target.
#[derive(Debug)]
pub struct FitArgs(TargetArgs);

/// The command of a target, whose help has its own flags alone.
fn command_of(target: &'static Target) -> clap::Command {
    let elsewhere = |flag: &str| {
        let is_taken = |t: &Target| t.fields.contains(&flag);
        TARGETS.iter().any(|t| is_taken(t)) && !is_taken(target)
    };
    TargetArgs::augment_args(clap::Command::new(target.name))
        .about(target.about)
        .after_help(format!(
            "Example:\n  organza fit {} {}",
            target.name, target.example
        ))
        .mut_args(|a| match elsewhere(a.get_id().as_str()) {
            true => a.hide(true),
            false => a,
        })
}

impl Args for FitArgs {
    fn augment_args(command: clap::Command) -> clap::Command {
        command
            .about("Find the surface, fibre, ply or volume parameters that match measured values, a picture or photographs")
            .subcommand_required(true)
            .arg_required_else_help(true)
            .allow_external_subcommands(true)
            // The spelling of before, for a hint.
            .arg(clap::Arg::new("what").long("what").hide(true))
            .subcommands(TARGETS.iter().map(|target| command_of(target)))
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        FitArgs::augment_args(command)
    }
}

impl FromArgMatches for FitArgs {
    fn from_arg_matches(matches: &ArgMatches) -> Result<FitArgs, clap::Error> {
        let what = matches.get_one::<String>("what");
        let (name, matches) = matches.subcommand().unwrap_or(("", matches));
        let target = TargetName::named(name).filter(|_| what.is_none());
        let Some(target) = target else {
            let names: Vec<&str> = TARGETS.iter().map(|t| t.name).collect();
            let names = names.join(", ");
            let named = what.and_then(|what| TargetName::named(what));
            let example = named.unwrap_or_default().target().name;
            let why = format!(
                "expected what to fit first, one of {names}: write `organza fit {example} ...`\n"
            );
            return Err(clap::Error::raw(ErrorKind::InvalidSubcommand, why));
        };
        let mut args = TargetArgs::from_arg_matches(matches)?;
        args.fit.target = target;
        Ok(FitArgs(args))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = FitArgs::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Command for FitArgs {
    const NAME: &'static str = "fit";

    fn run(&self) -> Result<()> {
        let args = &self.0;
        let fitted = run_to(&args.fit, Some(&args.outfile), args.work.context())?;
        if args.json {
            terminal::print_json(&fitted.json())?;
        }
        args.work.note(fitted.lines());
        Ok(())
    }
}
