//! Journals: files of records that a run computed, from which a later run of the same work
//! continues.
//!
//! A journal is [`MAGIC`], a head and any number of records. Head and records have one form: the
//! length of the content in bytes (`u64`, little-endian), the SHA-256 of the content, the content.
//! The head is JSON: the command, the code of the program ([`version::code`]) and the SHA-256 of
//! the key, in which the command names whatever decides its records. What follows the last complete
//! record was being written when the run ended; it is cut off. A record whose checksum is wrong
//! counts as missing.

use crate::error::{of_file, of_io};
use crate::identity::hex;
use crate::locked_file::LockedFile;
use crate::version;
use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom, Write};
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

const MAGIC: &[u8; 8] = b"organzaJ";

/// Bytes before the content of a head or a record.
const PREFIX: usize = 8 + 32;

/// What one record of a journal holds.
pub trait Record: Sized {
    /// The content of the record.
    fn to_bytes(&self) -> Vec<u8>;

    /// The record of some content; `None` when it is none of this kind.
    fn from_bytes(bytes: Vec<u8>) -> Option<Self>;
}

/// Any bytes.
impl Record for Vec<u8> {
    fn to_bytes(&self) -> Vec<u8> {
        self.clone()
    }

    fn from_bytes(bytes: Vec<u8>) -> Option<Vec<u8>> {
        Some(bytes)
    }
}

/// The work that a journal belongs to.
#[derive(Clone, Copy, Debug)]
pub struct Work<'a> {
    /// The command of the program.
    pub command: &'a str,
    /// Whatever decides the records besides the code of the program.
    pub key: &'a str,
}

/// What the head of a journal holds.
#[derive(Serialize, Deserialize)]
struct Head {
    command: String,
    code: String,
    /// SHA-256 of the key, in hexadecimal.
    key: String,
}

impl Head {
    fn of(work: &Work<'_>) -> Head {
        Head {
            command: work.command.to_owned(),
            code: version::code(),
            key: hex(&Sha256::digest(work.key)),
        }
    }

    /// With what comes before it.
    fn to_bytes(&self) -> Vec<u8> {
        let content = serde_json::to_vec(self).unwrap_or_default();
        [&MAGIC[..], &framed(&content)].concat()
    }

    /// Why a journal with this head is not one of the expected head.
    fn difference(&self, expected: &Head) -> Option<String> {
        let Head { command, code, key } = self;
        if *command != expected.command {
            return Some(format!(
                "is a journal of `organza {command}`; expected one of `organza {}`",
                expected.command
            ));
        }
        if *code != expected.code {
            return Some(format!(
                "was written by other code, organza {code}; this is organza {}; remove the file to \
                 start again, or continue with that program",
                expected.code
            ));
        }
        (*key != expected.key).then(|| {
            "belongs to other inputs or settings; remove the file to start again".to_owned()
        })
    }
}

/// The length, checksum and content of a head or a record.
fn framed(content: &[u8]) -> Vec<u8> {
    let length = (content.len() as u64).to_le_bytes();
    [&length[..], &Sha256::digest(content), content].concat()
}

/// Where the content of a record lies in its file.
#[derive(Clone, Copy, Debug)]
struct Place {
    start: u64,
    length: u64,
    digest: [u8; 32],
}

impl Place {
    /// What lies at `at` in a file of `size` bytes; `None` when it is not complete.
    fn find(file: &mut (impl Read + Seek), at: u64, size: u64) -> std::io::Result<Option<Place>> {
        let start = at.saturating_add(PREFIX as u64);
        if start > size {
            return Ok(None);
        }
        file.seek(SeekFrom::Start(at))?;
        let (mut length, mut digest) = ([0; 8], [0; 32]);
        file.read_exact(&mut length)?;
        file.read_exact(&mut digest)?;
        let length = u64::from_le_bytes(length);
        let is_complete = length <= size - start;
        Ok(is_complete.then_some(Place {
            start,
            length,
            digest,
        }))
    }

    fn end(&self) -> u64 {
        self.start + self.length
    }

    /// The content, if its checksum is right.
    fn content(&self, file: &mut File) -> std::io::Result<Option<Vec<u8>>> {
        file.seek(SeekFrom::Start(self.start))?;
        let mut content = Vec::new();
        Read::by_ref(file)
            .take(self.length)
            .read_to_end(&mut content)?;
        let is_right = Sha256::digest(&content)[..] == self.digest;
        Ok(is_right.then_some(content))
    }
}

/// A file of records.
pub struct Journal<T> {
    path: PathBuf,
    file: File,
    places: Vec<Place>,
    /// The end of the last complete record, bytes.
    end: u64,
    /// Keeps other runs from writing to the file.
    lock: Option<LockedFile>,
    records: PhantomData<T>,
}

impl<T: Record> Journal<T> {
    /// Opens the journal of some work, or begins it.
    ///
    /// # Errors
    /// A file of other work or other code, one that is no journal, one that another run holds, or
    /// one that cannot be read or written.
    pub fn open(path: &Path, work: &Work<'_>) -> Result<Journal<T>> {
        let cannot = || format!("cannot write {}", path.display());
        let file = File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .with_context(cannot)?;
        let lock = LockedFile::new(file.try_clone().with_context(cannot)?);
        if lock.is_none() {
            return Err(of_file(
                path,
                format!(
                    "is in use by another `organza {}`; expected a journal of its own",
                    work.command
                ),
            ));
        }
        let size = file.metadata().with_context(cannot)?.len();
        let head = Head::of(work).to_bytes();
        if size < head.len() as u64 {
            let mut found = Vec::new();
            (&file).read_to_end(&mut found).with_context(cannot)?;
            if head.starts_with(&found) {
                // The run ended while it was begun.
                let mut journal = Journal::empty(path, file);
                journal.lock = lock;
                journal.file.set_len(0).with_context(cannot)?;
                journal.put(&head)?;
                return Ok(journal);
            }
        }
        let mut journal = Journal::load(path, file, work)?;
        journal.lock = lock;
        journal.file.set_len(journal.end).with_context(cannot)?;
        Ok(journal)
    }

    /// Opens a journal that is only read.
    ///
    /// # Errors
    /// A file of other work or other code, one that is no journal or cannot be read.
    pub fn read_only(path: &Path, work: &Work<'_>) -> Result<Journal<T>> {
        let cannot = |e| of_io(path, &e);
        Journal::load(path, File::open(path).map_err(cannot)?, work)
    }

    /// Writes a whole journal.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn write(
        out: &mut dyn Write,
        work: &Work<'_>,
        records: impl IntoIterator<Item = T>,
    ) -> std::io::Result<()> {
        out.write_all(&Head::of(work).to_bytes())?;
        for record in records {
            out.write_all(&framed(&record.to_bytes()))?;
        }
        Ok(())
    }

    fn empty(path: &Path, file: File) -> Journal<T> {
        Journal {
            path: path.to_owned(),
            file,
            places: Vec::new(),
            end: 0,
            lock: None,
            records: PhantomData,
        }
    }

    /// Checks the head of a file and finds its records.
    fn load(path: &Path, file: File, work: &Work<'_>) -> Result<Journal<T>> {
        let cannot = || format!("cannot read {}", path.display());
        let refuse = |why: &str| Err(of_file(path, why));
        let mut journal = Journal::empty(path, file);
        let file = &mut journal.file;
        let size = file.metadata().with_context(cannot)?.len();
        let mut magic = Vec::new();
        file.rewind().with_context(cannot)?;
        Read::by_ref(file)
            .take(MAGIC.len() as u64)
            .read_to_end(&mut magic)
            .with_context(cannot)?;
        if magic != MAGIC {
            return refuse(&format!(
                "is not a journal; expected one of `organza {}`",
                work.command
            ));
        }
        let head = Place::find(file, MAGIC.len() as u64, size).with_context(cannot)?;
        let Some(head) = head else {
            return refuse("is cut short in its head; remove the file to start again");
        };
        let content = head.content(file).with_context(cannot)?;
        let found: Option<Head> = content.and_then(|c| serde_json::from_slice(&c).ok());
        let Some(found) = found else {
            return refuse("is damaged in its head; remove the file to start again");
        };
        if let Some(why) = found.difference(&Head::of(work)) {
            return refuse(&why);
        }
        let (mut places, mut end) = (Vec::new(), head.end());
        let mut reader = BufReader::new(&journal.file);
        while let Some(place) = Place::find(&mut reader, end, size).with_context(cannot)? {
            end = place.end();
            places.push(place);
        }
        (journal.places, journal.end) = (places, end);
        Ok(journal)
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of complete records.
    pub fn count(&self) -> usize {
        self.places.len()
    }

    /// A record by its number; `None` when it is damaged or there is none.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn read(&mut self, number: usize) -> Result<Option<T>> {
        let Some(place) = self.places.get(number) else {
            return Ok(None);
        };
        let content = place.content(&mut self.file);
        let content = content.with_context(|| format!("cannot read {}", self.path.display()))?;
        Ok(content.and_then(T::from_bytes))
    }

    /// Adds a record, down to the disk.
    ///
    /// # Errors
    /// The file cannot be written; of a record that failed nothing stays.
    pub fn add(&mut self, record: &T) -> Result<()> {
        let content = record.to_bytes();
        let place = Place {
            start: self.end + PREFIX as u64,
            length: content.len() as u64,
            digest: Sha256::digest(&content).into(),
        };
        self.put(&framed(&content))?;
        self.places.push(place);
        Ok(())
    }

    /// Adds bytes; of those that failed nothing stays.
    fn put(&mut self, bytes: &[u8]) -> Result<()> {
        let added = self.file.seek(SeekFrom::Start(self.end));
        let added = added.and_then(|_| self.file.write_all(bytes));
        // A file system may accept what it cannot keep and report that here.
        let added = added.and_then(|()| self.file.sync_data());
        if added.is_err() {
            // Should this fail too, the next run finds a record that is not complete.
            let _ = self.file.set_len(self.end);
        }
        added.with_context(|| format!("cannot write {}", self.path.display()))?;
        self.end += bytes.len() as u64;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORK: Work<'_> = Work {
        command: "fit",
        key: "a",
    };

    fn open(path: &Path, work: &Work<'_>) -> Result<Journal<Vec<u8>>> {
        Journal::open(path, work)
    }

    fn why_refused(path: &Path, work: &Work<'_>) -> String {
        open(path, work).map(|_| ()).unwrap_err().to_string()
    }

    #[test]
    fn records_are_found_again_wherever_the_last_one_was_cut() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        open(&path, &WORK).unwrap().add(&b"first".to_vec()).unwrap();
        let short = std::fs::read(&path).unwrap();
        let mut longer = open(&path, &WORK).unwrap();
        longer.add(&b"second".to_vec()).unwrap();
        drop(longer);
        let long = std::fs::read(&path).unwrap();
        for cut in 0..long.len() {
            std::fs::write(&path, &long[..cut]).unwrap();
            let mut again = open(&path, &WORK).unwrap();
            assert_eq!(
                again.count(),
                usize::from(cut >= short.len()),
                "cut at {cut}"
            );
            if cut >= short.len() {
                assert_eq!(again.read(0).unwrap().as_deref(), Some(&b"first"[..]));
                again.add(&b"second".to_vec()).unwrap();
                drop(again);
                assert_eq!(std::fs::read(&path).unwrap(), long);
            }
        }
    }

    #[test]
    fn a_record_that_is_damaged_is_missing_and_others_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let mut journal = open(&path, &WORK).unwrap();
        journal.add(&b"first".to_vec()).unwrap();
        journal.add(&b"second".to_vec()).unwrap();
        let second = journal.places[1];
        drop(journal);
        let good = std::fs::read(&path).unwrap();
        for at in second.start as usize - 32..good.len() {
            let mut bent = good.clone();
            bent[at] ^= 1;
            std::fs::write(&path, &bent).unwrap();
            let mut journal = open(&path, &WORK).unwrap();
            assert_eq!(journal.read(0).unwrap().as_deref(), Some(&b"first"[..]));
            assert_eq!(journal.read(1).unwrap(), None, "byte {at}");
        }
    }

    #[test]
    fn what_does_not_belong_to_the_work_is_refused_and_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let held = open(&path, &WORK).unwrap();
        let busy = why_refused(
            &path,
            &Work {
                command: "table",
                ..WORK
            },
        );
        assert!(
            busy.contains("is in use by another `organza table`"),
            "{busy}"
        );
        drop(held);
        let good = std::fs::read(&path).unwrap();
        let other = why_refused(&path, &Work { key: "b", ..WORK });
        assert!(other.contains("other inputs or settings"), "{other}");
        let other = why_refused(
            &path,
            &Work {
                command: "table",
                ..WORK
            },
        );
        assert!(
            other.contains("is a journal of `organza fit`; expected one of `organza table`"),
            "{other}"
        );
        assert_eq!(std::fs::read(&path).unwrap(), good);
        let text = "notes of the user, longer than the head of a journal is; ".repeat(9);
        std::fs::write(&path, &text).unwrap();
        let foreign = why_refused(&path, &WORK);
        assert!(foreign.contains("is not a journal"), "{foreign}");
        assert_eq!(std::fs::read(&path).unwrap(), text.as_bytes());
    }

    #[test]
    fn a_journal_of_other_code_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let other = Head {
            code: "0.1.0 (sources 0123)".into(),
            ..Head::of(&WORK)
        };
        std::fs::write(&path, other.to_bytes()).unwrap();
        let refused = why_refused(&path, &WORK);
        let expected = format!(
            "was written by other code, organza 0.1.0 (sources 0123); this is organza {}",
            version::code()
        );
        assert!(refused.contains(&expected), "{refused}");
        // The known-bad twin: the same head of this code.
        std::fs::write(&path, Head::of(&WORK).to_bytes()).unwrap();
        open(&path, &WORK).unwrap();
    }
}
