//! Volume files of every format, opened.

use crate::error::{InputError, Result};
use crate::loader::Loader;
use crate::read;
use organza_volume::Error;
use organza_volume::format::Source;
use std::path::Path;

/// What `decode` makes of a volume file and those that belong to it.
///
/// # Errors
/// Names the file at fault.
pub fn read<T>(
    path: &Path,
    loader: &Loader<'_>,
    decode: impl FnOnce(&Source<'_>) -> Result<T, Error>,
) -> Result<T> {
    let open = |name: &str, max_bytes: u64| {
        let path = path.with_file_name(name);
        let Some(size) = loader.file_bytes(&path) else {
            return Ok(None);
        };
        if size > max_bytes {
            return Err(format!(
                "is {size} bytes long; {max_bytes} bytes of memory are allowed"
            ));
        }
        let bytes = loader
            .bytes_or_why(&path)
            .map_err(|e| read::io_message(&e))?;
        Ok(Some(bytes))
    };
    let source = Source {
        name: &path.file_name().unwrap_or_default().to_string_lossy(),
        open: &open,
    };
    decode(&source).map_err(|e| match e {
        Error::Beside { name, problem } => InputError::of_file(path.with_file_name(name), problem),
        Error::Unreadable(why) => {
            // A file of nearly that name is named, if there is one.
            read::unreachable(path).unwrap_or_else(|| InputError::of_file(path, why))
        }
        e => InputError::of_file(path, e),
    })
}
