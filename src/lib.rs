//! organza: cloth from a weave draft to light.
//!
//! # Requests
//!
//! What the program's commands do are requests: plain structs, whose fields are the flags of the command
//! of the same name. [`Request::run`] does the work in a [`Context`] (threads, memory, files in memory,
//! progress, a flag that stops it) and returns what was found, or an [`Error`] with file, place and key.
//! [`Output::write`] writes it. A request can be [read from a table](Request::from_table), too.
//!
//! # From a draft to a picture
//!
//! ```
//! use organza::{Context, Output, Render, Request};
//!
//! # fn main() -> Result<(), organza::Error> {
//! let render = Render {
//!     scene: "twill-3-1-s".into(), // a named weave; a draft, a fabric or a scene file would do
//!     spp: Some(4),
//!     set: vec!["camera.resolution=[16,16]".into()],
//!     ..Render::default()
//! };
//! let picture = render.run(&Context::default())?;
//! let [(red, standard_error), ..] = picture.film.mean();
//! assert!(red > 0.0 && standard_error < red);
//! # let path = std::env::temp_dir().join(format!("organza_{}.png", std::process::id()));
//! picture.write(&path)?; // a .png, .exr or other picture
//! # std::fs::remove_file(path).unwrap();
//! # Ok(())
//! # }
//! ```
//!
//! # From a fabric to its BSDF
//!
//! ```
//! use organza::{Context, Measure, Output, Request};
//! use std::sync::Arc;
//!
//! # fn main() -> Result<(), organza::Error> {
//! let fabric = "draft = { weave = 'plain' }\nwarp = { per_cm = 24.0 }\nweft = { per_cm = 18.0 }\n\
//!               yarn.cotton = { tex = 20.0 }";
//! let context = Context {
//!     given: Arc::new([("cotton.toml", fabric)].into_iter().collect()), // in place of a file
//!     ..Context::default()
//! };
//! let measure = Measure { file: "cotton.toml".into(), albedo: true, spp: 64, ..Measure::default() };
//! let found = measure.run(&context)?;
//! let reflected = found.results()?;
//! assert_eq!(reflected.array("reflected").unwrap().shape, [225, 3]);
//! # Ok(())
//! # }
//! ```
//!
//! # From a fabric to a volume
//!
//! ```
//! use organza::{Context, Output, Request, Voxelize};
//! # use std::sync::Arc;
//!
//! # fn main() -> Result<(), organza::Error> {
//! # let fabric = "draft = { weave = 'plain' }\nwarp = { per_cm = 24.0 }\nweft = { per_cm = 18.0 }\n\
//! #               yarn.cotton = { tex = 20.0 }";
//! # let given = Arc::new([("cotton.toml", fabric)].into_iter().collect());
//! # let context = Context { given, ..Context::default() };
//! let voxelize = Voxelize { fabric: "cotton.toml".into(), voxel_um: Some(40.0), ..Voxelize::default() };
//! let volume = voxelize.run(&context)?;
//! assert!(volume.octree.occupied_voxels() > 1000);
//! # let path = std::env::temp_dir().join(format!("organza_{}.ovox", std::process::id()));
//! volume.write(&path)?; // .ovox, .vdb, .vol and others
//! # std::fs::remove_file(path).unwrap();
//! # Ok(())
//! # }
//! ```
//!
//! # Steps
//!
//! The steps that requests are made of are modules:
//!
//! | module | what it is for |
//! |---|---|
//! | [`weave`] | drafts, yarns, plies, fibres |
//! | [`scene`] | scene and fabric files, studios, models of a cloth |
//! | [`volume`] | voxels, the octree, volume files |
//! | [`transport`] | scenes, engines, pictures in the making |
//! | [`measure`] | the goniometer, BSDF files, fits |
//! | [`surface`] | surface models of woven cloth |
//! | [`scatter`], [`light`], [`mesh`], [`basis`] | fibres and flakes, lights, meshes, vectors and curves |
//! | [`picture`] | picture files |
//!
//! Lengths are in millimetres, angles in radians, where a name does not say otherwise.
//!
//! The folder `examples/` has programs that write files.

pub use organza_basis as basis;
pub use organza_light as light;
pub use organza_measure as measure;
pub use organza_mesh as mesh;
pub use organza_picture as picture;
pub use organza_scatter as scatter;
pub use organza_scene as scene;
pub use organza_surface as surface;
pub use organza_transport as transport;
pub use organza_volume as volume;
pub use organza_weave as weave;

/// Tables, as [`Request::from_table`] reads them.
pub use toml;

pub use organza_requests::{
    Array, Bake, Bench, Compare, Context, Error, ErrorKind, Fit, Listener, Measure, Numbers,
    Output, Render, Request, Results, Scan, StopFlag, Table, Voxelize, Weave, requests, run_table,
};
