//! `organza fit`

mod fibres;
mod picture;
mod surface;

use super::with_threads;
use crate::error::input;
use crate::file_kind::Wanted;
use crate::flags::{FitArgs, FitWhat, PatchModel};
use crate::output::note;
use crate::patches::PatchOptions;
use crate::{output, read};
use anyhow::{Context, Result};
use organza_measure::Effort;
use organza_measure::fit::Determined;
use serde_json::json;
use std::fmt::Write as _;
use toml::{Table, Value};

/// Runs the command.
pub fn run(args: &FitArgs) -> Result<()> {
    let is_fabric = |e: &std::ffi::OsStr| e.eq_ignore_ascii_case("toml");
    if !args.outfile.extension().is_some_and(is_fabric) {
        return Err(input(format!(
            "{}: expected a name that ends in .toml",
            args.outfile.display()
        )));
    }
    output::check_not_an_input(&args.outfile, &[&args.fabric])?;
    output::check_writable(&args.outfile)?;
    if let Some(journal) = &args.journal {
        output::check_writable(journal)?;
    }
    if args.model == PatchModel::Surface {
        return Err(input("--model: a surface cannot stand for the volume"));
    }
    with_threads(&args.common, || match args.what {
        FitWhat::Surface => surface::run(args),
        FitWhat::Fibres => fibres::run(args),
        FitWhat::Picture => picture::run(args),
    })
}

fn options(args: &FitArgs) -> PatchOptions {
    PatchOptions {
        voxel_um: args.voxel.voxel_um,
        level: 0,
        max_memory_bytes: args.memory.max_memory,
        quiet: args.common.quiet,
    }
}

fn effort(args: &FitArgs) -> Effort {
    Effort {
        paths: args.spp,
        seed: args.seed,
        target_error: None,
    }
}

/// The fabric file as a table, with keys removed and replaced and names of other files
/// made valid beside the new one.
fn table(args: &FitArgs, removed: &[String], overrides: &[String]) -> Result<Table> {
    let mut keys = args.common.set.clone();
    keys.extend_from_slice(overrides);
    let mut table: Table = read::toml_changed(&args.fabric, removed, &keys, Wanted::Fabric)?;
    if let Some(Value::Table(draft)) = table.get_mut("draft") {
        for key in ["wif", "curves"] {
            if let Some(Value::String(name)) = draft.get_mut(key) {
                let there = std::path::absolute(read::beside(&args.fabric, name))?;
                *name = there.to_string_lossy().into_owned();
            }
        }
    }
    Ok(table)
}

fn finish(args: &FitArgs, table: &Table, parameters: &[Determined], words: &str) -> Result<()> {
    let command: Vec<String> = std::env::args().collect();
    let mut text = format!("# Fitted by: {}\n# {words}\n#\n", command.join(" "));
    for p in parameters {
        let _ = writeln!(
            text,
            "# {} = {:.4} +- {:.4}{}",
            p.name,
            p.value,
            p.se,
            if p.is_fixed {
                ""
            } else {
                ", not fixed by the data"
            }
        );
    }
    let _ = write!(
        text,
        "\n{}",
        toml::to_string(table).context("the fabric cannot be written")?
    );
    output::write_file(&args.outfile, |out| {
        out.write_all(text.as_bytes()).context("writing failed")
    })?;
    if args.json {
        let told = json!({ "parameters": parameters, "words": words });
        output::tell(&(serde_json::to_string_pretty(&told)? + "\n"))?;
    }
    if !args.common.quiet {
        note!("{words}");
        let loose: Vec<&str> = parameters
            .iter()
            .filter(|p| !p.is_fixed)
            .map(|p| p.name.as_str())
            .collect();
        if !loose.is_empty() {
            note!("not fixed by the data: {}", loose.join(", "));
        }
    }
    Ok(())
}
