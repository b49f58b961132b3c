//! The journal of a search: evaluated points and their results, so that a
//! search that was interrupted resumes where it ended.
//!
//! The first line is [`MAGIC`] and the SHA-256 of the search's key. Each further
//! line is a record: the length of its content in bytes, the first 16 digits of
//! the content's SHA-256, and the content: hexadecimal words (the count of the
//! place's numbers, their bits, the bits of the numbers found). A last line
//! without its line break was being written when the run ended; it is dropped.

use crate::error::input;
use crate::locked_file::LockedFile;
use anyhow::{Context, Result};
use organza_scene::read;
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const MAGIC: &str = "organza-journal 2";

/// Digits of a record's checksum.
const CHECKSUM_DIGITS: usize = 16;

/// What a journal needs of the file that it adds to.
trait Storage: Send {
    /// Adds bytes, down to the disk.
    fn append(&mut self, bytes: &[u8]) -> std::io::Result<()>;
    /// Cuts what follows the first `length` bytes.
    fn truncate(&mut self, length: u64) -> std::io::Result<()>;
}

impl Storage for LockedFile {
    fn append(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        self.write_all(bytes)?;
        // A file system may accept what it cannot keep and report that here.
        self.sync_data()
    }

    fn truncate(&mut self, length: u64) -> std::io::Result<()> {
        self.set_len(length)?;
        self.seek(SeekFrom::Start(length)).map(|_| ())
    }
}

/// Numbers by the bits of their places; each list is stored as soon as it is
/// known.
pub struct FileJournal {
    known: HashMap<Vec<u64>, Vec<f64>>,
    file: Option<Stored>,
}

/// A file with its records.
struct Stored {
    path: PathBuf,
    storage: Box<dyn Storage>,
    /// Length of the complete records, bytes.
    length: u64,
}

impl FileJournal {
    /// Opens the file of the search that `key` describes, or begins it. Without a
    /// path, nothing is stored.
    ///
    /// # Errors
    /// A file of another search, a damaged one, one that another run holds, or
    /// one that cannot be read or written.
    pub fn open(path: Option<&Path>, key: &str) -> Result<FileJournal> {
        let Some(path) = path else {
            return Ok(FileJournal {
                known: HashMap::new(),
                file: None,
            });
        };
        let cannot = || format!("cannot write {}", path.display());
        let file = File::options()
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .with_context(cannot)?;
        let Some(file) = LockedFile::new(file) else {
            return Err(input(format!(
                "{}: is in use by another run; expected a journal of its own",
                path.display()
            )));
        };
        let text = read::text(path)?;
        let head = format!("{MAGIC} {}\n", hex(&Sha256::digest(key.as_bytes())));
        let content = Content::parse(&text, &head)
            .map_err(|why| input(format!("{}: {why}", path.display())))?;
        let mut stored = Stored {
            path: path.to_owned(),
            storage: Box::new(file),
            length: content.length,
        };
        stored
            .storage
            .truncate(stored.length)
            .with_context(cannot)?;
        if stored.length == 0 {
            stored.append(&head)?;
        }
        Ok(FileJournal {
            known: content.known,
            file: Some(stored),
        })
    }

    /// Whether the numbers of a place are stored.
    pub fn has(&self, place: &[f64]) -> bool {
        let key: Vec<u64> = place.iter().map(|x| x.to_bits()).collect();
        self.known.contains_key(&key)
    }

    /// The `count` numbers of a place: those stored, or those that `find`
    /// returns, which are then stored.
    ///
    /// # Errors
    /// Those of `find`; a record of another length; a record that cannot be
    /// stored ([`JournalError`] stands in the chain of these).
    pub fn once(
        &mut self,
        place: &[f64],
        count: usize,
        find: impl FnOnce() -> Result<Vec<f64>>,
    ) -> Result<Vec<f64>> {
        let key: Vec<u64> = place.iter().map(|x| x.to_bits()).collect();
        if let Some(list) = self.known.get(&key) {
            if list.len() == count {
                return Ok(list.clone());
            }
            let name = self.file.as_ref().map(|f| f.path.display().to_string());
            let error = input(format!(
                "{}: holds {} numbers for a place where {count} are expected; remove it to start \
                 again",
                name.unwrap_or_default(),
                list.len()
            ));
            return Err(error.context(JournalError));
        }
        let list = find()?;
        if let Some(file) = &mut self.file {
            file.append(&record(&key, &list)).context(JournalError)?;
        }
        self.known.insert(key, list.clone());
        Ok(list)
    }
}

/// Marks errors of the journal itself, which end the search.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("the journal failed")]
pub struct JournalError;

impl Stored {
    /// Adds a line; of one that failed, nothing stays.
    fn append(&mut self, line: &str) -> Result<()> {
        let added = self.storage.append(line.as_bytes());
        if added.is_err() {
            // Should this fail too, the next run finds a line without its end.
            let _ = self.storage.truncate(self.length);
        }
        added.with_context(|| format!("cannot write {}", self.path.display()))?;
        self.length += line.len() as u64;
        Ok(())
    }
}

/// The line of a place and its numbers.
fn record(place: &[u64], list: &[f64]) -> String {
    let count = [place.len() as u64].into_iter();
    let words = count
        .chain(place.iter().copied())
        .chain(list.iter().map(|x| x.to_bits()));
    let words: Vec<String> = words.map(|w| format!("{w:x}")).collect();
    let content = words.join(" ");
    format!("{} {} {content}\n", content.len(), checksum(&content))
}

fn checksum(content: &str) -> String {
    let mut digits = hex(&Sha256::digest(content.as_bytes()));
    digits.truncate(CHECKSUM_DIGITS);
    digits
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// What a journal's file holds.
struct Content {
    known: HashMap<Vec<u64>, Vec<f64>>,
    /// Length of the complete lines, bytes.
    length: u64,
}

impl Content {
    fn parse(text: &str, head: &str) -> Result<Content, String> {
        let mut content = Content {
            known: HashMap::new(),
            length: 0,
        };
        let mut lines = text.split_inclusive('\n');
        match lines.next() {
            // Ended while it was begun: nothing is lost.
            None => return Ok(content),
            Some(first) if !first.ends_with('\n') && head.starts_with(first) => return Ok(content),
            Some(first) if first == head => content.length = first.len() as u64,
            Some(first) if first.starts_with(MAGIC) => {
                return Err(
                    "belongs to another search, or to changed input files or another version of \
                     organza; remove it to start again"
                        .into(),
                );
            }
            Some(_) => return Err("is not a journal of this version of organza".into()),
        }
        for (i, line) in lines.enumerate() {
            let Some(complete) = line.strip_suffix('\n') else {
                break; // was being written when the run ended
            };
            let (place, list) = parse_record(complete).ok_or_else(|| {
                format!("line {} is damaged; remove the file to start again", i + 2)
            })?;
            content.known.insert(place, list);
            content.length += line.len() as u64;
        }
        Ok(content)
    }
}

/// A place and its numbers, if length and checksum are right.
fn parse_record(line: &str) -> Option<(Vec<u64>, Vec<f64>)> {
    let mut parts = line.splitn(3, ' ');
    let length: usize = parts.next()?.parse().ok()?;
    let (sum, content) = (parts.next()?, parts.next()?);
    if content.len() != length || checksum(content) != sum {
        return None;
    }
    let words: Result<Vec<u64>, _> = content
        .split(' ')
        .map(|w| u64::from_str_radix(w, 16))
        .collect();
    let words = words.ok()?;
    let (&count, rest) = words.split_first()?;
    let (place, list) = rest.split_at_checked(usize::try_from(count).ok()?)?;
    let list = list.iter().map(|&x| f64::from_bits(x)).collect();
    Some((place.to_vec(), list))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::{Arc, Mutex};

    fn never() -> Result<Vec<f64>> {
        panic!("known places are not looked at")
    }

    #[test]
    fn a_search_that_was_interrupted_resumes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let open = |key: &str| FileJournal::open(Some(&path), key);
        let mut first = open("a").unwrap();
        first.once(&[1.0, -2.5], 2, || Ok(vec![0.1, 7.0])).unwrap();
        first.once(&[3.0, 4.0], 0, || Ok(Vec::new())).unwrap();
        assert!(first.once(&[0.0], 1, || Err(input("no answer"))).is_err());
        let busy = open("a").map(|_| ()).unwrap_err().to_string();
        assert!(busy.contains("is in use by another run"), "{busy}");
        drop(first);
        // As when the machine stops in the middle of a line, at any byte of it.
        let text = std::fs::read_to_string(&path).unwrap();
        let line = record(&[0], &[2.0]);
        for cut in 1..line.len() {
            std::fs::write(&path, format!("{text}{}", &line[..cut])).unwrap();
            let mut again = open("a").unwrap();
            assert_eq!(again.once(&[1.0, -2.5], 2, never).unwrap(), [0.1, 7.0]);
            assert!(again.once(&[3.0, 4.0], 0, never).unwrap().is_empty());
            assert_eq!(again.once(&[0.0], 1, || Ok(vec![2.0])).unwrap(), [2.0]);
            drop(again);
            let mut last = open("a").unwrap();
            assert_eq!(last.once(&[0.0], 1, never).unwrap(), [2.0], "cut at {cut}");
        }
        let other = open("another search").map(|_| ()).unwrap_err().to_string();
        assert!(other.contains("belongs to another search"), "{other}");
    }

    #[test]
    fn damaged_records_and_lists_of_another_length_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let mut journal = FileJournal::open(Some(&path), "a").unwrap();
        journal.once(&[1.0], 2, || Ok(vec![0.1, 7.0])).unwrap();
        let short = journal.once(&[1.0], 3, never).unwrap_err();
        assert!(short.is::<JournalError>());
        let short = format!("{short:#}");
        assert!(short.contains("2 numbers for a place where 3"), "{short}");
        drop(journal);
        let good = std::fs::read_to_string(&path).unwrap();
        let start = good.find('\n').unwrap() + 1;
        for at in start..good.len() - 1 {
            let mut bytes = good.clone().into_bytes();
            bytes[at] = if bytes[at] == b'0' { b'1' } else { b'0' };
            std::fs::write(&path, &bytes).unwrap();
            let refused = FileJournal::open(Some(&path), "a").map(|_| ()).unwrap_err();
            assert!(
                refused.to_string().contains("line 2 is damaged"),
                "byte {at}"
            );
        }
    }

    /// A disk that has room for some bytes.
    #[derive(Clone, Default)]
    struct SmallDisk {
        bytes: Arc<Mutex<Vec<u8>>>,
        room: usize,
    }

    impl Storage for SmallDisk {
        fn append(&mut self, bytes: &[u8]) -> std::io::Result<()> {
            let mut held = self.bytes.lock().unwrap();
            let fit = bytes.len().min(self.room.saturating_sub(held.len()));
            held.extend(&bytes[..fit]);
            match fit == bytes.len() {
                true => Ok(()),
                false => Err(std::io::ErrorKind::StorageFull.into()),
            }
        }

        fn truncate(&mut self, length: u64) -> std::io::Result<()> {
            self.bytes.lock().unwrap().truncate(length as usize);
            Ok(())
        }
    }

    #[test]
    fn a_record_that_cannot_be_stored_is_reported_at_once_and_leaves_nothing() {
        let disk = SmallDisk {
            room: 100,
            ..SmallDisk::default()
        };
        let mut journal = FileJournal {
            known: HashMap::new(),
            file: Some(Stored {
                path: "journal".into(),
                storage: Box::new(disk.clone()),
                length: 0,
            }),
        };
        journal.once(&[1.0], 1, || Ok(vec![2.0])).unwrap();
        let held = disk.bytes.lock().unwrap().clone();
        let failed = journal.once(&[2.0], 4, || Ok(vec![0.1, 0.2, 0.3, 0.4]));
        let failed = failed.unwrap_err();
        assert!(failed.is::<JournalError>());
        assert!(format!("{failed:#}").contains("cannot write journal"));
        assert_eq!(*disk.bytes.lock().unwrap(), held, "no half of a line");
    }
}
