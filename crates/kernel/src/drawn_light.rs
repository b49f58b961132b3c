//! Directions toward a light, drawn for one lane after the other by the light itself.

use glam::Vec3;
use organza_lanes::math::{LaneRng, V3, path_rngs};
use organza_lanes::{Floats, MAX_LANES, Mask, SetBits};
use organza_light::Light;

/// One direction in every lane.
pub struct DrawnLight<F: Floats> {
    /// Unit.
    pub toward: V3<F>,
    /// Radiance over density.
    pub irradiance: V3<F>,
    /// Density, 1/sr.
    pub pdf: F,
    /// Where something of the light is seen.
    pub seen: F::Mask,
}

impl<F: Floats> DrawnLight<F> {
    /// Draws from places in the world, for the lanes of a mask.
    pub fn new(
        light: &Light,
        from_mm: impl Fn(usize) -> Vec3,
        rng: &mut LaneRng<F::Ints>,
        mask: F::Mask,
    ) -> DrawnLight<F> {
        let rngs = path_rngs(rng, mask);
        let mut toward = [[0.0; MAX_LANES], [0.0; MAX_LANES], [1.0; MAX_LANES]];
        let mut irradiance = [[1.0; MAX_LANES]; 3];
        let (mut pdf, mut seen) = ([1.0; MAX_LANES], 0);
        for lane in SetBits(mask.bits()) {
            let Some(drawn) = light.sample_toward(from_mm(lane), &mut rngs(lane)) else {
                continue;
            };
            for axis in 0..3 {
                toward[axis][lane] = drawn.w_in[axis];
                irradiance[axis][lane] = drawn.irradiance.0[axis];
            }
            pdf[lane] = drawn.pdf;
            seen |= 1 << lane;
        }
        let vector =
            |[x, y, z]: [[f32; MAX_LANES]; 3]| V3::new(F::load(&x), F::load(&y), F::load(&z));
        DrawnLight {
            toward: vector(toward),
            irradiance: vector(irradiance),
            pdf: F::load(&pdf),
            seen: F::Mask::from_bits(seen),
        }
    }
}
