//! Stages that make cloth of a scan: flat, in its own frame, with yarns, repeating.

use super::ScanJob;
use anyhow::Result;
use organza_basis::Budget;
use organza_scan::{ScannedField, SheetStages, made_cloth};
use organza_work::of_file;

/// Bytes of the labels of a voxel while yarns are separated.
const LABEL_BYTES: u64 = 3;

/// The least periods of a tile.
pub fn parse_period(text: &str) -> Result<[u32; 2], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y]) if x > 0 && y > 0 => Ok([x, y]),
        _ => Err("expected two whole numbers above 0, X,Y".into()),
    }
}

/// Takes the stages that were asked for.
///
/// # Errors
/// A stage that fails; too little memory.
pub fn made(
    args: &ScanJob,
    field: ScannedField,
    name: &str,
    budget: &mut Budget,
) -> Result<ScannedField> {
    if args.flatten.is_none() && !args.yarns && !args.tile {
        return Ok(field);
    }
    let voxels = field.dims().as_u64vec3().element_product();
    let needed = 2 * field.memory_bytes() + LABEL_BYTES * voxels;
    let fail = |why: String| of_file(name, why);
    budget
        .take(needed, "voxels in the frame of the cloth")
        .map_err(|e| fail(e.to_string()))?;
    let stages = SheetStages {
        flatten: args.flatten,
        yarns: args.yarns,
        tile: args.tile.then_some(args.least_period),
    };
    let (field, found) = made_cloth(field, &stages).map_err(|e| fail(e.to_string()))?;
    for line in found.lines() {
        args.context.note(format!("{name}: {line}"));
    }
    Ok(field)
}
