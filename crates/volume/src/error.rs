//! Errors of volumes.

/// Failures of the voxelizer and of volume files.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// Reading or writing bytes failed.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The options of the voxelizer are invalid.
    #[error("{0}")]
    Options(String),
    /// The tile has no usable box.
    #[error("the tile's box {0} is not a finite box")]
    Tile(String),
    /// A segment cannot be placed in the grid.
    #[error("segment of yarn {yarn}, fibre {fibre}: {problem}")]
    Segment {
        /// Its yarn.
        yarn: u32,
        /// Its curve within the yarn.
        fibre: u32,
        /// What is wrong with it.
        problem: String,
    },
    /// More memory is needed than allowed.
    #[error(
        "needs about {needed} bytes of memory, {allowed} are allowed: use larger voxels, a smaller tile or allow more"
    )]
    Memory {
        /// Estimated need, bytes.
        needed: u64,
        /// The limit, bytes.
        allowed: u64,
    },
    /// Whoever watched the work stopped it.
    #[error("{0}")]
    Stopped(#[from] organza_basis::Stopped),
    /// Reading takes more memory than allowed.
    #[error("{0}")]
    Budget(#[from] organza_basis::OverBudget),
    /// A file does not exist or cannot be opened.
    #[error("{0}")]
    Unreadable(String),
    /// One of the files of a volume is invalid.
    #[error("{name}: {problem}")]
    Beside {
        /// Name of the file.
        name: String,
        /// What is wrong with it.
        problem: Box<Error>,
    },
    /// A grid of a volume does not fit the others.
    #[error("{grid}: {problem}")]
    Grid {
        /// The grid: extinction, sggx or albedo.
        grid: &'static str,
        /// What is wrong with it.
        problem: String,
    },
    /// A file does not follow its format.
    #[error("not a readable {format} file: {problem}")]
    Format {
        /// File format, for example ".vol".
        format: &'static str,
        /// What is wrong, and where.
        problem: String,
    },
}

impl Error {
    /// A format error.
    pub(crate) fn format(format: &'static str, problem: impl Into<String>) -> Error {
        Error::Format {
            format,
            problem: problem.into(),
        }
    }
}
