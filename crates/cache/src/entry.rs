//! The file of an entry: a first line that names the format, a description in a line of JSON,
//! the result, and the SHA-256 of all of these.

use crate::Key;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::fs::File;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// The first line of every entry.
const MAGIC: &str = "organza-cache 1\n";

/// Maximum length of the line of the description, bytes.
const MAX_DESCRIPTION: usize = 16 << 10;

/// Length of the checksum, bytes.
const CHECKSUM: usize = 32;

/// What an entry is, for people: it has no part in finding the entry.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Description {
    /// The kind of result: "volume".
    pub kind: String,
    /// What it was computed from: the path of a fabric.
    pub name: String,
    /// How it was computed, in a few words.
    pub details: String,
    /// The program that computed it.
    pub program: String,
}

/// A file of the cache.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Its key.
    pub key: Key,
    /// Where it is.
    pub path: PathBuf,
    /// Its length, bytes.
    pub bytes: u64,
    /// When it was last read or written.
    pub used: SystemTime,
}

/// The description with the key, as the file holds it.
#[derive(Serialize, Deserialize)]
struct Head {
    key: String,
    #[serde(flatten)]
    about: Description,
}

impl Entry {
    /// What the entry says of itself; `None` where it is damaged or gone.
    pub fn description(&self) -> Option<Description> {
        let mut file = BufReader::new(File::open(&self.path).ok()?);
        let mut magic = [0; MAGIC.len()];
        file.read_exact(&mut magic).ok()?;
        let mut line = Vec::new();
        let limit = MAX_DESCRIPTION as u64;
        file.take(limit).read_until(b'\n', &mut line).ok()?;
        let head: Head = serde_json::from_slice(&line).ok()?;
        (magic == MAGIC.as_bytes()).then_some(head.about)
    }
}

/// Writes an entry.
///
/// # Errors
/// Those of the file; a description that is too long.
pub fn encode(
    out: &mut dyn Write,
    key: &Key,
    about: &Description,
    write: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> std::io::Result<()> {
    let mut out = Summed {
        out,
        digest: Sha256::new(),
    };
    let head = serde_json::to_string(&Head {
        key: key.to_string(),
        about: about.clone(),
    })?;
    if head.len() >= MAX_DESCRIPTION {
        return Err(std::io::Error::other("its description is too long"));
    }
    writeln!(out, "{MAGIC}{head}")?;
    write(&mut out)?;
    let sum = out.digest.clone().finalize();
    out.write_all(&sum)
}

/// The result that the bytes of an entry hold.
///
/// # Errors
/// Says what is wrong with them.
pub fn decode(mut bytes: Vec<u8>, key: &Key) -> Result<Vec<u8>, &'static str> {
    let Some(end) = bytes.len().checked_sub(CHECKSUM) else {
        return Err("is cut short");
    };
    if Sha256::digest(&bytes[..end])[..] != bytes[end..] {
        return Err("does not match its checksum");
    }
    let start = MAGIC.len();
    let line = bytes.get(start..end).ok_or("is cut short")?;
    if !bytes.starts_with(MAGIC.as_bytes()) {
        return Err("is of another format");
    }
    let length = line.iter().position(|&b| b == b'\n');
    let length = length.ok_or("has no description")?;
    let head: Head =
        serde_json::from_slice(&line[..length]).map_err(|_| "has a wrong description")?;
    if head.key != key.to_string() {
        return Err("belongs to another key");
    }
    bytes.truncate(end);
    bytes.drain(..start + length + 1);
    Ok(bytes)
}

/// Hashes what passes through.
struct Summed<'a> {
    out: &'a mut dyn Write,
    digest: Sha256,
}

impl Write for Summed<'_> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let count = self.out.write(bytes)?;
        self.digest.update(&bytes[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.out.flush()
    }
}

/// The entry that a file of the cache's folder is, if it is one.
pub fn of_file(path: &Path) -> Option<Entry> {
    let key = Key::parse(path.file_name()?.to_str()?)?;
    let about = std::fs::symlink_metadata(path).ok()?;
    about.is_file().then_some(Entry {
        key,
        path: path.to_owned(),
        bytes: about.len(),
        used: about.modified().ok()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_altered_byte_and_every_cut_is_noticed() {
        let key = Key::of("table", &[b"x"]);
        let about = Description {
            kind: "table".into(),
            name: "a\nb".into(),
            details: String::new(),
            program: "organza".into(),
        };
        let mut bytes = Vec::new();
        encode(&mut bytes, &key, &about, |out| out.write_all(b"result\n\n")).unwrap();
        assert_eq!(decode(bytes.clone(), &key).unwrap(), b"result\n\n");
        assert!(decode(bytes.clone(), &Key::of("table", &[b"y"])).is_err());
        for at in 0..bytes.len() {
            let mut wrong = bytes.clone();
            wrong[at] ^= 1;
            assert!(decode(wrong, &key).is_err(), "byte {at}");
            assert!(decode(bytes[..at].to_vec(), &key).is_err(), "cut at {at}");
        }
    }
}
