//! The journal of a search: evaluated points and their results, so that a
//! search that was broken off goes on where it ended.

use crate::error::input;
use anyhow::{Context, Result};
use organza_scene::read;
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// Numbers by the bits of their places; each list is written down as soon as
/// it is known.
pub struct FileJournal {
    known: HashMap<Vec<u64>, Vec<f64>>,
    file: Option<File>,
}

impl FileJournal {
    /// Opens the file of the search that `key` describes, or begins it.
    ///
    /// # Errors
    /// A file of another search, or one that cannot be read or written.
    pub fn open(path: Option<&Path>, key: &str) -> Result<FileJournal> {
        let mut known = HashMap::new();
        let Some(path) = path else {
            return Ok(FileJournal { known, file: None });
        };
        let head: String = Sha256::digest(key.as_bytes())
            .iter()
            .map(|b| format!("{b:02x}"))
            .collect();
        let text = if path.exists() {
            read::text(path)?
        } else {
            String::new()
        };
        // Broken off while it was begun: as if it were not there.
        let is_begun = text.contains('\n') || !head.starts_with(&text);
        let mut lines = text.lines();
        if let Some(first) = lines.next().filter(|_| is_begun)
            && first != head
        {
            return Err(input(format!(
                "{}: belongs to another search; remove it to start again",
                path.display()
            )));
        }
        for line in lines {
            // A last line that was cut off is computed again.
            if let Some((place, list)) = parse(line) {
                known.insert(place, list);
            }
        }
        let mut file = File::options()
            .append(true)
            .create(true)
            .open(path)
            .with_context(|| format!("cannot write {}", path.display()))?;
        if !is_begun {
            file.set_len(0)?;
            writeln!(file, "{head}")?;
        } else if !text.ends_with('\n') {
            writeln!(file)?;
        }
        Ok(FileJournal {
            known,
            file: Some(file),
        })
    }

    /// The numbers of a place: those remembered, or those of `find`, which are
    /// then remembered.
    ///
    /// # Errors
    /// What `find` says.
    pub fn once(
        &mut self,
        place: &[f64],
        find: impl FnOnce() -> Result<Vec<f64>>,
    ) -> Result<Vec<f64>> {
        let key: Vec<u64> = place.iter().map(|x| x.to_bits()).collect();
        if let Some(list) = self.known.get(&key) {
            return Ok(list.clone());
        }
        let list = find()?;
        if let Some(file) = &mut self.file {
            let mut line = String::new();
            let words = list.iter().map(|x| x.to_bits());
            for word in [key.len() as u64]
                .into_iter()
                .chain(key.iter().copied())
                .chain(words)
            {
                let _ = write!(line, "{word:x} ");
            }
            // A journal that cannot grow costs time, not the answer.
            let _ = writeln!(file, "{line}.");
        }
        self.known.insert(key, list.clone());
        Ok(list)
    }
}

/// A place and its numbers: the count of the place's numbers, all of them, a
/// stop.
fn parse(line: &str) -> Option<(Vec<u64>, Vec<f64>)> {
    let words = line.strip_suffix('.')?.split_ascii_whitespace();
    let words: Result<Vec<u64>, _> = words.map(|w| u64::from_str_radix(w, 16)).collect();
    let words = words.ok()?;
    let (&count, rest) = words.split_first()?;
    let count = usize::try_from(count).ok()?;
    let (place, list) = rest.split_at_checked(count)?;
    Some((
        place.to_vec(),
        list.iter().map(|&x| f64::from_bits(x)).collect(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_search_that_was_broken_off_goes_on() {
        let path = std::env::temp_dir().join(format!("organza_journal_{}", std::process::id()));
        let _ = std::fs::remove_file(&path);
        let never = || -> Result<Vec<f64>> { panic!("known places are not looked at") };
        let mut first = FileJournal::open(Some(&path), "a").unwrap();
        first.once(&[1.0, -2.5], || Ok(vec![0.1, 7.0])).unwrap();
        first.once(&[3.0, 4.0], || Ok(Vec::new())).unwrap();
        assert!(first.once(&[0.0], || Err(input("no answer"))).is_err());
        drop(first);
        // As when the machine stops in the middle of a line.
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, format!("{text}1 3ff")).unwrap();
        let mut again = FileJournal::open(Some(&path), "a").unwrap();
        assert_eq!(again.once(&[1.0, -2.5], never).unwrap(), [0.1, 7.0]);
        assert!(again.once(&[3.0, 4.0], never).unwrap().is_empty());
        assert_eq!(again.once(&[0.0], || Ok(vec![2.0])).unwrap(), [2.0]);
        drop(again);
        let mut last = FileJournal::open(Some(&path), "a").unwrap();
        assert_eq!(last.once(&[0.0], never).unwrap(), [2.0]);
        assert!(FileJournal::open(Some(&path), "another search").is_err());
        let _ = std::fs::remove_file(&path);
    }
}
