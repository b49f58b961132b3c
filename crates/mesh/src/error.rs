//! Errors of meshes.

use thiserror::Error;

/// Why a mesh was refused.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Error {
    /// The bytes do not follow the format.
    #[error("mesh: {0}")]
    Syntax(String),
    /// Texture coordinates, which place the cloth, are missing.
    #[error(
        "mesh \"{object}\": {missing} of {corners} face corners have no texture coordinates; \
         unwrap the mesh, and export it with them"
    )]
    MissingUv {
        /// Name of the object in the file.
        object: String,
        /// Corners without coordinates.
        missing: usize,
        /// All corners.
        corners: usize,
    },
    /// A number that is not finite.
    #[error("mesh \"{object}\": {what} {index} is not finite")]
    NotFinite {
        /// Name of the object in the file.
        object: String,
        /// Position, normal or texture coordinate.
        what: &'static str,
        /// Its index, from zero within the object.
        index: usize,
    },
    /// No face can be rendered.
    #[error("mesh: no face has an area ({dropped} were dropped)")]
    Empty {
        /// Faces without area.
        dropped: usize,
    },
    /// A scale that is not a positive number.
    #[error("{key} = {value}: expected a positive number")]
    Scale {
        /// Its key.
        key: &'static str,
        /// The value given.
        value: f32,
    },
    /// More memory is needed than allowed.
    #[error("mesh: {0}")]
    Memory(#[from] organza_basis::OverBudget),
    /// More triangles than can be indexed.
    #[error("mesh: {faces} faces, more than {limit}")]
    TooLarge {
        /// Faces in the file.
        faces: usize,
        /// The maximum.
        limit: usize,
    },
}
