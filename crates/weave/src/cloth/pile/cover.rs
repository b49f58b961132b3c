//! How much of a ground its loops hide.

use crate::cloth::{Centreline, Cloth, CurveLevel};
use glam::DVec2;

/// Cells across the radius of a loop's yarn.
const CELLS_PER_RADIUS: f64 = 6.0;
/// Largest width and height of the window in which cells are counted, in radii: it bounds the
/// work, however large the tile is.
const WINDOW_RADII: f64 = 80.0;

/// Share of the cloth that yarns of loops hide from above, each as wide as its yarn and opaque.
/// It is counted in cells of a window of the tile, from the parts of loops above `face_mm`.
pub(in crate::cloth) fn loop_cover(cloth: &Cloth, face_mm: f64) -> f64 {
    let tile_mm = cloth.tile.bounds_mm.size().truncate().as_dvec2();
    let loops = || {
        let threads = cloth.threads.iter();
        threads.filter(|t| matches!(t.line, Centreline::Laid { .. }))
    };
    let radius_mm = loops().map(|t| t.spun.yarn.radius_mm()).fold(0.0, f64::max);
    if radius_mm <= 0.0 {
        return 0.0;
    }
    let window_mm = tile_mm.min(DVec2::splat(WINDOW_RADII * radius_mm));
    let cells = (window_mm * CELLS_PER_RADIUS / radius_mm)
        .ceil()
        .max(DVec2::ONE);
    let cell_mm = window_mm / cells;
    let [columns, rows] = cells.to_array().map(|n| n as usize);
    let mut hidden = vec![false; columns * rows];
    for thread in loops() {
        let path = cloth.path(thread, CurveLevel::Yarn);
        for pair in path.points.windows(2) {
            if pair[0].z.max(pair[1].z) <= face_mm {
                continue;
            }
            let [from, to] = [pair[0], pair[1]].map(|p| p.truncate());
            // Of the images of a piece in neighbouring tiles, those that reach the window.
            let low = ((-to.max(from) - radius_mm) / tile_mm).ceil();
            let high = ((window_mm - to.min(from) + radius_mm) / tile_mm).floor();
            for i in low.x as i64..=high.x as i64 {
                for j in low.y as i64..=high.y as i64 {
                    let shift = tile_mm * DVec2::new(i as f64, j as f64);
                    let (a, b) = (from + shift, to + shift);
                    let first = ((a.min(b) - radius_mm) / cell_mm).floor().max(DVec2::ZERO);
                    let last = ((a.max(b) + radius_mm) / cell_mm).ceil().min(cells);
                    for y in first.y as usize..last.y as usize {
                        for x in first.x as usize..last.x as usize {
                            let at = cell_mm * (DVec2::new(x as f64, y as f64) + 0.5);
                            let along = b - a;
                            let t = (at - a).dot(along) / along.length_squared().max(1e-18);
                            let nearest = a + t.clamp(0.0, 1.0) * along;
                            hidden[y * columns + x] |= at.distance(nearest) <= radius_mm;
                        }
                    }
                }
            }
        }
    }
    hidden.iter().filter(|h| **h).count() as f64 / hidden.len() as f64
}
