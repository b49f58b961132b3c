//! The interface of a light for the walk, the kernel and exporters.

use crate::mitsuba::MitsubaLight;
use crate::{Hemisphere, ImageEnvironment, RectangleLight, SpotLight};
use glam::{DVec3, Vec3};
use organza_basis::{PathRng, Ray, Rgb};
use std::fmt::Debug;
use std::ops::Deref;
use std::sync::Arc;

/// How a light with a solid angle is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LightSearch {
    /// By shadow rays and by the walk, combined by the balance heuristic
    /// \[Veach1995].
    #[default]
    Both,
    /// By shadow rays alone, except for what the camera sees directly.
    ShadowRays,
    /// By the walk alone.
    Walk,
}

/// A direction drawn toward a light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Unit direction toward the light.
    pub w_in: Vec3,
    /// Radiance over density; for light from a single direction, the irradiance on
    /// a plane perpendicular to it.
    pub irradiance: Rgb,
    /// Density with which the direction was drawn, 1/sr; infinite for light from a
    /// single direction.
    pub pdf: f32,
}

/// A light as the kernel sees it: those that it draws in lanes, and all others.
#[derive(Clone, Copy, Debug)]
pub enum KernelLight<'a> {
    /// Parallel light.
    Parallel {
        /// Unit direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a plane perpendicular to it.
        irradiance: Rgb,
    },
    /// The same radiance from every direction of a hemisphere or of the sphere.
    Sky {
        /// Radiance.
        radiance: Rgb,
        /// Where it comes from.
        hemisphere: Hemisphere,
    },
    /// A picture of all directions.
    Picture(&'a ImageEnvironment),
    /// A rectangle.
    Panel(&'a RectangleLight),
    /// A spot, or a point that shines all around.
    Spot(&'a SpotLight),
    /// Any other light with a place, whose directions are drawn by
    /// [`LightSource::sample_toward`].
    Placed {
        /// The least and the greatest corner of a box around it, mm.
        bounds_mm: [Vec3; 2],
        /// The greatest radiance.
        radiance: Rgb,
    },
}

impl KernelLight<'_> {
    /// Corners of a box around a light that has a place, mm.
    pub fn bounds_mm(&self) -> Option<[Vec3; 2]> {
        match self {
            KernelLight::Parallel { .. } | KernelLight::Sky { .. } | KernelLight::Picture(_) => {
                None
            }
            KernelLight::Panel(rectangle) => Some(rectangle.bounds_mm()),
            KernelLight::Spot(spot) => Some([spot.position_mm; 2]),
            KernelLight::Placed { bounds_mm, .. } => Some(*bounds_mm),
        }
    }
}

/// A source of light.
///
/// # Contract
/// - A light is found by shadow rays, by the walk, or by both:
///   [`search`](LightSource::search). The two shares add up to one for every
///   direction.
/// - **`sample_toward`** draws for a shadow ray: `None` where none is sent, or
///   nothing of the light is seen. Densities are per steradian at the event.
/// - **`distance_along`** is where a ray ends on the light, mm: infinite for light
///   from infinity, `None` for a miss. A shadow ray is traced that far. A light
///   without an area gives the distance to its nearest point and a radiance of
///   zero, so that a walk that passes it counts nothing.
/// - **`radiance_toward`** is the radiance along a direction of sight that ends on
///   the light; black for lights without a solid angle.
pub trait LightSource: Debug + Send + Sync {
    /// Radiance along a direction of sight that ends on the light.
    fn radiance_toward(&self, direction: Vec3) -> Rgb;

    /// How it is found.
    fn search(&self) -> LightSearch;

    /// Draws a direction toward the light from a point.
    fn sample_toward(&self, from_mm: Vec3, rng: &mut PathRng) -> Option<LightSample>;

    /// Density with which `sample_toward` draws `w_in`, 1/sr; infinite for light
    /// from a single direction.
    fn pdf_toward(&self, from_mm: Vec3, w_in: Vec3) -> f32;

    /// Distance at which a ray ends on the light, mm.
    fn distance_along(&self, _: &Ray) -> Option<f64> {
        Some(f64::INFINITY)
    }

    /// Distance from a far origin to a light that can be seen at a place, mm.
    fn distance_mm(&self, _origin_mm: DVec3, _direction: DVec3) -> Option<f64> {
        None
    }

    /// Share of the light along a drawn direction that the shadow ray counts;
    /// `walk_pdf` is the density with which the walk would draw it, evaluated only
    /// where it matters.
    fn shadow_share(&self, drawn: &LightSample, walk_pdf: &dyn Fn() -> f32) -> f32 {
        match self.search() {
            LightSearch::Both => 1.0 / (1.0 + walk_pdf() / drawn.pdf),
            LightSearch::ShadowRays | LightSearch::Walk => 1.0,
        }
    }

    /// Share of the light that a walk counts which ends on it: the rest of
    /// [`shadow_share`](LightSource::shadow_share). The walk drew `w_in` with
    /// `walk_pdf` at an event at `from_mm`.
    fn walk_share(&self, from_mm: Vec3, w_in: Vec3, walk_pdf: f32) -> f32 {
        match self.search() {
            LightSearch::Walk => 1.0,
            // Beyond the reach of shadow rays (light that leaves a fibre
            // beside where it came in), the walk counts all.
            LightSearch::ShadowRays => f32::from(self.pdf_toward(from_mm, w_in) == 0.0),
            LightSearch::Both => 1.0 / (1.0 + self.pdf_toward(from_mm, w_in) / walk_pdf),
        }
    }

    /// What it is for the kernel.
    fn for_kernel(&self) -> KernelLight<'_>;

    /// The same light for Mitsuba 3; `index` is its place among the scene's lights.
    ///
    /// # Errors
    /// Why Mitsuba has no counterpart.
    fn for_mitsuba(&self, index: usize) -> Result<MitsubaLight, String>;
}

/// Any source of light.
#[derive(Clone, Debug)]
pub struct Light(Arc<dyn LightSource>);

impl<S: LightSource + 'static> From<S> for Light {
    fn from(source: S) -> Light {
        Light(Arc::new(source))
    }
}

impl Deref for Light {
    type Target = dyn LightSource;

    fn deref(&self) -> &(dyn LightSource + 'static) {
        &*self.0
    }
}
