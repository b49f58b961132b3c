//! organza: cloth from a weave draft to light.
//!
//! This crate gathers the crates that the program is made of, one module each, so that a program of
//! your own needs one dependency. What a step returns is data; files are written by a step of their own.
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
//! Lengths are in millimetres, angles in radians, where a name does not say otherwise. Errors are types
//! of the crates, whose messages name file, key and place.
//!
//! # From a draft to a picture
//!
//! ```
//! use organza::scene::{self, loader::Loader, studio::Studio, subject};
//! use organza::transport::{self, EngineChoice, Integrator, RenderSettings, Rendering};
//! use std::{ops::ControlFlow, path::Path, sync::Arc};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A named weave; the path of a .wif file or of a fabric would do.
//! let making = subject::Making { studio: Some(Studio::Flat), overrides: &[] };
//! let made = subject::scene_for(Path::new("plain"), making, &Loader::new())?.expect("no scene");
//! let loader = Loader::new().with_given(Arc::new(made.given()));
//! let smaller = ["camera.resolution=[16,16]".to_owned()];
//! let loaded = scene::load(&made.scene_path, &smaller, &loader)?;
//! let scene = loaded.build(None, &loader)?;
//! let settings = RenderSettings {
//!     integrator: Integrator::Woodcock,
//!     samples: 0..4,
//!     max_bounces: u32::MAX,
//!     seed: 1,
//!     crop: None,
//! };
//! let engine = transport::engine(&scene, &settings, EngineChoice::Processor, 1 << 30)?;
//! let rendering = Rendering::new(&scene, settings)?.with_engine(engine);
//! let rendering = rendering.take(4, &|_| ControlFlow::Continue(()))?;
//! let [(red, standard_error), ..] = rendering.film().mean();
//! assert!(red > 0.0 && standard_error < red);
//! # Ok(())
//! # }
//! ```
//!
//! # From a fabric to its BSDF
//!
//! ```
//! use organza::basis::unwatched;
//! use organza::measure::{Effort, SurfacePatch, measure_pairs, parse_pairs};
//! use organza::surface::SurfaceSpec;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let patch = SurfacePatch(SurfaceSpec::preset("denim")?.build()?);
//! let effort = Effort { paths: 256, seed: 1, target_error: None };
//! let pairs = parse_pairs("theta_i,phi_i,theta_o,phi_o\n30,0,45,180\n")?;
//! let results = measure_pairs(&patch, &pairs, &effort, &unwatched)?;
//! let bsdf = results.list[0].bsdf;
//! println!("{:?} +- {:?} 1/sr", bsdf.mean, bsdf.se);
//! # Ok(())
//! # }
//! ```
//!
//! # From fibres to a volume
//!
//! ```
//! use organza::basis::unwatched;
//! use organza::volume::{FibreFootprint, VoxelizeOptions, voxelize};
//! use organza::weave::{Cloth, FabricGeometry};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let geometry: FabricGeometry = toml::from_str(
//!     "draft = { weave = 'plain' }\nwarp = { per_cm = 24.0 }\nweft = { per_cm = 18.0 }\n\
//!      yarn.cotton = { tex = 20.0 }",
//! )?;
//! let no_files = |_: &str| Err(std::io::ErrorKind::NotFound.into());
//! let cloth = Cloth::build(&geometry, &no_files, 1)?;
//! let options = VoxelizeOptions {
//!     voxel_mm: 0.04,
//!     levels: None,
//!     footprint: FibreFootprint::Covered,
//!     max_memory_bytes: Some(1 << 30),
//! };
//! let octree = voxelize(&cloth, &options, &unwatched)?;
//! assert!(octree.occupied_voxels() > 1000);
//! # Ok(())
//! # }
//! ```
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
