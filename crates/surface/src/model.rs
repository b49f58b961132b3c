//! What a renderer asks of a surface.

use glam::{Vec2, Vec3};
use organza_basis::{PathRng, Rgb};

/// The piece of cloth that a ray sees.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Middle of it in the fabric plane, mm: x along the weft, y along the warp.
    pub position_mm: Vec2,
    /// Its diameter, mm; infinite for the mean over the whole cloth.
    pub width_mm: f32,
}

impl Footprint {
    /// The whole cloth.
    pub const FAR: Footprint = Footprint {
        position_mm: Vec2::ZERO,
        width_mm: f32::INFINITY,
    };

    /// A point.
    pub fn point(position_mm: Vec2) -> Footprint {
        Footprint {
            position_mm,
            width_mm: 0.0,
        }
    }
}

/// A direction that light may have come from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceSample {
    /// Unit direction away from the cloth.
    pub w_i: Vec3,
    /// Value times `|cos theta_i|` over the density: what the path's
    /// throughput is multiplied by.
    pub weight: Rgb,
    /// Density, 1/sr; infinite for light that went straight through a gap.
    pub pdf: f32,
}

impl SurfaceSample {
    /// True for light that passed between the yarns unscattered. No other
    /// strategy can find it.
    pub fn is_straight(&self) -> bool {
        self.pdf.is_infinite()
    }
}

/// A two-sided scattering surface in the fabric frame.
///
/// Directions are unit vectors that point away from the cloth; z is its face.
/// Values are radiance out over irradiance on the fabric plane, 1/sr, without a
/// cosine, and symmetric in the two directions. Every method returns finite,
/// non-negative numbers for any unit directions.
pub trait SurfaceModel: Sync {
    /// Scattered light, gaps left out.
    fn eval(&self, w_i: Vec3, w_o: Vec3, at: Footprint) -> Rgb;

    /// Draws a direction for light that leaves along `w_o`; `None` when the
    /// draw carries nothing.
    fn sample(&self, w_o: Vec3, at: Footprint, rng: &mut PathRng) -> Option<SurfaceSample>;

    /// Density with which [`sample`](Self::sample) draws a scattered `w_i`,
    /// 1/sr. It integrates to one less the gap and the draws that carry nothing.
    fn pdf(&self, w_i: Vec3, w_o: Vec3, at: Footprint) -> f32;

    /// Share of a ray along `w` that meets no yarn.
    fn gap(&self, w: Vec3) -> f32;
}
