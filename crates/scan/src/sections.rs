//! The radius of fibres, from their cross-sections.
//!
//! At random places inside fibres, rays run to the outline in planes of many directions. The
//! plane of the least section is the one across the fibre. There the place moves to the centre of
//! the outline, and the median length of 32 rays, interpolated below a voxel, is the radius:
//! rays that lead into a fibre that touches this one are fewer than half. No scale has to be
//! known before, so that the scales of the orientation can follow from the radius.
//!
//! Blur lowers the grey value in the middle of a thin fibre and moves its outline. The mean
//! section (value in the middle, slope at the outline, radius at the threshold) is that of a
//! blurred disk, whose true radius, blur and grey value follow from the three.

use crate::window::Window;
use glam::{DVec3, IVec3, Vec3};
use organza_basis::{Frame, PathRng};
use rayon::prelude::*;
use std::f32::consts::{PI, TAU};

/// Places that are looked at in a window.
const PLACES: u32 = 500;
/// Random places of the whole volume that may be tried for each.
const TRIES: u32 = 64;
/// Directions of planes, on a half sphere.
const PLANES: usize = 60;
/// Rays in each of them, and in the best.
const RAYS: usize = 12;
const FINAL_RAYS: usize = 32;
/// Longest ray, in voxels, and in chords of the first look.
const LONGEST: f32 = 96.0;
const LONGEST_CHORDS: f32 = 4.0;
/// Rise after a valley that ends a fibre, as a share of twice the difference of threshold and air.
const RISE: f32 = 0.12;
/// The same in deviations of the noise: noise alone must not end a ray.
const RISE_DEVIATIONS: f32 = 4.0;
/// A section is round enough where its rays' quartiles differ by at most this share of the
/// median.
const ROUND: f32 = 0.6;

/// One cross-section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Section {
    /// Half the width of the fibre, mm.
    pub radius_mm: f32,
    /// Length that a straight line along the fibre stays inside it, mm; at most twice the
    /// longest ray.
    pub length_mm: f32,
    /// Grey value in the middle.
    pub middle: f32,
    /// Fall of the grey value at the outline, per mm.
    pub slope_per_mm: f32,
}

/// Rays through a window.
struct Rays<'a> {
    window: &'a Window,
    threshold: f32,
    /// Rise of the grey value after a valley that ends a fibre.
    rise: f32,
    /// Voxels per mm.
    per_mm: Vec3,
    step_mm: f32,
    steps: usize,
}

impl Rays<'_> {
    /// Distance to where the grey value falls below the threshold, or to the valley before a
    /// fibre that touches this one, mm; infinite where there is neither.
    fn length_mm(&self, from: Vec3, direction: Vec3) -> f32 {
        let step = direction * self.per_mm * self.step_mm;
        let mut before = match self.window.at(from) {
            Some(v) if v >= self.threshold => v,
            _ => return 0.0,
        };
        let (mut peak, mut valley) = (before, (before, 0));
        for i in 1..self.steps {
            let Some(v) = self.window.at(from + step * i as f32) else {
                return f32::INFINITY;
            };
            if v < self.threshold {
                let part = (before - self.threshold) / (before - v);
                return ((i - 1) as f32 + part) * self.step_mm;
            }
            // A valley lies below what is before it and after it.
            let rise = v.min(peak) - valley.0;
            if rise > self.rise {
                return valley.1 as f32 * self.step_mm;
            }
            if v > peak {
                peak = v;
                valley = (v, i);
            } else if v < valley.0 {
                valley = (v, i);
            }
            before = v;
        }
        f32::INFINITY
    }

    /// The section at a place inside a fibre; `None` where it is not round or meets the
    /// border of the window.
    fn section(&self, place: Vec3, planes: &[Frame]) -> Option<Section> {
        // Twice, because a place near the outline may prefer a plane along the fibre.
        let mut at = place;
        let mut best = Frame::from_normal(Vec3::Z);
        for _ in 0..2 {
            let mut least = f32::INFINITY;
            for plane in planes {
                let area = self.sum_of_squares(at, plane, least);
                if area < least {
                    (least, best) = (area, *plane);
                }
            }
            if least == f32::INFINITY {
                return None;
            }
            for _ in 0..3 {
                at = self.centred(at, &best);
            }
        }
        let mut lengths: Vec<f32> = directions(&best, FINAL_RAYS)
            .map(|d| self.length_mm(at, d))
            .collect();
        lengths.sort_by(f32::total_cmp);
        let of = |share: f32| lengths[(share * FINAL_RAYS as f32) as usize];
        // The mean of both middle ones.
        let radius_mm = 0.5 * (lengths[FINAL_RAYS / 2 - 1] + lengths[FINAL_RAYS / 2]);
        let is_round = of(0.75) - of(0.25) <= ROUND * radius_mm;
        let longest = self.steps as f32 * self.step_mm;
        let along = |d: Vec3| self.length_mm(at, d).min(longest);
        let length_mm = along(best.n) + along(-best.n);
        // Where neighbours touch, the outline does not fall.
        let delta = 0.5 * self.step_mm;
        let grey = |d: Vec3, r: f32| self.window.at(at + d * self.per_mm * r);
        let falls = directions(&best, FINAL_RAYS).filter_map(|d| {
            let inner = grey(d, (radius_mm - delta).max(0.0))?;
            Some((inner - grey(d, radius_mm + delta)?) / (2.0 * delta))
        });
        let mut falls: Vec<f32> = falls.collect();
        falls.sort_by(f32::total_cmp);
        let slope_per_mm = *falls.get(falls.len() / 2)?;
        (is_round && radius_mm > 0.0).then_some(Section {
            radius_mm,
            length_mm,
            middle: self.window.at(at)?,
            slope_per_mm,
        })
    }

    /// Sum of the squared lengths of the rays of a plane, or a number that exceeds `limit`.
    fn sum_of_squares(&self, at: Vec3, plane: &Frame, limit: f32) -> f32 {
        let mut sum = 0.0;
        for d in directions(plane, RAYS) {
            sum += self.length_mm(at, d).powi(2);
            if sum > limit {
                break;
            }
        }
        sum
    }

    /// The shortest chord through a place along one of 13 directions.
    fn chord_mm(&self, at: Vec3) -> f32 {
        let mut least = f32::INFINITY;
        for i in 14..27 {
            let d = IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1).as_vec3();
            let d = d.normalize();
            least = least.min(self.length_mm(at, d) + self.length_mm(at, -d));
        }
        least
    }

    /// The place moved toward the middle of opposite rays.
    fn centred(&self, at: Vec3, plane: &Frame) -> Vec3 {
        let mut shift = Vec3::ZERO;
        for d in directions(plane, RAYS).take(RAYS / 2) {
            let (a, b) = (self.length_mm(at, d), self.length_mm(at, -d));
            if a.is_finite() && b.is_finite() {
                shift += d * (0.5 * (a - b));
            }
        }
        // Opposite pairs over half a turn: twice their mean is the whole shift.
        let moved = at + shift * (2.0 / (RAYS / 2) as f32) * self.per_mm;
        match self.window.at(moved) {
            Some(v) if v >= self.threshold => moved,
            _ => at,
        }
    }
}

/// Directions of a plane, evenly around.
fn directions(plane: &Frame, count: usize) -> impl Iterator<Item = Vec3> {
    let (s, t) = (plane.s, plane.t);
    (0..count).map(move |k| {
        let (sin, cos) = (TAU * k as f32 / count as f32).sin_cos();
        cos * s + sin * t
    })
}

/// Frames whose normals cover the half sphere evenly.
fn planes() -> Vec<Frame> {
    let golden = PI * (3.0 - 5f32.sqrt());
    let normal = |k: usize| {
        let z = (k as f32 + 0.5) / PLANES as f32;
        let (sin, cos) = (golden * k as f32).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * cos, r * sin, z)
    };
    (0..PLANES).map(|k| Frame::from_normal(normal(k))).collect()
}

/// Deviation of the noise: grey values below that of air are nothing else.
fn noise(window: &Window, air: f32) -> f32 {
    let (mut sum, mut count) = (0.0f64, 0u64);
    for v in window.data.iter().filter(|v| **v < air) {
        sum += f64::from(v - air).powi(2);
        count += 1;
    }
    (sum / count.max(1) as f64).sqrt() as f32
}

/// Round sections at random places of a window where the grey value exceeds the threshold, and
/// the number of such places that were tried.
pub(crate) fn sections(
    window: &Window,
    threshold: f32,
    air: f32,
    voxel_mm: DVec3,
    seed: u64,
) -> (Vec<Section>, usize) {
    let mut rays = Rays {
        window,
        threshold,
        rise: (RISE * 2.0 * (threshold - air)).max(RISE_DEVIATIONS * noise(window, air)),
        per_mm: (1.0 / voxel_mm).as_vec3(),
        step_mm: 0.5 * voxel_mm.min_element() as f32,
        steps: (2.0 * LONGEST) as usize,
    };
    let planes = planes();
    let size = Vec3::new(
        (window.nx - 1) as f32,
        (window.ny - 1) as f32,
        (window.count() - 1) as f32,
    );
    let places: Vec<Vec3> = (0..PLACES)
        .into_par_iter()
        .filter_map(|i| {
            let mut rng = PathRng::new(seed, 0, u64::from(i));
            (0..TRIES).find_map(|_| {
                let u = Vec3::new(rng.unit(), rng.unit(), rng.unit());
                let p = u * size + Vec3::Z * window.first as f32;
                window.at(p).filter(|v| *v >= threshold).map(|_| p)
            })
        })
        .collect();
    let mut chords: Vec<f32> = places.par_iter().map(|p| rays.chord_mm(*p)).collect();
    chords.sort_by(f32::total_cmp);
    if let Some(chord) = chords.get(chords.len() / 2).filter(|c| c.is_finite()) {
        let steps = (LONGEST_CHORDS * chord / rays.step_mm).ceil() as usize;
        rays.steps = rays.steps.min(steps.max(4));
    }
    let found = places.par_iter().map(|p| rays.section(*p, &planes));
    let found: Vec<Option<Section>> = found.collect();
    (found.into_iter().flatten().collect(), places.len())
}

/// What the mean section says of fibres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Fibre {
    pub radius_mm: f32,
    /// Grey value of a voxel full of fibre.
    pub grey: f32,
    /// Deviation of the blur, mm, with that of the noise filter.
    pub blur_mm: f32,
}

/// Least share of the grey value that blur may leave in the middle of a fibre.
const LEAST_MIDDLE: f32 = 0.5;

/// The fibre whose blurred disk is the mean section: of a radius at the threshold, grey values
/// of air, threshold and middle, and the slope at the outline. A given grey value of fibre stays.
pub(crate) fn unblurred(section: &Section, air: f32, threshold: f32, grey: Option<f32>) -> Fibre {
    let mut fibre = Fibre {
        radius_mm: section.radius_mm,
        grey: grey.unwrap_or(section.middle),
        blur_mm: 0.0,
    };
    // Each equation determines one of the three, and changes the others little.
    for _ in 0..12 {
        let contrast = (fibre.grey - air).max(f32::MIN_POSITIVE);
        let slope = section.slope_per_mm.max(0.0) / contrast;
        let delta = 0.02 * fibre.radius_mm;
        let falls = |blur: f32| {
            let at = |r: f32| blurred_disk(r, fibre.radius_mm, blur);
            (at(section.radius_mm - delta) - at(section.radius_mm + delta)) / (2.0 * delta)
        };
        // Slopes fall as blur grows.
        fibre.blur_mm = bisect(0.02 * fibre.radius_mm, 0.8 * fibre.radius_mm, |b| {
            falls(b) > slope
        });
        if grey.is_none() {
            let left = blurred_disk(0.0, fibre.radius_mm, fibre.blur_mm).max(LEAST_MIDDLE);
            fibre.grey = air + (section.middle - air) / left;
        }
        let share = (threshold - air) / (fibre.grey - air).max(f32::MIN_POSITIVE);
        let r = section.radius_mm;
        fibre.radius_mm = bisect(0.5 * r, 1.5 * r, |radius| {
            blurred_disk(r, radius, fibre.blur_mm) < share
        });
    }
    fibre
}

/// Where `is_below` changes from true to false, between two numbers.
fn bisect(mut low: f32, mut high: f32, is_below: impl Fn(f32) -> bool) -> f32 {
    for _ in 0..30 {
        let middle = 0.5 * (low + high);
        if is_below(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Value at a distance from the middle of a disk of value one that is blurred with a Gaussian:
/// strips of the disk, each with its integral across.
fn blurred_disk(distance: f32, radius: f32, blur: f32) -> f32 {
    const STRIPS: usize = 64;
    let scale = 1.0 / (std::f32::consts::SQRT_2 * blur);
    // What the blur takes from beyond each end of a strip.
    let edge = |x: f32| normal_below(x * std::f32::consts::SQRT_2 * scale);
    let width = 2.0 * radius / STRIPS as f32;
    let mut sum = 0.0;
    for k in 0..STRIPS {
        let x = -radius + (k as f32 + 0.5) * width;
        let half = (radius * radius - x * x).max(0.0).sqrt();
        let share = edge(x + 0.5 * width - distance) - edge(x - 0.5 * width - distance);
        sum += share * (2.0 * edge(half) - 1.0);
    }
    sum
}

/// The share of a standard normal distribution below a value, within 1e-7
/// `[AbramowitzStegun1964]`, 26.2.17.
fn normal_below(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.231_641_9 * x.abs());
    let series = t
        * (0.319_381_53
            + t * (-0.356_563_782
                + t * (1.781_477_937 + t * (-1.821_255_978 + t * 1.330_274_429))));
    let tail = (-0.5 * x * x).exp() * series / TAU.sqrt();
    if x < 0.0 { tail } else { 1.0 - tail }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blurred_disk_keeps_its_value_and_gives_its_parameters_back() {
        assert!((normal_below(0.0) - 0.5).abs() < 1e-6);
        assert!((normal_below(1.96) - 0.975).abs() < 1e-4);
        // In the middle of a disk the blur leaves 1 - exp(-r^2 / 2 s^2).
        let middle = blurred_disk(0.0, 2.0, 1.1);
        assert!(
            (middle - (1.0 - (-2.0f32 / 1.21).exp())).abs() < 2e-3,
            "{middle}"
        );
        assert!((blurred_disk(10.0, 10.0, 0.3) - 0.5).abs() < 0.02);
        for (radius, blur) in [(2.0f32, 1.2f32), (3.0, 0.8), (8.0, 0.5)] {
            let (air, grey, threshold) = (60.0, 160.0, 100.0);
            let at = |r: f32| air + (grey - air) * blurred_disk(r, radius, blur);
            let r = bisect(0.1, 2.0 * radius, |r| at(r) > threshold);
            let section = Section {
                radius_mm: r,
                length_mm: 0.0,
                middle: at(0.0),
                slope_per_mm: (at(r - 0.05) - at(r + 0.05)) / 0.1,
            };
            let f = unblurred(&section, air, threshold, None);
            assert!((f.radius_mm / radius - 1.0).abs() < 0.02, "{f:?}");
            assert!((f.blur_mm / blur - 1.0).abs() < 0.1, "{f:?}");
            assert!((f.grey / grey - 1.0).abs() < 0.02, "{f:?}");
        }
    }
}
