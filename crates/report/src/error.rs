//! Errors of reports.

use organza_scene::InputError;
use std::fmt::Display;
use std::path::Path;

/// Why a measurement, a bench, a page or a table could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// A file or a value of the command line is wrong.
    #[error("{0}")]
    Input(#[from] InputError),
    /// A file that cannot be written.
    #[error("{0}")]
    Write(#[source] crate::write_file::WriteError),
    /// A process that failed.
    #[error("{0}")]
    Run(String),
    /// A measurement without a result.
    #[error("{0}")]
    Measure(#[from] organza_measure::MeasureError),
    /// Whoever watched the work stopped it.
    #[error("{0}")]
    Stopped(#[from] organza_basis::Stopped),
    /// A picture that cannot be encoded.
    #[error("{0}")]
    Picture(#[from] organza_picture::PictureError),
    /// A plot that cannot be drawn.
    #[error("cannot draw a plot: {0}")]
    Plot(String),
    /// A page that cannot be assembled.
    #[error("cannot put a page together: {0}")]
    Page(#[from] askama::Error),
    /// Figures that cannot be written as JSON.
    #[error("cannot write figures as JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// A table that cannot be written.
    #[error("cannot write a table: {0}")]
    Table(#[from] csv::Error),
}

impl ReportError {
    /// A file is wrong.
    pub(crate) fn of_file(path: impl AsRef<Path>, message: impl Display) -> ReportError {
        ReportError::Input(InputError::of_file(path, message))
    }
}

impl From<crate::plot::DrawError> for ReportError {
    fn from(e: crate::plot::DrawError) -> ReportError {
        ReportError::Plot(e.to_string())
    }
}
