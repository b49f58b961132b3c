//! How light and view shade an even cloth over a photograph.

use crate::Photograph;
use glam::DVec2;
use nalgebra::{SMatrix, SVector};

/// Degree of the polynomial, and its terms.
const DEGREE: usize = 4;
const TERMS: usize = (DEGREE + 1) * (DEGREE + 2) / 2;
/// Least brightness, as a share of the middle.
const LEAST: f64 = 0.05;

/// How bright each channel of an even cloth is at a place, as a share of the middle: a polynomial of fourth
/// degree. Lamps and cameras nearby make it other than one, for they light and see places from other
/// directions. Places are those of [`Photograph::place`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shading {
    channels: [SVector<f64, TERMS>; 3],
}

/// Products of powers of x and y, one first.
fn terms(at: DVec2) -> SVector<f64, TERMS> {
    let mut terms = SVector::<f64, TERMS>::zeros();
    let powers = |v: f64| std::array::from_fn::<f64, { DEGREE + 1 }, _>(|k| v.powi(k as i32));
    let (xs, ys) = (powers(at.x), powers(at.y));
    let exponents = (0..=DEGREE).flat_map(|n| (0..=n).map(move |k| (n - k, k)));
    for (term, (i, j)) in terms.iter_mut().zip(exponents) {
        *term = xs[i] * ys[j];
    }
    terms
}

impl Default for Shading {
    /// That of distant lamps and cameras: none.
    fn default() -> Shading {
        Shading {
            channels: [terms(DVec2::ZERO); 3],
        }
    }
}

impl Shading {
    /// How bright the channels are at a place.
    pub fn at(&self, place: DVec2) -> [f64; 3] {
        let terms = terms(place);
        self.channels.map(|c| c.dot(&terms).max(LEAST))
    }

    /// A photograph without it.
    pub fn removed(&self, photograph: &Photograph) -> Photograph {
        photograph.scaled(|x, y| self.at(photograph.place(x, y)).map(|v| 1.0 / v))
    }

    /// The mean of several; none is no shading.
    pub fn mean(list: &[Shading]) -> Shading {
        if list.is_empty() {
            return Shading::default();
        }
        let n = list.len() as f64;
        let sum = |c: usize| {
            list.iter()
                .map(|s| s.channels[c])
                .sum::<SVector<f64, TERMS>>()
        };
        Shading {
            channels: std::array::from_fn(|c| sum(c) / n),
        }
    }
}

/// Finds the shading that explains colours at places with the least squares.
#[derive(Clone, Debug)]
pub struct ShadingSums {
    normal: SMatrix<f64, TERMS, TERMS>,
    right: [SVector<f64, TERMS>; 3],
}

impl Default for ShadingSums {
    fn default() -> ShadingSums {
        ShadingSums {
            normal: SMatrix::zeros(),
            right: [SVector::zeros(); 3],
        }
    }
}

impl ShadingSums {
    /// Adds the colour of a place.
    pub fn add(&mut self, place: DVec2, colour: [f64; 3]) {
        let terms = terms(place);
        self.normal += terms * terms.transpose();
        for (sum, value) in self.right.iter_mut().zip(colour) {
            *sum += terms * value;
        }
    }

    /// The shading of all colours; a channel that is dark in the middle has none.
    pub fn shading(&self) -> Shading {
        let factors = self.normal.lu();
        let none = Shading::default();
        let channel = |c: usize| {
            let found = factors.solve(&self.right[c]);
            let found = found.filter(|f| f[0] > 0.0 && f.iter().all(|v| v.is_finite()));
            found.map_or(none.channels[c], |f| f / f[0])
        };
        Shading {
            channels: std::array::from_fn(channel),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A planted shading comes back from a picture with threads, and its photograph is even without
    /// it; the twin, the photograph with its shading, is not.
    #[test]
    fn planted_shading_comes_back() {
        let planted = |at: DVec2| {
            let slope = 0.3 * at.x - 0.2 * at.y;
            [
                1.0 + slope,
                1.0 + 0.5 * slope * at.x,
                1.0 - 0.4 * at.length_squared(),
            ]
        };
        let rows: Vec<[f32; 3]> = (0..240 * 180)
            .map(|i| {
                let (x, y) = (i % 240, 179 - i / 240);
                let at =
                    DVec2::new(x as f64 - 119.5, y as f64 - 89.5) / (0.5 * 240f64.hypot(180.0));
                let threads = 1.0 + 0.5 * (x as f64 * 0.9).sin() * (y as f64 * 0.7).cos();
                planted(at).map(|v| (0.4 * threads * v) as f32)
            })
            .collect();
        let photograph = Photograph::new(240, 180, &rows).unwrap();
        let mut sums = ShadingSums::default();
        for y in 0..180 {
            for x in 0..240 {
                sums.add(photograph.place(x, y), photograph.pixel(x, y));
            }
        }
        let found = sums.shading();
        let corner = photograph.place(239, 179);
        for (c, (a, b)) in found
            .at(corner)
            .into_iter()
            .zip(planted(corner))
            .enumerate()
        {
            // Threads do not divide the picture evenly: 0.2 % of its mean, and more in the corners.
            assert!((a / b - 1.0).abs() < 0.01, "channel {c}: {a} {b}");
        }
        let even = found.removed(&photograph);
        let mean = |p: &Photograph, x0: usize, c: usize| -> f64 {
            let places = (0..180).flat_map(|y| (x0..x0 + 60).map(move |x| (x, y)));
            places.map(|(x, y)| p.pixel(x, y)[c]).sum::<f64>()
        };
        for c in 0..3 {
            let ratio = mean(&even, 0, c) / mean(&even, 180, c);
            assert!((ratio - 1.0).abs() < 0.01, "channel {c}: {ratio}");
        }
        let ratio = mean(&photograph, 0, 0) / mean(&photograph, 180, 0);
        assert!((ratio - 1.0).abs() > 0.2, "{ratio}");
    }
}
