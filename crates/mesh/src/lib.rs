//! Triangle meshes that cloth is draped over: reading them, checking and
//! repairing them, and meeting them with rays.
//!
//! A hit answers in the terms of the cloth: the place in the fabric plane in
//! millimetres, the frame of weft, warp and normal there, and how far the cloth
//! is stretched; a [`Shell`] answers with the straight stretches of the ray in a
//! slab of cloth laid over the mesh. What lies there, a surface model or voxels,
//! is for others to say: this crate knows neither.

// Negated comparisons are meant: what is not a number goes the safe way.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod error;
mod gltf_file;
mod indexed;
mod mesh;
mod obj;
mod ply;
mod scene;
mod shell;

pub use error::Error;
pub use gltf_file::read_gltf;
pub use mesh::{Mesh, Repairs, Vertex};
pub use obj::{Placement, read_obj};
pub use ply::read_ply;
pub use scene::{DrapedMesh, MeshHit};
pub use shell::{Folds, Shell, ShellSpan};
