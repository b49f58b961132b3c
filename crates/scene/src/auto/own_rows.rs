//! The bench of a fabric, in a file beside it.

use super::table::{Row, Traits};
use super::table_file;
use crate::error::{InputError, Result};
use crate::loader::Loader;
use std::path::{Path, PathBuf};

/// What the name of a fabric file ends in, in place of its own ending, for its bench.
pub const ENDING: &str = "choices.csv";

/// The largest file that is read: about 20,000 rows.
const MAX_BYTES: u64 = 4 << 20;

/// Where the bench of a fabric file is.
pub fn beside(fabric: &Path) -> PathBuf {
    fabric.with_extension(ENDING)
}

/// The rows of the bench beside a fabric file that were measured on this fabric; `None` if there is
/// no bench, or, with a warning, if the fabric is another one since.
///
/// # Errors
/// A file that cannot be read, is too large or is no bench.
pub(super) fn own_rows(
    path: &Path,
    traits: &Traits,
    loader: &Loader<'_>,
) -> Result<Option<Vec<Row>>> {
    let file = beside(path);
    if loader.unreachable(&file).is_some() {
        return Ok(None);
    }
    let fail = |why: String| InputError::of_file(&file, why);
    if let Some(found) = loader.file_bytes(&file).filter(|n| *n > MAX_BYTES) {
        return Err(fail(format!(
            "has {found} bytes; expected the choices.csv of a bench, which has at most {MAX_BYTES}"
        )));
    }
    let rows = table_file::rows(&loader.bytes(&file)?).map_err(fail)?;
    let own: Vec<Row> = rows
        .into_iter()
        .filter(|r| r.traits.is_of(traits))
        .collect();
    if own.is_empty() {
        loader.warn(
            &file,
            format!(
                "was measured on another fabric than {}; model = \"auto\" leaves it out",
                path.display()
            ),
        );
        return Ok(None);
    }
    Ok(Some(own))
}
