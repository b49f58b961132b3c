//! Temporary files and folders, which get their names when they are complete. Each is locked while
//! it is written: those that no process holds a lock on were left by killed ones.

use std::fs::{File, TryLockError};
use std::io;
use std::path::Path;
use std::time::{Duration, SystemTime};
use tempfile::{Builder, NamedTempFile, TempDir};

/// Ending of their names.
const ENDING: &str = ".tmp";

/// Characters of their names between what the caller chooses and the ending, at random: no other
/// process has the same ones, on this or another machine.
const RANDOM: usize = 12;

/// File in such a folder that is locked while the folder is filled.
const LOCK: &str = "lock";

/// Names of a folder that are looked through for what killed processes left.
const MAX_NAMES: usize = 100_000;

/// After this time one is taken for left over even where the file system passes no locks on.
const DAY: Duration = Duration::from_secs(24 * 3600);

/// Whether this process holds a new file: its lock, where there are locks, and its name. Between
/// creation and lock another process may take it for left over; it then has the lock, or has removed
/// the name.
fn is_held(file: &File, path: &Path) -> bool {
    !matches!(file.try_lock(), Err(TryLockError::WouldBlock)) && path.exists()
}

/// A builder of names that begin so, and of what the umask leaves of this mode.
fn builder(prefix: &str, mode: u32) -> Builder<'_, 'static> {
    let mut builder = Builder::new();
    builder.prefix(prefix).suffix(ENDING).rand_bytes(RANDOM);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(mode));
    }
    #[cfg(not(unix))]
    let _ = mode;
    builder
}

/// A new temporary file in a folder, locked as long as it is open.
///
/// # Errors
/// It cannot be made.
pub fn file(folder: &Path, prefix: &str) -> io::Result<NamedTempFile> {
    loop {
        let file = builder(prefix, 0o666).tempfile_in(folder)?;
        if is_held(file.as_file(), file.path()) {
            return Ok(file);
        }
    }
}

/// A temporary folder that is being filled.
pub struct TemporaryFolder {
    folder: TempDir,
    lock: File,
}

impl TemporaryFolder {
    /// A new one in a folder.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn new(parent: &Path, prefix: &str) -> io::Result<TemporaryFolder> {
        loop {
            let folder = builder(prefix, 0o777).tempdir_in(parent)?;
            let path = folder.path().join(LOCK);
            let lock = File::create(&path)?;
            if is_held(&lock, &path) {
                return Ok(TemporaryFolder { folder, lock });
            }
        }
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Gives it its name, in place of an empty folder.
    ///
    /// # Errors
    /// It cannot be renamed; nothing of it is left.
    pub fn complete(self, path: &Path) -> io::Result<()> {
        std::fs::remove_file(self.path().join(LOCK))?;
        if path.exists() {
            std::fs::remove_dir(path)?;
        }
        std::fs::rename(self.path(), path)?;
        drop(self.lock);
        // It has another name now, so that there is nothing to remove.
        let _ = self.folder.keep();
        Ok(())
    }
}

/// Removes the temporary files and folders of a folder whose names begin so, if no process writes
/// them.
pub fn remove_left_over(folder: &Path, prefix: &str) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for entry in entries.take(MAX_NAMES).flatten() {
        let (name, path) = (entry.file_name(), entry.path());
        let name = name.to_string_lossy();
        let middle = name.strip_prefix(prefix);
        let middle = middle.and_then(|rest| rest.strip_suffix(ENDING));
        if !middle.is_some_and(|m| m.len() == RANDOM && m.chars().all(char::is_alphanumeric)) {
            continue;
        }
        // The lock is held until it is removed, so that its maker does not take it meanwhile.
        match entry.file_type() {
            Ok(kind) if kind.is_file() => {
                if let Some(_lock) = lock_of_left(&path) {
                    let _ = std::fs::remove_file(&path);
                }
            }
            Ok(kind) if kind.is_dir() => {
                if let Some(_lock) = lock_of_left(&path.join(LOCK)) {
                    let _ = std::fs::remove_dir_all(&path);
                }
            }
            _ => {}
        }
    }
}

/// The file with its lock, if no other process holds it.
fn lock_of_left(path: &Path) -> Option<File> {
    let file = File::open(path).ok()?;
    let is_left = match file.try_lock() {
        Ok(()) => true,
        Err(TryLockError::WouldBlock) => false,
        Err(TryLockError::Error(_)) => {
            let written = file.metadata().and_then(|about| about.modified());
            written.is_ok_and(|t| SystemTime::now().duration_since(t).is_ok_and(|d| d > DAY))
        }
    };
    is_left.then_some(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicBool, Ordering};

    struct SetWhenDropped<'a>(&'a AtomicBool);

    impl Drop for SetWhenDropped<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Relaxed);
        }
    }

    #[test]
    fn what_is_new_is_not_taken_for_left_over() {
        let folder = tempfile::tempdir().unwrap();
        let is_done = AtomicBool::new(false);
        std::thread::scope(|scope| {
            // Set by a panic, too: the scope waits for its thread.
            let done = SetWhenDropped(&is_done);
            scope.spawn(|| {
                while !is_done.load(Ordering::Relaxed) {
                    remove_left_over(folder.path(), "new.");
                }
            });
            let lost = (0..400).filter(|_| {
                let file = file(folder.path(), "new.").unwrap();
                let filled = TemporaryFolder::new(folder.path(), "new.").unwrap();
                std::thread::yield_now();
                !file.path().exists() || !filled.path().join(LOCK).exists()
            });
            let lost = lost.count();
            drop(done);
            assert_eq!(lost, 0);
        });
    }
}
