//! Why a picture could not be read or written.

/// What is wrong with a picture file. Messages continue after the file's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The first bytes are those of no format that can be read.
    #[error("is no picture that can be read; expected {0}")]
    Unknown(String),
    /// The content does not follow the format.
    #[error("cannot be read as {format}: {why}")]
    Broken {
        /// Name of the format.
        format: &'static str,
        /// What the decoder found.
        why: String,
    },
    /// Decoding would take more memory than allowed.
    #[error(
        "has {width} x {height} pixels, which take {needed} bytes of memory to read; {allowed} are allowed"
    )]
    Memory {
        /// Pixels of a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        allowed: u64,
    },
    /// An OpenEXR file that `organza render` did not write.
    #[error("holds no exact sums; expected a picture of `organza render`")]
    NoSums,
    /// The sink failed, or the encoder did.
    #[error("encoding the {format} failed")]
    Write {
        /// Name of the format.
        format: &'static str,
        /// What the encoder or the file system reports.
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
