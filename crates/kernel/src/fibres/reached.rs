//! Which cells a piece of fibre reaches.

use super::cells::LEAD;
use super::copies::Ends;
use super::grid::Grid;
use glam::{DVec3, IVec3};

/// Calls `found` with every cell of the first period that a piece reaches, and
/// the periods by which the piece is moved to get there. Some are named that it
/// misses by little; none is left out.
pub fn for_each_cell(grid: &Grid, ends: &Ends, found: &mut impl FnMut(u32, [i16; 2])) {
    let cell_mm = grid.cell_mm();
    let half = 0.5 * cell_mm;
    // Rounding, and the overlap of neighbours.
    let margin = 2.0 * f64::from(LEAD) * cell_mm.min_element();
    let radius = ends.radius() + margin;
    let u = ends.axis;
    let [before, after] = ends.mitre;
    let (a, b) = (ends.a - before * u, ends.b + after * u);
    // How far the surface goes beside the axis; balls go as far everywhere.
    let aside = if ends.is_plain {
        radius * (DVec3::ONE - u * u).max(DVec3::ZERO).map(f64::sqrt) + DVec3::splat(margin)
    } else {
        DVec3::splat(radius)
    };
    let main = u.abs().max_position();
    let layer = |x: f64| (x / cell_mm[main]).floor() as i32;
    let first = layer(a[main].min(b[main]) - aside[main]);
    let last = layer(a[main].max(b[main]) + aside[main]);
    for i in first..=last {
        let Some(i_in) = inside(grid, main, i) else {
            continue;
        };
        // The part of the axis whose surface may lie in this layer.
        let from = f64::from(i) * cell_mm[main] - aside[main];
        let to = f64::from(i + 1) * cell_mm[main] + aside[main];
        let (mut p, mut q) = (a, b);
        if u[main] != 0.0 && ends.length > 0.0 {
            let at = |x: f64| ((x - a[main]) / u[main]).clamp(0.0, (b - a).length());
            (p, q) = (a + at(from) * u, a + at(to) * u);
        }
        let low = (p.min(q) - aside) / cell_mm;
        let high = (p.max(q) + aside) / cell_mm;
        let (y_axis, z_axis) = ((main + 1) % 3, (main + 2) % 3);
        for j in low[y_axis].floor() as i32..=high[y_axis].floor() as i32 {
            let Some(j_in) = inside(grid, y_axis, j) else {
                continue;
            };
            for k in low[z_axis].floor() as i32..=high[z_axis].floor() as i32 {
                let Some(k_in) = inside(grid, z_axis, k) else {
                    continue;
                };
                let mut cell = IVec3::ZERO;
                (cell[main], cell[y_axis], cell[z_axis]) = (i, j, k);
                let centre = (cell.as_dvec3() + 0.5) * cell_mm;
                if is_beside(centre - a, u, radius, half) {
                    continue;
                }
                let mut within = IVec3::ZERO;
                (within[main], within[y_axis], within[z_axis]) = (i_in.0, j_in.0, k_in.0);
                let mut shift = [0; 3];
                (shift[main], shift[y_axis], shift[z_axis]) = (i_in.1, j_in.1, k_in.1);
                found(grid.index(within) as u32, [shift[0], shift[1]]);
            }
        }
    }
}

/// A cell's number along an axis within the first period, and the periods by
/// which what is there moves; `None` beyond the faces.
fn inside(grid: &Grid, axis: usize, i: i32) -> Option<(i32, i16)> {
    let count = grid.dims[axis];
    if (0..count).contains(&i) {
        return Some((i, 0));
    }
    if !grid.repeats || axis == 2 {
        return None;
    }
    let shift = i16::try_from(-i.div_euclid(count)).ok()?;
    Some((i.rem_euclid(count), shift))
}

/// True when a box whose centre lies `w` from a point of a line is surely farther
/// from the line than a radius: the direction between them separates them.
fn is_beside(w: DVec3, u: DVec3, radius: f64, half: DVec3) -> bool {
    let across = w - u * w.dot(u);
    let square = across.length_squared();
    let rest = square - half.dot(across.abs());
    rest > 0.0 && rest * rest > radius * radius * square
}
