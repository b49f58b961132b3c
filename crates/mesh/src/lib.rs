//! Triangle meshes that cloth is draped over: reading them, checking and
//! repairing them, and meeting them with rays.
//!
//! A hit answers in the terms of the cloth: the place in the fabric plane in
//! millimetres, the frame of weft, warp and normal there, and how far the cloth
//! is stretched. What lies on the mesh, a surface model or a shell of voxels,
//! is for others to say: this crate knows neither.

// Negated comparisons are meant: what is not a number goes the safe way.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod error;
mod mesh;
mod obj;
mod scene;

pub use error::Error;
pub use mesh::{Mesh, Repairs, Vertex};
pub use obj::{Placement, read_obj};
pub use scene::{DrapedMesh, MeshHit};
