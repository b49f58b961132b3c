//! Pictures: cameras and their rays, what a path found, and what every pixel has
//! gathered. The walk and the kernel both fill films from here, and neither knows
//! of the other.
//!
//! A pixel's sums are whole numbers, which add to the same bits in any order:
//! pictures may be made in parts, on any machines, and [merged](Pixel::merge).

mod camera;
mod camera_rays;
mod film;
mod film_error;
mod path_sample;
mod pixel_cone;
mod pixel_sums;
mod stats;
mod tally;
mod wide_sum;

pub use camera::{Camera, CameraError, CameraPose, PixelFilter, Projection, aperture_mm};
pub use camera_rays::CameraParts;
pub use film::Film;
pub use film_error::{PixelErrors, Tail};
pub use path_sample::{Escape, FirstEvent, PathSample, SiteInfo};
pub use pixel_cone::PixelCone;
pub use pixel_sums::Pixel;
pub use stats::Stats;
pub use tally::{Brightness, Sample, Tally};
