//! Runs of threads as weavers write them: `8 red, 8 blue, 4 white`.

use crate::draft::MAX_THREADS;

/// The runs of a text: how many threads, and what `one` makes of the name. `expected` says what
/// stands behind the number, with an example.
///
/// # Errors
/// What is wrong, with the number of the entry.
pub(crate) fn listed<T>(
    text: &str,
    expected: &str,
    one: impl Fn(&str) -> Result<T, String>,
) -> Result<Vec<(usize, T)>, String> {
    let runs = text.split(',').enumerate();
    runs.map(|(i, item)| {
        let words: Vec<&str> = item.split_whitespace().collect();
        let (number, name) = match words[..] {
            [name] => (None, name),
            [number, name] => (Some(number), name),
            _ => {
                return Err(format!(
                    "entry {}: expected a number and {expected}, found \"{}\"",
                    i + 1,
                    item.trim()
                ));
            }
        };
        let at = |e: String| format!("entry {}: {e}", i + 1);
        let count = number.map_or(Ok(1), counted).map_err(at)?;
        Ok((count, one(name).map_err(at)?))
    })
    .collect()
}

/// A number of threads.
pub(crate) fn counted(text: &str) -> Result<usize, String> {
    let count = text.parse().ok().filter(|n| (1..=MAX_THREADS).contains(n));
    count.ok_or_else(|| {
        format!("expected a number of threads from 1 to {MAX_THREADS}, found \"{text}\"")
    })
}
