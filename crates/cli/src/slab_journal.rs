//! The journal of a scan: finished slabs, so that a scan that was interrupted resumes where it
//! ended.
//!
//! [`MAGIC`] and the SHA-256 of the scan's key. Each further record is the index of a slab and the
//! length of its bytes (u64 each, little-endian), their SHA-256, and the bytes. A last record that
//! is not complete was being written when the run ended; it is dropped.

use crate::error::input;
use crate::locked_file::LockedFile;
use anyhow::{Context, Result};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const MAGIC: &[u8; 8] = b"organzaS";
const DIGEST: usize = 32;
const HEAD: usize = MAGIC.len() + DIGEST;
const RECORD: usize = 16 + DIGEST;

/// Slabs by their indices, on the disk.
pub struct SlabJournal {
    path: PathBuf,
    file: LockedFile,
    /// Place, length and digest of the bytes of each slab.
    known: HashMap<u64, (u64, u64, [u8; DIGEST])>,
    /// Length of the complete records, bytes.
    length: u64,
}

impl SlabJournal {
    /// Opens the journal of the scan that `key` describes, or begins it.
    ///
    /// # Errors
    /// A file of another scan or another kind, one that another run holds, or one that cannot be
    /// read or written.
    pub fn open(path: &Path, key: &str) -> Result<SlabJournal> {
        let cannot = || format!("cannot write {}", path.display());
        let refuse = |why: &str| Err(input(format!("{}: {why}", path.display())));
        let file = File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .with_context(cannot)?;
        let Some(mut file) = LockedFile::new(file) else {
            return refuse("is in use by another scan; expected a journal of its own");
        };
        let mut head = [0u8; HEAD];
        head[..MAGIC.len()].copy_from_slice(MAGIC);
        head[MAGIC.len()..].copy_from_slice(&Sha256::digest(key.as_bytes()));
        let size = file.metadata().with_context(cannot)?.len();
        let mut found = Vec::new();
        (&mut *file)
            .take(HEAD as u64)
            .read_to_end(&mut found)
            .with_context(cannot)?;
        let mut journal = SlabJournal {
            path: path.to_owned(),
            file,
            known: HashMap::new(),
            length: HEAD as u64,
        };
        if found.len() < HEAD && head.starts_with(&found) {
            // Ended while it was begun.
            journal.file.set_len(0).with_context(cannot)?;
            journal.put(0, &[&head]).with_context(cannot)?;
            return Ok(journal);
        }
        if !found.starts_with(MAGIC) {
            return refuse("is not a journal of a scan");
        }
        if found != head {
            return refuse(
                "belongs to a scan of another volume or with other settings, or by another \
                 version of organza; remove it to start again",
            );
        }
        journal.read_records(size).with_context(cannot)?;
        journal.file.set_len(journal.length).with_context(cannot)?;
        Ok(journal)
    }

    /// Finds the complete records.
    fn read_records(&mut self, size: u64) -> std::io::Result<()> {
        let mut reader = BufReader::new(&*self.file);
        while self.length + RECORD as u64 <= size {
            reader.seek(SeekFrom::Start(self.length))?;
            let mut record = [0u8; RECORD];
            reader.read_exact(&mut record)?;
            let word = |at: usize| {
                let mut bytes = [0u8; 8];
                bytes.copy_from_slice(&record[at..at + 8]);
                u64::from_le_bytes(bytes)
            };
            let start = self.length + RECORD as u64;
            let Some(end) = start.checked_add(word(8)).filter(|e| *e <= size) else {
                break;
            };
            let mut digest = [0u8; DIGEST];
            digest.copy_from_slice(&record[16..]);
            self.known.insert(word(0), (start, word(8), digest));
            self.length = end;
        }
        Ok(())
    }

    /// Number of slabs that are stored.
    pub fn len(&self) -> usize {
        self.known.len()
    }

    /// The bytes of a slab, if they are stored; those that are damaged count as not stored.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn find(&mut self, index: usize) -> Result<Option<Vec<u8>>> {
        let Some((start, length, digest)) = self.known.get(&(index as u64)).copied() else {
            return Ok(None);
        };
        let cannot = || format!("cannot read {}", self.path.display());
        self.file
            .seek(SeekFrom::Start(start))
            .with_context(cannot)?;
        let mut bytes = Vec::new();
        (&mut *self.file)
            .take(length)
            .read_to_end(&mut bytes)
            .with_context(cannot)?;
        let is_whole = bytes.len() as u64 == length && Sha256::digest(&bytes)[..] == digest;
        Ok(is_whole.then_some(bytes))
    }

    /// Stores a slab, down to the disk.
    ///
    /// # Errors
    /// The file cannot be written; of a record that failed nothing stays.
    pub fn add(&mut self, index: usize, bytes: &[u8]) -> Result<()> {
        let digest: [u8; DIGEST] = Sha256::digest(bytes).into();
        let numbers = [index as u64, bytes.len() as u64].map(u64::to_le_bytes);
        let start = self.length + RECORD as u64;
        let added = self.put(self.length, &[&numbers[0][..], &numbers[1], &digest, bytes]);
        if added.is_err() {
            // Should this fail too, the next run finds a record without its end.
            let _ = self.file.set_len(self.length);
        }
        added.with_context(|| format!("cannot write {}", self.path.display()))?;
        self.length = start + bytes.len() as u64;
        let entry = (start, bytes.len() as u64, digest);
        self.known.insert(index as u64, entry);
        Ok(())
    }

    fn put(&mut self, at: u64, parts: &[&[u8]]) -> std::io::Result<()> {
        self.file.seek(SeekFrom::Start(at))?;
        for part in parts {
            self.file.write_all(part)?;
        }
        self.file.sync_data()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slabs_are_found_again_wherever_the_last_record_was_cut() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let mut first = SlabJournal::open(&path, "a").unwrap();
        first.add(2, b"third").unwrap();
        let busy = SlabJournal::open(&path, "a").map(|_| ()).unwrap_err();
        assert!(busy.to_string().contains("is in use by another scan"));
        drop(first);
        let good = std::fs::read(&path).unwrap();
        SlabJournal::open(&path, "a").unwrap().add(5, b"x").unwrap();
        let longer = std::fs::read(&path).unwrap();
        for cut in good.len()..longer.len() {
            std::fs::write(&path, &longer[..cut]).unwrap();
            let mut again = SlabJournal::open(&path, "a").unwrap();
            assert_eq!(again.find(2).unwrap().as_deref(), Some(&b"third"[..]));
            assert_eq!(again.find(5).unwrap(), None, "cut at {cut}");
            again.add(5, b"x").unwrap();
            drop(again);
            assert_eq!(std::fs::read(&path).unwrap(), longer);
        }
        for cut in 0..HEAD {
            std::fs::write(&path, &longer[..cut]).unwrap();
            assert_eq!(SlabJournal::open(&path, "a").unwrap().len(), 0);
        }
    }

    #[test]
    fn journals_of_other_scans_and_other_files_are_refused_and_damage_is_not_used() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        SlabJournal::open(&path, "a")
            .unwrap()
            .add(0, b"slab")
            .unwrap();
        let other = SlabJournal::open(&path, "b").map(|_| ()).unwrap_err();
        assert!(other.to_string().contains("another volume"), "{other}");
        let mut bytes = std::fs::read(&path).unwrap();
        let last = bytes.len() - 1;
        bytes[last] ^= 1;
        std::fs::write(&path, bytes).unwrap();
        let mut damaged = SlabJournal::open(&path, "a").unwrap();
        assert_eq!(damaged.find(0).unwrap(), None);
        drop(damaged);
        std::fs::write(
            &path,
            "notes of the user, longer than the head of a journal is",
        )
        .unwrap();
        let foreign = SlabJournal::open(&path, "a").map(|_| ()).unwrap_err();
        assert!(
            foreign.to_string().contains("is not a journal"),
            "{foreign}"
        );
        assert!(std::fs::read(&path).unwrap().starts_with(b"notes"));
    }
}
