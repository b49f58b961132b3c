//! A parsed value with its places in the text, as serde visits it.

use super::TomlError;
use serde::de::value::{StrDeserializer, StringDeserializer};
use serde::de::{
    DeserializeSeed, Deserializer, Error as _, IntoDeserializer, MapAccess, SeqAccess, Visitor,
};
use serde::forward_to_deserialize_any;
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// A value and its place in the text.
pub struct Node {
    pub value: Value,
    pub span: Option<Range<usize>>,
}

/// What TOML can hold.
pub enum Value {
    Text(String),
    Whole(i64),
    /// Beyond `i64`.
    LargeWhole(u64),
    Decimal(f64),
    Truth(bool),
    Date,
    List(Vec<Node>),
    Table(Vec<NodeEntry>),
}

/// A key with its value.
pub struct NodeEntry {
    key: String,
    span: Option<Range<usize>>,
    node: Node,
}

/// The key that says by which others a table is read. It is visited first, so that the
/// others can be read in place.
const FIRST_KEY: &str = "model";

impl Value {
    pub fn of_parsed_table(table: DeTable<'_>) -> Result<Value, TomlError> {
        let mut entries = Vec::new();
        for (key, value) in table {
            let span = Some(value.span());
            let value = Value::of_parsed(value.into_inner());
            entries.push(NodeEntry {
                span: Some(key.span()),
                key: key.into_inner().into_owned(),
                node: Node {
                    value: value.map_err(|e| e.at(&span))?,
                    span,
                },
            });
        }
        entries.sort_by_key(|entry| entry.key != FIRST_KEY);
        Ok(Value::Table(entries))
    }

    fn of_parsed(value: DeValue<'_>) -> Result<Value, TomlError> {
        Ok(match value {
            DeValue::String(text) => Value::Text(text.into_owned()),
            DeValue::Integer(whole) => {
                let (digits, radix) = (whole.as_str(), whole.radix());
                match i64::from_str_radix(digits, radix) {
                    Ok(whole) => Value::Whole(whole),
                    Err(_) => Value::LargeWhole(
                        u64::from_str_radix(digits, radix)
                            .map_err(|_| TomlError::custom("this whole number is too large"))?,
                    ),
                }
            }
            DeValue::Float(decimal) => {
                let text = decimal.as_str();
                let value: f64 = text.parse().map_err(TomlError::custom)?;
                if value.is_infinite() && !text.contains("inf") {
                    return Err(TomlError::custom("this number is too large"));
                }
                Value::Decimal(value)
            }
            DeValue::Boolean(truth) => Value::Truth(truth),
            DeValue::Datetime(_) => Value::Date,
            DeValue::Array(list) => {
                let node = |value: toml::Spanned<DeValue<'_>>| {
                    let span = Some(value.span());
                    let value = Value::of_parsed(value.into_inner()).map_err(|e| e.at(&span))?;
                    Ok(Node { value, span })
                };
                Value::List(
                    list.into_iter()
                        .map(node)
                        .collect::<Result<_, TomlError>>()?,
                )
            }
            DeValue::Table(table) => Value::of_parsed_table(table)?,
        })
    }

    pub fn of_table(table: toml::Table) -> Value {
        let entry = |(key, value)| NodeEntry {
            key,
            span: None,
            node: Node {
                value: Value::of_value(value),
                span: None,
            },
        };
        let mut entries: Vec<NodeEntry> = table.into_iter().map(entry).collect();
        entries.sort_by_key(|entry| entry.key != FIRST_KEY);
        Value::Table(entries)
    }

    fn of_value(value: toml::Value) -> Value {
        match value {
            toml::Value::String(text) => Value::Text(text),
            toml::Value::Integer(whole) => Value::Whole(whole),
            toml::Value::Float(decimal) => Value::Decimal(decimal),
            toml::Value::Boolean(truth) => Value::Truth(truth),
            toml::Value::Datetime(_) => Value::Date,
            toml::Value::Array(list) => {
                let node = |value| Node {
                    value: Value::of_value(value),
                    span: None,
                };
                Value::List(list.into_iter().map(node).collect())
            }
            toml::Value::Table(table) => Value::of_table(table),
        }
    }
}

impl<'de> Deserializer<'de> for Node {
    type Error = TomlError;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, TomlError> {
        let span = self.span;
        let read = match self.value {
            Value::Text(text) => visitor.visit_string(text),
            Value::Whole(whole) => visitor.visit_i64(whole),
            Value::LargeWhole(whole) => visitor.visit_u64(whole),
            Value::Decimal(decimal) => visitor.visit_f64(decimal),
            Value::Truth(truth) => visitor.visit_bool(truth),
            Value::Date => Err(TomlError::custom("no key takes a date")),
            Value::List(list) => visitor.visit_seq(ListAccess(list.into_iter())),
            Value::Table(entries) => visitor.visit_map(TableAccess {
                entries: entries.into_iter(),
                node: None,
            }),
        };
        read.map_err(|e| e.at(&span))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, TomlError> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, TomlError> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        _variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, TomlError> {
        let read = match self.value {
            Value::Text(text) => {
                visitor.visit_enum::<StringDeserializer<TomlError>>(text.into_deserializer())
            }
            _ => Err(TomlError::custom("expected a name in quotes")),
        };
        read.map_err(|e| e.at(&self.span))
    }

    forward_to_deserialize_any! {
        bool u8 u16 u32 u64 u128 i8 i16 i32 i64 i128 f32 f64 char str string seq
        bytes byte_buf map struct unit
        ignored_any unit_struct tuple_struct tuple identifier
    }
}

struct ListAccess(std::vec::IntoIter<Node>);

impl<'de> SeqAccess<'de> for ListAccess {
    type Error = TomlError;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, TomlError> {
        let node = self.0.next();
        node.map(|node| seed.deserialize(node)).transpose()
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.0.len())
    }
}

struct TableAccess {
    entries: std::vec::IntoIter<NodeEntry>,
    /// The value of the key that was just given out.
    node: Option<Node>,
}

impl<'de> MapAccess<'de> for TableAccess {
    type Error = TomlError;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, TomlError> {
        let Some(entry) = self.entries.next() else {
            return Ok(None);
        };
        self.node = Some(entry.node);
        let key = StrDeserializer::<TomlError>::new(&entry.key);
        let read = seed.deserialize(key).map(Some);
        read.map_err(|e| e.at(&entry.span))
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, TomlError> {
        let Some(node) = self.node.take() else {
            return Err(TomlError::custom("a value was read before its key"));
        };
        let span = node.span.clone();
        seed.deserialize(node).map_err(|e| e.at(&span))
    }

    fn size_hint(&self) -> Option<usize> {
        Some(self.entries.len())
    }
}
