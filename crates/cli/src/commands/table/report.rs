//! What `organza table` prints.

use super::{Made, TableArgs, Work};
use crate::output;
use crate::output::note;
use anyhow::Result;
use organza_scene::far_table;
use serde_json::{Value, json};
use std::sync::atomic::Ordering;

/// Prints what was made: `bytes` long, after so many seconds.
///
/// # Errors
/// An answer that cannot be written.
pub fn print(
    args: &TableArgs,
    work: &Work,
    made: &Made,
    about: Value,
    (bytes, seconds): (usize, f64),
) -> Result<()> {
    let paths = work.paths.load(Ordering::Relaxed);
    if args.json {
        let answer = json!({
            "file": args.outfile,
            "bytes": bytes,
            "memory_bytes": made.table.memory_bytes(),
            "nodes": made.table.rings().sphere(),
            "largest_row_error": made.residual,
            "paths": paths,
            "seconds": seconds,
            "about": about,
        });
        output::print(&(serde_json::to_string_pretty(&answer)? + "\n"))?;
    }
    if !args.common.quiet {
        note!(
            "{}: {} nodes, {} kB, from {} paths through {} in {seconds:.1} s",
            args.outfile.display(),
            made.table.rings().sphere(),
            bytes / 1000,
            paths,
            work.shown,
        );
        note!(
            "{} steps of sharpening; misfit of the means {:.2} of their noise",
            made.sharpened.steps,
            made.sharpened.misfit
        );
        for e in &made.errors {
            let kind = json!(e.kind);
            note!(
                "{}: {} held-out pairs, error {:.1} % rms (noise taken out), {:+.1} % in sum",
                kind.as_str().unwrap_or_default().replace('_', ", "),
                e.pairs,
                100.0 * e.rms,
                100.0 * e.bias
            );
        }
        if far_table::beside(&args.fabric) != args.outfile {
            note!(
                "model = \"table\" looks for it as {}",
                far_table::beside(&args.fabric).display()
            );
        }
    }
    Ok(())
}
