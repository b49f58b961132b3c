//! Where the faces of a cloth lie.

use super::{Cloth, CurveLevel};
use glam::{Vec2, Vec3};
use organza_basis::{Segment, SegmentSource};

/// Most cells of the map of heights along an edge.
const MAX_HEIGHTS: usize = 2048;

/// Where the lowest and the highest yarn lies, by place.
#[derive(Clone, Debug)]
pub(super) struct Heights {
    corner_mm: Vec2,
    cell_mm: Vec2,
    counts: [usize; 2],
    low_high_mm: Vec<[f32; 2]>,
    repeats: bool,
}

impl Heights {
    pub fn of(cloth: &Cloth) -> Heights {
        let tile = cloth.tile;
        let period = tile.period_mm();
        let yarns = cloth.curves(CurveLevel::Yarn);
        let mut thinnest = f32::INFINITY;
        let each = |visit: &mut dyn FnMut(&Segment)| {
            for batch in 0..yarns.batch_count() {
                yarns.for_each_in_batch(batch, visit);
            }
        };
        each(&mut |s| thinnest = thinnest.min(s.start_radius_mm.max(1e-6)));
        let counts = [period.x, period.y].map(|mm| {
            let cells = (4.0 * mm / thinnest).ceil();
            (cells as usize).clamp(1, MAX_HEIGHTS)
        });
        let cell_mm = period / Vec2::new(counts[0] as f32, counts[1] as f32);
        let mut heights = Heights {
            corner_mm: tile.bounds_mm.min.truncate(),
            cell_mm,
            counts,
            low_high_mm: vec![[f32::INFINITY, f32::NEG_INFINITY]; counts[0] * counts[1]],
            repeats: tile.repeats,
        };
        each(&mut |s| {
            let half = cloth.half_size(s.yarn) * s.start_radius_mm.max(s.end_radius_mm);
            let steps = (2.0 * s.length_mm() / cell_mm.min_element()).ceil();
            let steps = steps.clamp(1.0, 4096.0) as usize;
            for i in 0..=steps {
                heights.raise(s.start_mm.lerp(s.end_mm, i as f32 / steps as f32), half);
            }
        });
        heights
    }

    /// Takes a round spot of a yarn into account.
    fn raise(&mut self, centre_mm: Vec3, half_mm: Vec2) {
        let reach = (half_mm.x / self.cell_mm).ceil().min(Vec2::splat(64.0));
        let middle = ((centre_mm.truncate() - self.corner_mm) / self.cell_mm).floor();
        let [rx, ry] = [reach.x as i64, reach.y as i64];
        for dy in -ry..=ry {
            for dx in -rx..=rx {
                let steps = Vec2::new(dx as f32, dy as f32);
                let aside = (steps * self.cell_mm).length() / half_mm.x;
                if aside > 1.0 {
                    continue;
                }
                if let Some(cell) = self.cell(middle + steps) {
                    let half = half_mm.y * (1.0 - aside * aside).sqrt();
                    let [low, high] = &mut self.low_high_mm[cell];
                    *low = low.min(centre_mm.z - half);
                    *high = high.max(centre_mm.z + half);
                }
            }
        }
    }

    fn cell(&self, cell: Vec2) -> Option<usize> {
        let [x, y] = [cell.x as i64, cell.y as i64];
        let [nx, ny] = self.counts.map(|n| n as i64);
        let inside = (0..nx).contains(&x) && (0..ny).contains(&y);
        if !inside && !self.repeats {
            return None;
        }
        Some((y.rem_euclid(ny) * nx + x.rem_euclid(nx)) as usize)
    }

    /// Lowest and highest place of yarns; all of space where there are none.
    pub fn at(&self, place_mm: Vec2) -> [f32; 2] {
        let cell = ((place_mm - self.corner_mm) / self.cell_mm).floor();
        let found = self.cell(cell).map(|cell| self.low_high_mm[cell]);
        match found {
            Some([low, high]) if low <= high => [low, high],
            // What hangs in a gap is reached from both faces.
            _ => [f32::INFINITY, f32::NEG_INFINITY],
        }
    }

    pub fn thickness_mm(&self) -> f32 {
        let low = self.low_high_mm.iter().map(|h| h[0]);
        let high = self.low_high_mm.iter().map(|h| h[1]);
        let thickness = high.fold(f32::NEG_INFINITY, f32::max) - low.fold(f32::INFINITY, f32::min);
        if thickness.is_finite() {
            thickness
        } else {
            0.0
        }
    }

    /// The height that a share of all places of the cloth lie below, on its face or on its back:
    /// zero is the middle of the cloth, and one its outermost place.
    pub fn outer_mm(&self, is_back: bool, share: f32) -> f32 {
        let filled = self.low_high_mm.iter().filter(|[low, high]| low <= high);
        let mut outer: Vec<f32> = filled
            .map(|[low, high]| if is_back { -low } else { *high })
            .collect();
        let at = (share * outer.len() as f32) as usize;
        let at = at.min(outer.len().saturating_sub(1));
        match outer.is_empty() {
            true => 0.0,
            false => *outer.select_nth_unstable_by(at, f32::total_cmp).1,
        }
    }
}

impl Cloth {
    /// Half the width and half the height of a thread over the radius of its segments.
    fn half_size(&self, thread: u32) -> Vec2 {
        let Some(thread) = self.threads.get(thread as usize) else {
            // A tuft.
            return Vec2::ONE;
        };
        let flatten = thread.section.flatten;
        let ratio = (flatten.x / flatten.y).sqrt() as f32;
        Vec2::new(ratio, 1.0 / ratio)
    }
}
