//! The openings of a cloth: how far from the yarns a place is.

use crate::strand::Strand;
use glam::{DVec2, DVec3};
use organza_basis::Tile;
use std::ops::RangeInclusive;

/// Distances are known up to so many radii of a yarn; all places beyond are alike.
const FAR: f64 = 1.8;
/// Edge of a cell in radii of the thinnest yarn.
const CELL_RADII: f64 = 0.3;
/// Cells at most, 4 bytes each.
const MAX_CELLS: f64 = (1u64 << 24) as f64;

/// Distances from the centre of the nearest yarn, in radii of its section: below 1 inside of
/// yarns. They lie at the corners of cells, and are linear between.
#[derive(Clone, Debug)]
pub(crate) struct Openings {
    low_mm: DVec3,
    cell_mm: DVec3,
    counts: [usize; 3],
    radii: Vec<f32>,
    /// Heights of the lowest and the highest place of a yarn.
    pub faces_mm: [f64; 2],
}

/// Shows every thread of a cloth to a visitor.
pub(crate) type EachThread<'a> = &'a dyn Fn(&mut dyn FnMut(&Strand));

impl Openings {
    /// Of a cloth that repeats; `for_each` gives its threads.
    pub fn new(tile: Tile, for_each: EachThread<'_>) -> Openings {
        let mut thinnest = f64::INFINITY;
        let mut faces_mm = [f64::INFINITY, f64::NEG_INFINITY];
        for_each(&mut |strand| {
            let half = strand.section.highest() * strand.yarn.radius_mm();
            thinnest = thinnest.min(half);
            for p in &strand.path.points {
                faces_mm = [faces_mm[0].min(p.z - half), faces_mm[1].max(p.z + half)];
            }
        });
        let period = tile.period_mm().as_dvec2();
        let depth = (faces_mm[1] - faces_mm[0]).max(f64::MIN_POSITIVE);
        let size = period.extend(depth);
        let mut wanted = (size / (CELL_RADII * thinnest)).ceil();
        let all = wanted.x * wanted.y * wanted.z;
        wanted = (wanted * (MAX_CELLS / all).min(1.0).cbrt()).max(DVec3::ONE);
        let counts = wanted.to_array().map(|n| n as usize);
        let mut openings = Openings {
            low_mm: tile.bounds_mm.min.truncate().as_dvec2().extend(faces_mm[0]),
            cell_mm: size / DVec3::from(counts.map(|n| n as f64)),
            counts: [counts[0], counts[1], counts[2] + 1],
            radii: vec![FAR as f32; counts[0] * counts[1] * (counts[2] + 1)],
            faces_mm,
        };
        for_each(&mut |strand| openings.fill(strand));
        openings
    }

    /// Takes a thread into account.
    fn fill(&mut self, strand: &Strand) {
        let path = strand.path;
        for k in 0..path.steps() {
            let ends = [k, k + 1].map(|i| path.offset(i as isize, DVec2::ZERO));
            let s = path.arc_mm[k] / path.length_mm();
            let half = strand.scale(s) * strand.yarn.radius_mm() * strand.section.at(s);
            let reach = DVec3::splat(FAR * half.max_element());
            let corner = |at: DVec3| (at - self.low_mm) / self.cell_mm;
            let low = corner(ends[0].min(ends[1]) - reach).ceil();
            let high = corner(ends[0].max(ends[1]) + reach).floor();
            let [nx, ny, nz] = self.counts.map(|n| n as i64);
            let line = ends[1] - ends[0];
            let [xs, ys] = [(low.x, high.x, nx), (low.y, high.y, ny)]
                .map(|(low, high, count)| one_period(low as i64, high as i64, count));
            for z in (low.z as i64).max(0)..=(high.z as i64).min(nz - 1) {
                for y in ys.clone() {
                    for x in xs.clone() {
                        let place = DVec3::new(x as f64, y as f64, z as f64);
                        let from = self.low_mm + place * self.cell_mm - ends[0];
                        let along = from.dot(line) / line.length_squared();
                        // Beyond its ends, other pieces are nearer.
                        if !(-0.5..=1.5).contains(&along) {
                            continue;
                        }
                        let aside = from - along * line;
                        let section =
                            DVec2::new(aside.dot(path.lateral[k]), aside.dot(path.vertical[k]));
                        let radii = (section / half).length() as f32;
                        let [x, y] = [x.rem_euclid(nx), y.rem_euclid(ny)];
                        let cell = &mut self.radii[((z * ny + y) * nx + x) as usize];
                        *cell = cell.min(radii);
                    }
                }
            }
        }
    }

    /// The distance at a place, and its gradient per millimetre.
    pub fn at(&self, at_mm: DVec3) -> (f64, DVec3) {
        let place = (at_mm - self.low_mm) / self.cell_mm;
        let [nx, ny, nz] = self.counts.map(|n| n as i64);
        if place.z < 0.0 || place.z >= (nz - 1) as f64 {
            return (FAR, DVec3::ZERO);
        }
        let first = place.floor();
        let t = place - first;
        let [x, y, z] = first.to_array().map(|v| v as i64);
        let corner = |i: i64, j: i64, k: i64| {
            let [x, y] = [(x + i).rem_euclid(nx), (y + j).rem_euclid(ny)];
            let z = (z + k).min(nz - 1);
            f64::from(self.radii[((z * ny + y) * nx + x) as usize])
        };
        let mut value = 0.0;
        let mut slope = DVec3::ZERO;
        for i in 0..2 {
            for j in 0..2 {
                for k in 0..2 {
                    let side = |n: i64, t: f64| if n == 0 { (1.0 - t, -1.0) } else { (t, 1.0) };
                    let [(a, da), (b, db), (c, dc)] = [side(i, t.x), side(j, t.y), side(k, t.z)];
                    let v = corner(i, j, k);
                    value += a * b * c * v;
                    slope += v * DVec3::new(da * b * c, a * db * c, a * b * dc);
                }
            }
        }
        (value, slope / self.cell_mm)
    }
}

/// The cells from `low` to `high`, or as many in their middle as a period has: what lies farther
/// away are copies of the same cells, to which another copy of the piece is nearer.
fn one_period(low: i64, high: i64, count: i64) -> RangeInclusive<i64> {
    if high - low < count {
        return low..=high;
    }
    let first = low + (high - low + 1 - count) / 2;
    first..=first + count - 1
}

#[cfg(test)]
mod tests {
    use super::one_period;

    #[test]
    fn every_cell_of_a_narrow_tile_is_visited_once() {
        assert_eq!(one_period(-2, 5, 8), -2..=5);
        assert_eq!(one_period(-2, 5, 9), -2..=5);
        assert_eq!(one_period(-2, 5, 4), 0..=3);
        assert_eq!(one_period(-2, 5, 3), 0..=2);
        assert_eq!(one_period(-2, 5, 1), 1..=1);
    }
}
