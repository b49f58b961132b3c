//! The vector back ends: [`super::lanes`] by AVX2 with FMA, and by AVX-512.
//!
//! # Why this may be unsafe
//! The intrinsics here ask for nothing but the instructions. The types are private to this
//! crate; code over them is entered in one place ([`super::dispatch`]), after asking the
//! processor. Loads and stores take
//! slices and check their length; gathers clamp every index to the table.
#![allow(unsafe_code)]

/// Asks for the memory of an item that will be needed soon; nothing happens when
/// there is none.
#[inline(always)]
pub fn prefetch<T>(items: &[T], index: usize) {
    if let Some(item) = items.get(index) {
        let first = std::ptr::from_ref(item).cast::<i8>();
        for line in 0..size_of::<T>().div_ceil(64) {
            // Within the item, and a hint only.
            unsafe {
                std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T0 }>(
                    first.wrapping_add(64 * line),
                );
            }
        }
    }
}

macro_rules! vector_back_end {
    (
        $module:ident, $doc:literal, $lanes:literal, $f:ident, $u:ident,
        $intrinsics:tt, { $($own:item)* }
    ) => {
        #[doc = $doc]
        pub mod $module {
            use crate::lanes::{Floats, HalfMask, Ints};
            use std::arch::x86_64::*;

            /// Numbers.
            #[derive(Clone, Copy)]
            pub struct F($f);
            /// Whole numbers.
            #[derive(Clone, Copy)]
            pub struct U($u);

            $($own)*

            vector_back_end!(@body $lanes, $intrinsics);
        }
    };
    (@body $lanes:literal, {
        floats: { $($ftrait:ident $fname:ident $fop:ident;)* },
        ints: { $($utrait:ident $uname:ident $uop:ident;)* },
        set_f: $set_f:ident, set_u: $set_u:ident,
        load_f: $load_f:ident, store_f: $store_f:ident,
        load_u: $load_u:ident, store_u: $store_u:ident,
        mul_add: $mul_add:ident, sqrt: $sqrt:ident, min: $min:ident, max: $max:ident,
        floor: $floor:ident, abs: $abs:ident, below: $below:ident, equals: $equals:ident,
        truncate: $truncate:ident, convert: $convert:ident,
        f_as_u: $f_as_u:ident, u_as_f: $u_as_f:ident,
        shl: $shl:ident, shr: $shr:ident, umin: $umin:ident, gather: $gather:ident,
        select_f: $select_f:ident, select_u: $select_u:ident,
        mask: $mask:ty,
    }) => {
        $(impl std::ops::$ftrait for F {
            type Output = F;
            #[inline(always)]
            fn $fname(self, o: F) -> F {
                F(unsafe { $fop(self.0, o.0) })
            }
        })*
        $(impl std::ops::$utrait for U {
            type Output = U;
            #[inline(always)]
            fn $uname(self, o: U) -> U {
                U(unsafe { $uop(self.0, o.0) })
            }
        })*
        impl std::ops::Neg for F {
            type Output = F;
            #[inline(always)]
            fn neg(self) -> F {
                (self.as_ints() ^ U::splat(0x8000_0000)).as_floats()
            }
        }
        impl HalfMask for $mask {
            const LANES: u32 = $lanes;
        }
        impl Ints for U {
            type Floats = F;
            type Mask = $mask;
            #[inline(always)]
            fn splat(x: u32) -> U {
                U(unsafe { $set_u(x as i32) })
            }
            #[inline(always)]
            fn load(x: &[u32]) -> U {
                let x = &x[..$lanes];
                U(unsafe { $load_u(x.as_ptr().cast()) })
            }
            #[inline(always)]
            fn store(self, x: &mut [u32]) {
                let x = &mut x[..$lanes];
                unsafe { $store_u(x.as_mut_ptr().cast(), self.0) }
            }
            #[inline(always)]
            fn shl<const BITS: u32>(self) -> U {
                U(unsafe { $shl(self.0, $set_u(BITS as i32)) })
            }
            #[inline(always)]
            fn shr<const BITS: u32>(self) -> U {
                U(unsafe { $shr(self.0, $set_u(BITS as i32)) })
            }
            #[inline(always)]
            fn to_floats(self) -> F {
                F(unsafe { $convert(self.0) })
            }
            #[inline(always)]
            fn as_floats(self) -> F {
                F(unsafe { $u_as_f(self.0) })
            }
            #[inline(always)]
            fn equals(self, o: U) -> $mask {
                unsafe { $equals(self.0, o.0) }
            }
            #[inline(always)]
            fn or_where_not(self, mask: $mask, o: U) -> U {
                U(unsafe { $select_u(mask, self.0, o.0) })
            }
            #[inline(always)]
            fn gather(self, table: &[u32]) -> U {
                debug_assert!(table.len() < 1 << 31);
                let table = if table.is_empty() { &[0][..] } else { table };
                let last = (table.len().min(1 << 31) - 1) as u32;
                unsafe {
                    let at = $umin(self.0, $set_u(last as i32));
                    U($gather(at, table.as_ptr().cast()))
                }
            }
        }
        impl Floats for F {
            type Ints = U;
            type Mask = $mask;
            const LANES: usize = $lanes;
            #[inline(always)]
            fn splat(x: f32) -> F {
                F(unsafe { $set_f(x) })
            }
            #[inline(always)]
            fn load(x: &[f32]) -> F {
                let x = &x[..$lanes];
                F(unsafe { $load_f(x.as_ptr()) })
            }
            #[inline(always)]
            fn store(self, x: &mut [f32]) {
                let x = &mut x[..$lanes];
                unsafe { $store_f(x.as_mut_ptr(), self.0) }
            }
            #[inline(always)]
            fn mul_add(self, b: F, c: F) -> F {
                F(unsafe { $mul_add(self.0, b.0, c.0) })
            }
            #[inline(always)]
            fn sqrt(self) -> F {
                F(unsafe { $sqrt(self.0) })
            }
            #[inline(always)]
            fn min(self, o: F) -> F {
                F(unsafe { $min(self.0, o.0) })
            }
            #[inline(always)]
            fn max(self, o: F) -> F {
                F(unsafe { $max(self.0, o.0) })
            }
            #[inline(always)]
            fn floor(self) -> F {
                F(unsafe { $floor(self.0) })
            }
            #[inline(always)]
            fn abs(self) -> F {
                F(unsafe { $abs(self.0) })
            }
            #[inline(always)]
            fn below(self, o: F) -> $mask {
                unsafe { $below(self.0, o.0) }
            }
            #[inline(always)]
            fn to_ints(self) -> U {
                U(unsafe { $truncate(self.0) })
            }
            #[inline(always)]
            fn as_ints(self) -> U {
                U(unsafe { $f_as_u(self.0) })
            }
            #[inline(always)]
            fn or_where_not(self, mask: $mask, o: F) -> F {
                F(unsafe { $select_f(mask, self.0, o.0) })
            }
        }
    };
}

vector_back_end!(avx512, "Sixteen lanes by AVX-512 F, DQ, BW and VL.", 16, __m512, __m512i, {
    floats: {
        Add add _mm512_add_ps;
        Sub sub _mm512_sub_ps;
        Mul mul _mm512_mul_ps;
        Div div _mm512_div_ps;
    },
    ints: {
        Add add _mm512_add_epi32;
        Sub sub _mm512_sub_epi32;
        Mul mul _mm512_mullo_epi32;
        BitAnd bitand _mm512_and_si512;
        BitOr bitor _mm512_or_si512;
        BitXor bitxor _mm512_xor_si512;
    },
    set_f: _mm512_set1_ps, set_u: _mm512_set1_epi32,
    load_f: _mm512_loadu_ps, store_f: _mm512_storeu_ps,
    load_u: _mm512_loadu_si512, store_u: _mm512_storeu_si512,
    mul_add: _mm512_fmadd_ps, sqrt: _mm512_sqrt_ps, min: _mm512_min_ps, max: _mm512_max_ps,
    floor: floor, abs: _mm512_abs_ps, below: below, equals: _mm512_cmpeq_epi32_mask,
    truncate: _mm512_cvttps_epi32, convert: _mm512_cvtepi32_ps,
    f_as_u: _mm512_castps_si512, u_as_f: _mm512_castsi512_ps,
    shl: _mm512_sllv_epi32, shr: _mm512_srlv_epi32, umin: _mm512_min_epu32,
    gather: gather, select_f: select_f, select_u: select_u,
    mask: __mmask16,
}, {
    #[inline]
    #[target_feature(enable = "avx512f")]
    fn floor(x: __m512) -> __m512 {
        _mm512_roundscale_ps::<{ _MM_FROUND_TO_NEG_INF | _MM_FROUND_NO_EXC }>(x)
    }

    #[inline]
    #[target_feature(enable = "avx512f")]
    fn below(a: __m512, b: __m512) -> __mmask16 {
        _mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b)
    }

    #[inline]
    #[target_feature(enable = "avx512f")]
    unsafe fn gather(at: __m512i, table: *const i32) -> __m512i {
        unsafe { _mm512_i32gather_epi32::<4>(at, table) }
    }

    #[inline]
    #[target_feature(enable = "avx512f")]
    fn select_f(mask: __mmask16, a: __m512, b: __m512) -> __m512 {
        _mm512_mask_blend_ps(mask, b, a)
    }

    #[inline]
    #[target_feature(enable = "avx512f")]
    fn select_u(mask: __mmask16, a: __m512i, b: __m512i) -> __m512i {
        _mm512_mask_blend_epi32(mask, b, a)
    }
});

impl super::lanes::Mask for u16 {
    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self)
    }
    #[inline(always)]
    fn from_bits(bits: u32) -> u16 {
        bits as u16
    }
}

/// A truth value in each of eight lanes: all bits of a lane, or none.
#[derive(Clone, Copy)]
pub struct M8(std::arch::x86_64::__m256);

macro_rules! mask_operators {
    ($($trait:ident $name:ident $op:ident;)*) => {$(
        impl std::ops::$trait for M8 {
            type Output = M8;
            #[inline(always)]
            fn $name(self, o: M8) -> M8 {
                M8(unsafe { std::arch::x86_64::$op(self.0, o.0) })
            }
        }
    )*};
}
mask_operators!(BitAnd bitand _mm256_and_ps; BitOr bitor _mm256_or_ps;);

impl std::ops::Not for M8 {
    type Output = M8;
    #[inline(always)]
    fn not(self) -> M8 {
        use std::arch::x86_64::*;
        M8(unsafe { _mm256_xor_ps(self.0, _mm256_castsi256_ps(_mm256_set1_epi32(-1))) })
    }
}

impl super::lanes::Mask for M8 {
    #[inline(always)]
    fn bits(self) -> u32 {
        unsafe { std::arch::x86_64::_mm256_movemask_ps(self.0) as u32 }
    }
    #[inline(always)]
    fn from_bits(bits: u32) -> M8 {
        use std::arch::x86_64::*;
        unsafe {
            let lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let own = _mm256_and_si256(_mm256_set1_epi32(bits as i32), lane);
            M8(_mm256_castsi256_ps(_mm256_cmpeq_epi32(own, lane)))
        }
    }
}

vector_back_end!(avx2, "Eight lanes by AVX2 and FMA.", 8, __m256, __m256i, {
    floats: {
        Add add _mm256_add_ps;
        Sub sub _mm256_sub_ps;
        Mul mul _mm256_mul_ps;
        Div div _mm256_div_ps;
    },
    ints: {
        Add add _mm256_add_epi32;
        Sub sub _mm256_sub_epi32;
        Mul mul _mm256_mullo_epi32;
        BitAnd bitand _mm256_and_si256;
        BitOr bitor _mm256_or_si256;
        BitXor bitxor _mm256_xor_si256;
    },
    set_f: _mm256_set1_ps, set_u: _mm256_set1_epi32,
    load_f: _mm256_loadu_ps, store_f: _mm256_storeu_ps,
    load_u: _mm256_loadu_si256, store_u: _mm256_storeu_si256,
    mul_add: _mm256_fmadd_ps, sqrt: _mm256_sqrt_ps, min: _mm256_min_ps, max: _mm256_max_ps,
    floor: _mm256_floor_ps, abs: abs, below: below, equals: equals,
    truncate: _mm256_cvttps_epi32, convert: _mm256_cvtepi32_ps,
    f_as_u: _mm256_castps_si256, u_as_f: _mm256_castsi256_ps,
    shl: _mm256_sllv_epi32, shr: _mm256_srlv_epi32, umin: _mm256_min_epu32,
    gather: gather, select_f: select_f, select_u: select_u,
    mask: super::M8,
}, {
    #[inline]
    #[target_feature(enable = "avx2")]
    fn abs(x: __m256) -> __m256 {
        _mm256_andnot_ps(_mm256_set1_ps(-0.0), x)
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn below(a: __m256, b: __m256) -> super::M8 {
        super::M8(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b))
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn equals(a: __m256i, b: __m256i) -> super::M8 {
        super::M8(_mm256_castsi256_ps(_mm256_cmpeq_epi32(a, b)))
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    unsafe fn gather(at: __m256i, table: *const i32) -> __m256i {
        unsafe { _mm256_i32gather_epi32::<4>(table, at) }
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn select_f(mask: super::M8, a: __m256, b: __m256) -> __m256 {
        _mm256_blendv_ps(b, a, mask.0)
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    fn select_u(mask: super::M8, a: __m256i, b: __m256i) -> __m256i {
        let (a, b) = (_mm256_castsi256_ps(a), _mm256_castsi256_ps(b));
        _mm256_castps_si256(_mm256_blendv_ps(b, a, mask.0))
    }
});
