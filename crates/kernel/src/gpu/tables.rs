//! The tables of a scene as words with addresses, split into as many buffers as the adapter's
//! limit on a binding asks for.

use super::device::Limits;
use crate::refusal::Refusal;
use rayon::prelude::*;
use std::borrow::Cow;
use std::fmt::Write;
use std::ops::Range;

/// Words that shaders can read at once.
const QUAD: u64 = 4;

/// Parts of tables that are made at the same time, each where it is sent.
const MADE_AT_ONCE: usize = 16;

/// Part of a table that is made where it is sent, so that memory never holds all of it.
pub struct Made<'a> {
    /// Words that `make` gives.
    pub count: usize,
    pub make: Box<dyn Fn() -> Vec<u32> + Send + Sync + 'a>,
}

enum Part<'a> {
    Words(Cow<'a, [u32]>),
    Made(Made<'a>),
}

impl Part<'_> {
    fn count(&self) -> usize {
        match self {
            Part::Words(words) => words.len(),
            Part::Made(made) => made.count,
        }
    }

    fn words(&self) -> Cow<'_, [u32]> {
        match self {
            Part::Words(words) => Cow::Borrowed(words),
            Part::Made(made) => (made.make)().into(),
        }
    }
}

/// Tables that follow each other in one space of addresses.
#[derive(Default)]
struct Space<'a> {
    parts: Vec<Part<'a>>,
    words: u64,
}

impl<'a> Space<'a> {
    /// Adds a table in parts, one behind the other.
    fn add(&mut self, parts: impl IntoIterator<Item = Part<'a>>) -> u32 {
        // Beyond the range of addresses, `split` refuses.
        let first = self.words as u32;
        for part in parts {
            self.words += part.count() as u64;
            self.parts.push(part);
        }
        // The next table begins at a multiple of so many words.
        let beyond = self.words % QUAD;
        if beyond > 0 {
            self.words += QUAD - beyond;
            let room = vec![0; (QUAD - beyond) as usize];
            self.parts.push(Part::Words(room.into()));
        }
        first
    }
}

/// The tables of a scene: those of any size, and large ones with addresses of their own, which
/// few places of the shaders read. Compilers repeat the search for the buffer of an address
/// wherever one is read: with many buffers that takes them minutes.
#[derive(Default)]
pub struct Tables<'a> {
    all: Space<'a>,
    large: Space<'a>,
}

/// How tables are split into buffers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Split {
    /// Words of every buffer but the last of a kind.
    pub words_per_buffer: u64,
    /// Words of tables, and of large ones.
    words: [u64; 2],
}

impl<'a> Tables<'a> {
    /// Adds a table and gives its first word, a multiple of [`QUAD`].
    pub fn add(&mut self, table: impl Into<Cow<'a, [u32]>>) -> u32 {
        self.all.add([Part::Words(table.into())])
    }

    /// Adds a table of numbers, as bits.
    pub fn add_numbers(&mut self, table: &'a [f32]) -> u32 {
        self.add(bytemuck::cast_slice::<f32, u32>(table))
    }

    /// Adds a large table and gives its first word among these.
    pub fn add_large(&mut self, table: impl Into<Cow<'a, [u32]>>) -> u32 {
        self.large.add([Part::Words(table.into())])
    }

    /// The same of a table that is made in parts, one behind the other.
    pub fn add_large_made(&mut self, parts: impl IntoIterator<Item = Made<'a>>) -> u32 {
        self.large.add(parts.into_iter().map(Part::Made))
    }

    /// How the tables are split for these limits.
    ///
    /// # Errors
    /// More words than the buffers hold, or than can be addressed.
    pub fn split(&self, limits: &Limits) -> Result<Split, Refusal> {
        let split = Split {
            words_per_buffer: limits.words_per_buffer(),
            words: [self.all.words.max(QUAD), self.large.words],
        };
        let mut counts = split.words.iter();
        let is_addressed = counts.all(|&words| words <= u64::from(u32::MAX));
        if split.buffers().len() > limits.table_buffers as usize || !is_addressed {
            let most = split.words_per_buffer * u64::from(limits.table_buffers);
            let words = split.words.iter().sum::<u64>();
            return Err(Refusal::Binding(4 * words, 4 * most));
        }
        Ok(split)
    }

    /// Calls `write` with the number of a buffer, the first word there and words for it,
    /// for all tables.
    pub fn for_each_piece(&self, split: &Split, mut write: impl FnMut(usize, u64, &[u32])) {
        let [buffers, _] = split.buffers_of_each();
        for (space, before) in [(&self.all, 0), (&self.large, buffers)] {
            let mut at = 0u64;
            for parts in space.parts.chunks(MADE_AT_ONCE) {
                let made: Vec<Cow<'_, [u32]>> = parts.par_iter().map(Part::words).collect();
                for words in made {
                    let mut left = &words[..];
                    while !left.is_empty() {
                        let within = at % split.words_per_buffer;
                        let room = split.words_per_buffer - within;
                        let (own, rest) = left.split_at(left.len().min(room as usize));
                        let buffer = before + at / split.words_per_buffer;
                        write(buffer as usize, within, own);
                        at += own.len() as u64;
                        left = rest;
                    }
                }
            }
        }
    }
}

impl Split {
    /// Buffers of tables, and of large ones.
    fn buffers_of_each(&self) -> [u64; 2] {
        self.words
            .map(|words| words.div_ceil(self.words_per_buffer))
    }

    /// Words of every buffer.
    pub fn buffers(&self) -> Vec<u64> {
        let mut buffers = Vec::new();
        for words in self.words {
            let mut left = words;
            while left > 0 {
                let own = left.min(self.words_per_buffer);
                buffers.push(own);
                left -= own;
            }
        }
        buffers
    }

    /// The buffers, bound from that number of group 0 on, and the functions `word` and `number`
    /// that read a word at an address, `quad` and `four` that read four at a multiple of four;
    /// of large tables `large_word` and so on.
    pub fn source(&self, first_binding: u32) -> String {
        let mut text = String::new();
        for i in 0..self.buffers().len() {
            let binding = first_binding + i as u32;
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "@group(0) @binding({binding}) var<storage, read> quads_{i}: array<vec4<u32>>;"
            );
        }
        let [few, large] = self.buffers_of_each();
        for (of, buffers) in [("", 0..few), ("large_", few..few + large)] {
            if buffers.is_empty() {
                continue;
            }
            let mut read = |name: &str, kind: &str, what: &str| {
                let found = self.branch(what, buffers.start, buffers.clone());
                text += &format!("fn {of}{name}(at: u32) -> {kind} {{ {found} }}\n");
            };
            read("word", "u32", "quads_$[@ >> 2u][@ & 3u]");
            read("quad", "vec4<u32>", "quads_$[@ >> 2u]");
            for (name, kind, whole) in [("number", "f32", "word"), ("four", "vec4<f32>", "quad")] {
                let bits = format!("bitcast<{kind}>({of}{whole}(at))");
                text += &format!("fn {of}{name}(at: u32) -> {kind} {{ return {bits}; }}\n");
            }
        }
        text
    }

    /// A search by halves for the buffer of an address, among these, whose addresses begin with
    /// the buffer `zero`; `$` stands for the number of a buffer, `@` for the address in it.
    fn branch(&self, what: &str, zero: u64, buffers: Range<u64>) -> String {
        let words_before = |buffer: u64| (buffer - zero) * self.words_per_buffer;
        let Range { start, end } = buffers;
        if start + 1 == end {
            let own = format!("(at - {}u)", words_before(start));
            let own = what.replace('$', &start.to_string()).replace('@', &own);
            return format!("return {own};");
        }
        let middle = start.midpoint(end);
        let [low, high] = [start..middle, middle..end].map(|half| self.branch(what, zero, half));
        let words = words_before(middle);
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
        assert_eq!(tables.add_large(vec![7; 5]), 0);
        let parts = [(8, 30), (6, 40)].map(|(word, count)| Made {
            count,
            make: Box::new(move || vec![word; count]),
        });
        assert_eq!(tables.add_large_made(parts), 8);
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
        let split = tables.split(&limits(256, 5)).unwrap();
        assert_eq!(split.buffers(), [64, 64, 12, 64, 16]);
        let mut buffers = split.buffers().map_words();
        tables.for_each_piece(&split, |buffer, first, words| {
            buffers[buffer][first as usize..][..words.len()].copy_from_slice(words);
        });
        let all = buffers.concat();
        assert_eq!(all[..5], [1, 2, 3, 0, 1.0f32.to_bits()]);
        assert_eq!(all[73..77], [1.0f32.to_bits(), 0, 0, 9]);
        assert_eq!(all.len(), 140 + 80);
        assert_eq!(all[140..149], [7, 7, 7, 7, 7, 0, 0, 0, 8]);
        assert_eq!(all[140 + 37..140 + 39], [8, 6]);
        let source = split.source(6);
        assert!(source.contains("binding(10)"));
        // The fourth buffer is the first of large tables.
        assert!(source.contains("if at < 64u { return quads_3[(at - 0u) >> 2u]; }"));
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
        let refused = tables().split(&limits(256, 4));
        assert_eq!(refused, Err(Refusal::Binding(880, 1024)));
    }
}
