//! The folder of entries.

use crate::entry::{self, Description, Entry};
use crate::{Key, entry::of_file, temporary};
use std::fs::{File, TryLockError};
use std::io::{self, BufWriter, ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// Held by the process that makes room and gives an entry its name, so that the folder keeps
/// its limit.
const LOCK: &str = "lock";

/// What the names of files begin with that are not complete.
const TEMPORARY: &str = "new.";

/// Time to wait for the lock; without it the entry gets its name all the same.
const PATIENCE: Duration = Duration::from_secs(5);

/// The file by which backups know a folder of this kind, and its first line
/// (<https://bford.info/cachedir/>).
const TAG: (&str, &str) = (
    "CACHEDIR.TAG",
    "Signature: 8a477f597d28d172789f06886806bc55\n# Results that organza can compute again.\n",
);

/// A folder of entries, of limited size.
#[derive(Clone, Debug)]
pub struct Cache {
    folder: PathBuf,
    limit_bytes: u64,
}

/// What was removed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Removed {
    /// Number of entries.
    pub entries: usize,
    /// Their length, bytes.
    pub bytes: u64,
}

impl Cache {
    /// The cache of a folder that may not exist yet.
    pub fn new(folder: &Path, limit_bytes: u64) -> Cache {
        Cache {
            folder: folder.to_owned(),
            limit_bytes,
        }
    }

    /// Makes the folder if it does not exist.
    ///
    /// # Errors
    /// The folder cannot be made or read.
    pub fn make(&self) -> io::Result<()> {
        std::fs::create_dir_all(&self.folder)?;
        std::fs::read_dir(&self.folder)?;
        let tag = self.folder.join(TAG.0);
        if !tag.exists() {
            // Entries are found without it, and the folder may be there to be read only. A
            // partial tag would never be replaced.
            if std::fs::write(&tag, TAG.1).is_err() {
                let _ = std::fs::remove_file(tag);
            }
        }
        Ok(())
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The most that all entries together may take, bytes.
    pub fn limit_bytes(&self) -> u64 {
        self.limit_bytes
    }

    /// Where the entry of a key is, or would be.
    pub fn path(&self, key: &Key) -> PathBuf {
        self.folder.join(key.to_string())
    }

    /// The result of a key, if there is an entry of at most `max_bytes`. The entry counts as
    /// used now.
    ///
    /// # Errors
    /// `InvalidData` for an entry that is damaged, which is removed; that an existing entry
    /// cannot be read.
    pub fn read(&self, key: &Key, max_bytes: u64) -> io::Result<Option<Vec<u8>>> {
        let path = self.path(key);
        let mut file = match File::open(&path) {
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(None),
            file => file?,
        };
        let length = file.metadata()?.len();
        let Some(room) = usize::try_from(length).ok().filter(|_| length <= max_bytes) else {
            return Ok(None);
        };
        let mut bytes = Vec::new();
        if bytes.try_reserve_exact(room).is_err() {
            return Ok(None);
        }
        (&mut file).take(length).read_to_end(&mut bytes)?;
        let result = entry::decode(bytes, key).map_err(|why| {
            self.remove(key);
            io::Error::new(ErrorKind::InvalidData, why)
        })?;
        // Where the folder can only be read, nothing is removed either.
        let _ = File::options()
            .append(true)
            .open(&path)
            .and_then(|file| file.set_modified(SystemTime::now()));
        Ok(Some(result))
    }

    /// Removes the entry of a key, if there is one.
    pub fn remove(&self, key: &Key) {
        let _ = std::fs::remove_file(self.path(key));
    }

    /// Writes an entry, in place of one of the same key. The entries that were not used for
    /// the longest time make room for it. False if it alone is larger than the limit and was
    /// not kept.
    ///
    /// # Errors
    /// Those of `write` and of the file; nothing is left behind.
    pub fn write(
        &self,
        key: &Key,
        about: &Description,
        write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> io::Result<bool> {
        let temporary = temporary::file(&self.folder, TEMPORARY)?;
        let mut out = BufWriter::new(temporary.as_file());
        entry::encode(&mut out, key, about, write)?;
        out.flush()?;
        drop(out);
        temporary.as_file().sync_all()?;
        let bytes = temporary.as_file().metadata()?.len();
        if bytes > self.limit_bytes {
            return Ok(false);
        }
        let _lock = self.lock();
        self.shrink(self.limit_bytes - bytes, Some(key))?;
        temporary.persist(self.path(key)).map_err(|e| e.error)?;
        Ok(true)
    }

    /// The lock of the folder; `None` where another process keeps it for long, or where the
    /// file system has none.
    fn lock(&self) -> Option<File> {
        let mut options = File::options();
        options.write(true).create(true).truncate(false);
        let file = options.open(self.folder.join(LOCK)).ok()?;
        let started = Instant::now();
        loop {
            match file.try_lock() {
                Ok(()) => return Some(file),
                Err(TryLockError::WouldBlock) if started.elapsed() < PATIENCE => {
                    std::thread::sleep(Duration::from_millis(10));
                }
                Err(_) => return None,
            }
        }
    }

    /// All entries, those used last first; none if the folder does not exist. Temporary files
    /// that nobody writes are removed.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn entries(&self) -> io::Result<Vec<Entry>> {
        let mut entries = Vec::new();
        temporary::remove_left_over(&self.folder, TEMPORARY);
        let files = match std::fs::read_dir(&self.folder) {
            Err(e) if e.kind() == ErrorKind::NotFound => return Ok(entries),
            files => files?,
        };
        for file in files {
            entries.extend(of_file(&file?.path()));
        }
        entries.sort_by_key(|entry| (std::cmp::Reverse(entry.used), entry.path.clone()));
        Ok(entries)
    }

    /// Removes the entries that were not used since a time.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn remove_older(&self, since: SystemTime) -> io::Result<Removed> {
        let entries = self.entries()?;
        Ok(remove(entries.iter().filter(|entry| entry.used < since)))
    }

    /// Removes entries until those left take at most `bytes`, those first that were not used
    /// for the longest time.
    ///
    /// # Errors
    /// The folder cannot be read.
    pub fn remove_above(&self, bytes: u64) -> io::Result<Removed> {
        let _lock = self.lock();
        self.shrink(bytes, None)
    }

    /// As [`Self::remove_above`]; the entry of a key is to be replaced and does not count.
    fn shrink(&self, bytes: u64, replaced: Option<&Key>) -> io::Result<Removed> {
        let mut entries = self.entries()?;
        entries.retain(|entry| Some(&entry.key) != replaced);
        let mut sum = 0u64;
        let kept = entries.iter().take_while(|entry| {
            sum = sum.saturating_add(entry.bytes);
            sum <= bytes
        });
        let kept = kept.count();
        Ok(remove(&entries[kept..]))
    }
}

/// Removes files; one that another process removed already counts as removed.
fn remove<'a>(entries: impl IntoIterator<Item = &'a Entry>) -> Removed {
    let mut removed = Removed::default();
    for entry in entries {
        match std::fs::remove_file(&entry.path) {
            Err(e) if e.kind() != ErrorKind::NotFound => {}
            _ => {
                removed.entries += 1;
                removed.bytes += entry.bytes;
            }
        }
    }
    removed
}

#[cfg(test)]
mod tests;
