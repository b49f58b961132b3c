//! Pictures in memory.

use crate::{Attributes, Display};
use glam::UVec2;
use organza_basis::Rgb;
use organza_film::Film;

/// Linear colours.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width and height, pixels.
    pub size: UVec2,
    /// Rows from the top, each from the left.
    pub pixels: Vec<Rgb>,
}

impl Picture {
    /// Of pixels.
    pub const fn new(size: UVec2, pixels: Vec<Rgb>) -> Picture {
        Picture { size, pixels }
    }
}

/// A render to be written.
#[derive(Clone, Copy, Debug)]
pub struct Rendered<'a> {
    /// What every pixel has gathered.
    pub film: &'a Film,
    /// How formats that hold display values show it.
    pub display: Display,
    /// What made the picture, for formats that keep it.
    pub attributes: &'a Attributes,
    /// What is known beside the film, for formats that keep it.
    pub layers: Layers<'a>,
}

/// What a render may know beside its film; as many pixels.
#[derive(Clone, Copy, Debug, Default)]
pub struct Layers<'a> {
    /// Light that comes straight to the camera or by one event.
    pub direct: Option<&'a Film>,
    /// The error of a cache of radiance about every pixel, in units of radiance.
    pub cache_error: Option<&'a [f32]>,
}

impl<'a> Rendered<'a> {
    /// A film alone.
    pub fn new(film: &'a Film, display: Display, attributes: &'a Attributes) -> Rendered<'a> {
        Rendered {
            film,
            display,
            attributes,
            layers: Layers::default(),
        }
    }

    /// Width and height, pixels.
    pub fn size(&self) -> UVec2 {
        self.film.size()
    }

    /// The estimated radiance of every pixel.
    pub fn colours(&self) -> Picture {
        Picture::new(
            self.size(),
            self.film.pixels().iter().map(|p| p.mean()).collect(),
        )
    }
}
