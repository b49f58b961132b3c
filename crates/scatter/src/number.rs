//! Numbers of formulas that are written once for one path and for many.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number, or one number in each lane of a vector. The kernel implements it for its
/// lanes.
pub trait Number:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// A constant, the same in all lanes.
    fn constant(x: f32) -> Self;

    /// `self * factor + term`, rounded once or twice.
    fn times_plus(self, factor: Self, term: Self) -> Self;

    /// The number without its sign.
    fn magnitude(self) -> Self;

    /// The square root.
    fn square_root(self) -> Self;

    /// `self` where `test` is negative, otherwise `other`.
    fn where_negative(self, test: Self, other: Self) -> Self;
}

impl Number for f32 {
    #[inline(always)]
    fn constant(x: f32) -> f32 {
        x
    }

    /// Rounded twice: not every processor fuses a product with a sum.
    #[inline(always)]
    fn times_plus(self, factor: f32, term: f32) -> f32 {
        self * factor + term
    }

    #[inline(always)]
    fn magnitude(self) -> f32 {
        self.abs()
    }

    #[inline(always)]
    fn square_root(self) -> f32 {
        self.sqrt()
    }

    #[inline(always)]
    fn where_negative(self, test: f32, other: f32) -> f32 {
        if test < 0.0 { self } else { other }
    }
}
