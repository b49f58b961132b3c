//! Exact clipping of a straight line to the cells of a unit grid.

use glam::{DVec3, IVec3};

/// Calls `visit(cell, t0, t1)` for every cell of the unit grid that the line
/// from `a` to `b` passes, in order, with the interval of `t` in `[0, 1]`
/// inside it. The intervals join without gap, so their lengths sum to one.
///
/// It steps from the cell of `a` to the cell of `b` in a number of steps known beforehand, so
/// that it ends whatever rounding does. Coordinates must be finite and fit an `i32`.
pub fn for_each_clip(a: DVec3, b: DVec3, mut visit: impl FnMut(IVec3, f64, f64)) {
    let mut cell = a.floor().as_ivec3();
    let end = b.floor().as_ivec3();
    let per_t = 1.0 / (b - a);
    let mut left = (end - cell).abs();
    let step = (end - cell).signum();
    // Distance to the far face of the present cell, per axis. Axes without
    // steps left never come first.
    let crossing = |cell: IVec3, axis: usize, left: i32| -> f64 {
        if left == 0 {
            return f64::INFINITY;
        }
        let face = cell[axis] + i32::from(step[axis] > 0);
        (f64::from(face) - a[axis]) * per_t[axis]
    };
    let mut next = [0, 1, 2].map(|axis| crossing(cell, axis, left[axis]));
    let mut t = 0.0;
    for _ in 0..left.element_sum() {
        let axis = if next[0] <= next[1] && next[0] <= next[2] {
            0
        } else if next[1] <= next[2] {
            1
        } else {
            2
        };
        let face = next[axis].clamp(t, 1.0);
        visit(cell, t, face);
        t = face;
        cell[axis] += step[axis];
        left[axis] -= 1;
        next[axis] = crossing(cell, axis, left[axis]);
    }
    visit(cell, t, 1.0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    #[test]
    fn clips_join_and_lie_in_their_cells() {
        let mut rng = PathRng::from_seed(2);
        for _ in 0..20_000 {
            let mut corner = || {
                // Half of the coordinates on faces, some far away.
                let u = DVec3::new(rng.unit().into(), rng.unit().into(), rng.unit().into());
                let v = 12.0 * u - 6.0;
                match rng.below(3) {
                    0 => v.round(),
                    1 => v,
                    _ => DVec3::new(v.x.round(), v.y + 100.0, v.z),
                }
            };
            let (a, b) = (corner(), corner());
            let mut at = 0.0;
            for_each_clip(a, b, |cell, t0, t1| {
                assert_eq!(t0, at, "seed 2");
                assert!(t1 >= t0, "seed 2");
                at = t1;
                let middle = a + 0.5 * (t0 + t1) * (b - a) - cell.as_dvec3();
                let slack = 1e-9;
                let (low, high) = (DVec3::splat(-slack), DVec3::splat(1.0 + slack));
                let is_inside = middle.cmpge(low).all() && middle.cmple(high).all();
                assert!(is_inside, "seed 2: {a} {b} {cell} {middle}");
            });
            assert_eq!(at, 1.0, "seed 2");
        }
    }
}
