//! Files of measured values that models are compared with or fitted to.

use crate::context::Context;
use crate::error::{InputError, of_file};
use anyhow::Result;
use organza_measure::{PairValue, parse_values, read_klems};
use organza_scene::file_kind::Wanted;
use std::path::Path;

/// Pairs of measured data that are taken at most.
const MAX_DATA: usize = 2000;

/// Measured values of a file, thinned evenly to what is compared.
///
/// # Errors
/// Names the file and the place.
pub fn read(path: &Path, context: &Context) -> Result<Vec<PairValue>> {
    let text = context.loader().text_of(path, Wanted::Text)?;
    let is_xml = path
        .extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("xml"));
    let list = if is_xml {
        let bsdf = read_klems(&text).map_err(|e| of_file(path, e))?;
        bsdf.pairs()
    } else {
        parse_values(&text).map_err(|e| InputError::from(e).in_file(path))?
    };
    let step = list.len().div_ceil(MAX_DATA).max(1);
    // Steps that share no factor with the width of a matrix visit all of it.
    Ok(list.into_iter().step_by(step).collect())
}
