//! The tables of a scene as one address space of words, split into as many buffers as the
//! adapter's limit on a binding asks for.

use super::device::Limits;
use crate::refusal::Refusal;
use std::borrow::Cow;
use std::fmt::Write;

/// Words that shaders can read at once.
const QUAD: u64 = 4;

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
    /// Adds a table and gives its first word, a multiple of [`QUAD`].
    pub fn add(&mut self, table: impl Into<Cow<'a, [u32]>>) -> u32 {
        let table = table.into();
        let first = self.words;
        self.words += table.len() as u64;
        self.parts.push(table);
        let beyond = self.words % QUAD;
        if beyond > 0 {
            self.words += QUAD - beyond;
            self.parts.push(vec![0; (QUAD - beyond) as usize].into());
        }
        // Beyond the range of addresses, `split` refuses.
        first as u32
    }

    /// Adds a table in parts, each of a multiple of [`QUAD`] words, one behind the other, and
    /// gives the first word of all.
    pub fn add_parts(&mut self, parts: Vec<Vec<u32>>) -> u32 {
        let first = self.words as u32;
        for part in parts {
            self.add(part);
        }
        first
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
            words: self.words.max(QUAD),
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

    /// The buffers, bound from that number of group 0 on, and the functions `word` and `number`
    /// that read a word at an address, `quad` and `four` that read four at a multiple of four.
    pub fn source(&self, first_binding: u32) -> String {
        let count = self.buffers().len();
        let mut text = String::new();
        for i in 0..count {
            let binding = first_binding + i as u32;
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "@group(0) @binding({binding}) var<storage, read> quads_{i}: array<vec4<u32>>;"
            );
        }
        text += &self.reader("word", "u32", "quads_$[@ >> 2u][@ & 3u]");
        text += "fn number(at: u32) -> f32 { return bitcast<f32>(word(at)); }\n";
        text += &self.reader("quad", "vec4<u32>", "quads_$[@ >> 2u]");
        text + "fn four(at: u32) -> vec4<f32> { return bitcast<vec4<f32>>(quad(at)); }\n"
    }

    /// A function that reads what lies at an address; `$` stands for the number of a buffer,
    /// `@` for the address in it.
    fn reader(&self, name: &str, kind: &str, what: &str) -> String {
        let found = self.branch(what, 0, self.buffers().len() as u64);
        format!("fn {name}(at: u32) -> {kind} {{ {found} }}\n")
    }

    /// A search by halves for the buffer of an address, among those from `first` up to `end`.
    fn branch(&self, what: &str, first: u64, end: u64) -> String {
        if first + 1 == end {
            let own = format!("(at - {}u)", first * self.words_per_buffer);
            let own = what.replace('$', &first.to_string()).replace('@', &own);
            return format!("return {own};");
        }
        let middle = first.midpoint(end);
        let [low, high] = [(first, middle), (middle, end)].map(|(a, b)| self.branch(what, a, b));
        let words = middle * self.words_per_buffer;
        format!("if at < {words}u {{ {low} }} else {{ {high} }}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tables() -> Tables<'static> {
        let mut tables = Tables::default();
        assert_eq!(tables.add(vec![1, 2, 3]), 0);
        assert_eq!(tables.add_numbers(&[1.0; 70]), 4);
        assert_eq!(tables.add(vec![9; 64]), 76);
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
        assert_eq!(split.buffers(), [64, 64, 12]);
        let mut buffers = split.buffers().map_words();
        tables.for_each_piece(&split, |buffer, first, words| {
            buffers[buffer][first as usize..][..words.len()].copy_from_slice(words);
        });
        let all = buffers.concat();
        assert_eq!(all[..5], [1, 2, 3, 0, 1.0f32.to_bits()]);
        assert_eq!(all[73..77], [1.0f32.to_bits(), 0, 0, 9]);
        assert_eq!(all.len(), 140);
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
        assert_eq!(refused, Err(Refusal::Binding(560, 512)));
    }
}
