//! The sums of one pixel before they are added to the film: whole numbers, as there,
//! but of one word each.

use crate::{FirstEvent, Pixel};
use glam::Vec3;

/// Bits of a value after the point, in units of the scene's brightness.
const BITS: i32 = 40;
/// A sample below `2^ROOM` times the brightness goes into the one-word sums.
const ROOM: i32 = 7;
/// Samples that fit for sure: squares have `BITS + 2 ROOM` bits.
const MAX_SAMPLES: u32 = 1 << (63 - BITS - 2 * ROOM);
/// Below this brightness a unit would be less than the film's.
const MIN_EXPONENT: i32 = -24;

/// Sums over samples of one pixel.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tally {
    /// Of the red, green and blue, in units of `2^(exponent - 40)`.
    pub values: [i64; 3],
    /// Of their squares, in units of `2^(2 exponent - 40)`.
    pub squares: [u64; 3],
    /// Of products of components of the axis met first, in units of `2^-30`.
    pub axis: [i64; 6],
    /// Of depths, in units of `2^-32` mm.
    pub depth: u64,
    /// Scattering events.
    pub bounces: u64,
    /// Samples.
    pub count: u32,
    /// Samples that met matter.
    pub hits: u32,
    /// Yarn met first by the first sample that met one, and that sample.
    pub yarn: Option<(u32, u32)>,
}

/// The brightness that samples are counted in.
#[derive(Clone, Copy, Debug)]
pub struct Brightness {
    exponent: i32,
    /// Units in one.
    scale: f32,
    square_scale: f64,
    /// What the one-word sums hold.
    most: f32,
}

impl Brightness {
    /// Of a scene whose brightest light is this.
    pub fn of(light: f32) -> Brightness {
        let exponent = light.max(f32::MIN_POSITIVE).log2().ceil() as i32;
        let exponent = exponent.max(MIN_EXPONENT);
        Brightness {
            exponent,
            scale: 2f32.powi(BITS - exponent),
            square_scale: 2f64.powi(BITS - 2 * exponent),
            most: 2f32.powi(ROOM + exponent),
        }
    }

    /// The unit of values is `2^(exponent - 40)`, that of squares `2^(2 exponent - 40)`.
    pub fn exponent(&self) -> i32 {
        self.exponent
    }

    /// Samples from here on are counted one by one.
    pub fn most(&self) -> f32 {
        self.most
    }

    /// Places by which a sum of values is shifted in units of `2^-bits`.
    pub fn value_shift(&self, bits: i32) -> i32 {
        bits - BITS + self.exponent
    }

    /// Places by which a sum of squares is shifted.
    pub fn square_shift(&self, bits: i32) -> i32 {
        bits - BITS + 2 * self.exponent
    }
}

/// One path that has ended.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Red, green and blue; noise may make them negative.
    pub radiance: [f32; 3],
    /// Scattering events along the path.
    pub bounces: u32,
    /// Its first event, if it met matter.
    pub first: Option<FirstEvent>,
    /// Its number among the samples of the pixel.
    pub index: u32,
}

impl Tally {
    /// Adds a sample; `false` when it is not a number or too bright to count.
    ///
    /// Now and then the sums go to `pixel`; [`Tally::flush`] brings the rest.
    #[inline]
    pub fn add(&mut self, s: &Sample, brightness: &Brightness, pixel: &mut Pixel) -> bool {
        let most = s.radiance.iter().fold(0.0f32, |m, x| m.max(x.abs()));
        let good = s.radiance.iter().all(|x| x.abs() < Pixel::RADIANCE_LIMIT);
        if !good {
            return false;
        }
        if most >= brightness.most {
            // Rare: counted by itself, in larger units.
            let brighter = Brightness::of(most);
            let mut alone = Tally::default();
            alone.add(s, &brighter, pixel);
            pixel.add_tally(&alone, &brighter);
            return true;
        }
        for c in 0..3 {
            let x = s.radiance[c];
            self.values[c] += (x * brightness.scale) as i64;
            let square = f64::from(x) * f64::from(x);
            self.squares[c] += (square * brightness.square_scale) as i64 as u64;
        }
        self.count += 1;
        self.bounces += u64::from(s.bounces);
        if let Some(first) = s.first {
            self.hits += 1;
            self.depth += (first.depth_mm * 4_294_967_296.0) as i64 as u64;
            let t: Vec3 = first.info.axis;
            let whole = |x: f32| (x * 1_073_741_824.0) as i64;
            self.axis[0] += whole(t.x * t.x);
            self.axis[1] += whole(t.y * t.y);
            self.axis[2] += whole(t.z * t.z);
            self.axis[3] += whole(t.x * t.y);
            self.axis[4] += whole(t.x * t.z);
            self.axis[5] += whole(t.y * t.z);
            if self.yarn.is_none() {
                self.yarn = first.info.yarn.map(|y| (y, s.index));
            }
        }
        if self.count == MAX_SAMPLES {
            self.flush(brightness, pixel);
        }
        true
    }

    /// Adds all to the pixel and starts again.
    pub fn flush(&mut self, brightness: &Brightness, pixel: &mut Pixel) {
        if self.count > 0 {
            pixel.add_tally(self, brightness);
            *self = Tally::default();
        }
    }
}
