//! Every mistake of every type, read from texts.

use super::*;
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Name {
    #[default]
    First,
    Second,
}

#[derive(Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Inner {
    flag: bool,
}

/// A value of every type that our files have.
#[derive(Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct All {
    single: f32,
    double: f64,
    u8: u8,
    u16: u16,
    u32: u32,
    u64: u64,
    i32: i32,
    i64: i64,
    text: String,
    flag: bool,
    maybe: Option<f64>,
    colour: [f32; 3],
    list: Vec<u32>,
    name: Name,
    inner: Inner,
    inners: Vec<Inner>,
    by_name: BTreeMap<String, f64>,
}

/// The same behind a tag, as in `[[light]]` and `[[object]]`.
#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum Tagged {
    #[allow(dead_code)] // read, and only its mistakes looked at
    All(Box<All>),
}

const WRONG: [(&str, &str); 24] = [
    (
        "single = 'wide'",
        "expected a number, found the text \"wide\"",
    ),
    ("double = [1.0]", "expected a number, found a list"),
    (
        "u8 = 256",
        "expected a whole number from 0 to 255, found 256",
    ),
    (
        "u16 = -1",
        "expected a whole number from 0 to 65535, found -1",
    ),
    (
        "u32 = -3",
        "expected a whole number from 0 to 4294967295, found -3",
    ),
    (
        "u64 = 1.5",
        "expected a whole number of at least 0, found 1.5",
    ),
    (
        "u64 = 2.0",
        "expected a whole number of at least 0, found 2.0",
    ),
    (
        "i32 = 'one'",
        "expected a whole number, found the text \"one\"",
    ),
    ("i64 = true", "expected a whole number, found true"),
    ("text = 1", "expected a text in quotes, found 1"),
    (
        "flag = 'yes'",
        "expected true or false, found the text \"yes\"",
    ),
    ("maybe = 'no'", "expected a number, found the text \"no\""),
    ("colour = 1.0", "expected a list of 3 values, found 1.0"),
    (
        "colour = [1.0, 2.0]",
        "expected a list of 3 values, found 2",
    ),
    ("list = 'a'", "expected a list, found the text \"a\""),
    ("list = {}", "expected a list, found a table"),
    ("name = 1", "expected a name in quotes"),
    (
        "name = 'frist'",
        "unknown variant `frist`, expected `first` or `second`; did you mean `first`?",
    ),
    ("inner = 'Z'", "expected a table, found the text \"Z\""),
    (
        "inner = { flga = true }",
        "unknown field `flga`, expected `flag`; did you mean `flag`?",
    ),
    ("inners = {}", "expected a list, found a table"),
    ("by_name = 1", "expected a table, found 1"),
    ("double = 1979-05-27", "no key takes a date"),
    (
        "u64 = 99999999999999999999",
        "this whole number is too large",
    ),
];

#[test]
fn every_type_is_expected_in_plain_words() {
    for (text, words) in WRONG {
        let error = from_text::<All>(text).unwrap_err();
        assert_eq!(error.message, words, "{text}");
        let place = error.span.expect(text).start;
        assert!(
            place == text.find('=').unwrap() + 2 || words.starts_with("unknown field"),
            "{text}"
        );
    }
}

#[test]
fn tagged_tables_speak_the_same_words() {
    for (text, words) in WRONG {
        let tagged = format!("kind = 'all'\n{text}");
        let error = from_text::<Tagged>(&tagged).unwrap_err();
        assert!(
            error.message.starts_with(words),
            "{text}: {}",
            error.message
        );
    }
    let error = from_text::<Tagged>("kind = 'al'").unwrap_err();
    assert!(error.message.ends_with("did you mean `all`?"), "{error}");
    let error = from_text::<Tagged>("single = 1.0").unwrap_err();
    assert_eq!(error.message, "`kind` is missing");
}

#[test]
fn a_text_and_its_table_read_as_the_library_reads_them() {
    let text = "single = 1\ndouble = 0.1\nu64 = 9_007_199_254_740_993\ni64 = -16\n\
                maybe = inf\ncolour = [1, 2.5, 3e-3]\nname = 'second'\n\
                by_name = { b = 1, a = 2 }\n[inner]\nflag = true\n[[inners]]\n[[inners]]";
    let library: All = toml::from_str(text).unwrap();
    assert_eq!(from_text::<All>(text), Ok(library));
    let table: toml::Table = toml::from_str(text).unwrap();
    let library: All = table.clone().try_into().unwrap();
    assert_eq!(from_table::<All>(table), Ok(library));
    let error = from_text::<All>("inners = {}").unwrap_err();
    assert!(error.is_table_for_list);
    let error = from_text::<All>("double = = 1").unwrap_err();
    assert!(error.span.is_some() && !error.message.is_empty());
}
