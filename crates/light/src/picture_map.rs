//! Where directions lie in an equirectangular picture, of one path or of many.

use glam::{UVec2, Vec3};
use organza_lanes::math::{V3, sin_cos_of_turns, turns_of};
use organza_lanes::{Floats, Ints};

/// A picture of all directions, linear between the centres of its pixels.
#[derive(Clone, Copy, Debug)]
pub struct PictureMap {
    /// Columns and rows.
    pub size: UVec2,
    /// Unit vectors: up, toward the picture's middle, and to the left of it.
    pub up: Vec3,
    /// See above.
    pub centre: Vec3,
    /// See above.
    pub left: Vec3,
}

/// The four pixels around a direction.
pub struct Corners<F: Floats> {
    /// Indices in rows from the top: upper left and right, lower left and right.
    pub pixels: [F::Ints; 4],
    shares: [F; 2],
}

impl<F: Floats> Corners<F> {
    /// A value between those of the pixels.
    #[inline(always)]
    pub fn between(&self, [a, b, c, d]: [F; 4]) -> F {
        let [fx, fy] = self.shares;
        let (low, high) = ((b - a).mul_add(fx, a), (d - c).mul_add(fx, c));
        (high - low).mul_add(fy, low)
    }
}

impl PictureMap {
    /// Columns and rows as numbers.
    #[inline(always)]
    fn size<F: Floats>(&self) -> [F; 2] {
        [F::splat(self.size.x as f32), F::splat(self.size.y as f32)]
    }

    /// Where a direction lies in the picture, in pixels from the upper left.
    #[inline(always)]
    pub fn place<F: Floats>(&self, w: V3<F>) -> [F; 2] {
        let (x, y, z) = (
            w.dot(V3::splat(self.centre)),
            w.dot(V3::splat(self.left)),
            w.dot(V3::splat(self.up)),
        );
        let polar = turns_of(x.mul_add(x, y * y).sqrt(), z);
        let [width, height] = self.size::<F>();
        let column = (F::splat(0.5) - turns_of(y, x)) * width;
        [column, (polar + polar) * height]
    }

    /// The pixels around a direction.
    #[inline(always)]
    pub fn corners<F: Floats>(&self, w: V3<F>) -> Corners<F> {
        let (half, zero, one) = (F::splat(0.5), F::splat(0.0), F::splat(1.0));
        let [x, y] = self.place(w);
        let (x, y) = (x - half, y - half);
        let (left, above) = (x.floor(), y.floor());
        let shares = [x - left, y - above];
        let [width, height] = self.size::<F>();
        let (last, bottom) = (width - one, height - one);
        let right = left + one;
        let right = zero.or_where_not(last.below(right), right);
        let left = last.or_where_not(left.below(zero), left);
        let left = left.max(zero).min(last).to_ints();
        let right = right.max(zero).min(last).to_ints();
        let row = F::Ints::splat(self.size.x);
        let below = (above + one).min(bottom).to_ints() * row;
        let above = above.max(zero).min(bottom).to_ints() * row;
        Corners {
            pixels: [above + left, above + right, below + left, below + right],
            shares,
        }
    }

    /// The unit direction of a place in pixels from the upper left, and the sine of the angle
    /// between it and up.
    #[inline(always)]
    pub fn direction<F: Floats>(&self, [x, y]: [F; 2]) -> (V3<F>, F) {
        let half = F::splat(0.5);
        let turns = half - x * F::splat(1.0 / self.size.x as f32);
        let (sin_azimuth, cos_azimuth) = sin_cos_of_turns(turns - turns.floor());
        let (sin, cos) = sin_cos_of_turns(y * F::splat(0.5 / self.size.y as f32));
        let across = V3::splat(self.centre).scaled(sin * cos_azimuth);
        let across = V3::splat(self.left).scaled_add(sin * sin_azimuth, across);
        (V3::splat(self.up).scaled_add(cos, across), sin)
    }
}
