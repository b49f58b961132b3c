//! The two words that describe a voxel to the lanes.
//!
//! ```text
//! word 0:  extinction 16 | end-on ratio 12 | reach 4
//! word 1:  bound 8       | axis 12 + 12
//! ```
//! - The extinction across the fibres, and the bound, are floating-point numbers
//!   of 4 bits of exponent and 12 or 4 after the point, as a share of the
//!   medium's greatest extinction; what is below `2^-28` of it vanishes. Bounds
//!   are rounded up.
//! - The end-on ratio e is stored as its square root.
//! - The axis is projected to the octahedron `|x| + |y| + |z| = 1`, whose lower
//!   half is folded over the upper one [Cigolle2014].
//! - A [reach](steps_of) says how far around the voxel the bound holds.
//!
//! So the extinction is kept to `2^-13` of its value and `2^-28` of the
//! greatest, e to 0.25 % above 0.01, and the axis to 1e-3 rad (4e-4 on average):
//! less than voxels know of the fibres in them.

use glam::Vec3;
use organza_lanes::math::{V3, with_sign_of};
use organza_lanes::{Floats, Ints};

/// Words of a voxel, or of one of the populations in it.
pub const WORDS: usize = 2;

/// Bits of the least floating-point code, `2^-15`, which stands for zero.
const BASE: u32 = (127 - 15) << 23;
const LEAST: f32 = 1.0 / 32_768.0;
/// The greatest bound.
pub const MOST: f32 = 2.0 - 1.0 / 16.0 - LEAST;

const END_ON_ONE: f32 = 4095.0;
/// Octahedral coordinates count from -1 in steps of one over this.
const AXIS_ZERO: f32 = 2047.0;

/// Reaches tried, by code, nearest first; code one would be one and a half.
pub const REACH_CODES: [u32; 15] = [0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

/// The reach of a code, in voxels, itself counted: 1, 2, 3, 4, 6, 8, 12, ...: a
/// floating-point number of one bit after the point.
pub fn steps_of(code: u32) -> usize {
    f32::from_bits((127 << 23) + (code << 22)) as usize
}

/// The code of a bound.
pub fn bound_code(bound: f32) -> u32 {
    let above = (bound + LEAST).to_bits().saturating_sub(BASE);
    // Rounding may put the greatest a hair above its code.
    above.div_ceil(1 << 19).min(255)
}

/// The bound of a code.
pub fn bound_of(code: u32) -> f32 {
    f32::from_bits(BASE + (code << 19)) - LEAST
}

/// The words of the matter of a voxel, without its surroundings; the extinction
/// as a share.
pub fn pack(broadside: f32, axis: Vec3, end_on: f32) -> [u32; WORDS] {
    let above = (broadside + LEAST).to_bits().saturating_sub(BASE);
    let extinction = ((above + (1 << 10)) >> 11).min(0xffff);
    let root = (end_on.sqrt() * END_ON_ONE).round() as u32;
    let on_octahedron = axis / (axis.x.abs() + axis.y.abs() + axis.z.abs()).max(1e-20);
    let fold = (-on_octahedron.z).max(0.0);
    let code = |x: f32| ((x + fold.copysign(x) + 1.0) * AXIS_ZERO).round() as u32;
    [
        extinction << 16 | root.min(0xfff) << 4,
        code(on_octahedron.x).min(0xfff) << 12 | code(on_octahedron.y).min(0xfff),
    ]
}

/// The end-on ratio of a code, as [`VoxelWords::end_on`] gives it.
pub fn end_on_of(code: u32) -> f32 {
    let root = code as f32 / END_ON_ONE;
    root * root
}

/// Adds what a voxel knows of its surroundings.
pub fn with_surroundings(words: [u32; WORDS], bound_code: u32, reach_code: u32) -> [u32; WORDS] {
    [words[0] | reach_code, words[1] | bound_code << 24]
}

/// Words in every lane.
#[derive(Clone, Copy)]
pub struct VoxelWords<U>(pub [U; WORDS]);

impl<U: Ints> VoxelWords<U> {
    /// Matter as dense as there is anywhere, which is known to reach nowhere.
    pub fn unknown() -> Self {
        VoxelWords([U::splat(0), U::splat(255 << 24)])
    }

    #[inline(always)]
    pub fn or_where_not(self, mask: U::Mask, o: Self) -> Self {
        let ([a, b], [c, d]) = (self.0, o.0);
        VoxelWords([a.or_where_not(mask, c), b.or_where_not(mask, d)])
    }

    /// The bound, as a share.
    #[inline(always)]
    pub fn bound(self) -> U::Floats {
        bound_of_code(self.0[1].shr::<24>())
    }

    /// The reach, in voxels.
    #[inline(always)]
    pub fn reach(self) -> U::Floats {
        reach_of_code(self.0[0] & U::splat(0xf))
    }

    /// Extinction across the fibres, as a share.
    #[inline(always)]
    pub fn broadside(self) -> U::Floats {
        let bits = self.0[0].shr::<16>().shl::<11>() + U::splat(BASE);
        bits.as_floats() - U::Floats::splat(LEAST)
    }

    /// The code of the end-on ratio.
    #[inline(always)]
    pub fn end_on_code(self) -> U {
        self.0[0].shr::<4>() & U::splat(0xfff)
    }

    /// The end-on ratio.
    #[inline(always)]
    pub fn end_on(self) -> U::Floats {
        let root = self.end_on_code().to_floats();
        let root = root * U::Floats::splat(1.0 / END_ON_ONE);
        root * root
    }

    /// Along the fibres; its length is between `3^-1/2` and one.
    #[inline(always)]
    pub fn axis(self) -> V3<U::Floats> {
        let one = U::Floats::splat(1.0);
        let x = octahedral(self.0[1].shr::<12>());
        let y = octahedral(self.0[1]);
        let z = one - x.abs() - y.abs();
        let fold = (-z).max(U::Floats::splat(0.0));
        V3::new(x - with_sign_of(fold, x), y - with_sign_of(fold, y), z)
    }
}

/// Bounds of codes, as [`bound_of`] gives them.
#[inline(always)]
pub fn bound_of_code<F: Floats>(code: F::Ints) -> F {
    let bits = code.shl::<19>() + F::Ints::splat(BASE);
    bits.as_floats() - F::splat(LEAST)
}

/// Reaches of codes in voxels, as [`steps_of`] gives them.
#[inline(always)]
pub fn reach_of_code<F: Floats>(code: F::Ints) -> F {
    (code.shl::<22>() + F::Ints::splat(127 << 23)).as_floats()
}

#[inline(always)]
fn octahedral<U: Ints>(code: U) -> U::Floats {
    let code = (code & U::splat(0xfff)).to_floats();
    code.mul_add(U::Floats::splat(1.0 / AXIS_ZERO), U::Floats::splat(-1.0))
}
