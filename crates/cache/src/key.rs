//! Keys of entries.

use sha2::{Digest, Sha256};
use std::fmt;

/// A digest of everything that decides a result.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Key([u8; 32]);

impl Key {
    /// The key of a kind of result and the parts that decide it. The length of each part
    /// counts, so that bytes cannot move from one part to the next unnoticed.
    pub fn of(kind: &str, parts: &[&[u8]]) -> Key {
        let mut digest = Sha256::new();
        for part in std::iter::once(&kind.as_bytes()).chain(parts) {
            digest.update((part.len() as u64).to_le_bytes());
            digest.update(part);
        }
        Key(digest.finalize().into())
    }

    /// The key of a name that [`fmt::Display`] wrote: 64 hexadecimal digits in lower case.
    pub fn parse(name: &str) -> Option<Key> {
        let digits: Vec<u8> = name
            .bytes()
            .map(|b| match b {
                b'0'..=b'9' => Some(b - b'0'),
                b'a'..=b'f' => Some(b - b'a' + 10),
                _ => None,
            })
            .collect::<Option<_>>()?;
        let bytes: Vec<u8> = digits.chunks_exact(2).map(|d| 16 * d[0] + d[1]).collect();
        let is_whole = digits.len() == 64;
        bytes.try_into().ok().filter(|_| is_whole).map(Key)
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Key({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_and_its_length_counts() {
        let key = Key::of("volume", &[b"ab", b"c"]);
        for other in [
            Key::of("volume", &[b"a", b"bc"]),
            Key::of("volume", &[b"abc"]),
            Key::of("volume", &[b"ab", b"c", b""]),
            Key::of("table", &[b"ab", b"c"]),
            Key::of("volume", &[b"ab", b"d"]),
        ] {
            assert_ne!(key, other);
        }
        assert_eq!(key, Key::of("volume", &[b"ab", b"c"]));
    }

    #[test]
    fn names_are_read_back_and_others_are_none() {
        let key = Key::of("volume", &[b"x"]);
        let name = key.to_string();
        assert_eq!(Key::parse(&name), Some(key));
        let upper = name.to_uppercase();
        for wrong in ["", "00", "lock", &name[1..], &format!("{name}0"), &upper] {
            assert_eq!(Key::parse(wrong), None, "{wrong}");
        }
    }
}
