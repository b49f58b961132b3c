//! Tables in text.

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

/// The rows of a table in text: a line for each, with ` | ` between its fields.
///
/// # Panics
/// When a row has another number of fields.
pub fn table_rows<const N: usize>(text: &str) -> impl Iterator<Item = [&str; N]> {
    let rows = text.lines().filter(|line| !line.trim().is_empty());
    rows.map(|row| {
        let fields: Vec<&str> = row.split(" | ").map(str::trim).collect();
        fields.try_into().expect("every row has as many fields")
    })
}
