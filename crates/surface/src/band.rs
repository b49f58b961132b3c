//! The band of constant width as which a highlight is drawn.

use crate::real::Real;

/// Relates angles to the places of a rectangle at which their highlights lie. The two are
/// proportional (equation 8.2), and each highlight is drawn over a share of the rectangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Band<T> {
    /// Angle per distance from the middle, 1/mm.
    pub per_mm: T,
    /// Half the width of the band, mm.
    reach_mm: T,
    /// Position of the middle of the last band that fits, mm.
    edge_mm: T,
    limit: T,
}

impl<T: Real> Band<T> {
    /// For a rectangle of length `size_mm` that holds angles in
    /// `[-limit, limit]`.
    pub fn new(size_mm: f64, share: f64, limit: f64) -> Self {
        Band {
            per_mm: T::of(2.0 * limit / size_mm),
            reach_mm: T::of(0.5 * share * size_mm),
            edge_mm: T::of(0.5 * size_mm * (1.0 - share)),
            limit: T::of(limit),
        }
    }

    /// The angle that lies at a place.
    #[inline(always)]
    pub fn angle(&self, x_mm: T) -> T {
        self.per_mm * x_mm
    }

    /// The angles whose band covers a place. A band keeps its width at the edges: angles beyond
    /// the last place where a band fits are drawn at that place.
    #[inline(always)]
    pub fn angles(&self, x_mm: T) -> (T, T) {
        let (low, high) = (x_mm - self.reach_mm, x_mm + self.reach_mm);
        (
            if low < -self.edge_mm {
                -self.limit
            } else {
                low * self.per_mm
            },
            if high > self.edge_mm {
                self.limit
            } else {
                high * self.per_mm
            },
        )
    }
}
