//! What the reader of TOML says, in the words of who writes it.

use organza_basis::nearest_name;

/// A message of the reader in plain words. `header` is the table at whose header
/// it points, if it points at one.
pub fn plain(message: &str, header: Option<&str>) -> String {
    let message = message.trim_end();
    if message.starts_with("unknown") {
        return with_nearest(message);
    }
    if let Some(key) = message.strip_prefix("missing field ") {
        return format!("{key} is missing");
    }
    if message.ends_with("expected string only") {
        return "expected a name in quotes".into();
    }
    if message == "wanted string or table" {
        return "expected a name in quotes or a table".into();
    }
    if message.starts_with("wanted exactly 1 element") {
        return "expected one table in single brackets, found a list of them".into();
    }
    let Some((found, expected)) = message
        .strip_prefix("invalid ")
        .and_then(|rest| rest.split_once(", expected "))
    else {
        return message.to_owned();
    };
    let expected = expected_words(expected);
    let found = ["type: ", "value: ", "length "]
        .iter()
        .find_map(|kind| found.strip_prefix(kind))
        .unwrap_or(found);
    match (found, header) {
        ("map", Some(table)) if expected == "a list" => {
            format!("expected a list of tables, found one table; write [[{table}]]")
        }
        _ => format!("expected {expected}, found {}", found_words(found)),
    }
}

fn expected_words(expected: &str) -> String {
    let whole = |most: u64| format!("a whole number from 0 to {most}");
    match expected {
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
        "variant identifier" => "a name in quotes".into(),
        _ if expected.starts_with("struct ") => "a table".into(),
        _ => match expected.strip_prefix("an array of length ") {
            Some(count) => format!("a list of {count} values"),
            None => expected.to_owned(),
        },
    }
}

fn found_words(found: &str) -> String {
    match found {
        "map" => return "a table".into(),
        "sequence" => return "a list".into(),
        _ => {}
    }
    for kind in ["integer ", "floating point ", "boolean "] {
        if let Some(value) = found.strip_prefix(kind) {
            return value.trim_matches('`').to_owned();
        }
    }
    found
        .strip_prefix("string ")
        .map_or(found.to_owned(), |text| format!("the text {text}"))
}

/// Adds "did you mean" to a message of the form "unknown X `a`, expected one of
/// `b`, `c`".
fn with_nearest(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let Some(wrong) = quoted.next() else {
        return message.to_owned();
    };
    let valid: Vec<&str> = quoted.collect();
    // `fov` is far from `fov_deg` by letters, and yet its beginning.
    let longer = || valid.iter().copied().find(|v| v.starts_with(wrong));
    let near = nearest_name(wrong, valid.iter().copied());
    match near.or_else(|| longer().filter(|_| wrong.len() > 1)) {
        Some(near) => format!("{message}; did you mean `{near}`?"),
        None => message.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_word_of_rust_is_left() {
        for (message, words) in [
            (
                "invalid type: string \"wide\", expected f64",
                "expected a number, found the text \"wide\"",
            ),
            (
                "invalid value: integer `-3`, expected u32",
                "expected a whole number from 0 to 4294967295, found -3",
            ),
            (
                "invalid type: floating point `1.5`, expected u64",
                "expected a whole number of at least 0, found 1.5",
            ),
            (
                "invalid type: string \"Z\", expected struct TwistSpec",
                "expected a table, found the text \"Z\"",
            ),
            (
                "invalid length 2, expected an array of length 3",
                "expected a list of 3 values, found 2",
            ),
            ("missing field `camera`", "`camera` is missing"),
            (
                "unknown field `fov`, expected one of `kind`, `fov_deg`",
                "unknown field `fov`, expected one of `kind`, `fov_deg`; did you mean `fov_deg`?",
            ),
            ("something else", "something else"),
        ] {
            assert_eq!(plain(message, None), words);
        }
        assert_eq!(
            plain("invalid type: map, expected a sequence", Some("object")),
            "expected a list of tables, found one table; write [[object]]"
        );
    }
}
