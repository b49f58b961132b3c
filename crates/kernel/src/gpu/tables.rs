//! The tables of a scene as one address space of words, split into as many buffers as the
//! adapter's limit on a binding asks for.

use super::device::Limits;
use crate::refusal::Refusal;
use std::borrow::Cow;
use std::fmt::Write;

/// Tables that follow each other.
#[derive(Default)]
pub struct Tables<'a> {
    parts: Vec<Cow<'a, [u32]>>,
    words: u64,
}

/// How tables are split into buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Split {
    /// Words of every buffer but the last.
    pub words_per_buffer: u64,
    /// Words of all together.
    pub words: u64,
}

impl<'a> Tables<'a> {
    /// Adds a table and gives its first word.
    pub fn add(&mut self, table: impl Into<Cow<'a, [u32]>>) -> u32 {
        let table = table.into();
        let first = self.words;
        self.words += table.len() as u64;
        self.parts.push(table);
        // Beyond the range of addresses, `split` refuses.
        first as u32
    }

    /// Adds a table of numbers, as bits.
    pub fn add_numbers(&mut self, table: &'a [f32]) -> u32 {
        self.add(bytemuck::cast_slice::<f32, u32>(table))
    }

    /// How the tables are split for these limits.
    ///
    /// # Errors
    /// More words than the buffers hold, or than can be addressed.
    pub fn split(&self, limits: &Limits) -> Result<Split, Refusal> {
        let words_per_buffer = limits.words_per_buffer();
        let split = Split {
            words_per_buffer,
            words: self.words.max(1),
        };
        let most = (words_per_buffer * u64::from(limits.table_buffers)).min(u64::from(u32::MAX));
        if split.words > most {
            return Err(Refusal::Binding(4 * split.words, 4 * most));
        }
        Ok(split)
    }

    /// Calls `write` with the number of a buffer, the first word there and words for it,
    /// for all tables.
    pub fn for_each_piece(&self, split: &Split, mut write: impl FnMut(usize, u64, &[u32])) {
        let mut at = 0u64;
        for table in &self.parts {
            let mut left = &table[..];
            while !left.is_empty() {
                let within = at % split.words_per_buffer;
                let room = split.words_per_buffer - within;
                let (own, rest) = left.split_at(left.len().min(room as usize));
                write((at / split.words_per_buffer) as usize, within, own);
                at += own.len() as u64;
                left = rest;
            }
        }
    }
}

impl Split {
    /// Words of every buffer.
    pub fn buffers(&self) -> Vec<u64> {
        let mut left = self.words;
        let mut buffers = Vec::new();
        while left > 0 {
            let own = left.min(self.words_per_buffer);
            buffers.push(own);
            left -= own;
        }
        buffers
    }

    /// The buffers, bound from that number of group 0 on, and the function `word` that reads
    /// a word at an address.
    pub fn source(&self, first_binding: u32) -> String {
        let count = self.buffers().len();
        let mut text = String::new();
        for i in 0..count {
            let binding = first_binding + i as u32;
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "@group(0) @binding({binding}) var<storage, read> words_{i}: array<u32>;"
            );
        }
        text += "fn word(at: u32) -> u32 {\n";
        for i in 0..count - 1 {
            let (first, end) = (
                i as u64 * self.words_per_buffer,
                (i as u64 + 1) * self.words_per_buffer,
            );
            let _ = writeln!(
                text,
                "    if at < {end}u {{ return words_{i}[at - {first}u]; }}"
            );
        }
        let first = (count as u64 - 1) * self.words_per_buffer;
        let _ = writeln!(text, "    return words_{}[at - {first}u];", count - 1);
        text + "}\nfn number(at: u32) -> f32 { return bitcast<f32>(word(at)); }\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tables() -> Tables<'static> {
        let mut tables = Tables::default();
        assert_eq!(tables.add(vec![1, 2, 3]), 0);
        assert_eq!(tables.add_numbers(&[1.0; 70]), 3);
        assert_eq!(tables.add(vec![9; 64]), 73);
        tables
    }

    fn limits(binding_bytes: u64, table_buffers: u32) -> Limits {
        Limits {
            binding_bytes,
            table_buffers,
        }
    }

    #[test]
    fn every_word_comes_to_its_address() {
        let tables = tables();
        let split = tables.split(&limits(256, 3)).unwrap();
        assert_eq!(split.buffers(), [64, 64, 9]);
        let mut buffers = split.buffers().map_words();
        tables.for_each_piece(&split, |buffer, first, words| {
            buffers[buffer][first as usize..][..words.len()].copy_from_slice(words);
        });
        let all = buffers.concat();
        assert_eq!(all[..4], [1, 2, 3, 1.0f32.to_bits()]);
        assert_eq!(all[72..74], [1.0f32.to_bits(), 9]);
        assert_eq!(all.len(), 137);
        assert!(split.source(6).contains("binding(8)"));
    }

    trait MapWords {
        fn map_words(self) -> Vec<Vec<u32>>;
    }

    impl MapWords for Vec<u64> {
        fn map_words(self) -> Vec<Vec<u32>> {
            self.into_iter().map(|n| vec![0; n as usize]).collect()
        }
    }

    #[test]
    fn what_does_not_fit_is_refused_with_the_figures() {
        let refused = tables().split(&limits(256, 2));
        assert_eq!(refused, Err(Refusal::Binding(548, 512)));
    }
}
