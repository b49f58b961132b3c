//! The table of choices as CSV.

use super::choice::Choice;
use super::lit::Lit;
use super::table::{Row, Traits};
use crate::representation::{Representation, Tracker};
use organza_measure::{Cost, Figure};
use serde::{Deserialize, Serialize, Serializer};
use std::fmt::Display;

/// The table that the program carries along.
const MEASURED: &str = include_str!("../../data/choices.csv");

/// A line of the file; its fields are the columns.
#[derive(Serialize, Deserialize)]
struct Line {
    fabric: String,
    #[serde(serialize_with = "fixed::<4, _>")]
    spacing_mm: f64,
    #[serde(serialize_with = "fixed::<4, _>")]
    openness: f64,
    #[serde(serialize_with = "fixed::<4, _>")]
    albedo: f64,
    #[serde(serialize_with = "fixed::<3, _>")]
    fibre_um: f64,
    #[serde(serialize_with = "shortest")]
    pixel_mm: f64,
    lit: Lit,
    model: &'static Representation,
    #[serde(serialize_with = "shortest")]
    voxel_scale: f32,
    level: u8,
    tracker: Tracker,
    #[serde(serialize_with = "fixed::<5, _>")]
    rmse: f64,
    #[serde(serialize_with = "fixed::<5, _>")]
    rmse_low: f64,
    #[serde(serialize_with = "fixed::<5, _>")]
    rmse_high: f64,
    #[serde(serialize_with = "fixed::<5, _>")]
    bias: f64,
    #[serde(serialize_with = "fixed::<5, _>")]
    bias_low: f64,
    #[serde(serialize_with = "fixed::<5, _>")]
    bias_high: f64,
    #[serde(serialize_with = "fixed::<4, _>")]
    setup_s: f64,
    #[serde(serialize_with = "fixed::<6, _>")]
    noise_s: f64,
    memory_bytes: u64,
}

/// A number with `DIGITS` digits after the point.
fn fixed<const DIGITS: usize, S: Serializer>(x: &f64, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(&format_args!("{x:.DIGITS$}"))
}

/// A number with as few digits as it needs: `1`, not `1.0`.
fn shortest<T: Display, S: Serializer>(x: &T, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(x)
}

impl From<&Row> for Line {
    fn from(r: &Row) -> Line {
        Line {
            fabric: r.fabric.clone(),
            spacing_mm: r.traits.spacing_mm,
            openness: r.traits.openness,
            albedo: r.traits.albedo,
            fibre_um: r.traits.fibre_um,
            pixel_mm: r.pixel_mm,
            lit: r.lit,
            model: r.choice.model,
            voxel_scale: r.choice.voxel_scale,
            level: r.choice.level,
            tracker: r.choice.tracker,
            rmse: r.rmse.value,
            rmse_low: r.rmse.low,
            rmse_high: r.rmse.high,
            bias: r.bias.value,
            bias_low: r.bias.low,
            bias_high: r.bias.high,
            setup_s: r.cost.setup_s,
            noise_s: r.cost.noise_s,
            memory_bytes: r.cost.memory_bytes,
        }
    }
}

impl From<Line> for Row {
    fn from(l: Line) -> Row {
        Row {
            fabric: l.fabric,
            traits: Traits {
                spacing_mm: l.spacing_mm,
                openness: l.openness,
                albedo: l.albedo,
                fibre_um: l.fibre_um,
            },
            pixel_mm: l.pixel_mm,
            lit: l.lit,
            choice: Choice {
                model: l.model,
                voxel_scale: l.voxel_scale,
                level: l.level,
                tracker: l.tracker,
            },
            rmse: Figure {
                value: l.rmse,
                low: l.rmse_low,
                high: l.rmse_high,
            },
            bias: Figure {
                value: l.bias,
                low: l.bias_low,
                high: l.bias_high,
            },
            cost: Cost {
                setup_s: l.setup_s,
                noise_s: l.noise_s,
                memory_bytes: l.memory_bytes,
            },
        }
    }
}

/// The table as CSV.
///
/// # Errors
/// None is expected: it is written into a text.
pub fn write(rows: &[Row]) -> csv::Result<String> {
    let mut out = csv::Writer::from_writer(Vec::new());
    for row in rows {
        out.serialize(Line::from(row))?;
    }
    let bytes = out.into_inner().map_err(|e| e.into_error())?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// The rows of a table; lines that are none are left out.
fn read(text: &str) -> Vec<Row> {
    let mut file = csv::Reader::from_reader(text.as_bytes());
    let lines = file.deserialize::<Line>();
    lines.filter_map(|line| line.ok().map(Row::from)).collect()
}

/// The rows of a table, each checked.
///
/// # Errors
/// Why a line is no row, in words that follow the name of the file.
pub(super) fn rows(bytes: &[u8]) -> Result<Vec<Row>, String> {
    let mut file = csv::Reader::from_reader(bytes);
    let expected = "expected the choices.csv of `organza bench`";
    let mut rows = Vec::new();
    for (at, line) in file.deserialize::<Line>().enumerate() {
        let fail = |why: &str| format!("line {}: {why}; {expected}", at + 2);
        let line = line.map_err(|e| match e.kind() {
            csv::ErrorKind::Deserialize { err, .. } => fail(&err.kind().to_string()),
            _ => fail(&e.to_string()),
        })?;
        let row = Row::from(line);
        if !row.is_possible() {
            return Err(fail("a number is out of range"));
        }
        rows.push(row);
    }
    if rows.is_empty() {
        return Err(format!("has no rows; {expected}"));
    }
    Ok(rows)
}

/// The table that the program carries along.
pub fn measured() -> Vec<Row> {
    read(MEASURED)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_read_as_they_were_written_and_the_programs_own_is_whole() {
        let rows = measured();
        assert_eq!(rows.len(), MEASURED.lines().count() - 1);
        assert_eq!(write(&rows).unwrap(), MEASURED);
        let mut named = rows[..2].to_vec();
        named[0].fabric = "plain, \"grey\"".into();
        assert_eq!(read(&write(&named).unwrap()), named);
        let (head, _) = MEASURED.split_once('\n').unwrap();
        assert!(read(&format!("{head}\ndenim,1,2\n")).is_empty());
    }

    #[test]
    fn tables_beside_fabrics_are_checked_line_by_line() {
        let all = measured();
        assert_eq!(rows(MEASURED.as_bytes()).unwrap(), all);
        let (head, lines) = MEASURED.split_once('\n').unwrap();
        let first = lines.lines().next().unwrap();
        let fields: Vec<&str> = first.split(',').collect();
        let with = |column: usize, value: &str| {
            let mut own = fields.clone();
            own[column] = value;
            rows(format!("{head}\n{first}\n{}\n", own.join(",")).as_bytes()).unwrap_err()
        };
        let column = |name: &str| head.split(',').position(|h| h == name).unwrap();
        for (name, value) in [
            ("pixel_mm", "0"),
            ("rmse_high", "NaN"),
            ("noise_s", "-1"),
            ("voxel_scale", "inf"),
            ("albedo", "1e300"),
        ] {
            let why = with(column(name), value);
            assert!(
                why.starts_with("line 3: a number is out of range"),
                "{name}: {why}"
            );
        }
        let why = with(column("model"), "fibers");
        assert!(
            why.starts_with("line 3: ") && why.contains("fibres"),
            "{why}"
        );
        for text in ["", head, "a,b\n1,2\n", "\u{0}\n\n\n"] {
            let why = rows(text.as_bytes()).unwrap_err();
            assert!(why.contains("expected the choices.csv"), "{text}: {why}");
        }
    }
}
