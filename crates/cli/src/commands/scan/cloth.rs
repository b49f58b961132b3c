//! Flags that make cloth of a scan: flat, in its own frame, with yarns, repeating.

use crate::error::of_file;
use crate::flags::values::whole;
use crate::output::note;
use anyhow::Result;
use clap::Args;
use organza_basis::Budget;
use organza_scan::{MAX_DEGREE, ScannedField, SheetStages, made_cloth};

/// Bytes of the labels of a voxel while yarns are separated.
const LABEL_BYTES: u64 = 3;

/// The stages after the scan itself.
#[derive(Args, Debug)]
pub struct ClothArgs {
    /// Turn the cloth flat: z out of its face, x along the weft, and bends subtracted as a polynomial of heights of this degree, 0 to 6 (0: a plane) [default: 4, where the flag has no value]
    #[arg(long, value_name = "DEGREE", num_args = 0..=1, require_equals = true, default_missing_value = "4", value_parser = whole::<u32>(0..=u64::from(MAX_DEGREE)))]
    pub flatten: Option<u32>,
    /// Tell warp and weft apart, as two materials with optics of their own
    #[arg(long)]
    pub yarns: bool,
    /// Cut a tile that repeats in x and y without a seam
    #[arg(long)]
    pub tile: bool,
    /// Least periods of the tile along x and y, voxels [default: half of the scan]
    #[arg(long, value_name = "X,Y", requires = "tile", value_parser = parse_period)]
    pub least_period: Option<[u32; 2]>,
}

fn parse_period(text: &str) -> Result<[u32; 2], String> {
    let numbers: Option<Vec<u32>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y]) if x > 0 && y > 0 => Ok([x, y]),
        _ => Err("expected two whole numbers above 0, X,Y".into()),
    }
}

impl ClothArgs {
    /// Takes the stages that were asked for.
    ///
    /// # Errors
    /// A stage that fails; too little memory.
    pub fn made(
        &self,
        field: ScannedField,
        name: &str,
        budget: &mut Budget,
        is_quiet: bool,
    ) -> Result<ScannedField> {
        if self.flatten.is_none() && !self.yarns && !self.tile {
            return Ok(field);
        }
        let voxels = field.dims().as_u64vec3().element_product();
        let needed = 2 * field.memory_bytes() + LABEL_BYTES * voxels;
        let fail = |why: String| of_file(name, why);
        budget
            .take(needed, "voxels in the frame of the cloth")
            .map_err(|e| fail(e.to_string()))?;
        let stages = SheetStages {
            flatten: self.flatten,
            yarns: self.yarns,
            tile: self.tile.then_some(self.least_period),
        };
        let (field, found) = made_cloth(field, &stages).map_err(|e| fail(e.to_string()))?;
        if !is_quiet {
            for line in found.lines() {
                note!("{name}: {line}");
            }
        }
        Ok(field)
    }
}
