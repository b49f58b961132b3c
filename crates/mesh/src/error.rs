//! Errors of meshes.

use thiserror::Error;

/// Why a mesh was refused.
#[derive(Clone, Debug, PartialEq, Error)]
#[allow(missing_docs)] // the messages say what is wrong
pub enum Error {
    #[error("mesh: {0}")]
    Syntax(String),
    #[error(
        "mesh \"{object}\": {missing} of {corners} face corners have no texture coordinates; \
         unwrap the mesh, and export it with them"
    )]
    MissingUv {
        object: String,
        missing: usize,
        corners: usize,
    },
    #[error("mesh \"{object}\": {what} {index} is not finite")]
    NotFinite {
        object: String,
        what: &'static str,
        index: usize,
    },
    #[error("mesh: no face has an area ({dropped} were dropped)")]
    Empty { dropped: usize },
    #[error("{key} = {value}: expected a positive number")]
    Scale { key: &'static str, value: f32 },
    #[error("mesh: {0}")]
    Memory(#[from] organza_basis::OverBudget),
    #[error("mesh: {faces} faces, more than {limit}")]
    TooLarge { faces: usize, limit: usize },
}
