//! Colours of threads as weavers write them: `"8 red, 8 blue, 4 white"`, hexadecimal sRGB, and
//! the thread counts of tartans, `"B/24 R4 K24 Y/4"`.

use crate::draft::MAX_THREADS;
use crate::error::did_you_mean;
use crate::runs::{counted, listed};
use organza_basis::Rgb;
use serde::Deserializer;
use serde::de::{Error, SeqAccess, Visitor};
use std::fmt;

/// Colours by name, in sRGB: those of dyed yarn on a screen (estimated), never blacker or whiter
/// than yarn is.
const NAMES: [(&str, u32); 36] = [
    ("white", 0xece8df),
    ("ivory", 0xe6dcc3),
    ("cream", 0xdfd2b1),
    ("ecru", 0xcdbf9f),
    ("beige", 0xbfa985),
    ("silver", 0xb4b4b2),
    ("grey", 0x7d7d7b),
    ("gray", 0x7d7d7b),
    ("charcoal", 0x3b3c3e),
    ("black", 0x1d1c1d),
    ("red", 0xb01c24),
    ("scarlet", 0xc5291d),
    ("crimson", 0x8c1530),
    ("wine", 0x5a1a28),
    ("rust", 0x99472a),
    ("pink", 0xd79aa4),
    ("orange", 0xd0691e),
    ("gold", 0xc59a2e),
    ("yellow", 0xd9b62c),
    ("olive", 0x656332),
    ("lime", 0x8fae3c),
    ("green", 0x2c6a3d),
    ("bottle", 0x173d2b),
    ("mint", 0xa3cdb4),
    ("teal", 0x1f6b70),
    ("turquoise", 0x3fa6ab),
    ("azure", 0x7aa7cd),
    ("sky", 0x9dbfdb),
    ("blue", 0x254a93),
    ("navy", 0x1b2745),
    ("indigo", 0x2b3858),
    ("violet", 0x5b4a8d),
    ("purple", 0x5c2a66),
    ("lilac", 0xb09cc4),
    ("brown", 0x573a28),
    ("tan", 0xa5815a),
];

/// Letters of the thread counts of tartans, after the Scottish Register of Tartans.
const LETTERS: [(&str, u32); 18] = [
    ("B", 0x2c4480),
    ("DB", 0x1d2647),
    ("LB", 0x87a9cc),
    ("A", 0x5c8ca8),
    ("R", 0xb3202a),
    ("DR", 0x7a1620),
    ("G", 0x245c3a),
    ("DG", 0x173c28),
    ("LG", 0x7fa678),
    ("K", 0x1d1c1d),
    ("W", 0xe6e2d8),
    ("N", 0x7d7d7b),
    ("DN", 0x4a4a4a),
    ("LN", 0xb9b9b6),
    ("Y", 0xd9b42c),
    ("T", 0x6b4428),
    ("P", 0x602c6c),
    ("O", 0xcc651c),
];

fn of_hex(hex: u32) -> Rgb {
    let channel = |shift: u32| Rgb::linear_from_srgb((hex >> shift & 0xff) as f32 / 255.0);
    Rgb::new(channel(16), channel(8), channel(0))
}

/// The colour of every thread of a text; at least one.
///
/// # Errors
/// What is wrong, with the place and the nearest valid name.
pub(crate) fn parse(text: &str) -> Result<Vec<Rgb>, String> {
    let runs = match tartan_runs(text) {
        Some(runs) => runs?,
        None => listed(text, "a colour such as \"8 red\"", one)?,
    };
    let threads: usize = runs.iter().map(|(count, _)| count).sum();
    if threads > MAX_THREADS {
        return Err(format!(
            "expected at most {MAX_THREADS} threads, found {threads}"
        ));
    }
    let colours = runs.into_iter();
    Ok(colours
        .flat_map(|(count, colour)| std::iter::repeat_n(colour, count))
        .collect())
}

/// One colour, by name or as `#rgb` or `#rrggbb` in sRGB; linear.
///
/// # Errors
/// What is wrong, with the nearest valid name.
pub fn one(name: &str) -> Result<Rgb, String> {
    if let Some(digits) = name.strip_prefix('#') {
        let is_hex = digits.bytes().all(|b| b.is_ascii_hexdigit());
        let value = u32::from_str_radix(digits, 16);
        return match (value, digits.len(), is_hex) {
            (Ok(hex), 6, true) => Ok(of_hex(hex)),
            (Ok(hex), 3, true) => {
                Ok(of_hex([8, 4, 0].into_iter().fold(0, |all, shift| {
                    (all << 8) | (0x11 * ((hex >> shift) & 0xf))
                })))
            }
            _ => Err(format!(
                "expected a colour such as #c03 or #cc0033, found \"{name}\""
            )),
        };
    }
    let lower = name.to_lowercase();
    let found = NAMES.iter().find(|(known, _)| *known == lower);
    found.map(|(_, hex)| of_hex(*hex)).ok_or_else(|| {
        let known = NAMES.map(|(known, _)| known);
        let hint = match did_you_mean(name, known) {
            hint if hint.is_empty() => format!("; expected #rrggbb or one of {}", known.join(", ")),
            hint => hint,
        };
        format!("there is no colour \"{name}\"{hint}")
    })
}

/// A hexadecimal name of the nearest colour that can be written so.
pub fn hex_of(colour: Rgb) -> String {
    let [r, g, b] = colour.0.to_array().map(Rgb::srgb8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Colours as runs that [`parse`] reads, such as `8 #b01c24, 4 #ece8df`.
pub fn written(colours: &[Rgb]) -> String {
    let names: Vec<String> = colours.iter().map(|c| hex_of(*c)).collect();
    let runs = names.chunk_by(|a, b| a == b);
    let runs = runs.map(|run| match run {
        [one] => one.clone(),
        [first, ..] => format!("{} {first}", run.len()),
        [] => String::new(),
    });
    runs.collect::<Vec<_>>().join(", ")
}

/// The runs of a thread count of a tartan; `None` for a text that is none. `B/24 R4 K24 Y/4` is
/// mirrored at its ends, which stand once (full counts at the pivots); without `/` it repeats.
fn tartan_runs(text: &str) -> Option<Result<Vec<(usize, Rgb)>, String>> {
    let tokens: Vec<&str> = text.split_whitespace().collect();
    let parts: Option<Vec<(&str, bool, &str)>> = tokens.iter().map(|t| token(t)).collect();
    let parts = parts.filter(|p| !p.is_empty())?;
    let run = |(letters, _, digits): &(&str, bool, &str)| {
        let found = LETTERS.iter().find(|(known, _)| known == letters);
        let colour = found.map(|(_, hex)| of_hex(*hex)).ok_or_else(|| {
            let known = LETTERS.map(|(known, _)| known).join(", ");
            format!("thread count: there is no colour {letters}; there are {known}")
        })?;
        Ok((
            counted(digits).map_err(|e| format!("thread count: {e}"))?,
            colour,
        ))
    };
    let mut runs: Vec<(usize, Rgb)> = match parts.iter().map(run).collect() {
        Ok(runs) => runs,
        Err(why) => return Some(Err(why)),
    };
    let last = parts.len() - 1;
    let pivots: Vec<usize> = (0..=last).filter(|&i| parts[i].1).collect();
    match pivots[..] {
        [] => {}
        [0, end] if end == last && last > 0 => {
            let back: Vec<_> = runs[1..last].iter().rev().copied().collect();
            runs.extend(back);
        }
        _ => {
            return Some(Err(
                "thread count: expected / at the first and the last stripe, as in \
                 \"B/24 R4 K24 Y/4\", or nowhere"
                    .into(),
            ));
        }
    }
    Some(Ok(runs))
}

/// Letters, whether a pivot, and digits of a stripe such as `B/24` or `R4`.
fn token(text: &str) -> Option<(&str, bool, &str)> {
    let end = text.find(|c: char| !c.is_ascii_uppercase())?;
    let (letters, rest) = text.split_at(end);
    let (is_pivot, digits) = match rest.strip_prefix('/') {
        Some(digits) => (true, digits),
        None => (false, rest),
    };
    let is_count = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
    (!letters.is_empty() && is_count).then_some((letters, is_pivot, digits))
}

/// Reads a list of colours, each three linear channels or a name, or a text for [`parse`].
///
/// # Errors
/// What is wrong with it; an empty list, which would silently mean the same as a missing key.
pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Vec<Rgb>, D::Error> {
    struct List;
    impl<'de> Visitor<'de> for List {
        type Value = Vec<Rgb>;
        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str("colours such as \"8 red, 4 #ece8df\" or [[0.8, 0.1, 0.1]]")
        }
        fn visit_str<E: Error>(self, text: &str) -> Result<Vec<Rgb>, E> {
            parse(text).map_err(E::custom)
        }
        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<Rgb>, A::Error> {
            let mut colours = Vec::new();
            while let Some(OneColour(colour)) = list.next_element()? {
                colours.push(colour);
            }
            match colours.is_empty() {
                true => Err(A::Error::custom(
                    "expected colours such as [[0.8, 0.1, 0.1]], found an empty list",
                )),
                false => Ok(colours),
            }
        }
    }
    deserializer.deserialize_any(List)
}

/// A colour as an element of a list: three linear channels, or the name of one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OneColour(pub Rgb);

impl<'de> serde::Deserialize<'de> for OneColour {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<OneColour, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = OneColour;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("three linear channels or the name of a colour")
            }
            fn visit_str<E: Error>(self, name: &str) -> Result<OneColour, E> {
                one(name).map(OneColour).map_err(E::custom)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<OneColour, A::Error> {
                let list = serde::de::value::SeqAccessDeserializer::new(list);
                serde::Deserialize::deserialize(list).map(OneColour)
            }
        }
        deserializer.deserialize_any(Either)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn red() -> Rgb {
        one("red").unwrap()
    }

    #[test]
    fn runs_names_and_hexadecimal_colours_are_read() {
        let white = one("white").unwrap();
        let colours = parse("2 red, white,1 #B01c24").unwrap();
        assert_eq!(colours, [red(), red(), white, red()]);
        assert_eq!(one("#f80").unwrap(), one("#ff8800").unwrap());
        assert_eq!(hex_of(one("#12a0f3").unwrap()), "#12a0f3");
        assert_eq!(parse(&written(&colours)).unwrap(), colours);
    }

    #[test]
    fn a_tartan_turns_at_its_pivots() {
        let counts = |text: &str| {
            let all = parse(text).unwrap();
            all.chunk_by(|a, b| a == b)
                .map(<[Rgb]>::len)
                .collect::<Vec<_>>()
        };
        assert_eq!(counts("B/24 R4 K24 Y/4"), [24, 4, 24, 4, 24, 4]);
        assert_eq!(counts("B24 R4 K24"), [24, 4, 24]);
    }

    #[test]
    fn wrong_colours_name_the_place_and_the_nearest() {
        for (text, words) in [
            (
                "8 redd, 8 blue",
                "entry 1: there is no colour \"redd\"; did you mean \"red\"?",
            ),
            ("8 red, 0 blue", "entry 2: expected a number of threads"),
            ("8 red blue", "entry 1: expected a number and a colour"),
            ("#12345", "expected a colour such as #c03"),
            ("B/24 R4", "expected / at the first and the last"),
            ("B/24 X4 R/2", "there is no colour X"),
            ("", "entry 1: expected a number and a colour"),
            ("9000 red, 9000 blue", "at most 16384 threads"),
        ] {
            let why = parse(text).unwrap_err();
            assert!(why.contains(words), "{text}: {why}");
        }
    }
}
