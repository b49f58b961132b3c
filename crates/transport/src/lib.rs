//! Light through cloth: what it meets, the general walk of paths, and the choice of an
//! engine that walks many paths at once.
//!
//! # The waist
//! [`Medium`] is all that a tracker knows of matter: where it is, bounds on its
//! extinction along stretches of a ray, and at a point the extinction toward a
//! direction and the scattering there. [`GridMedium`] answers from
//! dense grids that other programs made. The media of octrees are one type,
//! [`OctreeMedium`], over what scatters in a voxel: micro-flakes of a family
//! ([`FlakeOctreeMedium`]) or virtual fibres ([`VirtualFibreMedium`]). [`Scene`] resolves
//! which medium a ray is in once per ray; the loops inside are monomorphic. [`ExplicitFibres`] are no medium: rays
//! intersect them one by one, and they are the ground truth of the others. A
//! [`LevelledCloth`] holds several media and a [`Surface`](organza_scatter::Surface) for
//! distant views; every path meets the one that suits its pixel.
//!
//! # The general walk
//! Paths start at the camera and go against the light, one at a time, through every
//! [`Scene`]. An event multiplies what a path carries by scattered light over the density
//! of the drawn direction; each kind of [`Light`] is found by shadow rays, by the walk, or
//! by both. Media may overlap: the first collision with their sum is the nearest of the
//! first collisions with each.
//!
//! # Engines
//! The crate `organza_kernel` walks many paths at once through scenes of one flat medium
//! or of explicit fibres. [`engine()`] lays a scene out for one of its [`ENGINES`] or says
//! why only the general walk can render it; [`Rendering::with_engine`] takes the result.
//! The general walk is the oracle of the engines.
//!
//! # Determinism
//! Seed, pixel and sample index determine the random numbers of a path, and a pixel's
//! sums are whole numbers, which add to the same bits in any order. Pictures may
//! therefore be rendered in parts, on any machines, and [merged](Pixel::merge). Threads
//! share nothing but the scene.
//!
//! ```
//! use glam::{DVec3, UVec2, UVec3, Vec3};
//! use organza_basis::{Aabb, Rgb, Sym3};
//! use organza_transport::*;
//! use std::ops::ControlFlow;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // A cube of fibres along x: 2 per mm seen broadside, half of it end-on.
//! let medium = GridMedium::new(
//!     Aabb::new(Vec3::splat(-0.5), Vec3::splat(0.5)),
//!     false,
//!     Interpolation::Nearest,
//!     Grid::new(UVec3::ONE, vec![[2.0]]).unwrap(),
//!     Grid::constant(Sym3::axial(Vec3::X, 1.0, 0.25).to_array()),
//!     Grid::constant([0.9, 0.8, 0.7]),
//! )?;
//! let pose = CameraPose {
//!     origin_mm: DVec3::new(0.0, 0.0, 5.0),
//!     target_mm: DVec3::ZERO,
//!     up: DVec3::Y,
//! };
//! let projection = Projection::Orthographic { width_mm: 2.0 };
//! let scene = Scene {
//!     media: vec![AnyMedium::Grid(medium)],
//!     lights: vec![Light::from(EnvironmentLight {
//!         radiance: Rgb::WHITE,
//!         hemisphere: Hemisphere::All,
//!     })],
//!     camera: Camera::new(projection, pose, UVec2::splat(8), PixelFilter::Box)?,
//! };
//! let settings = RenderSettings {
//!     integrator: Integrator::Woodcock,
//!     samples: 0..16,
//!     max_bounces: u32::MAX,
//!     seed: 1,
//!     crop: None,
//! };
//! let (film, stats) = render(&scene, &settings, &|_| ControlFlow::Continue(()))?;
//! assert_eq!((stats.paths, stats.rejected), (8 * 8 * 16, 0));
//! let [(red, standard_error), ..] = film.mean();
//! assert!(red > 0.5 && red < 1.0 && standard_error > 0.0);
//! # Ok(())
//! # }
//! ```

mod engine;
mod kernel_matter;
mod levelled_engine;
mod matter;
mod walk;

pub use engine::{EngineChoice, KernelRefusal, engine, fibre_probe, flatten};
pub use matter::*;
pub use walk::*;

pub use organza_scatter::{FlakeFamily, FlakeOptics, population_shape};
// What a scene and its picture are made of, under one name for those who trace them.
pub use organza_basis::cell_grid::{CellGrid, CellSpan, Cells, LocalRay};
pub use organza_film::{
    Camera, CameraError, CameraPose, Escape, Film, FirstEvent, PathSample, Pixel, PixelCone,
    PixelErrors, PixelFilter, Projection, SiteInfo, Stats, Tail, aperture_mm,
};
pub use organza_kernel::Refusal;
pub use organza_kernel::fibres::{CacheMode, CachePlan, CacheReport, KeptLight, LearnWatch, Plane};
pub use organza_kernel::packed::Switch;
pub use organza_kernel::{
    Backend, CPU_ENGINES, ENGINES, Engine, EngineRecord, FibreProbe, FlatScene, LaidOut,
    ProbePaths, VoxelEngine, engine_named,
};
pub use organza_light::{
    DirectionalLight, DiscLight, EnvironmentLight, Hemisphere, ImageEnvironment,
    ImageEnvironmentError, ImageLight, Light, LightSample, LightSearch, LightSource,
    RectangleError, RectangleLight, SpotLight,
};
