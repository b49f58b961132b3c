//! Local visibility of a yarn's fibres [Schroeder2011].
//!
//! Inside a voxel the fibre that a camera sees is also lit from about the
//! camera's side, which fibres strewn at random do not know. The bidirectional
//! visibility distribution function V(w_in, w_out) is the part of the points
//! seen from w_out that the light from w_in reaches without being blocked within
//! the cell around them. Multiply the direct light of the *first* event by it,
//! and start that shadow ray's own collisions outside the cell; later events do
//! without.
//!
//! The table is counted from explicit fibres of the yarn, in cells of twice the
//! leaf size, by whoever can trace them: see [`BvdfBuilder::add`].

use crate::cone_table::node;
use crate::error::{Error, in_range};
use glam::Vec3;
use std::f32::consts::TAU;

/// Most values that a table may have: 64 MiB of single precision.
const MAX_VALUES: usize = 1 << 24;

/// Layout of the two directions: equal areas of the sphere in the yarn's frame
/// (x along the yarn, z out of the cloth), cosines from -1 to 1 about x, azimuths
/// about it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Layout {
    cosines: usize,
    azimuths: usize,
}

impl Layout {
    fn directions(&self) -> usize {
        self.cosines * self.azimuths
    }

    /// The cell of a unit direction, as continuous coordinates in cells.
    fn coordinates(&self, w: Vec3) -> (f32, f32) {
        let turn = (w.z.atan2(w.y) / TAU).rem_euclid(1.0);
        let cosine = (0.5 + 0.5 * w.x).clamp(0.0, 1.0);
        (cosine * self.cosines as f32, turn * self.azimuths as f32)
    }

    fn cell(&self, w: Vec3) -> usize {
        let (c, a) = self.coordinates(w);
        let c = (c as usize).min(self.cosines - 1);
        c * self.azimuths + (a as usize).min(self.azimuths - 1)
    }

    /// The four cells around a direction with their weights.
    fn around(&self, w: Vec3) -> [(usize, f32); 4] {
        let (c, a) = self.coordinates(w);
        let last = (self.cosines - 1) as f32;
        // Between cell centres; nothing lies beyond the outer ones.
        let (c0, ct) = node(((c - 0.5) / last).clamp(0.0, 1.0), self.cosines);
        let a = a - 0.5;
        let at = a - a.floor();
        let a0 = (a.floor() as isize).rem_euclid(self.azimuths as isize) as usize;
        let a1 = (a0 + 1) % self.azimuths;
        let row = |c: usize| c.min(self.cosines - 1) * self.azimuths;
        [
            (row(c0) + a0, (1.0 - ct) * (1.0 - at)),
            (row(c0) + a1, (1.0 - ct) * at),
            (row(c0 + 1) + a0, ct * (1.0 - at)),
            (row(c0 + 1) + a1, ct * at),
        ]
    }
}

/// Counts of a table in the making.
#[derive(Clone, Debug)]
pub struct BvdfBuilder {
    layout: Layout,
    /// Per pair of cells: how many pairs were lit, and how many there were.
    counts: Vec<(u32, u32)>,
}

impl BvdfBuilder {
    /// A table of `cosines x azimuths` directions for each of light and view; the
    /// published one has `32 x 64` of one and `64 x 64` of the other, far more
    /// than its smooth values need.
    pub fn new(cosines: usize, azimuths: usize) -> Result<BvdfBuilder, Error> {
        let expected = "2 to 64, and no more than 4096 directions in all";
        in_range("cosines", cosines as f32, [2.0, 64.0], expected)?;
        in_range("azimuths", azimuths as f32, [2.0, 64.0], expected)?;
        let layout = Layout { cosines, azimuths };
        let values = layout.directions() * layout.directions();
        in_range(
            "directions",
            values as f32,
            [1.0, MAX_VALUES as f32],
            expected,
        )?;
        Ok(BvdfBuilder {
            layout,
            counts: vec![(0, 0); values],
        })
    }

    /// Counts a fibre point seen from `w_out`: is it `lit` from `w_in`, as far as
    /// its cell goes? Unit directions away from the point, in the yarn's frame.
    pub fn add(&mut self, w_in: Vec3, w_out: Vec3, lit: bool) {
        let (i, o) = (self.layout.cell(w_in), self.layout.cell(w_out));
        let count = &mut self.counts[o * self.layout.directions() + i];
        count.0 += u32::from(lit);
        count.1 += 1;
    }

    /// The table. Pairs never seen take the mean of all that were, or one when
    /// there were none.
    pub fn build(self) -> Bvdf {
        let (lit, all) = self.counts.iter().fold((0u64, 0u64), |s, c| {
            (s.0 + u64::from(c.0), s.1 + u64::from(c.1))
        });
        let mean = if all > 0 {
            lit as f32 / all as f32
        } else {
            1.0
        };
        let visibility = self
            .counts
            .iter()
            .map(|&(lit, all)| {
                if all > 0 {
                    lit as f32 / all as f32
                } else {
                    mean
                }
            })
            .collect();
        Bvdf {
            layout: self.layout,
            visibility,
        }
    }
}

/// A table of local visibility.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvdf {
    layout: Layout,
    visibility: Vec<f32>,
}

impl Bvdf {
    /// Visibility in `[0, 1]` of light from `w_in` at points seen from `w_out`,
    /// interpolated; unit directions in the yarn's frame.
    pub fn at(&self, w_in: Vec3, w_out: Vec3) -> f32 {
        let inner = self.layout.around(w_in);
        self.layout
            .around(w_out)
            .iter()
            .map(|&(o, weight)| {
                let row = &self.visibility[o * self.layout.directions()..];
                weight * inner.iter().map(|&(i, w)| w * row[i]).sum::<f32>()
            })
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::proofs::hard_directions;
    use organza_basis::{PathRng, warp};

    /// A cylinder that hides what faces away from the camera's side: planted,
    /// then read back.
    #[test]
    fn planted_visibility_is_read_back() {
        let mut builder = BvdfBuilder::new(8, 16).unwrap();
        let mut rng = PathRng::from_seed(71);
        let planted = |w_in: Vec3, w_out: Vec3| 0.5 + 0.4 * w_in.dot(w_out);
        for _ in 0..2_000_000 {
            let a = warp::uniform_sphere(rng.unit2());
            let b = warp::uniform_sphere(rng.unit2());
            builder.add(a, b, rng.unit() < planted(a, b));
        }
        let table = builder.build();
        let mut squared = 0.0;
        for _ in 0..2000 {
            let a = warp::uniform_sphere(rng.unit2());
            let b = warp::uniform_sphere(rng.unit2());
            squared += (table.at(a, b) - planted(a, b)).powi(2) / 2000.0;
        }
        // Counting noise of 122 draws a cell, thinned by interpolation: 0.03.
        assert!(squared.sqrt() < 0.04, "seed 71: {}", squared.sqrt());
    }

    #[test]
    fn tables_are_bounded_everywhere() {
        let mut builder = BvdfBuilder::new(2, 2).unwrap();
        assert_eq!(builder.clone().build().at(Vec3::X, Vec3::Y), 1.0);
        for w in hard_directions(Vec3::Z) {
            builder.add(w, -w, false);
            builder.add(w, w, true);
        }
        let table = builder.build();
        for a in hard_directions(Vec3::X) {
            for b in hard_directions(Vec3::Y) {
                let v = table.at(a, b);
                assert!((0.0..=1.0 + 1e-6).contains(&v), "{a} {b}: {v}");
            }
        }
        assert!(BvdfBuilder::new(1, 16).is_err() && BvdfBuilder::new(64, 65).is_err());
    }
}
