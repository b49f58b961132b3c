//! Lanes: one number for each of the paths that are walked side by side.
//!
//! Every operation is one that IEEE 754 rounds in one way only (no reciprocal estimates,
//! products fused with sums exactly where the source has it), so a lane computes the same
//! bits whatever vector it is part of. Only plain `f32` rounds products before it adds to
//! them: processors without fused products would need a function call for each.

use std::ops::{Add, BitAnd, BitOr, BitXor, Div, Mul, Neg, Not, Sub};

/// Most lanes of any back end.
pub const MAX_LANES: usize = 32;

/// A truth value in every lane.
pub trait Mask: Copy + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// Bit i is lane i.
    fn bits(self) -> u32;
    /// The lanes whose bits are set.
    fn from_bits(bits: u32) -> Self;
    /// True when some lane is.
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

/// Numbers of the bits that are set.
pub struct SetBits(pub u32);

impl Iterator for SetBits {
    type Item = usize;
    #[inline(always)]
    fn next(&mut self) -> Option<usize> {
        let lane = self.0.trailing_zeros();
        self.0 &= self.0.wrapping_sub(1);
        (lane < 32).then_some(lane as usize)
    }
}

/// A whole number of 32 bits in every lane, arithmetic modulo 2^32.
pub trait Ints:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + BitAnd<Output = Self>
    + BitOr<Output = Self>
    + BitXor<Output = Self>
{
    /// Numbers of the same lanes.
    type Floats: Floats<Ints = Self, Mask = Self::Mask>;
    /// Truth values of the same lanes.
    type Mask: Mask;
    /// The same in all lanes.
    fn splat(x: u32) -> Self;
    /// From the front of `x`, which must be long enough.
    fn load(x: &[u32]) -> Self;
    /// To the front of `x`.
    fn store(self, x: &mut [u32]);
    /// Shifted left.
    fn shl<const BITS: u32>(self) -> Self;
    /// Shifted right, zeros coming in.
    fn shr<const BITS: u32>(self) -> Self;
    /// The number, which must be below 2^31.
    fn to_floats(self) -> Self::Floats;
    /// The number with these bits.
    fn as_floats(self) -> Self::Floats;
    /// Equality.
    fn equals(self, o: Self) -> Self::Mask;
    /// `self` where `mask`, else `o`.
    fn or_where_not(self, mask: Self::Mask, o: Self) -> Self;
    /// `table[self]`, the last entry beyond the end, zero of an empty table. It must have fewer
    /// than 2^31 entries.
    fn gather(self, table: &[u32]) -> Self;
}

/// An `f32` in every lane.
pub trait Floats:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Whole numbers of the same lanes.
    type Ints: Ints<Floats = Self, Mask = Self::Mask>;
    /// Truth values of the same lanes.
    type Mask: Mask;
    /// Number of lanes.
    const LANES: usize;
    /// The same in all lanes.
    fn splat(x: f32) -> Self;
    /// From the front of `x`.
    fn load(x: &[f32]) -> Self;
    /// To the front of `x`.
    fn store(self, x: &mut [f32]);
    /// `self * b + c`, rounded once; twice of plain `f32`.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// The lesser, `o` when either is NaN.
    fn min(self, o: Self) -> Self;
    /// The greater, `o` when either is NaN.
    fn max(self, o: Self) -> Self;
    /// The greatest whole number not above.
    fn floor(self) -> Self;
    /// Without its sign.
    fn abs(self) -> Self;
    /// Less than.
    fn below(self, o: Self) -> Self::Mask;
    /// The whole number toward zero; must fit 31 bits and a sign.
    fn to_ints(self) -> Self::Ints;
    /// The bits.
    fn as_ints(self) -> Self::Ints;
    /// `self` where `mask`, else `o`.
    fn or_where_not(self, mask: Self::Mask, o: Self) -> Self;
}

/// Two vectors side by side: while one waits for memory, the other computes. Only vectors of x86-64
/// are paired.
#[derive(Clone, Copy)]
pub struct Two<T>(T, T);

macro_rules! pairwise {
    ($($trait:ident $name:ident;)*) => {$(
        impl<T: $trait<Output = T>> $trait for Two<T> {
            type Output = Two<T>;
            #[inline(always)]
            fn $name(self, o: Two<T>) -> Two<T> {
                Two(self.0.$name(o.0), self.1.$name(o.1))
            }
        }
    )*};
}
pairwise!(Add add; Sub sub; Mul mul; Div div; BitAnd bitand; BitOr bitor; BitXor bitxor;);

impl<T: Neg<Output = T>> Neg for Two<T> {
    type Output = Two<T>;
    #[inline(always)]
    fn neg(self) -> Two<T> {
        Two(-self.0, -self.1)
    }
}

impl<T: Not<Output = T>> Not for Two<T> {
    type Output = Two<T>;
    #[inline(always)]
    fn not(self) -> Two<T> {
        Two(!self.0, !self.1)
    }
}

/// A mask of one vector of a pair: knows how many lanes that is.
pub trait HalfMask: Mask {
    /// Lanes of the vector.
    const LANES: u32;
}

impl<M: HalfMask> Mask for Two<M> {
    #[inline(always)]
    fn bits(self) -> u32 {
        self.0.bits() | self.1.bits() << M::LANES
    }
    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        Two(M::from_bits(bits), M::from_bits(bits >> M::LANES))
    }
}

impl<U: Ints> Ints for Two<U>
where
    U::Mask: HalfMask,
{
    type Floats = Two<U::Floats>;
    type Mask = Two<U::Mask>;
    #[inline(always)]
    fn splat(x: u32) -> Self {
        Two(U::splat(x), U::splat(x))
    }
    #[inline(always)]
    fn load(x: &[u32]) -> Self {
        Two(U::load(x), U::load(&x[U::Floats::LANES..]))
    }
    #[inline(always)]
    fn store(self, x: &mut [u32]) {
        self.0.store(x);
        self.1.store(&mut x[U::Floats::LANES..]);
    }
    #[inline(always)]
    fn shl<const BITS: u32>(self) -> Self {
        Two(self.0.shl::<BITS>(), self.1.shl::<BITS>())
    }
    #[inline(always)]
    fn shr<const BITS: u32>(self) -> Self {
        Two(self.0.shr::<BITS>(), self.1.shr::<BITS>())
    }
    #[inline(always)]
    fn to_floats(self) -> Self::Floats {
        Two(self.0.to_floats(), self.1.to_floats())
    }
    #[inline(always)]
    fn as_floats(self) -> Self::Floats {
        Two(self.0.as_floats(), self.1.as_floats())
    }
    #[inline(always)]
    fn equals(self, o: Self) -> Self::Mask {
        Two(self.0.equals(o.0), self.1.equals(o.1))
    }
    #[inline(always)]
    fn or_where_not(self, mask: Self::Mask, o: Self) -> Self {
        Two(
            self.0.or_where_not(mask.0, o.0),
            self.1.or_where_not(mask.1, o.1),
        )
    }
    #[inline(always)]
    fn gather(self, table: &[u32]) -> Self {
        Two(self.0.gather(table), self.1.gather(table))
    }
}

impl<F: Floats> Floats for Two<F>
where
    F::Mask: HalfMask,
{
    type Ints = Two<F::Ints>;
    type Mask = Two<F::Mask>;
    const LANES: usize = 2 * F::LANES;
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Two(F::splat(x), F::splat(x))
    }
    #[inline(always)]
    fn load(x: &[f32]) -> Self {
        Two(F::load(x), F::load(&x[F::LANES..]))
    }
    #[inline(always)]
    fn store(self, x: &mut [f32]) {
        self.0.store(x);
        self.1.store(&mut x[F::LANES..]);
    }
    #[inline(always)]
    fn mul_add(self, b: Self, c: Self) -> Self {
        Two(self.0.mul_add(b.0, c.0), self.1.mul_add(b.1, c.1))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Two(self.0.sqrt(), self.1.sqrt())
    }
    #[inline(always)]
    fn min(self, o: Self) -> Self {
        Two(self.0.min(o.0), self.1.min(o.1))
    }
    #[inline(always)]
    fn max(self, o: Self) -> Self {
        Two(self.0.max(o.0), self.1.max(o.1))
    }
    #[inline(always)]
    fn floor(self) -> Self {
        Two(self.0.floor(), self.1.floor())
    }
    #[inline(always)]
    fn abs(self) -> Self {
        Two(self.0.abs(), self.1.abs())
    }
    #[inline(always)]
    fn below(self, o: Self) -> Self::Mask {
        Two(self.0.below(o.0), self.1.below(o.1))
    }
    #[inline(always)]
    fn to_ints(self) -> Self::Ints {
        Two(self.0.to_ints(), self.1.to_ints())
    }
    #[inline(always)]
    fn as_ints(self) -> Self::Ints {
        Two(self.0.as_ints(), self.1.as_ints())
    }
    #[inline(always)]
    fn or_where_not(self, mask: Self::Mask, o: Self) -> Self {
        Two(
            self.0.or_where_not(mask.0, o.0),
            self.1.or_where_not(mask.1, o.1),
        )
    }
}
