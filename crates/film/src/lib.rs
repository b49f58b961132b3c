//! Pictures: cameras and their rays, what a path found, and what every pixel has
//! gathered. The walk and the kernel both fill films from here, and neither knows
//! of the other.
//!
//! A pixel's sums are whole numbers, which add to the same bits in any order:
//! pictures may be made in parts, on any machines, and [merged](Pixel::merge).

mod camera;
mod film;
mod film_error;
mod path_sample;
mod pixel_cone;
mod stats;
mod tally;
mod wide_sum;

pub use camera::{
    Camera, CameraError, CameraParts, CameraPose, PixelFilter, Projection, aperture_mm,
};
pub use film::{Film, Pixel};
pub use film_error::PixelErrors;
pub use path_sample::{Escape, FirstEvent, PathSample, SiteInfo};
pub use pixel_cone::PixelCone;
pub use stats::Stats;
pub use tally::{Brightness, Sample, Tally};
