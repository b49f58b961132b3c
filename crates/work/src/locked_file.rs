//! A file that one run at a time holds.

use std::fs::{File, TryLockError};
use std::ops::{Deref, DerefMut};

/// A file with a lock, which ends when this value is dropped. Closing the file would not be
/// enough: a process that another thread starts inherits the open file, and its lock with it,
/// until it executes its program.
pub struct LockedFile(File);

impl LockedFile {
    /// Locks a file; `None` where somebody else holds it. File systems without locks lock
    /// nothing.
    pub fn new(file: File) -> Option<LockedFile> {
        match file.try_lock() {
            Err(TryLockError::WouldBlock) => None,
            Ok(()) | Err(TryLockError::Error(_)) => Some(LockedFile(file)),
        }
    }
}

impl Deref for LockedFile {
    type Target = File;

    fn deref(&self) -> &File {
        &self.0
    }
}

impl DerefMut for LockedFile {
    fn deref_mut(&mut self) -> &mut File {
        &mut self.0
    }
}

impl Drop for LockedFile {
    fn drop(&mut self) {
        let _ = self.0.unlock();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_ends_although_a_started_process_still_has_the_file() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let open = || LockedFile::new(File::open(file.path()).unwrap());
        let first = open().unwrap();
        // As a process has it between fork and exec: one open file, two descriptors.
        let inherited = first.try_clone().unwrap();
        assert!(open().is_none());
        drop(first);
        assert!(open().is_some());
        drop(inherited);
    }
}
