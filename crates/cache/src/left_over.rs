//! Temporary files: under them entries are written, and killed processes leave some.

use std::fs::File;
use std::path::Path;
use std::time::{Duration, SystemTime};
use tempfile::NamedTempFile;

/// Ending of the names of temporary files.
const ENDING: &str = ".tmp";

/// After this time a temporary file is taken for left over even where the file system passes
/// no locks on.
const DAY: Duration = Duration::from_secs(24 * 3600);

/// A new temporary file in the folder, locked as long as it is open, which shows other
/// processes that it is in use.
pub fn temporary_file(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix("new.").suffix(ENDING).rand_bytes(12);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666)); // less the umask
    }
    loop {
        let file = builder.tempfile_in(folder)?;
        // Another process may have taken it for left over before it was locked.
        let _ = file.as_file().try_lock();
        if file.path().exists() {
            return Ok(file);
        }
    }
}

/// Removes a file if it is a temporary one that no process writes.
pub fn remove_if_left_over(path: &Path) {
    let name = path.file_name().and_then(|name| name.to_str());
    let middle = name.and_then(|name| name.strip_prefix("new.")?.strip_suffix(ENDING));
    if !middle.is_some_and(|m| m.len() == 12 && m.chars().all(char::is_alphanumeric)) {
        return;
    }
    let is_free = |file: File| match file.try_lock() {
        Ok(()) => true,
        Err(std::fs::TryLockError::WouldBlock) => false,
        Err(std::fs::TryLockError::Error(_)) => {
            let written = file.metadata().and_then(|about| about.modified());
            written.is_ok_and(|t| SystemTime::now().duration_since(t).is_ok_and(|d| d > DAY))
        }
    };
    if File::open(path).is_ok_and(is_free) {
        let _ = std::fs::remove_file(path);
    }
}
