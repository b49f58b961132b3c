//! Rays across fibres, from their inside to their outline.

use crate::interior;
use crate::noise;
use crate::plane_means::PlaneMeans;
use crate::window::Window;
use glam::{DVec3, IVec3, Vec3};
use organza_basis::{Frame, Sym3};
use std::f32::consts::TAU;

/// Rays in a plane, and in the plane across a fibre.
const RAYS: usize = 12;
const FINAL_RAYS: usize = 32;
/// Longest ray, in voxels.
const LONGEST: f32 = 96.0;
/// Rise after a valley that ends a fibre, as a share of the contrast: of grey values as they are,
/// and of means along the fibre, which hold less noise.
const RISE: f32 = 0.12;
const RISE_OF_MEANS: f32 = 0.05;
/// The same in deviations of the noise: noise alone must not end a ray.
const RISE_DEVIATIONS: f32 = 4.0;
const RISE_DEVIATIONS_OF_MEANS: f32 = 3.0;
/// Distance, in voxels, at which the noise of two filtered values hardly depends on each other.
const INDEPENDENT: f32 = 2.5;
/// Half the length of these means, in radii, and its limits in voxels.
const MEAN_RADII: f32 = 2.5;
const MEAN_VOXELS: (f32, f32) = (2.0, 10.0);
/// Moves to the middle of the outline: the first ones by the lengths of all rays, the others by
/// those below the median, because rays between two neighbours are too long.
const MOVES: usize = 8;
const MOVES_BY_ALL: usize = 3;
/// Greatest grey value that counts as air beyond a free outline, as a share of the difference of
/// threshold and air, to which two deviations of the noise are added.
const BEYOND: f32 = 0.3;
/// Distances beyond the outline where it is looked at, in radii.
const BEYOND_RADII: [f32; 2] = [0.7, 1.0];
/// Rays on either side of a free one that must be free, too: 22 degrees.
const FREE_AROUND: usize = 2;
/// Fewest free rays that a section is taken from.
const LEAST_FREE: usize = 4;
/// A section is round enough where its rays' quartiles differ by at most this share of the
/// median.
const ROUND: f32 = 0.6;

/// One cross-section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FibreSection {
    /// Half the width of the fibre, mm.
    pub radius_mm: f32,
    /// Length that a straight line along the fibre stays inside it, mm; at most twice the
    /// longest ray.
    pub length_mm: f32,
    /// Grey value in the middle.
    pub middle: f32,
    /// Fall of the grey value at the outline, per mm.
    pub slope_per_mm: f32,
    /// Difference of the quartiles of its rays, as a share of their median.
    pub unroundness: f32,
    /// Whether the radius is that of parts of the outline that no other fibre is near to.
    pub is_free: bool,
    /// Covariance of grey values inside that continue along the fibre, see
    /// [`interior::covariance`].
    pub inner_covariance: Option<[f32; interior::TWISTS.len()]>,
}

/// How far a ray goes.
#[derive(Clone, Copy, Debug)]
struct End {
    /// Distance to where the grey value falls below the threshold, or to the valley before a
    /// fibre that touches this one, mm; infinite where there is neither.
    length_mm: f32,
    /// Whether it ends at the threshold.
    is_outline: bool,
}

/// Grey values that rays run through, and the least rise behind a valley.
struct Values<'a> {
    at: &'a dyn Fn(Vec3) -> Option<f32>,
    rise: f32,
}

/// The plane across a fibre, and the rays in it from its middle.
struct Across {
    middle: Vec3,
    plane: Frame,
    /// Half the number of values that are averaged along the fibre.
    half: i32,
    ends: Vec<End>,
}

/// Rays through a window.
pub(crate) struct Rays<'a> {
    window: &'a Window,
    threshold: f32,
    /// Twice the difference of threshold and air.
    contrast: f32,
    /// Deviation of the noise.
    noise: f32,
    /// Distance at which the noise of two values hardly depends on each other, in the least
    /// edges of a voxel.
    noise_reach: f32,
    /// Greatest grey value of air beyond an outline.
    beyond: f32,
    /// Distance by which blur has moved outlines inward, mm.
    shrunk_mm: f32,
    /// Voxels per mm.
    per_mm: Vec3,
    /// Least edge of a voxel.
    voxel_mm: f32,
    step_mm: f32,
    steps: usize,
}

impl<'a> Rays<'a> {
    pub fn new(
        window: &'a Window,
        threshold: f32,
        air: f32,
        voxel_mm: DVec3,
        shrunk_mm: f32,
        noise_reach: f32,
    ) -> Rays<'a> {
        let noise = noise::deviation(window, air);
        let least_mm = voxel_mm.min_element() as f32;
        Rays {
            window,
            threshold,
            contrast: 2.0 * (threshold - air),
            noise,
            noise_reach,
            beyond: air + BEYOND * (threshold - air) + 2.0 * noise,
            shrunk_mm,
            per_mm: (1.0 / voxel_mm).as_vec3(),
            voxel_mm: least_mm,
            step_mm: 0.5 * least_mm,
            steps: (2.0 * LONGEST) as usize,
        }
    }

    /// Makes rays no longer than a length, mm.
    pub fn limit(&mut self, length_mm: f32) {
        let steps = (length_mm / self.step_mm).ceil() as usize;
        self.steps = self.steps.min(steps.max(4));
    }

    /// The end of a ray.
    fn end(&self, from: Vec3, direction: Vec3, values: &Values<'_>) -> End {
        let end = |length_mm, is_outline| End {
            length_mm,
            is_outline,
        };
        let step = direction * self.per_mm * self.step_mm;
        let mut before = match (values.at)(from) {
            Some(v) if v >= self.threshold => v,
            _ => return end(0.0, false),
        };
        let (mut peak, mut valley) = (before, (before, 0));
        for i in 1..self.steps {
            let Some(v) = (values.at)(from + step * i as f32) else {
                break;
            };
            if v < self.threshold {
                let part = (before - self.threshold) / (before - v);
                return end(((i - 1) as f32 + part) * self.step_mm, true);
            }
            // A valley lies below what is before it and after it.
            let rise = v.min(peak) - valley.0;
            if rise > values.rise {
                return end(valley.1 as f32 * self.step_mm, false);
            }
            if v > peak {
                peak = v;
                valley = (v, i);
            } else if v < valley.0 {
                valley = (v, i);
            }
            before = v;
        }
        end(f32::INFINITY, false)
    }

    /// Its length in grey values as they are.
    fn length_mm(&self, from: Vec3, direction: Vec3) -> f32 {
        let values = Values {
            at: &|p| self.window.at(p),
            rise: (RISE * self.contrast).max(RISE_DEVIATIONS * self.noise),
        };
        self.end(from, direction, &values).length_mm
    }

    /// The section at a place inside a fibre; `None` where it is not round or meets the
    /// border of the window.
    pub fn section(&self, place: Vec3, planes: &[Frame]) -> Option<FibreSection> {
        let mut across = self.across(place, self.rough_radius_mm(place, planes)?)?;
        // Again with a radius that does not span neighbours.
        across = self.across(place, median_length(&across.ends))?;
        let median_mm = median_length(&across.ends);
        let mut lengths: Vec<f32> = across.ends.iter().map(|e| e.length_mm).collect();
        lengths.sort_by(f32::total_cmp);
        let quartiles = [0.25, 0.75].map(|share| lengths[(share * FINAL_RAYS as f32) as usize]);
        let unroundness = (quartiles[1] - quartiles[0]) / median_mm;
        if !(median_mm > 0.0 && unroundness <= ROUND) {
            return None;
        }
        let (at, plane) = (across.middle, &across.plane);
        let around: Vec<Vec3> = directions(plane, FINAL_RAYS).collect();
        let grey =
            |k: usize, r: f32| self.mean(at + around[k] * self.per_mm * r, plane, across.half);
        let is_open = |k: usize| {
            let End {
                length_mm,
                is_outline,
            } = across.ends[k];
            let is_air = |radii: f32| {
                let value = grey(k, length_mm + radii * median_mm);
                value.is_some_and(|v| v < self.beyond)
            };
            is_outline && BEYOND_RADII.into_iter().all(is_air)
        };
        let open: Vec<bool> = (0..FINAL_RAYS).map(is_open).collect();
        let is_free = |k: &usize| {
            let first = k + FINAL_RAYS - FREE_AROUND;
            (0..=2 * FREE_AROUND).all(|i| open[(first + i) % FINAL_RAYS])
        };
        let mut rays: Vec<usize> = (0..FINAL_RAYS).filter(is_free).collect();
        let is_free = rays.len() >= LEAST_FREE;
        if !is_free {
            rays = (0..FINAL_RAYS).collect();
        }
        let delta = 0.5 * self.step_mm;
        let fall = |k: &usize| {
            let r = across.ends[*k].length_mm;
            let inner = grey(*k, (r - delta).max(0.0))?;
            Some((inner - grey(*k, r + delta)?) / (2.0 * delta))
        };
        let longest = self.steps as f32 * self.step_mm;
        let along = |d: Vec3| self.length_mm(at, d).min(longest);
        let radius_mm = median(rays.iter().map(|k| across.ends[*k].length_mm));
        let scale = self.per_mm * self.voxel_mm;
        let inner = |p: Vec3| {
            let off = p.x * plane.s + p.y * plane.t + p.z * plane.n;
            self.window.at(at + off * scale)
        };
        Some(FibreSection {
            radius_mm,
            inner_covariance: interior::covariance(
                radius_mm / self.voxel_mm,
                self.noise_reach,
                inner,
            ),
            length_mm: along(plane.n) + along(-plane.n),
            middle: self.mean(at, plane, across.half)?,
            slope_per_mm: median(rays.iter().filter_map(fall)),
            unroundness,
            is_free,
        })
    }

    /// The radius of the least section through a place; `None` where rays meet the border.
    fn rough_radius_mm(&self, place: Vec3, planes: &[Frame]) -> Option<f32> {
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
                let lengths = directions(&best, RAYS).map(|d| self.length_mm(at, d));
                let moved = at + self.shift(&best, &lengths.collect::<Vec<_>>());
                if self.window.at(moved).is_some_and(|v| v >= self.threshold) {
                    at = moved;
                }
            }
        }
        let radius = median(directions(&best, FINAL_RAYS).map(|d| self.length_mm(at, d)));
        radius.is_finite().then_some(radius)
    }

    /// The plane across the fibre at a place, of a radius that is roughly known, and the rays in
    /// it through means along the fibre.
    fn across(&self, place: Vec3, rough_mm: f32) -> Option<Across> {
        if !rough_mm.is_finite() {
            return None;
        }
        let plane = Frame::from_normal(self.axis(place, rough_mm)?);
        let half = MEAN_RADII * rough_mm / self.voxel_mm;
        let half = half.clamp(MEAN_VOXELS.0, MEAN_VOXELS.1).round() as i32;
        let left = INDEPENDENT / (2 * half + 1) as f32;
        let noise = self.noise * left.sqrt().min(1.0);
        let means = PlaneMeans::new(place, &plane, self.per_mm, self.voxel_mm, |p| {
            self.mean(p, &plane, half)
        });
        let mean = |p: Vec3| means.at(p);
        let values = Values {
            at: &mean,
            rise: (RISE_OF_MEANS * self.contrast).max(RISE_DEVIATIONS_OF_MEANS * noise),
        };
        let mut middle = place;
        for i in 0..MOVES {
            let mut lengths: Vec<f32> = directions(&plane, RAYS)
                .map(|d| self.unshrunk_mm(self.end(middle, d, &values)))
                .collect();
            let mut gain = 1.0;
            if i >= MOVES_BY_ALL {
                let most = median(lengths.iter().copied());
                lengths.iter_mut().for_each(|l| *l = l.min(most));
                // Rays on one side only tell the shift.
                gain = 1.5;
            }
            let moved = middle + gain * self.shift(&plane, &lengths);
            if mean(moved).is_some_and(|v| v >= self.threshold) {
                middle = moved;
            }
        }
        let ends = directions(&plane, FINAL_RAYS).map(|d| self.end(middle, d, &values));
        Some(Across {
            middle,
            ends: ends.collect(),
            plane,
            half,
        })
    }

    /// The length of a ray without blur, which moves outlines, but not valleys. Middles between
    /// both would lie too far from the outline.
    fn unshrunk_mm(&self, end: End) -> f32 {
        match end.is_outline {
            true => end.length_mm + self.shrunk_mm,
            false => end.length_mm,
        }
    }

    /// The mean of `2 half + 1` values along the normal of a plane.
    fn mean(&self, at: Vec3, plane: &Frame, half: i32) -> Option<f32> {
        let step = plane.n * self.per_mm * self.voxel_mm;
        let mut sum = 0.0;
        for k in -half..=half {
            sum += self.window.at(at + step * k as f32)?;
        }
        Some(sum / (2 * half + 1) as f32)
    }

    /// The direction in which grey values change least within a radius of a place.
    fn axis(&self, place: Vec3, radius_mm: f32) -> Option<Vec3> {
        let reach = (radius_mm * self.per_mm).clamp(Vec3::splat(2.0), Vec3::splat(8.0));
        let low = (place - reach).ceil().as_ivec3();
        let high = (place + reach).floor().as_ivec3();
        let mut sum = Sym3::from_array([0.0; 6]);
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    let p = IVec3::new(x, y, z);
                    if ((p.as_vec3() - place) / reach).length_squared() > 1.0 {
                        continue;
                    }
                    if let Some(g) = self.gradient(p) {
                        sum = sum.plus(Sym3::outer(g));
                    }
                }
            }
        }
        let trace = sum.trace();
        (trace > 0.0).then(|| sum.scaled(1.0 / trace).eigen()[2].1)
    }

    /// Change of the grey value over two mm along each axis.
    fn gradient(&self, p: IVec3) -> Option<Vec3> {
        let change = |e: IVec3| Some(self.window.voxel(p + e)? - self.window.voxel(p - e)?);
        let g = Vec3::new(change(IVec3::X)?, change(IVec3::Y)?, change(IVec3::Z)?);
        Some(g * self.per_mm)
    }

    /// From a place toward the middle of opposite rays, in voxels.
    fn shift(&self, plane: &Frame, lengths: &[f32]) -> Vec3 {
        let mut shift = Vec3::ZERO;
        let (ahead, behind) = lengths.split_at(RAYS / 2);
        for (d, (a, b)) in directions(plane, RAYS).zip(ahead.iter().zip(behind)) {
            if a.is_finite() && b.is_finite() {
                shift += d * (0.5 * (a - b));
            }
        }
        // Opposite pairs over half a turn: twice their mean is the whole shift.
        shift * (2.0 / (RAYS / 2) as f32) * self.per_mm
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
    pub fn chord_mm(&self, at: Vec3) -> f32 {
        let mut least = f32::INFINITY;
        for i in 14..27 {
            let d = IVec3::new(i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1).as_vec3();
            let d = d.normalize();
            least = least.min(self.length_mm(at, d) + self.length_mm(at, -d));
        }
        least
    }
}

fn median_length(ends: &[End]) -> f32 {
    median(ends.iter().map(|e| e.length_mm))
}

/// The median, of an even number the mean of both middle ones; zero of none.
pub(crate) fn median(values: impl Iterator<Item = f32>) -> f32 {
    let mut sorted: Vec<f32> = values.collect();
    sorted.sort_by(f32::total_cmp);
    match sorted.len() {
        0 => 0.0,
        n => 0.5 * (sorted[(n - 1) / 2] + sorted[n / 2]),
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
