//! The lights of a view, grouped by how paths through voxels find them.

use super::environment::Parts;
use super::optical_depth_table::OpticalDepthTable;
use super::placed_light::PlacedLight;
use crate::refusal::Refusal;
use glam::Vec3;
use organza_basis::{CellGrid, Rgb};
use organza_light::{Hemisphere, ImageEnvironment, KernelLight, Light};

/// Most texels along an edge of an environment picture: places in it have 16 bits a
/// coordinate.
const MAX_PICTURE_SIZE: u32 = 1 << 16;

/// A light that shadow rays find, by a table of its own.
pub struct DirectLight {
    /// Unit direction in which it travels through the matter, or about which.
    pub direction: Vec3,
    /// Irradiance across the direction of parallel light.
    pub irradiance: Rgb,
    /// What the light comes from when it is not parallel.
    pub placed: Option<PlacedLight>,
}

impl DirectLight {
    /// The brightest that it can make a pixel, roughly.
    pub fn brightness(&self) -> f32 {
        match &self.placed {
            Some(placed) => placed.brightness,
            None => self.irradiance.max_component(),
        }
    }
}

/// All lights of a view.
pub struct LightGroups<'a> {
    /// Parallel light, then what has a place.
    pub direct: Vec<DirectLight>,
    /// Radiance from directions with z below zero, and from others.
    pub environment: [Vec3; 2],
    /// Environment pictures, each with its sky and its lamps.
    pub pictures: Vec<(&'a ImageEnvironment, Parts)>,
}

impl<'a> LightGroups<'a> {
    /// Groups lights around matter.
    ///
    /// # Errors
    /// A light that only the general walk supports.
    pub fn new(lights: &'a [Light], cell_grid: &CellGrid) -> Result<LightGroups<'a>, Refusal> {
        let (mut direct, mut placed) = (Vec::new(), Vec::new());
        let mut environment = [Vec3::ZERO; 2];
        let mut pictures = Vec::new();
        for light in lights {
            match light.for_kernel() {
                KernelLight::Parallel {
                    direction,
                    irradiance,
                } => direct.push(DirectLight {
                    direction,
                    irradiance,
                    placed: None,
                }),
                KernelLight::Sky {
                    radiance,
                    hemisphere,
                } => {
                    if hemisphere != Hemisphere::Front {
                        environment[0] += radiance.0;
                    }
                    if hemisphere != Hemisphere::Back {
                        environment[1] += radiance.0;
                    }
                }
                KernelLight::Picture(image) if image.size().max_element() > MAX_PICTURE_SIZE => {
                    return Err(Refusal::Picture);
                }
                KernelLight::Picture(image) => pictures.push((image, Parts::of(image))),
                kind @ (KernelLight::Panel(_)
                | KernelLight::Spot(_)
                | KernelLight::Placed { .. }) => {
                    let bounds_mm = kind.bounds_mm().unwrap_or_default();
                    let found = PlacedLight::new(light, bounds_mm, cell_grid)?;
                    placed.push(DirectLight {
                        direction: found.direction,
                        irradiance: Rgb::BLACK,
                        placed: Some(found),
                    });
                }
            }
        }
        direct.append(&mut placed);
        Ok(LightGroups {
            direct,
            environment,
            pictures,
        })
    }

    /// Bytes that their tables take at most, all working space included.
    pub fn max_bytes(&self, voxels: u64) -> u64 {
        let of_pictures: u64 = self.pictures.iter().map(|(_, p)| p.bytes(voxels)).sum();
        OpticalDepthTable::max_bytes(voxels, self.direct.len() as u64) + of_pictures
    }

    /// Words of the longest table of a picture.
    pub fn picture_words(&self) -> u64 {
        let words = self.pictures.iter().map(|(_, parts)| parts.words());
        words.max().unwrap_or(0)
    }
}
