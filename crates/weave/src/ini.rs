//! The outer structure of a WIF file: sections of `key=value` lines, with the deviations that
//! programs produce.

use std::collections::BTreeMap;

/// Sections by normalised name (upper case, single spaces).
#[derive(Debug, Default)]
pub(crate) struct Ini {
    sections: BTreeMap<String, IniSection>,
}

/// Values by normalised key.
#[derive(Debug, Default)]
pub(crate) struct IniSection {
    values: BTreeMap<String, String>,
}

impl Ini {
    /// Reads tolerantly: a byte order mark, any line endings, UTF-8 or otherwise Latin-1,
    /// comment lines (`;`, `#`), lines before the first section and lines without `=` are
    /// accepted. A repeated section continues the first; a repeated key replaces the earlier
    /// one.
    pub fn parse(bytes: &[u8]) -> Ini {
        let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text.to_owned(),
            Err(_) => bytes.iter().map(|&b| char::from(b)).collect(),
        };
        let mut ini = Ini::default();
        let mut section: Option<&mut IniSection> = None;
        for line in text.split(['\n', '\r']).map(str::trim) {
            if line.starts_with([';', '#']) {
                continue;
            }
            if let Some(name) = line.strip_prefix('[') {
                let name = name.split(']').next().unwrap_or(name);
                section = Some(ini.sections.entry(normalised(name)).or_default());
            } else if let (Some(section), Some((key, value))) = (&mut section, line.split_once('='))
            {
                section
                    .values
                    .insert(normalised(key), value.trim().to_owned());
            }
        }
        ini
    }

    pub fn section(&self, name: &str) -> Option<&IniSection> {
        self.sections.get(name)
    }

    /// Names of all sections.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.sections.keys().map(String::as_str)
    }
}

impl IniSection {
    /// The value of a key; an empty value counts as absent.
    pub fn get(&self, key: &str) -> Option<&str> {
        self.values
            .get(key)
            .map(String::as_str)
            .filter(|v| !v.is_empty())
    }

    /// All keys and values except empty ones.
    pub fn entries(&self) -> impl Iterator<Item = (&str, &str)> {
        self.values
            .iter()
            .map(|(k, v)| (k.as_str(), v.as_str()))
            .filter(|(_, v)| !v.is_empty())
    }
}

fn normalised(name: &str) -> String {
    let words: Vec<&str> = name.split_whitespace().collect();
    words.join(" ").to_uppercase()
}
