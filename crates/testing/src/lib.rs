//! Helpers that the tests of several crates share. Only `[dev-dependencies]` name this
//! crate.
//!
//! ```
//! let rows = organza_testing::csv_numbers("# a table\na,b\n1,2.5\n3,4\n");
//! assert_eq!(rows, [[1.0, 2.5], [3.0, 4.0]]);
//! ```

/// The numbers of a CSV table, row by row; headers, comments and whatever else is no row
/// of numbers are left out.
pub fn csv_numbers(text: &str) -> Vec<Vec<f64>> {
    csv::ReaderBuilder::new()
        .has_headers(false)
        .flexible(true)
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes())
        .records()
        .filter_map(|record| {
            record
                .ok()?
                .iter()
                .map(|field| field.parse().ok())
                .collect()
        })
        .collect()
}
