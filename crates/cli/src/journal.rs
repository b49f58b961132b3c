//! A search's memory in a file: places and their costs, so that a search that
//! was broken off goes on where it ended.

use crate::error::input;
use crate::read;
use anyhow::{Context, Result};
use organza_measure::Journal;
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;

/// Costs by the bits of their places; each is written down as soon as it is
/// known.
pub struct FileJournal {
    costs: HashMap<Vec<u64>, f64>,
    file: Option<File>,
}

impl FileJournal {
    /// Opens the file of the search that `key` describes, or begins it.
    ///
    /// # Errors
    /// A file of another search, or one that cannot be read or written.
    pub fn open(path: Option<&Path>, key: &str) -> Result<FileJournal> {
        let mut costs = HashMap::new();
        let Some(path) = path else {
            return Ok(FileJournal { costs, file: None });
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
                "{}: belongs to another search; remove it to begin anew",
                path.display()
            )));
        }
        for line in lines {
            // A last line that was cut off is computed again.
            let words: Vec<u64> = line
                .split(' ')
                .filter_map(|w| u64::from_str_radix(w, 16).ok())
                .collect();
            if let (Some((&cost, place)), true) = (words.split_last(), line.ends_with(' ')) {
                costs.insert(place.to_vec(), f64::from_bits(cost));
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
            costs,
            file: Some(file),
        })
    }
}

fn bits(place: &[f64]) -> Vec<u64> {
    place.iter().map(|x| x.to_bits()).collect()
}

impl Journal for FileJournal {
    fn recall(&self, place: &[f64]) -> Option<f64> {
        self.costs.get(&bits(place)).copied()
    }

    fn keep(&mut self, place: &[f64], cost: f64) {
        let key = bits(place);
        if let Some(file) = &mut self.file {
            let words = key
                .iter()
                .chain(std::iter::once(&cost.to_bits()))
                .fold(String::new(), |line, w| line + &format!("{w:016x} "));
            // A journal that cannot grow costs time, not the answer.
            let _ = writeln!(file, "{words}");
        }
        self.costs.insert(key, cost);
    }
}
