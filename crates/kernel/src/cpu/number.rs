//! Lanes as numbers of the formulas that `scatter` shares with the kernel.

use super::lanes::{Floats, HalfMask, Two, one};
#[cfg(target_arch = "x86_64")]
use super::vector::{avx2, avx512};
use organza_scatter::Number;

macro_rules! number {
    ($lanes:ty $(, of $half:ident: $bound:ident)?) => {
        impl$(<$half: $bound>)? Number for $lanes
        $(where $half::Mask: HalfMask)?
        {
            #[inline(always)]
            fn constant(x: f32) -> Self {
                Self::splat(x)
            }

            /// Rounded once.
            #[inline(always)]
            fn times_plus(self, factor: Self, term: Self) -> Self {
                self.mul_add(factor, term)
            }

            #[inline(always)]
            fn magnitude(self) -> Self {
                self.abs()
            }

            #[inline(always)]
            fn square_root(self) -> Self {
                self.sqrt()
            }

            #[inline(always)]
            fn where_negative(self, test: Self, other: Self) -> Self {
                self.or_where_not(test.below(Self::splat(0.0)), other)
            }
        }
    };
}

number!(one::F);
number!(Two<F>, of F: Floats);
#[cfg(target_arch = "x86_64")]
number!(avx2::F);
#[cfg(target_arch = "x86_64")]
number!(avx512::F);
