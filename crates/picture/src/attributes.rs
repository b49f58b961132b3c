//! The provenance of a picture, as lines of text in its file.

use percent_encoding::{AsciiSet, CONTROLS, percent_decode_str, utf8_percent_encode};

/// Bytes that are written as `%XX`: control characters, the escape itself, and
/// all that is not ASCII. Text fields of OpenEXR hold Latin-1 alone, and one
/// character outside it would make the field impossible to write.
const ESCAPED: &AsciiSet = &CONTROLS.add(b'%');

/// Names and values, in the order in which they are written.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Attributes(Vec<(String, String)>);

impl Attributes {
    /// Adds a value, or replaces the one of that name.
    pub fn set(&mut self, name: &str, value: impl Into<String>) {
        let value = value.into();
        match self.0.iter_mut().find(|(n, _)| n == name) {
            Some((_, old)) => *old = value,
            None => self.0.push((name.to_owned(), value)),
        }
    }

    /// Removes the value of a name, if there is one.
    pub fn remove(&mut self, name: &str) {
        self.0.retain(|(n, _)| n != name);
    }

    /// The value of a name.
    pub fn get(&self, name: &str) -> Option<&str> {
        let found = self.0.iter().find(|(n, _)| n == name);
        found.map(|(_, value)| value.as_str())
    }

    /// All names and values, in order.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().map(|(n, v)| (n.as_str(), v.as_str()))
    }

    /// Lines `name=value` in ASCII, `%XX` for all other bytes.
    pub(crate) fn to_ascii(&self) -> String {
        let line = |(name, value): &(String, String)| {
            format!("{name}={}", utf8_percent_encode(value, ESCAPED))
        };
        self.0.iter().map(line).collect::<Vec<_>>().join("\n")
    }

    /// From the lines of [`Attributes::to_ascii`]; others are left out.
    pub(crate) fn from_ascii(text: &str) -> Attributes {
        let pairs = text.lines().filter_map(|line| line.split_once('='));
        let decode = |v: &str| percent_decode_str(v).decode_utf8_lossy().into_owned();
        Attributes(pairs.map(|(n, v)| (n.to_owned(), decode(v))).collect())
    }
}

impl<N: Into<String>, V: Into<String>> FromIterator<(N, V)> for Attributes {
    fn from_iter<I: IntoIterator<Item = (N, V)>>(pairs: I) -> Attributes {
        let pairs = pairs.into_iter().map(|(n, v)| (n.into(), v.into()));
        Attributes(pairs.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_text_survives_as_ascii() {
        let attributes: Attributes = [
            ("scene", "шёлк 100 %.toml"),
            ("note", "two\nlines = one value"),
            ("empty", ""),
        ]
        .into_iter()
        .collect();
        let text = attributes.to_ascii();
        assert!(text.is_ascii() && text.lines().count() == 3, "{text}");
        assert_eq!(Attributes::from_ascii(&text), attributes);
    }
}
