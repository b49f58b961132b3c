//! Tables of numbers in text.

/// The numbers of a CSV table, row by row. Headers, comments and other lines that are not
/// rows of numbers are left out.
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
