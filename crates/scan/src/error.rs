//! Why a scan cannot be read or used.

use organza_basis::OverBudget;

/// Failures of reading and of processing a scan.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScanError {
    /// Reading bytes failed.
    #[error("{0}")]
    Io(#[from] std::io::Error),
    /// The file does not follow its format, or holds what cannot be used.
    #[error("not a usable {format} file: {problem}")]
    Format {
        /// The format, for example "TIFF".
        format: &'static str,
        /// What is wrong, and where.
        problem: String,
    },
    /// A file of a stack is at fault.
    #[error("{name}: {problem}")]
    InStack {
        /// Name of the file.
        name: String,
        /// What is wrong with it.
        problem: Box<ScanError>,
    },
    /// More memory is needed than allowed.
    #[error("{0}")]
    Budget(#[from] OverBudget),
    /// Settings that contradict each other or the scan.
    #[error("{0}")]
    Settings(String),
    /// The grey values hold no cloth.
    #[error("{0}")]
    Content(String),
    /// The octree cannot be made.
    #[error("{0}")]
    Volume(#[from] organza_volume::Error),
    /// Whoever watched the scan stopped it.
    #[error("{0}")]
    Stopped(#[from] organza_basis::Stopped),
}

impl ScanError {
    /// A format error.
    pub(crate) fn format(format: &'static str, problem: impl Into<String>) -> ScanError {
        ScanError::Format {
            format,
            problem: problem.into(),
        }
    }

    /// An error of reading; the end of the file, and data that cannot be unpacked, are errors of
    /// the format.
    pub(crate) fn read(format: &'static str, place: &str, e: std::io::Error) -> ScanError {
        match e.kind() {
            std::io::ErrorKind::UnexpectedEof => {
                ScanError::format(format, format!("it ends in {place}"))
            }
            std::io::ErrorKind::InvalidData | std::io::ErrorKind::InvalidInput => {
                ScanError::format(format, format!("{place}: {e}"))
            }
            _ => ScanError::Io(e),
        }
    }
}
