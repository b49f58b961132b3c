//! Why a picture could not be read or written.

/// What is wrong with a picture file. Messages continue after the file's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what is wrong
pub enum PictureError {
    #[error("is no picture that can be read; expected {0}")]
    Unknown(String),
    #[error("cannot be read as {format}: {why}")]
    Broken { format: &'static str, why: String },
    #[error(
        "has {width} x {height} pixels, which take {needed} bytes of memory to read; {allowed} are allowed"
    )]
    Memory {
        width: u32,
        height: u32,
        needed: u64,
        allowed: u64,
    },
    #[error("holds no exact sums; expected a picture of `organza render`")]
    NoSums,
    #[error("encoding the {format} failed")]
    Write {
        format: &'static str,
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl PictureError {
    /// A [`PictureError::Broken`] of a decoder's error.
    pub(crate) fn broken(format: &'static str, why: impl ToString) -> PictureError {
        PictureError::Broken {
            format,
            why: why.to_string(),
        }
    }

    /// A [`PictureError::Write`] of an encoder's error.
    pub(crate) fn write(
        format: &'static str,
        source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
    ) -> PictureError {
        PictureError::Write {
            format,
            source: source.into(),
        }
    }
}
