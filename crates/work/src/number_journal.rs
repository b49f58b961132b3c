//! The journal of a fit or a table: numbers that were found at places, so that a run that was
//! interrupted resumes where it ended.

use crate::error::input;
use crate::journal::{Journal, Record, Work};
use anyhow::{Context, Result};
use organza_measure::{Measured, Pair, PairValue};
use std::collections::HashMap;
use std::path::Path;

/// A place and the numbers found there: the count of the place's numbers and the bits of all
/// numbers, little-endian words of 8 bytes.
struct FoundNumbers {
    place: Vec<u64>,
    list: Vec<f64>,
}

impl Record for FoundNumbers {
    fn to_bytes(&self) -> Vec<u8> {
        let count = std::iter::once(self.place.len() as u64);
        let numbers = self.list.iter().map(|x| x.to_bits());
        let words = count.chain(self.place.iter().copied()).chain(numbers);
        words.flat_map(u64::to_le_bytes).collect()
    }

    fn from_bytes(bytes: Vec<u8>) -> Option<FoundNumbers> {
        let (words, []) = bytes.as_chunks::<8>() else {
            return None;
        };
        let words: Vec<u64> = words.iter().map(|w| u64::from_le_bytes(*w)).collect();
        let (&count, rest) = words.split_first()?;
        let (place, list) = rest.split_at_checked(usize::try_from(count).ok()?)?;
        Some(FoundNumbers {
            place: place.to_vec(),
            list: list.iter().map(|&x| f64::from_bits(x)).collect(),
        })
    }
}

/// Numbers by the bits of their places; each list is stored as soon as it is known.
pub struct NumberJournal {
    known: HashMap<Vec<u64>, Vec<f64>>,
    file: Option<Journal<FoundNumbers>>,
}

impl NumberJournal {
    /// Opens the journal of some work, or begins it. Without a path, nothing is stored.
    ///
    /// # Errors
    /// See [`Journal::open`].
    pub fn open(path: Option<&Path>, work: &Work<'_>) -> Result<NumberJournal> {
        let mut known = HashMap::new();
        let Some(path) = path else {
            return Ok(NumberJournal { known, file: None });
        };
        let mut journal = Journal::<FoundNumbers>::open(path, work)?;
        for number in 0..journal.count() {
            if let Some(found) = journal.read(number)? {
                known.insert(found.place, found.list);
            }
        }
        Ok(NumberJournal {
            known,
            file: Some(journal),
        })
    }

    /// Whether the numbers of a place are stored.
    pub fn has(&self, place: &[f64]) -> bool {
        let key: Vec<u64> = place.iter().map(|x| x.to_bits()).collect();
        self.known.contains_key(&key)
    }

    /// The `count` numbers of a place: those stored, or those that `find` returns, which are then
    /// stored.
    ///
    /// # Errors
    /// Those of `find`; a record of another length; a record that cannot be stored
    /// ([`JournalError`] stands in the chain of these).
    pub fn once(
        &mut self,
        place: &[f64],
        count: usize,
        find: impl FnOnce() -> Result<Vec<f64>>,
    ) -> Result<Vec<f64>> {
        let place: Vec<u64> = place.iter().map(|x| x.to_bits()).collect();
        if let Some(list) = self.known.get(&place) {
            if list.len() == count {
                return Ok(list.clone());
            }
            let name = self.file.as_ref().map(|f| f.path().display().to_string());
            let error = input(format!(
                "{}: holds {} numbers for a place where {count} are expected; remove it to start \
                 again",
                name.unwrap_or_default(),
                list.len()
            ));
            return Err(error.context(JournalError));
        }
        let found = FoundNumbers {
            place,
            list: find()?,
        };
        if let Some(journal) = &mut self.file {
            journal.add(&found).context(JournalError)?;
        }
        self.known.insert(found.place, found.list.clone());
        Ok(found.list)
    }
}

/// Marks errors of the journal itself, which end the search.
#[derive(Clone, Copy, Debug, thiserror::Error)]
#[error("the journal failed")]
pub struct JournalError;

/// How many numbers a value of a pair is.
pub const PAIR_NUMBERS: usize = 6;

/// Values of pairs as numbers: means and standard errors.
pub fn pair_numbers(list: &[PairValue]) -> Vec<f64> {
    let numbers = |v: &PairValue| [v.bsdf.mean, v.bsdf.se].concat();
    list.iter().flat_map(numbers).collect()
}

/// The values of pairs, of so many paths each, that [`pair_numbers`] made numbers of.
pub fn pair_values(pairs: &[Pair], paths: u64, numbers: &[f64]) -> Vec<PairValue> {
    let each = pairs.iter().zip(numbers.chunks_exact(PAIR_NUMBERS));
    let value = |(pair, v): (&Pair, &[f64])| PairValue {
        pair: *pair,
        bsdf: Measured::new([v[0], v[1], v[2]], [v[3], v[4], v[5]]),
        paths,
    };
    each.map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORK: Work<'_> = Work {
        command: "fit",
        key: "a",
    };

    fn never() -> Result<Vec<f64>> {
        panic!("known places are not looked at")
    }

    #[test]
    fn a_search_that_was_interrupted_resumes() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let open = || NumberJournal::open(Some(&path), &WORK).unwrap();
        let mut first = open();
        first.once(&[1.0, -2.5], 2, || Ok(vec![0.1, 7.0])).unwrap();
        first.once(&[3.0, 4.0], 0, || Ok(Vec::new())).unwrap();
        assert!(first.once(&[0.0], 1, || Err(input("no answer"))).is_err());
        drop(first);
        let mut again = open();
        assert_eq!(again.once(&[1.0, -2.5], 2, never).unwrap(), [0.1, 7.0]);
        assert!(again.once(&[3.0, 4.0], 0, never).unwrap().is_empty());
        assert_eq!(again.once(&[0.0], 1, || Ok(vec![2.0])).unwrap(), [2.0]);
        drop(again);
        assert_eq!(open().once(&[0.0], 1, never).unwrap(), [2.0]);
    }

    #[test]
    fn lists_of_another_length_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("journal");
        let mut journal = NumberJournal::open(Some(&path), &WORK).unwrap();
        journal.once(&[1.0], 2, || Ok(vec![0.1, 7.0])).unwrap();
        let short = journal.once(&[1.0], 3, never).unwrap_err();
        assert!(short.is::<JournalError>());
        let short = format!("{short:#}");
        assert!(short.contains("2 numbers for a place where 3"), "{short}");
    }
}
