//! Linear Rec.709 colour.

use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Sub};

/// Linear Rec.709 red, green and blue; a radiance, a throughput or an albedo.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f32; 3]", into = "[f32; 3]")]
pub struct Rgb(pub Vec3);

impl Rgb {
    /// No light.
    pub const BLACK: Rgb = Rgb(Vec3::ZERO);
    /// One in every channel.
    pub const WHITE: Rgb = Rgb(Vec3::ONE);

    /// From three channels.
    pub const fn new(r: f32, g: f32, b: f32) -> Rgb {
        Rgb(Vec3::new(r, g, b))
    }

    /// The same value in every channel.
    pub const fn splat(v: f32) -> Rgb {
        Rgb(Vec3::splat(v))
    }

    /// Largest channel.
    pub fn max_component(self) -> f32 {
        self.0.max_element()
    }

    /// Mean of the channels.
    pub fn mean(self) -> f32 {
        self.0.element_sum() * (1.0 / 3.0)
    }

    /// Relative luminance, Rec.709 weights.
    pub fn luminance(self) -> f32 {
        self.0.dot(Vec3::new(0.2126, 0.7152, 0.0722))
    }

    /// True when every channel is finite and not negative.
    pub fn is_valid(self) -> bool {
        self.0.is_finite() && self.0.cmpge(Vec3::ZERO).all()
    }

    /// True when every channel is zero.
    pub fn is_black(self) -> bool {
        self.0 == Vec3::ZERO
    }

    /// One 8-bit sRGB channel (IEC 61966-2-1) of a linear value, rounded.
    pub fn srgb8(linear: f32) -> u8 {
        let x = linear.clamp(0.0, 1.0);
        let y = if x <= 0.003_130_8 {
            12.92 * x
        } else {
            1.055 * x.powf(1.0 / 2.4) - 0.055
        };
        (y * 255.0 + 0.5) as u8
    }

    /// The linear value of an encoded sRGB channel in `[0, 1]`.
    pub fn linear_from_srgb(encoded: f32) -> f32 {
        if encoded <= 0.040_45 {
            encoded / 12.92
        } else {
            ((encoded + 0.055) / 1.055).powf(2.4)
        }
    }
}

impl From<[f32; 3]> for Rgb {
    fn from(c: [f32; 3]) -> Rgb {
        Rgb(Vec3::from_array(c))
    }
}
impl From<Rgb> for [f32; 3] {
    fn from(c: Rgb) -> [f32; 3] {
        c.0.to_array()
    }
}
impl Add for Rgb {
    type Output = Rgb;
    fn add(self, o: Rgb) -> Rgb {
        Rgb(self.0 + o.0)
    }
}
impl Sub for Rgb {
    type Output = Rgb;
    fn sub(self, o: Rgb) -> Rgb {
        Rgb(self.0 - o.0)
    }
}
impl AddAssign for Rgb {
    fn add_assign(&mut self, o: Rgb) {
        self.0 += o.0;
    }
}
impl Mul for Rgb {
    type Output = Rgb;
    fn mul(self, o: Rgb) -> Rgb {
        Rgb(self.0 * o.0)
    }
}
impl MulAssign for Rgb {
    fn mul_assign(&mut self, o: Rgb) {
        self.0 *= o.0;
    }
}
impl Mul<f32> for Rgb {
    type Output = Rgb;
    fn mul(self, k: f32) -> Rgb {
        Rgb(self.0 * k)
    }
}
impl Mul<Rgb> for f32 {
    type Output = Rgb;
    fn mul(self, c: Rgb) -> Rgb {
        Rgb(self * c.0)
    }
}
impl MulAssign<f32> for Rgb {
    fn mul_assign(&mut self, k: f32) {
        self.0 *= k;
    }
}
impl Div<f32> for Rgb {
    type Output = Rgb;
    fn div(self, k: f32) -> Rgb {
        Rgb(self.0 / k)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_round_trips_every_byte() {
        for b in 0..=255u8 {
            assert_eq!(Rgb::srgb8(Rgb::linear_from_srgb(f32::from(b) / 255.0)), b);
        }
    }
}
