//! Directions and places of draped cloth, which differ from the world's.

use super::met_fibres::Met;
use super::paths::{Paths, load};
use organza_lanes::Floats;
use organza_lanes::math::V3;
use organza_scatter::near::Frame;

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
            Some([x, y, z]) => V3::new(x.dot(w), y.dot(w), z.dot(w)),
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
        let out_mm = load::<F>(&paths.met.out, first);
        let frame = Frame::new(tangent, self.own(w_out));
        let offset = match &self.axes {
            None => frame.offset(out_mm),
            Some(_) => {
                let way = load::<F>(&paths.met.way, first);
                Frame::new(tangent, way.scaled(F::splat(-1.0))).offset(out_mm)
            }
        };
        Met {
            frame,
            out_mm,
            offset,
        }
    }
}
