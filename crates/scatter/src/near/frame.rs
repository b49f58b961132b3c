//! The frame of a fibre as light meets it, in lanes.

use organza_lanes::Floats;
use organza_lanes::math::{V3, beside, clamp};

/// See [`FibreFrame`](crate::FibreFrame).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame<F> {
    /// Unit tangent.
    pub tangent: V3<F>,
    /// Unit direction of travel across the tangent.
    pub forward: V3<F>,
    /// Unit `tangent x forward`.
    pub side: V3<F>,
    /// Sine of the inclination of `w_out`.
    pub sin_out: F,
    /// Its cosine, not negative.
    pub cos_out: F,
}

impl<F: Floats> Frame<F> {
    /// From a unit tangent and the unit direction back along the walk. A walk along the fibre
    /// has no direction across it and gets any.
    #[inline(always)]
    pub fn new(tangent: V3<F>, w_out: V3<F>) -> Frame<F> {
        let one = F::splat(1.0);
        let cross = w_out.cross(tangent);
        // Rounding has tilted a short product toward the tangent.
        let upright = tangent.scaled_add(-tangent.dot(cross), cross);
        let length = upright.dot(upright).sqrt();
        let is_long = F::splat(1e-7).below(length);
        let side = upright
            .scaled(one / length)
            .or_where_not(is_long, beside(tangent));
        Frame {
            tangent,
            forward: side.cross(tangent),
            side,
            sin_out: clamp(tangent.dot(w_out)),
            cos_out: cross.dot(cross).sqrt().min(one),
        }
    }

    /// Offset in `[-1, 1]` of a ray that meets the fibre's surface at `out` from its axis.
    #[inline(always)]
    pub fn offset(&self, out: V3<F>) -> F {
        // Across the tangent, which at a bend is not that of the cylinder.
        let across = self.tangent.scaled_add(-self.tangent.dot(out), out);
        let height = across.dot(across).sqrt();
        clamp(across.dot(self.side) / height.max(F::splat(1e-20)))
    }

    /// From the axis to the surface of a fibre of unit radius where a ray at an offset meets it.
    #[inline(always)]
    pub fn surface(&self, offset: F) -> V3<F> {
        let one = F::splat(1.0);
        let deep = (one - offset * offset).max(F::splat(0.0)).sqrt();
        self.side.scaled_add(offset, self.forward.scaled(-deep))
    }

    /// `self` where `mask`, else `o`.
    #[inline(always)]
    pub fn or_where_not(self, mask: F::Mask, o: Frame<F>) -> Frame<F> {
        Frame {
            tangent: self.tangent.or_where_not(mask, o.tangent),
            forward: self.forward.or_where_not(mask, o.forward),
            side: self.side.or_where_not(mask, o.side),
            sin_out: self.sin_out.or_where_not(mask, o.sin_out),
            cos_out: self.cos_out.or_where_not(mask, o.cos_out),
        }
    }

    /// The unit vector across the fibre at the angle of a sine and a cosine.
    #[inline(always)]
    pub fn across(&self, [sin, cos]: [F; 2]) -> V3<F> {
        self.side.scaled_add(sin, self.forward.scaled(cos))
    }
}
