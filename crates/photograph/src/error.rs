//! What may be wrong with a photograph.

/// Why a photograph gives no cloth.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PhotographError {
    /// Too few pixels.
    #[error("the picture has {width} x {height} pixels; expected at least 64 x 64")]
    TooSmall {
        /// Pixels.
        width: usize,
        /// Pixels.
        height: usize,
    },
    /// A value is infinite or not a number.
    #[error("the picture has values that are not finite")]
    NotFinite,
    /// No two directions of threads.
    #[error(
        "no weave found: {seen}; expected a woven cloth whose warp runs up the picture within 20 \
         degrees, with at least 6 threads of each system and at least 6 pixels from thread to thread; \
         within 10 degrees and with many threads, 2.5 pixels will do"
    )]
    NoThreads {
        /// What the spectrum has instead.
        seen: String,
    },
    /// The crossings have no pattern.
    #[error("no weave found: {seen}")]
    NoWeave {
        /// What the crossings show instead.
        seen: String,
    },
}
