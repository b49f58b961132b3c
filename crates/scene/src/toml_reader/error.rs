//! Mistakes in TOML, in plain words.

use organza_basis::nearest_name;
use serde::de::{Error as _, Expected, Unexpected};
use std::fmt::{self, Display};
use std::ops::Range;

/// A mistake in a TOML text.
#[derive(Clone, Debug, PartialEq)]
pub struct TomlError {
    /// What was expected and what was found.
    pub message: String,
    /// Bytes of the text that it is about, if it is about a part of it.
    pub span: Option<Range<usize>>,
    /// Whether one table stands where a list of tables is expected.
    pub is_table_for_list: bool,
}

impl TomlError {
    /// The same, about a place if it is about none yet.
    pub(super) fn at(mut self, span: &Option<Range<usize>>) -> TomlError {
        if self.span.is_none() {
            self.span.clone_from(span);
        }
        self
    }

    /// A name that is none of those expected, with the nearest one.
    fn unknown(what: &str, wrong: &str, expected: &[&str]) -> TomlError {
        let names: Vec<String> = expected.iter().map(|name| format!("`{name}`")).collect();
        let message = match &names[..] {
            [] => format!("unknown {what} `{wrong}`, none is expected"),
            [only] => format!("unknown {what} `{wrong}`, expected {only}"),
            [one, other] => format!("unknown {what} `{wrong}`, expected {one} or {other}"),
            many => format!(
                "unknown {what} `{wrong}`, expected one of {}",
                many.join(", ")
            ),
        };
        // `fov` is far from `fov_deg` by letters, and yet its beginning.
        let longer = || expected.iter().find(|name| name.starts_with(wrong));
        let longer = || longer().copied().filter(|_| wrong.len() > 1);
        let near = nearest_name(wrong, expected.iter().copied()).or_else(longer);
        let near = near.map_or(String::new(), |near| format!("; did you mean `{near}`?"));
        TomlError::custom(message + &near)
    }
}

impl Display for TomlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for TomlError {}

impl serde::de::Error for TomlError {
    fn custom<T: Display>(message: T) -> TomlError {
        TomlError {
            message: message.to_string(),
            span: None,
            is_table_for_list: false,
        }
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> TomlError {
        let expected = expected_in_words(expected);
        let message = format!("expected {expected}, found {}", found_in_words(found));
        TomlError {
            is_table_for_list: found == Unexpected::Map && expected == "a list",
            ..TomlError::custom(message)
        }
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> TomlError {
        TomlError::invalid_type(found, expected)
    }

    fn invalid_length(found: usize, expected: &dyn Expected) -> TomlError {
        let expected = expected_in_words(expected);
        TomlError::custom(format!("expected {expected}, found {found}"))
    }

    fn unknown_variant(wrong: &str, expected: &'static [&'static str]) -> TomlError {
        TomlError::unknown("variant", wrong, expected)
    }

    fn unknown_field(wrong: &str, expected: &'static [&'static str]) -> TomlError {
        TomlError::unknown("field", wrong, expected)
    }

    fn missing_field(key: &'static str) -> TomlError {
        TomlError::custom(format!("`{key}` is missing"))
    }
}

/// What serde's own visitors expect is known only by the name that they display, which is
/// Rust's. `every_type_is_expected_in_plain_words` holds every name in use to the version
/// of serde in `Cargo.lock`; our own visitors speak plainly already.
fn expected_in_words(expected: &dyn Expected) -> String {
    let name = expected.to_string();
    let whole = |max: u64| format!("a whole number from 0 to {max}");
    match name.as_str() {
        "f32" | "f64" => "a number".into(),
        "u8" => whole(u64::from(u8::MAX)),
        "u16" => whole(u64::from(u16::MAX)),
        "u32" => whole(u64::from(u32::MAX)),
        "u64" | "usize" => "a whole number of at least 0".into(),
        "i32" | "i64" => "a whole number".into(),
        "a sequence" => "a list".into(),
        "a map" | "map" => "a table".into(),
        "a boolean" => "true or false".into(),
        "a string" => "a text in quotes".into(),
        "variant identifier" | "string or map" | "map with a single key" => {
            "a name in quotes".into()
        }
        _ if name.starts_with("struct ") => "a table".into(),
        _ => match name.strip_prefix("an array of length ") {
            Some(count) => format!("a list of {count} values"),
            None => name,
        },
    }
}

fn found_in_words(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Bool(truth) => truth.to_string(),
        Unexpected::Unsigned(whole) => whole.to_string(),
        Unexpected::Signed(whole) => whole.to_string(),
        // With a decimal point.
        Unexpected::Float(decimal) => format!("{decimal:?}"),
        Unexpected::Str(text) => format!("the text {text:?}"),
        Unexpected::Seq => "a list".into(),
        Unexpected::Map => "a table".into(),
        other => other.to_string(),
    }
}
