//! Directions and places of draped cloth, which differ from the world's.

use super::near_event::Met;
use super::paths::{Paths, load};
use organza_lanes::Floats;
use organza_lanes::math::V3;

/// What the cloths that lanes are in have instead of the world's directions.
pub struct OwnFrame<F: Floats> {
    /// Axes of the cloths in the world; `None` where nothing is draped.
    axes: Option<[V3<F>; 3]>,
}

impl<F: Floats> OwnFrame<F> {
    /// Of the lanes from slot `first` on.
    #[inline(always)]
    pub fn new(paths: &Paths, first: usize, is_draped: bool) -> OwnFrame<F> {
        let all = &paths.met.own_axes;
        let axes = [
            load::<F>(&all[0], first),
            load::<F>(&all[1], first),
            load::<F>(&all[2], first),
        ];
        OwnFrame {
            axes: is_draped.then_some(axes),
        }
    }

    /// A direction of the world in the cloths.
    #[inline(always)]
    pub fn own(&self, w: V3<F>) -> V3<F> {
        match &self.axes {
            None => w,
            Some([x, y, z]) => V3 {
                x: x.dot(w),
                y: y.dot(w),
                z: z.dot(w),
            },
        }
    }

    /// A direction of the cloths in the world.
    #[inline(always)]
    pub fn world(&self, w: V3<F>) -> V3<F> {
        match &self.axes {
            None => w,
            Some([x, y, z]) => x.scaled(w.x) + y.scaled(w.y) + z.scaled(w.z),
        }
    }

    /// What is met, as light along `w_out` of the world finds it. The map of a shell turns
    /// the places along a ray otherwise than directions, so that the offset at which light
    /// meets a fibre is that of the way through the places.
    #[inline(always)]
    pub fn met(&self, paths: &Paths, first: usize, tangent: V3<F>, w_out: V3<F>) -> Met<F> {
        let out = load::<F>(&paths.met.out, first);
        if self.axes.is_none() {
            return Met {
                tangent,
                out_mm: out,
                w_out,
            };
        }
        let w_out = self.own(w_out);
        let way = load::<F>(&paths.met.way, first);
        let (one, zero) = (F::splat(1.0), F::splat(0.0));
        let along = tangent.dot(out);
        let across = tangent.scaled_add(-along, out);
        let height = across.dot(across).sqrt();
        let (beside_way, _) = beside_and_ahead(tangent, way.scaled(-one));
        let (beside, ahead) = beside_and_ahead(tangent, w_out);
        let offset = across.dot(beside_way).max(-height).min(height);
        let depth = (height * height - offset * offset).max(zero).sqrt();
        Met {
            tangent,
            out_mm: beside.scaled(offset) + ahead.scaled(depth) + tangent.scaled(along),
            w_out,
        }
    }
}

/// Unit vectors across a tangent: beside the plane of tangent and `w`, and in it, on the
/// side of `w`.
#[inline(always)]
fn beside_and_ahead<F: Floats>(tangent: V3<F>, w: V3<F>) -> (V3<F>, V3<F>) {
    let cross = w.cross(tangent);
    let square = cross.dot(cross);
    let is_long = F::splat(1e-14).below(square);
    let length = square.max(F::splat(1e-14)).sqrt();
    let any = organza_lanes::math::beside(tangent);
    let beside = cross
        .scaled(F::splat(1.0) / length)
        .or_where_not(is_long, any);
    (beside, tangent.cross(beside))
}
