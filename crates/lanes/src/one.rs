//! One lane: of the kernel, with fused products, and plain `f32`.

use crate::lanes::{Floats, Ints, Mask};

impl Mask for bool {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
    #[inline(always)]
    fn from_bits(bits: u32) -> bool {
        bits & 1 != 0
    }
}

/// One number of the kernel, which rounds as vectors do.
#[derive(Clone, Copy)]
pub struct F(pub f32);

/// Operators of a wrapper.
macro_rules! operators {
    ($type:ident: $($trait:ident $name:ident = $operation:expr;)*) => {$(
        impl std::ops::$trait for $type {
            type Output = $type;
            #[inline(always)]
            fn $name(self, o: $type) -> $type {
                $type($operation(self.0, o.0))
            }
        }
    )*};
}

operators!(F:
    Add add = |a, b| a + b;
    Sub sub = |a, b| a - b;
    Mul mul = |a, b| a * b;
    Div div = |a, b| a / b;
);

impl std::ops::Neg for F {
    type Output = F;
    #[inline(always)]
    fn neg(self) -> F {
        F(-self.0)
    }
}

/// A lane: its number, its whole number, how to make and to read a number, and its fused product.
macro_rules! one_lane {
    ($f:ty, $u:ident, $doc:literal, $new:expr, $get:expr, $mul_add:expr) => {
        #[doc = $doc]
        #[derive(Clone, Copy)]
        pub struct $u(pub u32);

        operators!($u:
            Add add = u32::wrapping_add;
            Sub sub = u32::wrapping_sub;
            Mul mul = u32::wrapping_mul;
            BitAnd bitand = |a, b| a & b;
            BitOr bitor = |a, b| a | b;
            BitXor bitxor = |a, b| a ^ b;
        );

        impl Ints for $u {
            type Floats = $f;
            type Mask = bool;
            #[inline(always)]
            fn splat(x: u32) -> $u {
                $u(x)
            }
            #[inline(always)]
            fn load(x: &[u32]) -> $u {
                $u(x[0])
            }
            #[inline(always)]
            fn store(self, x: &mut [u32]) {
                x[0] = self.0;
            }
            #[inline(always)]
            fn shl<const BITS: u32>(self) -> $u {
                $u(self.0 << BITS)
            }
            #[inline(always)]
            fn shr<const BITS: u32>(self) -> $u {
                $u(self.0 >> BITS)
            }
            #[inline(always)]
            fn to_floats(self) -> $f {
                $new(self.0 as i32 as f32)
            }
            #[inline(always)]
            fn as_floats(self) -> $f {
                $new(f32::from_bits(self.0))
            }
            #[inline(always)]
            fn equals(self, o: $u) -> bool {
                self.0 == o.0
            }
            #[inline(always)]
            fn or_where_not(self, mask: bool, o: $u) -> $u {
                if mask { self } else { o }
            }
            #[inline(always)]
            fn gather(self, table: &[u32]) -> $u {
                let last = table.len().saturating_sub(1);
                $u(table.get((self.0 as usize).min(last)).copied().unwrap_or(0))
            }
        }

        impl Floats for $f {
            type Ints = $u;
            type Mask = bool;
            const LANES: usize = 1;
            #[inline(always)]
            fn splat(x: f32) -> $f {
                $new(x)
            }
            #[inline(always)]
            fn load(x: &[f32]) -> $f {
                $new(x[0])
            }
            #[inline(always)]
            fn store(self, x: &mut [f32]) {
                x[0] = $get(self);
            }
            #[inline(always)]
            fn mul_add(self, b: $f, c: $f) -> $f {
                $new($mul_add($get(self), $get(b), $get(c)))
            }
            #[inline(always)]
            fn sqrt(self) -> $f {
                $new(f32::sqrt($get(self)))
            }
            #[inline(always)]
            fn min(self, o: $f) -> $f {
                if $get(self) < $get(o) { self } else { o }
            }
            #[inline(always)]
            fn max(self, o: $f) -> $f {
                if $get(self) > $get(o) { self } else { o }
            }
            #[inline(always)]
            fn floor(self) -> $f {
                $new(f32::floor($get(self)))
            }
            #[inline(always)]
            fn abs(self) -> $f {
                $new(f32::abs($get(self)))
            }
            #[inline(always)]
            fn below(self, o: $f) -> bool {
                $get(self) < $get(o)
            }
            #[inline(always)]
            fn to_ints(self) -> $u {
                $u($get(self) as i32 as u32)
            }
            #[inline(always)]
            fn as_ints(self) -> $u {
                $u($get(self).to_bits())
            }
            #[inline(always)]
            fn or_where_not(self, mask: bool, o: $f) -> $f {
                if mask { self } else { o }
            }
        }
    };
}

one_lane!(
    F,
    U,
    "One whole number of the kernel.",
    F,
    (|x: F| x.0),
    f32::mul_add
);
one_lane!(
    f32,
    Word,
    "One whole number beside `f32`.",
    (|x: f32| x),
    (|x: f32| x),
    (|a: f32, b: f32, c: f32| a * b + c)
);
