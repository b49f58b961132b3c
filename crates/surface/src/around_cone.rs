//! A density over the angle around a cone of light that a fibre mirrors.

use crate::cone::{Cone, Vector};
use crate::phase::CircularPhase;
use crate::real::Real;
use std::f32::consts::FRAC_1_SQRT_2;

/// Sectors around a cone, of 15 degrees each.
const SECTORS: usize = 12;

/// Sines of their bounds, and sines and cosines of their middles.
const BOUNDS: [f32; SECTORS + 1] = [
    -1.0,
    -0.965_925_8,
    -0.866_025_4,
    -FRAC_1_SQRT_2,
    -0.5,
    -0.258_819_05,
    0.0,
    0.258_819_05,
    0.5,
    FRAC_1_SQRT_2,
    0.866_025_4,
    0.965_925_8,
    1.0,
];
const SINES: [f32; SECTORS] = [
    -0.991_444_9,
    -0.923_879_5,
    -0.793_353_3,
    -0.608_761_4,
    -0.382_683_4,
    -0.130_526_2,
    0.130_526_2,
    0.382_683_4,
    0.608_761_4,
    0.793_353_3,
    0.923_879_5,
    0.991_444_9,
];
const COSINES: [f32; SECTORS] = [
    0.130_526_2,
    0.382_683_4,
    0.608_761_4,
    0.793_353_3,
    0.923_879_5,
    0.991_444_9,
    0.991_444_9,
    0.923_879_5,
    0.793_353_3,
    0.608_761_4,
    0.382_683_4,
    0.130_526_2,
];

/// Share of the draws that is even in the sine, whatever the sectors send.
pub(crate) const EVEN_SHARE: f32 = 0.1;

/// A sector whose middle is below the horizon or close to it counts as this high: part of it
/// may be above.
const MIN_HEIGHT: f32 = 0.05;

/// Least light of a sector, far below any that matters: shares need a sum above zero.
const MIN_LIGHT: f32 = 1e-20;

/// A density over the sine of the angle around a cone, constant in each sector.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AroundCone {
    /// Density in each sector.
    densities: [f32; SECTORS],
}

impl AroundCone {
    /// Even in the sine.
    pub const EVEN: AroundCone = AroundCone {
        densities: [0.5; SECTORS],
    };

    /// Follows the light that arrives within a cone with the phase function; gives its
    /// integral over the sine, without the cone's strength and the cosine of `w_out`, too.
    #[inline]
    pub fn new(cone: &Cone, w_out: Vector, phase: &CircularPhase<f32>) -> (AroundCone, f32) {
        // Components are linear in the sine and the cosine: a loop without branches.
        let [along, up, beside] = [cone.fibre, cone.normal, cone.side].map(|v| (v.z, v.dot(w_out)));
        let middle = (cone.sin_theta * along.0, cone.sin_theta * along.1);
        let by_cos = (cone.radius * up.0, cone.radius * up.1);
        let by_sin = (cone.radius * beside.0, cone.radius * beside.1);
        let mut densities = [0.0; SECTORS];
        for k in 0..SECTORS {
            let (sin, cos) = (SINES[k], COSINES[k]);
            let height = middle.0 + by_cos.0 * cos + by_sin.0 * sin;
            let cos_io = middle.1 + by_cos.1 * cos + by_sin.1 * sin;
            let facing = cone.cos_out + cone.radius * cos;
            densities[k] = phase.eval(cos_io) * height.larger(MIN_HEIGHT) / facing;
        }
        let mut total = 0.0;
        for k in 0..SECTORS {
            densities[k] = densities[k].larger(MIN_LIGHT);
            total += densities[k] * (BOUNDS[k + 1] - BOUNDS[k]);
        }
        let scale = (1.0 - EVEN_SHARE) / total;
        for density in &mut densities {
            *density = *density * scale + 0.5 * EVEN_SHARE;
        }
        (AroundCone { densities }, total)
    }

    /// Sine and cosine of the angle for an even number in `[0, 1)`.
    #[inline]
    pub fn draw(&self, even: f32) -> (f32, f32) {
        let mut left = even;
        let mut k = 0;
        loop {
            let share = self.densities[k] * (BOUNDS[k + 1] - BOUNDS[k]);
            if left < share || k + 1 == SECTORS {
                break;
            }
            left -= share;
            k += 1;
        }
        let sin = (BOUNDS[k] + left / self.densities[k]).smaller(BOUNDS[k + 1]);
        (sin, (1.0 - sin * sin).larger(0.0).sqrt())
    }

    /// Density of a sine.
    #[inline]
    pub fn density(&self, sin: f32) -> f32 {
        let above = BOUNDS[1..SECTORS].iter().filter(|&&bound| sin >= bound);
        self.densities[above.count()]
    }
}
