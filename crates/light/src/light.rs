//! Lights, and how a walk finds them.
//!
//! | light | found by |
//! |---|---|
//! | parallel | shadow rays: no walk ever meets a single direction |
//! | constant environment, shining plane | the walk alone: a shadow ray in a random direction is the worse estimate of light from everywhere |
//! | rectangle, image environment | both, weighed by the balance heuristic [Veach1995] |

use crate::{ImageEnvironment, RectangleLight};
use glam::{DVec3, Vec3};
use organza_basis::{PathRng, Ray, Rgb};
use std::sync::Arc;

/// Which half of the sphere an environment fills, as seen from the cloth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Hemisphere {
    /// Everywhere.
    #[default]
    All,
    /// Where the cloth's face looks: directions with z >= 0.
    Front,
    /// Behind the cloth, like the lamp of a light table: z < 0.
    Back,
}

/// How a light that has a width and a place is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightSearch {
    /// By shadow rays and by the walk, weighed against each other.
    #[default]
    Both,
    /// By shadow rays alone (the first sight of the camera apart).
    ShadowRays,
    /// By the walk alone.
    Walk,
}

/// A source of light.
#[derive(Clone, Debug)]
pub enum Light {
    /// Parallel light.
    Directional {
        /// Unit direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a plane perpendicular to the direction.
        irradiance: Rgb,
    },
    /// Light from infinity, the same from every direction of a hemisphere or
    /// of the sphere.
    Environment {
        /// Radiance.
        radiance: Rgb,
        /// Where it comes from.
        hemisphere: Hemisphere,
    },
    /// Light from infinity as a picture.
    Image {
        /// The picture.
        image: Arc<ImageEnvironment>,
        /// How it is found.
        search: LightSearch,
    },
    /// A rectangle that shines.
    Rectangle {
        /// The rectangle.
        rectangle: RectangleLight,
        /// How it is found.
        search: LightSearch,
    },
}

/// A direction drawn toward a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit direction toward the light.
    pub w_in: Vec3,
    /// Radiance over density; irradiance of parallel light.
    pub irradiance: Rgb,
    /// Density with which the direction was drawn, 1/sr; infinite for the one
    /// direction of parallel light.
    pub pdf: f32,
}

impl Light {
    /// Radiance of this light along a direction of sight that
    /// [meets](Light::distance_along) it. Parallel light has no width and is
    /// never met.
    pub fn radiance_toward(&self, direction: Vec3) -> Rgb {
        match self {
            Light::Directional { .. } => Rgb::BLACK,
            Light::Environment {
                radiance,
                hemisphere,
            } => {
                let lit = match hemisphere {
                    Hemisphere::All => true,
                    Hemisphere::Front => direction.z >= 0.0,
                    Hemisphere::Back => direction.z < 0.0,
                };
                if lit { *radiance } else { Rgb::BLACK }
            }
            Light::Image { image, .. } => image.radiance_toward(direction),
            Light::Rectangle { rectangle, .. } => rectangle.radiance_toward(direction),
        }
    }

    /// Distance in mm at which a ray meets the light: infinite for light from
    /// infinity, `None` when it misses.
    pub fn distance_along(&self, ray: &Ray) -> Option<f32> {
        match self {
            Light::Rectangle { rectangle, .. } => rectangle.distance_along(ray),
            _ => Some(f32::INFINITY),
        }
    }

    /// Distance in mm from a far origin to a light that has a place.
    pub fn distance_mm(&self, origin_mm: DVec3, direction: DVec3) -> Option<f64> {
        match self {
            Light::Rectangle { rectangle, .. } => rectangle.distance_mm(origin_mm, direction),
            _ => None,
        }
    }

    /// Draws a direction toward the light from a point, for a shadow ray;
    /// `None` where no shadow rays are sent to it, or nothing of it is seen.
    pub fn sample_toward(&self, from_mm: Vec3, rng: &mut PathRng) -> Option<LightSample> {
        let (w_in, pdf) = match self {
            Light::Directional {
                direction,
                irradiance,
            } => {
                return Some(LightSample {
                    w_in: -direction,
                    irradiance: *irradiance,
                    pdf: f32::INFINITY,
                });
            }
            Light::Environment { .. } => return None,
            Light::Image { search, .. } | Light::Rectangle { search, .. }
                if *search == LightSearch::Walk =>
            {
                return None;
            }
            Light::Image { image, .. } => image.sample(rng)?,
            Light::Rectangle { rectangle, .. } => rectangle.sample_toward(from_mm, rng)?,
        };
        Some(LightSample {
            w_in,
            irradiance: self.radiance_toward(w_in) / pdf,
            pdf,
        })
    }

    /// Share of the light along a drawn direction that the shadow ray counts;
    /// `walk_pdf` tells the density with which the walk would draw it, where that
    /// matters.
    pub fn shadow_share(&self, drawn: &LightSample, walk_pdf: impl FnOnce() -> f32) -> f32 {
        match self {
            Light::Image { search, .. } | Light::Rectangle { search, .. }
                if *search == LightSearch::Both =>
            {
                1.0 / (1.0 + walk_pdf() / drawn.pdf)
            }
            _ => 1.0,
        }
    }

    /// Share of the light that a walk counts which meets it: the rest of
    /// [`Light::shadow_share`]. The walk drew `w_in` with `walk_pdf` at an
    /// event at `from_mm`.
    pub fn walk_share(&self, from_mm: Vec3, w_in: Vec3, walk_pdf: f32) -> f32 {
        let (search, pdf) = match self {
            Light::Directional { .. } => return 0.0,
            Light::Environment { .. } => return 1.0,
            Light::Image { image, search } => (search, image.pdf(w_in)),
            Light::Rectangle { rectangle, search } => (search, rectangle.pdf_toward(from_mm, w_in)),
        };
        match search {
            LightSearch::Walk => 1.0,
            // Beyond the reach of shadow rays (light that leaves a fibre
            // beside where it came in), the walk counts all.
            LightSearch::ShadowRays => f32::from(pdf == 0.0),
            LightSearch::Both => 1.0 / (1.0 + pdf / walk_pdf),
        }
    }
}
