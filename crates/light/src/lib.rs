//! Light sources: how they shine, and how shadow rays and walks find them.

mod image_environment;
mod light;
mod rectangle;

pub use image_environment::{ImageEnvironment, ImageEnvironmentError};
pub use light::{Hemisphere, Light, LightSample, LightSearch};
pub use rectangle::{RectangleError, RectangleLight};
