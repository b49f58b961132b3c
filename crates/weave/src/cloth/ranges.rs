//! The ranges of numbers in a fabric's tables.

use crate::Error;

/// A key of a table, its value if it is given, the least and the largest that are allowed, and
/// their unit.
pub(super) type Range<'a> = (&'a str, Option<f64>, [f64; 2], &'a str);

/// Refuses the first number that lies outside its range; one that is not a number does.
pub(super) fn check_ranges(table: &str, ranges: &[Range]) -> Result<(), Error> {
    for (key, value, [low, high], unit) in ranges {
        if let Some(found) = value.filter(|v| !(low..=high).contains(&v)) {
            let space = if unit.is_empty() { "" } else { " " };
            let message =
                format!("expected a number from {low} to {high}{space}{unit}, found {found}");
            return Err(Error::spec(format!("{table}.{key}"), message));
        }
    }
    Ok(())
}
