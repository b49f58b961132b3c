//! Numbers in tables of words.

use crate::{Floats, Ints, V3};

/// A word behind a place of a table.
#[inline(always)]
pub fn word_of<F: Floats>(words: &[u32], first: F::Ints, k: u32) -> F {
    (first + F::Ints::splat(k)).gather(words).as_floats()
}

/// Three words behind a place of a table.
#[inline(always)]
pub fn vector_of<F: Floats>(words: &[u32], first: F::Ints, k: u32) -> V3<F> {
    V3 {
        x: word_of::<F>(words, first, k),
        y: word_of::<F>(words, first, k + 1),
        z: word_of::<F>(words, first, k + 2),
    }
}
