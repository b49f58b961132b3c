//! Values of requests as tables of keys hold them, and checks of those that are plain numbers. A value
//! has the same range in a table, in Rust and as a flag: each is read by one function of
//! [`crate::values`].

use crate::error::InputError;
use crate::values;
use clap::ValueEnum;
use glam::UVec2;
use organza_transport::Crop;
use serde::Deserialize;
use serde::de::{Deserializer, Error};
use std::fmt::Display;
use std::ops::Range;
use std::time::Duration;

/// Refuses values of a field that its reader refuses: none, one or several.
///
/// # Errors
/// Names the field and what was expected.
pub fn check<T: Display, U>(
    field: &str,
    list: impl IntoIterator<Item = T>,
    read: impl Fn(&str) -> Result<U, String>,
) -> Result<(), InputError> {
    for value in list {
        let text = value.to_string();
        read(&text).map_err(|why| InputError::of_option(field, format!("{why}, found {text}")))?;
    }
    Ok(())
}

/// Numbers as a flag takes them.
pub fn listed<T: Display>(numbers: &[T]) -> String {
    let texts: Vec<String> = numbers.iter().map(ToString::to_string).collect();
    texts.join(",")
}

/// Four edges of a crop: left, top, right, bottom.
pub fn crop<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Crop>, D::Error> {
    let edges = Option::<[u32; 4]>::deserialize(from)?;
    Ok(edges.map(|[x0, y0, x1, y1]| Crop::new(UVec2::new(x0, y0), UVec2::new(x1, y1))))
}

/// The first of some things, and the one after the last.
pub fn range<'de, D: Deserializer<'de>, N: Deserialize<'de> + PartialOrd + Display>(
    from: D,
) -> Result<Option<Range<N>>, D::Error> {
    match Option::<[N; 2]>::deserialize(from)? {
        Some([first, end]) if first >= end => Err(D::Error::custom(format!(
            "expected two numbers, the second of which is larger, found {first} and {end}"
        ))),
        Some([first, end]) => Ok(Some(first..end)),
        None => Ok(None),
    }
}

/// A number or a text.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number or a text")]
enum NumberOrText {
    Number(f64),
    Text(String),
}

/// A text, or a number as text.
pub fn some_text<'de, D: Deserializer<'de>>(from: D) -> Result<Option<String>, D::Error> {
    Ok(
        Option::<NumberOrText>::deserialize(from)?.map(|value| match value {
            NumberOrText::Number(number) => number.to_string(),
            NumberOrText::Text(text) => text,
        }),
    )
}

/// A time: seconds, or a text such as `5m`.
pub fn time<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Duration>, D::Error> {
    let Some(text) = some_text(from)? else {
        return Ok(None);
    };
    let time = values::parse_duration(&text).map_err(D::Error::custom)?;
    Ok(Some(time))
}

/// A time that has a default.
pub fn some_time<'de, D: Deserializer<'de>>(from: D) -> Result<Duration, D::Error> {
    time(from)?.ok_or_else(|| D::Error::custom("expected a time"))
}

/// A seed: a number, or a text of one that TOML's numbers do not reach.
pub fn seed<'de, D: Deserializer<'de>>(from: D) -> Result<u64, D::Error> {
    some_seed(from)?.ok_or_else(|| D::Error::custom("expected a seed"))
}

/// A seed that may be missing.
pub fn some_seed<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u64>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected a whole number of at least 0")]
    enum Seed {
        Number(u64),
        Text(String),
    }
    match Option::<Seed>::deserialize(from)? {
        Some(Seed::Number(number)) => Ok(Some(number)),
        Some(Seed::Text(text)) => values::parse_seed(&text)
            .map(Some)
            .map_err(D::Error::custom),
        None => Ok(None),
    }
}

/// One of the names of a flag's values.
pub fn name<'de, D: Deserializer<'de>, T: ValueEnum>(from: D) -> Result<T, D::Error> {
    of_name(&String::deserialize(from)?)
}

/// The same of a key that may be missing.
pub fn some_name<'de, D: Deserializer<'de>, T: ValueEnum>(from: D) -> Result<Option<T>, D::Error> {
    Option::<String>::deserialize(from)?
        .map(|name| of_name(&name))
        .transpose()
}

/// A list of names, or one text of them with commas.
pub fn names<'de, D: Deserializer<'de>, T: ValueEnum>(from: D) -> Result<Vec<T>, D::Error> {
    let list = texts(from)?;
    list.iter().map(|name| of_name(name)).collect()
}

/// A list of texts, or one text of them with commas.
pub fn texts<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected a list of texts")]
    enum Texts {
        One(String),
        List(Vec<String>),
    }
    Ok(match Texts::deserialize(from)? {
        Texts::One(text) => text.split(',').map(|t| t.trim().to_owned()).collect(),
        Texts::List(list) => list,
    })
}

fn of_name<T: ValueEnum, E: Error>(name: &str) -> Result<T, E> {
    T::from_str(name, false).map_err(|_| {
        let all = T::value_variants().iter().filter_map(T::to_possible_value);
        let all: Vec<String> = all.map(|value| value.get_name().to_owned()).collect();
        not_one_of(name, &all)
    })
}

/// The error of a name that is none of these, with the nearest one.
pub(crate) fn not_one_of<E: Error>(name: &str, all: &[impl AsRef<str>]) -> E {
    let all: Vec<&str> = all.iter().map(AsRef::as_ref).collect();
    let near = organza_basis::nearest_name(name, all.iter().copied());
    let near = near.map_or(String::new(), |near| format!("; did you mean \"{near}\"?"));
    let all = all.join(", ");
    E::custom(format!("expected one of {all}, found \"{name}\"{near}"))
}

/// Overrides: a table from dotted keys to values, or a list of `key.path=value`.
pub fn overrides<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(
        untagged,
        expecting = "expected a table of keys, or a list of KEY.PATH=VALUE"
    )]
    enum Overrides {
        List(Vec<String>),
        Table(toml::Table),
    }
    Ok(match Overrides::deserialize(from)? {
        Overrides::List(list) => list,
        Overrides::Table(table) => {
            let flat = table
                .into_iter()
                .map(|(key, value)| format!("{key}={value}"));
            flat.collect()
        }
    })
}
