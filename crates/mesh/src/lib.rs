//! Triangle meshes over which cloth is draped: reading, checking and repairing them, and
//! intersecting them with rays.
//!
//! A hit is given in the coordinates of the cloth: the place in the fabric plane in
//! millimetres, the frame of weft, warp and normal there, and the stretch of the cloth. A
//! [`Shell`] returns the straight parts of the ray in a slab of cloth over the mesh. Surface
//! models and voxels that use these coordinates live in other crates.
//!
//! ```
//! use glam::Vec3;
//! use organza_basis::{Budget, Ray};
//! use organza_mesh::{DrapedMesh, Placement, read_obj};
//!
//! # fn main() -> Result<(), organza_mesh::Error> {
//! let square = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n\
//!     vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
//! // Its unit of length is a centimetre, of texture coordinates 10 mm of cloth.
//! let placement = Placement {
//!     mm_per_unit: 10.0,
//!     mm_per_uv: 10.0,
//! };
//! // Readers take no more memory than the budget.
//! let mut budget = Budget::new(1 << 20);
//! let draped = DrapedMesh::new(read_obj(square, placement, &mut budget)?);
//! let down = Ray::new(Vec3::new(2.0, 7.0, 5.0), Vec3::NEG_Z);
//! let hit = draped.hit(&down, 0.0, f64::INFINITY).unwrap();
//! assert!((hit.distance_mm - 5.0).abs() < 1e-5);
//! assert!((hit.uv_mm - glam::Vec2::new(2.0, 7.0)).length() < 1e-4);
//! # Ok(())
//! # }
//! ```

// Negated comparisons are intended: a NaN takes the safe branch.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod chart;
mod error;
mod gltf_file;
mod indexed;
mod mesh;
mod obj;
mod ply;
mod scene;
mod shell;
mod shell_around;
mod shell_tables;

pub use chart::Chart;
pub use error::Error;
pub use gltf_file::read_gltf;
pub use mesh::{Mesh, Repairs, Vertex};
pub use obj::{Placement, read_obj};
pub use ply::read_ply;
pub use scene::{DrapedMesh, MeshHit};
pub use shell::{Folds, Shell, ShellSpan, ShellStep};
pub use shell_around::{NOBODY, ShellBox};
pub use shell_tables::{ShellTables, ShellTetrahedron};
