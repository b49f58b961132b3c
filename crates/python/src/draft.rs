//! Weave drafts.

use crate::array::{Buffer, buffer};
use crate::errors::input;
use organza_requests::{Array, Numbers};
use organza_scene::InputError;
use organza_weave::Draft;
use organza_weave::draft::Thread;
use pyo3::prelude::*;
use std::collections::HashMap;

/// A draft's title, warnings and arrays. `word` is the name of a weave; with `bytes` they are a
/// WIF file of that name, with `rows` a drawdown.
///
/// Arrays: `warp_up` (picks, ends), the first pick first, 1 where the warp is on the face;
/// `warp_colour` (ends, 3) and `weft_colour` (picks, 3), linear, NaN where the draft has none;
/// `warp_spacing_mm` and `weft_spacing_mm`, NaN likewise.
pub fn read_draft<'py>(
    py: Python<'py>,
    word: &str,
    bytes: Option<&[u8]>,
    rows: Option<Vec<String>>,
) -> PyResult<(String, Vec<String>, HashMap<&'static str, Buffer<'py>>)> {
    let draft = match (bytes, rows) {
        (Some(bytes), _) => Draft::from_wif(bytes),
        (None, Some(rows)) => Draft::from_drawdown(&rows),
        (None, None) => Draft::named(word),
    };
    let draft = draft.map_err(|e| match bytes {
        Some(_) => input(py, &InputError::from(e).in_file(word)),
        None => input(py, &InputError::new(format!("{word}: {e}"))),
    })?;
    let (ends, picks) = (draft.ends(), draft.picks());
    let cells = (0..picks).flat_map(|p| (0..ends).map(move |e| (e, p)));
    let up = cells.map(|(e, p)| u8::from(draft.warp_up(e, p))).collect();
    let mut arrays = HashMap::new();
    let mut add = |name, shape: Vec<usize>, numbers| -> PyResult<()> {
        arrays.insert(name, buffer(py, &Array { shape, numbers })?);
        Ok(())
    };
    add("warp_up", vec![picks, ends], Numbers::U8(up))?;
    add("warp_colour", vec![ends, 3], colours(&draft.warp))?;
    add("weft_colour", vec![picks, 3], colours(&draft.weft))?;
    add("warp_spacing_mm", vec![ends], spacings(&draft.warp))?;
    add("weft_spacing_mm", vec![picks], spacings(&draft.weft))?;
    Ok((draft.title.clone(), draft.warnings.clone(), arrays))
}

fn colours(threads: &[Thread]) -> Numbers {
    let of = |t: &Thread| t.colour.map_or([f32::NAN; 3], |c| c.0.to_array());
    Numbers::F32(threads.iter().flat_map(of).collect())
}

fn spacings(threads: &[Thread]) -> Numbers {
    let of = |t: &Thread| t.spacing_mm.unwrap_or(f32::NAN);
    Numbers::F32(threads.iter().map(of).collect())
}
