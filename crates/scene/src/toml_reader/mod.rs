//! Reads TOML into tables of keys, with mistakes in the words of whoever wrote the file.
//!
//! serde reports a mistake by calling a method of the reader's error type. [`TomlError`]
//! has its own methods, so that a message is made from what was found and expected, and
//! never from another message.

mod error;
mod node;
#[cfg(test)]
mod tests;

pub use error::TomlError;

use node::{Node, Value};
use serde::de::{DeserializeOwned, Error as _};
use toml::de::DeTable;

/// Reads a text.
///
/// # Errors
/// The first mistake.
pub fn from_text<T: DeserializeOwned>(text: &str) -> Result<T, TomlError> {
    let document = DeTable::parse(text).map_err(|e| TomlError {
        span: e.span(),
        ..TomlError::custom(e.message())
    })?;
    let table = Value::of_parsed_table(document.into_inner())?;
    let span = None;
    T::deserialize(Node { value: table, span })
}

/// Reads a table that has no text of its own.
///
/// # Errors
/// The first mistake.
pub fn from_table<T: DeserializeOwned>(table: toml::Table) -> Result<T, TomlError> {
    let value = Value::of_table(table);
    T::deserialize(Node { value, span: None })
}
