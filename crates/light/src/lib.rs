//! Light sources: how they shine, how shadow rays and walks find them, and how
//! scene files describe them.
//!
//! | light | found by |
//! |---|---|
//! | parallel, spot | shadow rays: no walk ever meets a single direction |
//! | constant environment | the walk alone: a shadow ray in a random direction is the worse estimate of light from everywhere |
//! | rectangle, disc, image environment | both, combined by the balance heuristic \[Veach1995] |
//!
//! A kind of light is one file and one line of [`catalogue`]: its table in files,
//! its check, its sampling, and what it is for the kernel and for Mitsuba. The
//! crate opens no file; pictures are handed in decoded.

pub mod catalogue;
mod directional;
mod disc;
mod environment;
mod image_environment;
mod light;
pub mod mitsuba;
mod picture_map;
mod rectangle;
mod spherical_rectangle;
mod spot;

pub use catalogue::{LightError, LightKind, LightTable, LoadPicture, LoadedPicture};
pub use directional::{DirectionalLight, DirectionalTable};
pub use disc::{DiscLight, DiscTable};
pub use environment::{EnvironmentLight, EnvironmentTable, Hemisphere};
pub use image_environment::{ImageEnvironment, ImageEnvironmentError, ImageLight};
pub use light::{KernelLight, Light, LightSample, LightSearch, LightSource};
pub use picture_map::{Corners, PictureMap};
pub use rectangle::{RectangleError, RectangleLight, RectangleTable};
pub use spot::{SpotLight, SpotTable};
