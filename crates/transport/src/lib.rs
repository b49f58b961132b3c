//! Light through media of fibres: trackers, lights, cameras and films.
//!
//! # The waist
//! [`Medium`] is all that a tracker knows of matter: where it is, a bound on
//! its extinction along stretches of a ray, and at a point the extinction
//! toward a direction and the scattering there. [`GridMedium`] answers from
//! dense grids that other programs made, [`ClothMedium`] from an octree of
//! fibres taken as micro-flakes, [`FibreMedium`] from the same with fibres that
//! scatter as fibres. [`Scene`] resolves which medium a ray is in once per ray; the loops
//! inside are monomorphic. Beside them stand [`ExplicitFibres`], which a ray meets
//! one by one: the ground truth of the others. A [`LevelledCloth`] holds several of
//! them, and last a [`Sheet`], of which every path meets the one that suits its
//! pixel.
//!
//! # The walk
//! Paths start at the camera and go against the light. An event weighs the
//! path by albedo times phase over density; each kind of [`Light`] is found by
//! shadow rays, by the walk, or by both. Media may overlap:
//! collisions of their sum are the nearest of the collisions of each.
//!
//! # Determinism
//! The random numbers of a path are named by seed, pixel and sample index, and
//! a pixel's sums are whole numbers, which add to the same bits in any order:
//! pictures may be made in parts, on any machines, and [merged](Pixel::merge).
//! Threads share nothing but the scene.

mod camera;
mod cloth_medium;
mod detail;
mod draping;
mod explicit_fibres;
mod fibre_medium;
mod film;
mod film_error;
mod flake_medium;
mod grid_medium;
mod image_environment;
mod integrator;
mod kernel;
mod lattice;
mod levelled_cloth;
mod light;
mod local_visibility;
mod medium;
mod plane;
mod population_flakes;
mod rectangle;
mod render;
mod scene;
mod sheet;
mod stats;
mod tracking;
mod wide_sum;

pub use camera::{Camera, CameraError, CameraPose, PixelFilter, Projection, aperture_mm};
pub use cloth_medium::{ClothMedium, MergedFlakes};
pub use detail::{Detail, LevelSteps, PixelCone, Tracking};
pub use draping::Draping;
pub use explicit_fibres::{ExplicitFibres, ExplicitFibresError, FibreHit, Overlap};
pub use fibre_medium::{FibreEvent, FibreMedium, FibreSite};
pub use film::{Film, Pixel};
pub use film_error::PixelErrors;
pub use flake_medium::{FlakeFamily, FlakeMedium, FlakeSite};
pub use grid_medium::{Grid, GridMedium, GridMediumError, Interpolation};
pub use image_environment::{ImageEnvironment, ImageEnvironmentError};
pub use integrator::{Escape, FirstEvent, Integrator, PathSample, trace_from, trace_path};
pub use kernel::{Backend, Kernel, KernelRefusal};
pub use lattice::{CellSpan, Cells, Lattice, LocalRay};
pub use levelled_cloth::LevelledCloth;
pub use light::{Hemisphere, Light, LightSample, LightSearch};
pub use local_visibility::LocalVisibility;
pub use medium::{Medium, SiteInfo};
pub use plane::Plane;
pub use population_flakes::{FlakeOptics, population_shape};
pub use rectangle::{RectangleError, RectangleLight};
pub use render::{Crop, Pass, RenderError, RenderSettings, Rendering, Watch, render};
pub use scene::{AnyMedium, Collision, Scene};
pub use sheet::{Sheet, SheetPoint};
pub use stats::Stats;
pub use tracking::{
    exact_transmittance, sample_collision, sample_collision_exactly, stopped_transmittance,
    transmittance,
};
