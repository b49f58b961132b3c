//! Pairs of directions and the CSV files that list them.

use crate::{Measured, PairValue};
use glam::Vec3;
use organza_basis::nearest_name;

/// A direction away from the cloth: polar angle from the face normal and
/// azimuth from the weft toward the warp.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Angles {
    /// 0 along the normal of the face, 180 along that of the back.
    pub theta_deg: f64,
    /// Any finite number.
    pub phi_deg: f64,
}

impl Angles {
    /// Of both angles, degrees.
    pub const fn new(theta_deg: f64, phi_deg: f64) -> Angles {
        Angles { theta_deg, phi_deg }
    }

    /// Along the normal of the face.
    pub const NORMAL: Angles = Angles::new(0.0, 0.0);

    /// The unit vector.
    pub fn direction(&self) -> Vec3 {
        let (sin_t, cos_t) = self.theta_deg.to_radians().sin_cos();
        let (sin_p, cos_p) = (self.phi_deg % 360.0).to_radians().sin_cos();
        glam::DVec3::new(sin_t * cos_p, sin_t * sin_p, cos_t)
            .as_vec3()
            .normalize()
    }
}

/// The directions of the light and of the eye.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Pair {
    /// Toward the light.
    pub incident: Angles,
    /// Toward the eye.
    pub exitant: Angles,
}

impl Pair {
    /// Of both directions.
    pub const fn new(incident: Angles, exitant: Angles) -> Pair {
        Pair { incident, exitant }
    }
}

/// A mistake in a file, with its place.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{line}:{column}: {kind}")]
pub struct PairsError {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// The mistake.
    pub kind: PairsErrorKind,
}

/// The kinds of mistakes.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PairsErrorKind {
    /// The header lacks a column.
    #[error("the header has no column `{column}`; expected {expected}{}", hint(.nearest))]
    MissingColumn {
        /// Its name.
        column: &'static str,
        /// The required columns.
        expected: String,
        /// The present column that is nearest to it.
        nearest: Option<String>,
    },
    /// A column appears twice.
    #[error("the column `{0}` appears twice in the header")]
    RepeatedColumn(&'static str),
    /// A line that ends early.
    #[error("the line has {found} fields; expected {expected} as in the header")]
    Fields {
        /// Fields of the line.
        found: usize,
        /// Fields of the header.
        expected: usize,
    },
    /// A field is not a number, or is out of range.
    #[error("{column}: expected {expected}, found `{found}`")]
    Number {
        /// Name of the column.
        column: &'static str,
        /// The valid range in words.
        expected: &'static str,
        /// What stands there.
        found: String,
    },
    /// The file has at most a header.
    #[error("the file lists no directions")]
    Empty,
}

fn hint(nearest: &Option<String>) -> String {
    match nearest {
        Some(n) => format!("; `{n}` is near, is it meant?"),
        None => String::new(),
    }
}

/// Directions nearer to the cloth's plane than this, as a cosine, are refused: there the cosine
/// in the denominator of the BSDF vanishes.
const MIN_COSINE: f64 = 1e-4;

/// Reads a CSV file with a header that names the columns `theta_i`, `phi_i`, `theta_o` and
/// `phi_o`, in degrees, in any order. Further columns are ignored, so that a table of results
/// can be read as a list of pairs. Blank lines and lines that begin with `#` are ignored as
/// well. Fields may be in quotes. theta runs from 0 to 180: light and eye may be on either
/// side.
///
/// # Errors
/// The first mistake, with line and column.
pub fn parse_pairs(text: &str) -> Result<Vec<Pair>, PairsError> {
    parse(text, ["theta_i", "phi_i", "theta_o", "phi_o"], |v| {
        Pair::new(Angles::new(v[0], v[1]), Angles::new(v[2], v[3]))
    })
}

/// The incident directions of a file, which needs no exitant directions: each once, in the
/// order of their first appearance.
///
/// # Errors
/// As [`parse_pairs`].
pub fn parse_incident(text: &str) -> Result<Vec<Angles>, PairsError> {
    let all = parse(text, ["theta_i", "phi_i"], |v| Angles::new(v[0], v[1]))?;
    Ok(distinct_incident(all))
}

/// Measured values of a table as [`write_pairs`](crate::write_pairs) writes it;
/// without the columns of standard errors they are zero.
///
/// # Errors
/// See [`PairsError`].
pub fn parse_values(text: &str) -> Result<Vec<PairValue>, PairsError> {
    let value = |v: [f64; 7], se: [f64; 3]| PairValue {
        pair: Pair::new(Angles::new(v[0], v[1]), Angles::new(v[2], v[3])),
        bsdf: Measured::new([v[4], v[5], v[6]], se),
        paths: 0,
    };
    const NAMES: [&str; 7] = ["theta_i", "phi_i", "theta_o", "phi_o", "r", "g", "b"];
    let mean = parse(text, NAMES, |v| v)?;
    let se = parse(text, ["se_r", "se_g", "se_b"], |v| v);
    let se = se.unwrap_or_else(|_| vec![[0.0; 3]; mean.len()]);
    Ok(mean.into_iter().zip(se).map(|(v, s)| value(v, s)).collect())
}

/// Each direction once, in the order of first appearance.
pub fn distinct_incident(all: impl IntoIterator<Item = Angles>) -> Vec<Angles> {
    let mut seen = std::collections::HashSet::new();
    let bits = |a: &Angles| (a.theta_deg.to_bits(), a.phi_deg.to_bits());
    all.into_iter().filter(|a| seen.insert(bits(a))).collect()
}

fn parse<const N: usize, T>(
    text: &str,
    names: [&'static str; N],
    make: impl Fn([f64; N]) -> T,
) -> Result<Vec<T>, PairsError> {
    let mut table = Table::new(text);
    let Some(header) = table.next() else {
        return Err(PairsError {
            line: 1,
            column: 1,
            kind: PairsErrorKind::Empty,
        });
    };
    let columns: Vec<&str> = header.fields().map(|(_, f)| f).collect();
    let mut at = [0; N];
    for (index, name) in at.iter_mut().zip(names) {
        let mut found = (0..columns.len()).filter(|&i| columns.get(i) == Some(&name));
        *index = found.next().ok_or_else(|| {
            let unknown = columns.iter().copied().filter(|c| !names.contains(c));
            let nearest = nearest_name(name, unknown).map(str::to_owned);
            let place = columns.iter().position(|c| Some(*c) == nearest.as_deref());
            let kind = PairsErrorKind::MissingColumn {
                column: name,
                expected: names.join(","),
                nearest,
            };
            header.error(place.unwrap_or(0), kind)
        })?;
        if let Some(again) = found.next() {
            return Err(header.error(again, PairsErrorKind::RepeatedColumn(name)));
        }
    }
    let mut list = Vec::new();
    for row in table {
        let found = row.record.len();
        if found != columns.len() {
            let expected = columns.len();
            return Err(row.error(found, PairsErrorKind::Fields { found, expected }));
        }
        let mut values = [0.0; N];
        for ((value, &index), name) in values.iter_mut().zip(&at).zip(names) {
            let field = row.record.get(index).map_or("", str::trim);
            let number = if name.starts_with("theta") {
                polar_angle(field)
            } else if name.starts_with("phi") {
                azimuth(field)
            } else {
                quantity(field)
            };
            *value = number.map_err(|expected| {
                let kind = PairsErrorKind::Number {
                    column: name,
                    expected,
                    found: field.to_owned(),
                };
                row.error(index, kind)
            })?;
        }
        list.push(make(values));
    }
    if list.is_empty() {
        return Err(PairsError {
            line: header.line,
            column: 1,
            kind: PairsErrorKind::Empty,
        });
    }
    Ok(list)
}

/// The records of a CSV file, with their lines in it.
struct Table {
    records: csv::StringRecordsIntoIter<std::io::Cursor<String>>,
    /// The numbers, from 1, of the lines that are neither blank nor comments.
    lines: Vec<usize>,
}

/// A record and its place.
struct Row {
    record: csv::StringRecord,
    /// From 1.
    line: usize,
}

impl Table {
    fn new(text: &str) -> Table {
        let (mut kept, mut lines) = (String::new(), Vec::new());
        let text = text.trim_start_matches('\u{feff}');
        for (number, line) in text.lines().enumerate() {
            if !(line.trim().is_empty() || line.trim_start().starts_with('#')) {
                kept += line;
                kept.push('\n');
                lines.push(number + 1);
            }
        }
        let reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .terminator(csv::Terminator::Any(b'\n'))
            .from_reader(std::io::Cursor::new(kept));
        Table {
            records: reader.into_records(),
            lines,
        }
    }
}

impl Iterator for Table {
    type Item = Row;

    fn next(&mut self) -> Option<Row> {
        // Reading valid text from memory cannot fail.
        let record = self.records.next()?.ok()?;
        let kept = record.position().map_or(1, csv::Position::line) as usize;
        let line = self.lines.get(kept.saturating_sub(1));
        let line = line.copied().unwrap_or(kept);
        Some(Row { record, line })
    }
}

impl Row {
    /// The fields, and the columns, from 1, where they begin; for a field in quotes, the column
    /// where it would begin without them.
    fn fields(&self) -> impl Iterator<Item = (usize, &str)> {
        let mut column = 1;
        self.record.iter().map(move |field| {
            let start = column + field.chars().take_while(|c| c.is_whitespace()).count();
            column += field.chars().count() + 1;
            (start, field.trim())
        })
    }

    /// A mistake in a field, or at the end of the line behind the last one.
    fn error(&self, field: usize, kind: PairsErrorKind) -> PairsError {
        let letters: usize = self.record.iter().map(|f| f.chars().count() + 1).sum();
        PairsError {
            line: self.line,
            column: self.fields().nth(field).map_or(letters, |(start, _)| start),
            kind,
        }
    }
}

fn polar_angle(field: &str) -> Result<f64, &'static str> {
    let theta: f64 = field.parse().unwrap_or(f64::NAN);
    if !(0.0..=180.0).contains(&theta) {
        return Err("an angle from 0 to 180 degrees");
    }
    if theta.to_radians().cos().abs() < MIN_COSINE {
        return Err("a direction out of the cloth's plane, 0.006 degrees off 90 or more");
    }
    Ok(theta)
}

fn quantity(field: &str) -> Result<f64, &'static str> {
    match field.parse::<f64>() {
        Ok(x) if x.is_finite() && x >= 0.0 => Ok(x),
        _ => Err("a number of at least 0"),
    }
}

fn azimuth(field: &str) -> Result<f64, &'static str> {
    match field.parse::<f64>() {
        Ok(phi) if phi.is_finite() => Ok(phi),
        _ => Err("an angle in degrees"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_found_by_name_and_the_rest_left_alone() {
        let text = "# a table\n\nr, phi_i,theta_i,theta_o,phi_o\n0.1,10, 30,120,-45\n";
        let pairs = parse_pairs(text).unwrap();
        let expected = Pair::new(Angles::new(30.0, 10.0), Angles::new(120.0, -45.0));
        assert_eq!(pairs, [expected]);
        let quoted = text.replace("120", "\"120\"").replace('\n', "\r\n");
        assert_eq!(parse_pairs(&quoted).unwrap(), [expected]);
        let w = expected.exitant.direction();
        assert!(w.z < 0.0 && (w.length() - 1.0).abs() < 1e-6);
        let twice = "theta_i,phi_i\n30,0\n150,0\n30,0\n";
        let list = parse_incident(twice).unwrap();
        assert_eq!(list, [Angles::new(30.0, 0.0), Angles::new(150.0, 0.0)]);
    }

    #[test]
    fn mistakes_are_reported_with_their_place() {
        let head = "theta_i,phi_i,theta_o,phi_o\n";
        for (text, words) in [
            (String::new(), "1:1: the file lists no directions"),
            (head.into(), "1:1: the file lists no directions"),
            (
                "theta_i,phi_i,tehta_o,phi_o\n".into(),
                "1:15: the header has no column `theta_o`; expected \
                 theta_i,phi_i,theta_o,phi_o; `tehta_o` is near, is it meant?",
            ),
            (
                "theta_i,phi_i,theta_i,phi_o,theta_o\n".into(),
                "1:15: the column `theta_i` appears twice in the header",
            ),
            (
                format!("{head}1,2,3,4\n1,2,NaN,4\n"),
                "3:5: theta_o: expected an angle from 0 to 180 degrees, found `NaN`",
            ),
            (
                format!("{head}-1,2,3,4\n"),
                "2:1: theta_i: expected an angle from 0 to 180 degrees, found `-1`",
            ),
            (
                format!("{head}1,2,180.5,4\n"),
                "2:5: theta_o: expected an angle from 0 to 180 degrees, found `180.5`",
            ),
            (
                format!("{head}90,2,3,4\n"),
                "2:1: theta_i: expected a direction out of the cloth's plane, 0.006 degrees off \
                 90 or more, found `90`",
            ),
            (
                format!("{head}1, inf,3,4\n"),
                "2:4: phi_i: expected an angle in degrees, found `inf`",
            ),
            (
                format!("{head}\n# a comment\n1,2,3,4\n  \n\"1\",2,x,4\n"),
                "6:5: theta_o: expected an angle from 0 to 180 degrees, found `x`",
            ),
            (
                format!("{head}1,2,3\n"),
                "2:6: the line has 3 fields; expected 4 as in the header",
            ),
        ] {
            assert_eq!(parse_pairs(&text).unwrap_err().to_string(), words);
        }
    }
}
