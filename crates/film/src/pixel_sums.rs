//! The sums of a pixel, and what follows from them: mean, variance, tangent, depth.

use crate::wide_sum::{WideSum, mantissa_and_exponent};
use crate::{Brightness, PathSample, Tally};
use glam::Vec3;
use organza_basis::{Moments, Rgb, Sym3};

/// Unit of sums of radiance: `2^-64`. An `f32` from `2^-40` on is a whole
/// number of them, what is smaller is cut off at `5.4e-20`.
const RADIANCE_BITS: i32 = 64;
/// Unit of sums of squared radiance: `2^-96`.
const SQUARE_BITS: i32 = 96;
/// Unit of sums of depth: `2^-32` mm.
const DEPTH_BITS: i32 = 32;
/// Unit of sums of products of axis components: `2^-30`.
const AXIS_UNIT: f32 = 1.0 / (1u32 << 30) as f32;
/// No sample of the pixel met a yarn.
const NO_SAMPLE: u32 = u32::MAX;

/// Sums of one channel's samples and of their squares.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct ChannelSums {
    values: WideSum<2>,
    squares: WideSum<3>,
}

impl ChannelSums {
    fn add(&mut self, x: f32) {
        let (m, e) = mantissa_and_exponent(x);
        let m = u64::from(m);
        self.values.add_scaled(m, e + RADIANCE_BITS);
        self.squares.add_scaled(m * m, 2 * e + SQUARE_BITS);
    }
}

/// The complete state of a pixel, as whole numbers: adding samples in any order and
/// merging pixels in any grouping gives the same bits. Fewer than `2^32`
/// samples. The vector kernel's samples may be negative, which is noise around
/// a value that is not; sums of radiance have a sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pixel {
    radiance: [ChannelSums; 3],
    /// Sum over samples with an event of the fibre axis met first times its
    /// transpose (an axis has no sign): xx, yy, zz, xy, xz, yz.
    axis: [i64; 6],
    depth: WideSum<2>,
    bounces: u64,
    count: u32,
    hits: u32,
    /// Yarn met first by the sample of lowest index that met one.
    yarn: u32,
    yarn_sample: u32,
}

impl Default for Pixel {
    fn default() -> Pixel {
        Pixel {
            radiance: Default::default(),
            axis: [0; 6],
            depth: WideSum::default(),
            bounces: 0,
            count: 0,
            hits: 0,
            yarn: 0,
            yarn_sample: NO_SAMPLE,
        }
    }
}

impl Pixel {
    /// Words of [`Pixel::to_words`].
    pub const WORDS: usize = 52;

    /// Every channel of a sample is below this; brighter ones are rejected
    /// like infinite ones.
    pub const RADIANCE_LIMIT: f32 = 4_294_967_296.0;

    /// True when a sample can be added.
    pub fn accepts(s: &PathSample) -> bool {
        s.radiance.is_valid() && s.radiance.max_component() < Pixel::RADIANCE_LIMIT
    }

    /// Adds sample `index` of the pixel, which must be
    /// [acceptable](Pixel::accepts).
    pub fn add(&mut self, s: &PathSample, index: u32) {
        for (channel, value) in self.radiance.iter_mut().zip(s.radiance.0.to_array()) {
            channel.add(value);
        }
        self.count += 1;
        self.bounces += u64::from(s.bounces);
        if let Some(first) = s.first {
            for (sum, product) in self
                .axis
                .iter_mut()
                .zip(Sym3::outer(first.info.axis).to_array())
            {
                *sum += (product / AXIS_UNIT) as i64;
            }
            let depth = (first.depth_mm * 2f64.powi(DEPTH_BITS)) as u64;
            self.depth.add_scaled(depth, 0);
            self.hits += 1;
            if let Some(yarn) = first.info.yarn
                && index < self.yarn_sample
            {
                (self.yarn, self.yarn_sample) = (yarn, index);
            }
        }
    }

    /// Adds the samples of a tally.
    pub fn add_tally(&mut self, t: &Tally, brightness: &Brightness) {
        for (channel, (&value, &square)) in self
            .radiance
            .iter_mut()
            .zip(t.values.iter().zip(&t.squares))
        {
            let shift = brightness.value_shift(RADIANCE_BITS);
            channel.values.add_signed(value, shift);
            let shift = brightness.square_shift(SQUARE_BITS);
            channel.squares.add_scaled(square, shift);
        }
        for (sum, &product) in self.axis.iter_mut().zip(&t.axis) {
            *sum += product;
        }
        self.depth.add_scaled(t.depth, 0);
        self.bounces += t.bounces;
        self.count += t.count;
        self.hits += t.hits;
        if let Some((yarn, sample)) = t.yarn
            && sample < self.yarn_sample
        {
            (self.yarn, self.yarn_sample) = (yarn, sample);
        }
    }

    /// Adds all samples of the same pixel of another film. Both together must
    /// have fewer than `2^32`.
    pub fn merge(&mut self, o: &Pixel) {
        for (a, b) in self.radiance.iter_mut().zip(&o.radiance) {
            a.values.merge(&b.values);
            a.squares.merge(&b.squares);
        }
        for (a, b) in self.axis.iter_mut().zip(o.axis) {
            *a = a.wrapping_add(b);
        }
        self.depth.merge(&o.depth);
        self.bounces = self.bounces.wrapping_add(o.bounces);
        self.count = self.count.saturating_add(o.count);
        self.hits = self.hits.saturating_add(o.hits);
        if o.yarn_sample < self.yarn_sample {
            (self.yarn, self.yarn_sample) = (o.yarn, o.yarn_sample);
        }
    }

    /// Samples taken.
    pub fn count(&self) -> u64 {
        u64::from(self.count)
    }

    /// Mean and variance of the samples of a channel.
    ///
    /// The sums are exact and their difference is taken in `f64`, so a
    /// deviation below 3e-8 of the mean, half an `f32` step, is lost.
    pub fn moments(&self, channel: usize) -> Moments {
        let sums = &self.radiance[channel];
        let n = f64::from(self.count.max(1));
        let sum = sums.values.to_f64_signed() * 2f64.powi(-RADIANCE_BITS);
        let squares = sums.squares.to_f64() * 2f64.powi(-SQUARE_BITS);
        Moments {
            count: self.count(),
            mean: sum / n,
            sum_sq_dev: (squares - sum * (sum / n)).max(0.0),
        }
    }

    /// Estimated radiance.
    pub fn mean(&self) -> Rgb {
        Rgb::from([0, 1, 2].map(|c| self.moments(c).mean as f32))
    }

    /// Estimated variance of [`Pixel::mean`], per channel.
    pub fn variance_of_mean(&self) -> Rgb {
        Rgb::from([0, 1, 2].map(|c| variance_of_mean(&self.moments(c)) as f32))
    }

    /// Fraction of samples that met nothing.
    pub fn straight_through(&self) -> f32 {
        if self.count == 0 {
            return 0.0;
        }
        (1.0 - f64::from(self.hits) / f64::from(self.count)) as f32
    }

    /// The main direction of the fibres met first: unit, its largest component
    /// positive; zero where there are none.
    pub fn tangent(&self) -> Vec3 {
        let trace: f64 = self.axis[..3].iter().map(|&s| s as f64).sum();
        if trace <= 0.0 {
            return Vec3::ZERO;
        }
        let tensor = Sym3::from_array(self.axis.map(|s| (s as f64 / trace) as f32));
        let [(_, axis), ..] = tensor.eigen();
        axis * axis[axis.abs().max_position()].signum()
    }

    /// Mean distance of the first events from the camera, if there were any.
    pub fn depth_mm(&self) -> Option<f64> {
        let sum = self.depth.to_f64() * 2f64.powi(-DEPTH_BITS);
        (self.hits > 0).then(|| sum / f64::from(self.hits))
    }

    /// Yarn met first by the first sample that met one.
    pub fn yarn(&self) -> Option<u32> {
        (self.yarn_sample != NO_SAMPLE).then_some(self.yarn)
    }

    /// Mean number of scattering events.
    pub fn mean_bounces(&self) -> f64 {
        self.bounces as f64 / f64::from(self.count.max(1))
    }

    /// The pixel's sums without loss: of red, green and blue each 4 words of
    /// values and 6 of squares, 6 x 2 of the axis, 4 of depth, 2 of bounces,
    /// then samples, hits, yarn and its sample; low words first.
    pub fn to_words(&self) -> [u32; Pixel::WORDS] {
        let mut words = [0; Pixel::WORDS];
        let mut slots = words.iter_mut();
        let mut put = |limb: u64| {
            for (slot, word) in slots
                .by_ref()
                .take(2)
                .zip([limb as u32, (limb >> 32) as u32])
            {
                *slot = word;
            }
        };
        for channel in &self.radiance {
            channel.values.limbs().into_iter().for_each(&mut put);
            channel.squares.limbs().into_iter().for_each(&mut put);
        }
        self.axis.iter().for_each(|&s| put(s as u64));
        self.depth.limbs().into_iter().for_each(&mut put);
        put(self.bounces);
        put(u64::from(self.count) | (u64::from(self.hits) << 32));
        put(u64::from(self.yarn) | (u64::from(self.yarn_sample) << 32));
        words
    }

    /// The pixel of [`Pixel::to_words`].
    pub fn from_words(words: &[u32; Pixel::WORDS]) -> Pixel {
        let mut pairs = words.chunks_exact(2);
        let mut take = || {
            pairs
                .next()
                .map_or(0, |p| u64::from(p[0]) | (u64::from(p[1]) << 32))
        };
        let radiance = std::array::from_fn(|_| ChannelSums {
            values: WideSum::from_limbs(std::array::from_fn(|_| take())),
            squares: WideSum::from_limbs(std::array::from_fn(|_| take())),
        });
        let axis = std::array::from_fn(|_| take() as i64);
        let depth = WideSum::from_limbs(std::array::from_fn(|_| take()));
        let bounces = take();
        let (counts, yarns) = (take(), take());
        Pixel {
            radiance,
            axis,
            depth,
            bounces,
            count: counts as u32,
            hits: (counts >> 32) as u32,
            yarn: yarns as u32,
            yarn_sample: (yarns >> 32) as u32,
        }
    }
}

pub(crate) fn variance_of_mean(m: &Moments) -> f64 {
    m.variance() / m.count.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FirstEvent, SiteInfo};
    use organza_basis::PathRng;

    /// Samples over the whole range of radiance, some without an event.
    fn samples(count: u64) -> Vec<PathSample> {
        let mut rng = PathRng::from_seed(11);
        let mut radiance = || 2f32.powf(60.0 * rng.unit() - 29.0);
        let colours: Vec<Rgb> = (0..count)
            .map(|_| Rgb::new(radiance(), radiance(), radiance()))
            .collect();
        let mut rng = PathRng::from_seed(12);
        let mut event = || FirstEvent {
            info: SiteInfo {
                axis: Vec3::new(rng.unit() - 0.5, 1.0, rng.unit() - 0.5).normalize(),
                yarn: (rng.below(4) == 0).then(|| rng.below(9)),
            },
            depth_mm: 5.0 + f64::from(rng.unit()),
        };
        (0u32..)
            .zip(colours)
            .map(|(i, radiance)| PathSample {
                radiance,
                bounces: i % 7,
                first: (i % 3 != 0).then(&mut event),
                ..PathSample::default()
            })
            .collect()
    }

    fn gather<'a>(samples: impl Iterator<Item = (usize, &'a PathSample)>) -> Pixel {
        let mut pixel = Pixel::default();
        samples.for_each(|(i, s)| pixel.add(s, i as u32));
        pixel
    }

    #[test]
    fn order_and_grouping_leave_no_trace() {
        let samples = samples(500);
        let whole = gather(samples.iter().enumerate());
        assert_eq!(whole, gather(samples.iter().enumerate().rev()));
        for parts in [2, 3, 7, 100] {
            let mut merged = Pixel::default();
            for part in (0..parts).rev() {
                let own = samples
                    .iter()
                    .enumerate()
                    .filter(|(i, _)| i % parts == part);
                merged.merge(&gather(own));
            }
            assert_eq!(whole, merged, "{parts} parts");
        }
        // The known-bad twin: a running mean of the same samples depends on it.
        let values = || samples.iter().map(|s| f64::from(s.radiance.0.x));
        let (forth, back): (Moments, Moments) = (values().collect(), values().rev().collect());
        assert_ne!(forth, back);
    }

    #[test]
    fn words_hold_everything() {
        let pixel = gather(samples(100).iter().enumerate());
        assert_eq!(Pixel::from_words(&pixel.to_words()), pixel);
        let empty = Pixel::default();
        assert_eq!(Pixel::from_words(&empty.to_words()), empty);
    }

    /// Against the running mean and variance of `basis`.
    #[test]
    fn moments_agree_with_a_second_way() {
        let samples = samples(1000);
        let pixel = gather(samples.iter().enumerate());
        let other: Moments = samples.iter().map(|s| f64::from(s.radiance.0.y)).collect();
        let own = pixel.moments(1);
        assert_eq!(own.count, 1000);
        assert!((own.mean / other.mean - 1.0).abs() < 8.0 * f64::EPSILON);
        assert!((own.variance() / other.variance() - 1.0).abs() <= 8.0 * f64::EPSILON);
        assert!(pixel.tangent().y > 0.9 && (pixel.tangent().length() - 1.0).abs() < 1e-5);
        assert!((pixel.depth_mm().unwrap() - 5.5).abs() < 0.05);
        assert!(pixel.yarn().is_some());
    }

    #[test]
    fn a_deviation_of_few_steps_of_f32_is_seen() {
        let mut pixel = Pixel::default();
        let mut other = Moments::default();
        for i in 0..1000u32 {
            let x = 1.0 + (i % 5) as f32 * f32::EPSILON;
            let sample = PathSample {
                radiance: Rgb::splat(x),
                ..PathSample::default()
            };
            pixel.add(&sample, i);
            other.add(f64::from(x));
        }
        let ratio = pixel.moments(0).variance() / other.variance();
        assert!((ratio - 1.0).abs() < 0.05, "{ratio}");
    }

    #[test]
    fn what_cannot_be_added_is_known() {
        let of = |x: f32| {
            Pixel::accepts(&PathSample {
                radiance: Rgb::new(x, 0.0, 1.0),
                ..PathSample::default()
            })
        };
        assert!(of(0.0) && of(4e9) && of(f32::MIN_POSITIVE / 8.0));
        assert!(!of(-1.0) && !of(f32::NAN) && !of(f32::INFINITY) && !of(4.3e9));
    }
}
