//! A lean that neighbouring tufts or loops have in common, as in pile that was washed or crushed.

use crate::spec::PileSpec;
use crate::spline::catmull_rom;
use crate::strand::normal;
use glam::DVec2;
use organza_basis::PathRng;

/// Family of the random numbers.
const RUFFLE: u64 = 15 << 40;
/// Distance over which the lean changes where the fabric does not give it, mm (estimated).
const RUFFLE_MM: f64 = 3.0;
/// The fewest and the most knots along an edge of the tile.
const MIN_KNOTS: f64 = 2.0;
const MAX_KNOTS: f64 = 1024.0;
/// Root mean square of the spline between independent knots of deviation one: 0.9 along each axis.
const SPLINE_RMS: f64 = 0.81;

/// A smooth random lean, periodic in the tile.
pub(super) struct Ruffle {
    size_mm: DVec2,
    counts: [usize; 2],
    /// Tangents of the lean, row by row.
    knots: Vec<DVec2>,
}

impl Ruffle {
    /// The ruffle of a pile, if it has any.
    pub fn new(spec: &PileSpec, size_mm: DVec2, seed: u64) -> Option<Ruffle> {
        let deviation = spec.ruffle_deg?.to_radians().tan() / SPLINE_RMS;
        let knots = size_mm / spec.ruffle_mm.unwrap_or(RUFFLE_MM);
        let counts = knots
            .to_array()
            .map(|n| n.round().clamp(MIN_KNOTS, MAX_KNOTS) as usize);
        let mut rng = PathRng::new(seed, 0, RUFFLE);
        let mut knot =
            || DVec2::from_array([(); 2].map(|()| normal(&mut rng, [0.0, deviation], 1.0)));
        Some(Ruffle {
            size_mm,
            counts,
            knots: (0..counts[0] * counts[1]).map(|_| knot()).collect(),
        })
    }

    /// The tangent of the lean at a place.
    pub fn lean_at(&self, at_mm: DVec2) -> DVec2 {
        let place = at_mm / self.size_mm * DVec2::new(self.counts[0] as f64, self.counts[1] as f64);
        let first = place.floor();
        let share = place - first;
        let around = |axis: usize, offset: i64| {
            (first[axis] as i64 + offset).rem_euclid(self.counts[axis] as i64) as usize
        };
        let rows = [-1, 0, 1, 2].map(|j| {
            let row = around(1, j) * self.counts[0];
            let knots = [-1, 0, 1, 2].map(|i| self.knots[row + around(0, i)]);
            catmull_rom(knots, share.x)
        });
        catmull_rom(rows, share.y)
    }
}
