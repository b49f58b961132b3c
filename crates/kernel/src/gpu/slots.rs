//! Sums of slots, as shaders write them, for the film: see `film_sums.wgsl`.

use glam::Vec3;
use organza_film::{Brightness, FirstEvent, Pixel, Sample, SiteInfo, Tally};

/// Words and bytes of a slot.
pub const SLOT_WORDS: usize = 32;
pub const SLOT_BYTES: u64 = 4 * SLOT_WORDS as u64;
/// Nothing was met, or no yarn.
const NONE: u32 = u32::MAX;

/// The sums of a slot.
pub fn tally(words: &[u32]) -> Tally {
    let wide = |at: usize| u64::from(words[at]) | u64::from(words[at + 1]) << 32;
    Tally {
        values: std::array::from_fn(|c| wide(2 * c) as i64),
        squares: std::array::from_fn(|c| wide(6 + 2 * c)),
        axis: std::array::from_fn(|k| wide(12 + 2 * k) as i64),
        depth: wide(24),
        bounces: wide(26),
        count: words[28],
        hits: words[29],
        yarn: (words[31] != NONE).then_some((words[30], words[31])),
    }
}

/// A sample of the list of bright ones: its slot, and what it found.
pub fn bright_sample(words: &[u32]) -> (u32, Sample) {
    let three = |at: usize| [0, 1, 2].map(|k| f32::from_bits(words[at + k]));
    let first = || FirstEvent {
        info: SiteInfo::new(
            Vec3::from_array(three(8)),
            (words[11] != NONE).then_some(words[11]),
        ),
        depth_mm: f64::from(f32::from_bits(words[7])),
    };
    let sample = Sample {
        radiance: three(2),
        bounces: words[5],
        first: (words[6] != NONE).then(first),
        index: words[1],
    };
    (words[0], sample)
}

/// Adds a bright sample to its pixel.
pub fn add_bright(sample: &Sample, brightness: &Brightness, pixel: &mut Pixel) {
    let mut tally = Tally::default();
    // Shaders have rejected what is no number.
    tally.add(sample, brightness, pixel);
    tally.flush(brightness, pixel);
}
