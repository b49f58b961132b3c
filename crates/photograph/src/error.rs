//! What may be wrong with a photograph.

/// Why a photograph gives no cloth.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what is wrong
pub enum PhotographError {
    #[error("the picture has {width} x {height} pixels; expected at least 64 x 64")]
    TooSmall { width: usize, height: usize },
    #[error("the picture has values that are not finite")]
    NotFinite,
    #[error(
        "no weave found: {seen}; expected a woven cloth whose warp runs up the picture within 20 \
         degrees, with at least 6 threads of each system and at least 6 pixels from thread to thread; \
         within 10 degrees and with many threads, 2.5 pixels will do"
    )]
    NoThreads { seen: String },
    #[error("no weave found: {seen}")]
    NoWeave { seen: String },
}
