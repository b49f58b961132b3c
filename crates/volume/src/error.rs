//! Errors of volumes.

/// Failures of the voxelizer and of volume files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what is wrong
pub enum Error {
    /// Reading or writing bytes failed.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The options of the voxelizer are invalid.
    #[error("{0}")]
    Options(String),
    #[error("the tile's box {0} is not a finite box")]
    Tile(String),
    #[error("segment of yarn {yarn}, fibre {fibre}: {problem}")]
    Segment {
        yarn: u32,
        fibre: u32,
        problem: String,
    },
    #[error(
        "needs about {needed} bytes of memory, {allowed} are allowed: use larger voxels, a smaller tile or allow more"
    )]
    Memory { needed: u64, allowed: u64 },
    /// Whoever watched the work stopped it.
    #[error("{0}")]
    Stopped(#[from] organza_basis::Stopped),
    /// Reading takes more memory than allowed.
    #[error("{0}")]
    Budget(#[from] organza_basis::OverBudget),
    /// A file does not exist or cannot be opened.
    #[error("{0}")]
    Unreadable(String),
    #[error("{name}: {problem}")]
    Beside { name: String, problem: Box<Error> },
    #[error("{grid}: {problem}")]
    Grid { grid: &'static str, problem: String },
    #[error("not a readable {format} file: {problem}")]
    Format {
        format: &'static str,
        problem: String,
    },
}

impl Error {
    pub(crate) fn format(format: &'static str, problem: impl Into<String>) -> Error {
        Error::Format {
            format,
            problem: problem.into(),
        }
    }
}
