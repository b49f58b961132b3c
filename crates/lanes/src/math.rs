//! Elementary functions and random numbers of lanes.

use crate::lanes::{Floats, Ints, MAX_LANES};
use organza_basis::{PathRng, mix64};
use std::f32::consts::{FRAC_1_PI, LOG2_E, TAU};
use std::ops::{Add, Sub};

/// A vector in space in every lane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct V3<F> {
    pub x: F,
    pub y: F,
    pub z: F,
}

impl<F: Floats> V3<F> {
    #[inline(always)]
    pub fn new(x: F, y: F, z: F) -> V3<F> {
        V3 { x, y, z }
    }

    #[inline(always)]
    pub fn splat(v: glam::Vec3) -> V3<F> {
        V3::new(F::splat(v.x), F::splat(v.y), F::splat(v.z))
    }

    #[inline(always)]
    pub fn dot(self, o: V3<F>) -> F {
        self.x.mul_add(o.x, self.y.mul_add(o.y, self.z * o.z))
    }

    #[inline(always)]
    pub fn cross(self, o: V3<F>) -> V3<F> {
        V3 {
            x: self.y.mul_add(o.z, -(self.z * o.y)),
            y: self.z.mul_add(o.x, -(self.x * o.z)),
            z: self.x.mul_add(o.y, -(self.y * o.x)),
        }
    }

    #[inline(always)]
    pub fn scaled(self, k: F) -> V3<F> {
        V3::new(self.x * k, self.y * k, self.z * k)
    }

    /// `self * k + o`.
    #[inline(always)]
    pub fn scaled_add(self, k: F, o: V3<F>) -> V3<F> {
        V3::new(
            self.x.mul_add(k, o.x),
            self.y.mul_add(k, o.y),
            self.z.mul_add(k, o.z),
        )
    }

    /// `self * k + o`, component by component.
    #[inline(always)]
    pub fn times_add(self, k: V3<F>, o: V3<F>) -> V3<F> {
        V3::new(
            self.x.mul_add(k.x, o.x),
            self.y.mul_add(k.y, o.y),
            self.z.mul_add(k.z, o.z),
        )
    }

    /// Component by component.
    #[inline(always)]
    pub fn times(self, o: V3<F>) -> V3<F> {
        V3::new(self.x * o.x, self.y * o.y, self.z * o.z)
    }

    #[inline(always)]
    pub fn or_where_not(self, mask: F::Mask, o: V3<F>) -> V3<F> {
        V3 {
            x: self.x.or_where_not(mask, o.x),
            y: self.y.or_where_not(mask, o.y),
            z: self.z.or_where_not(mask, o.z),
        }
    }

    #[inline(always)]
    pub fn sum(self) -> F {
        self.x + self.y + self.z
    }
}

impl From<V3<f32>> for glam::Vec3 {
    #[inline(always)]
    fn from(v: V3<f32>) -> glam::Vec3 {
        glam::Vec3::new(v.x, v.y, v.z)
    }
}

impl<F: Floats> Add for V3<F> {
    type Output = V3<F>;
    #[inline(always)]
    fn add(self, o: V3<F>) -> V3<F> {
        V3::new(self.x + o.x, self.y + o.y, self.z + o.z)
    }
}

impl<F: Floats> Sub for V3<F> {
    type Output = V3<F>;
    #[inline(always)]
    fn sub(self, o: V3<F>) -> V3<F> {
        V3::new(self.x - o.x, self.y - o.y, self.z - o.z)
    }
}

/// A unit vector across another.
#[inline(always)]
pub fn beside<F: Floats>(axis: V3<F>) -> V3<F> {
    let steep = axis.x.abs().below(F::splat(0.6));
    let other = V3::splat(glam::Vec3::X).or_where_not(steep, V3::splat(glam::Vec3::Y));
    let across = axis.cross(other);
    across.scaled(F::splat(1.0) / across.dot(across).sqrt())
}

/// Horner's rule, the constant coefficient first.
#[inline(always)]
fn polynomial<F: Floats, const N: usize>(x: F, coefficients: [f32; N]) -> F {
    let mut sum = F::splat(coefficients[N - 1]);
    let mut i = N - 1;
    while i > 0 {
        i -= 1;
        sum = sum.mul_add(x, F::splat(coefficients[i]));
    }
    sum
}

/// `-ln x` of a normal positive number, to 1e-7 of its value.
///
/// `x = m 2^e` with m between the roots of 1/2 and 2; the polynomial is the
/// minimax one for `(ln(1 + f) - f + f^2/2) / f^3`.
#[inline(always)]
pub fn minus_ln<F: Floats>(x: F) -> F {
    const ROOT_HALF_TO_ONE: u32 = 0x3f80_0000 - 0x3f35_04f3;
    let bits = x.as_ints();
    let exponent = (bits + F::Ints::splat(ROOT_HALF_TO_ONE)).shr::<23>() - F::Ints::splat(127);
    let f = (bits - exponent.shl::<23>()).as_floats() - F::splat(1.0);
    // The exponent as a number, although it is negative: counted from -512.
    let e = (exponent + F::Ints::splat(512)).to_floats() - F::splat(512.0);
    let p = polynomial(
        f,
        [
            3.333_333_2e-1,
            -2.500_082_1e-1,
            2.000_122_7e-1,
            -1.662_335_6e-1,
            1.420_176_2e-1,
            -1.316_019_5e-1,
            1.276_155e-1,
            -7.634_43e-2,
        ],
    );
    let ln = (f * f).mul_add(f.mul_add(p, F::splat(-0.5)), f);
    -(e.mul_add(F::splat(std::f32::consts::LN_2), ln))
}

/// Minimax for `(2^f - 1) / f` between -1/2 and 1/2.
const EXP2: [f32; 6] = [
    6.931_472e-1,
    2.402_265_1e-1,
    5.550_327_8e-2,
    9.618_004e-3,
    1.340_027_4e-3,
    1.547_618_8e-4,
];

/// `2^x` for `x <= 0`, to 1e-7 of its value; below 2^-126 that.
#[inline(always)]
pub fn exp2<F: Floats>(x: F) -> F {
    let x = x.max(F::splat(-126.0));
    let whole = (x + F::splat(0.5)).floor();
    let f = x - whole;
    let p = polynomial(f, EXP2);
    let exponent = (whole + F::splat(127.0)).to_ints();
    f.mul_add(p, F::splat(1.0)) * exponent.shl::<23>().as_floats()
}

/// Sine and cosine of `2 pi u` for u in `[0, 1)`, to 1e-7.
#[inline(always)]
pub fn sin_cos_of_turns<F: Floats>(u: F) -> (F, F) {
    let four = u * F::splat(4.0);
    let quarter = (four + F::splat(0.5)).floor();
    let r = (four - quarter) * F::splat(std::f32::consts::FRAC_PI_2);
    let z = r * r;
    let sin = (r * z).mul_add(
        polynomial(z, [-1.666_665_5e-1, 8.332_178e-3, -1.951_73e-4]),
        r,
    );
    let cos = (z * z).mul_add(
        polynomial(z, [4.166_664_7e-2, -1.388_736_8e-3, 2.443_845e-5]),
        z.mul_add(F::splat(-0.5), F::splat(1.0)),
    );
    let quarter = quarter.to_ints();
    let one = F::Ints::splat(1);
    let swapped = (quarter & one).equals(one);
    let (s, c) = (
        cos.or_where_not(swapped, sin),
        sin.or_where_not(swapped, cos),
    );
    (
        (s.as_ints() ^ sign_bit::<F>(quarter)).as_floats(),
        (c.as_ints() ^ sign_bit::<F>(quarter + one)).as_floats(),
    )
}

/// A point on the unit sphere, uniform for two uniform numbers in `[0, 1)`.
#[inline(always)]
pub fn on_sphere<F: Floats>(turns: F, height: F) -> V3<F> {
    let one = F::splat(1.0);
    let (sin, cos) = sin_cos_of_turns(turns);
    let r = (F::splat(4.0) * height * (one - height)).sqrt();
    V3::new(r * cos, r * sin, height.mul_add(F::splat(-2.0), one))
}

/// Set in the second half of every four.
#[inline(always)]
fn sign_bit<F: Floats>(quarter: F::Ints) -> F::Ints {
    (quarter & F::Ints::splat(2)).shl::<30>()
}

/// `size`, which must not be negative, with the sign of `s`.
#[inline(always)]
pub fn with_sign_of<F: Floats>(size: F, s: F) -> F {
    let sign = s.as_ints() & F::Ints::splat(0x8000_0000);
    (size.as_ints() | sign).as_floats()
}

/// The angle of the point (x, y) from the x axis in turns, from -1/2 to 1/2, to
/// 1e-7; 0 of the origin. The polynomial is the minimax one for
/// `atan(a) / (2 pi a)` up to 1.
#[inline(always)]
pub fn turns_of<F: Floats>(y: F, x: F) -> F {
    let (across, up) = (x.abs(), y.abs());
    let steep = across.below(up);
    let most = across.max(up).max(F::splat(f32::MIN_POSITIVE));
    let a = across.min(up) / most;
    let p = polynomial(
        a * a,
        [
            1.591_548_3e-1,
            -5.304_612e-2,
            3.174_594_4e-2,
            -2.213_627e-2,
            1.534_603_4e-2,
            -8.898_723e-3,
            3.479_597_9e-3,
            -6.453_043e-4,
        ],
    );
    let turns = a * p;
    let turns = (F::splat(0.25) - turns).or_where_not(steep, turns);
    let behind = x.below(F::splat(0.0));
    let turns = (F::splat(0.5) - turns).or_where_not(behind, turns);
    (turns.as_ints() | (y.as_ints() & F::Ints::splat(0x8000_0000))).as_floats()
}

/// `e^x` of numbers that are not positive.
#[inline(always)]
pub fn exp<F: Floats>(x: F) -> F {
    exp2(x * F::splat(LOG2_E))
}

/// `exp(-x^2 / 2)`.
#[inline(always)]
pub fn bell<F: Floats>(x: F) -> F {
    exp(x * x * F::splat(-0.5))
}

/// The angle of the point (x, y) from the x axis, radians; 0 of the origin.
#[inline(always)]
pub fn atan2<F: Floats>(y: F, x: F) -> F {
    turns_of(y, x) * F::splat(TAU)
}

/// The angle of a sine, between -pi/2 and pi/2.
#[inline(always)]
pub fn asin<F: Floats>(sin: F) -> F {
    let one = F::splat(1.0);
    atan2(sin, (one - sin * sin).max(F::splat(0.0)).sqrt())
}

/// Sine and cosine of an angle.
#[inline(always)]
pub fn sin_cos<F: Floats>(angle: F) -> (F, F) {
    let turns = angle * F::splat(0.5 * FRAC_1_PI);
    sin_cos_of_turns(turns - turns.floor())
}

/// An angle brought to between about -pi and pi.
#[inline(always)]
pub fn wrap<F: Floats>(angle: F) -> F {
    let turns = (angle * F::splat(0.5 * FRAC_1_PI) + F::splat(0.5)).floor();
    turns.mul_add(F::splat(-TAU), angle)
}

/// A number brought to between -1 and 1.
#[inline(always)]
pub fn clamp<F: Floats>(x: F) -> F {
    x.max(F::splat(-1.0)).min(F::splat(1.0))
}

/// A standard normal number from two uniform ones.
#[inline(always)]
pub fn normal<F: Floats>(u: F, v: F) -> F {
    let half_square = minus_ln(positive(u));
    let (_, cos) = sin_cos_of_turns(v);
    (half_square + half_square).sqrt() * cos
}

/// Random numbers for each lane alone, by its number.
#[inline(always)]
pub fn path_rngs<U: Ints>(rng: &mut LaneRng<U>, mask: U::Mask) -> impl Fn(usize) -> PathRng {
    let [low, high, _] = rng.bits(mask);
    let mut names = [[0; MAX_LANES]; 2];
    low.store(&mut names[0]);
    high.store(&mut names[1]);
    move |lane| PathRng::from_seed(u64::from(names[0][lane]) | u64::from(names[1][lane]) << 32)
}

/// Where random numbers of lanes come from.
pub trait Draws<F: Floats> {
    /// Three numbers in `[0, 1)`; lanes outside the mask get numbers too, which need not count.
    fn units(&mut self, mask: F::Mask) -> [F; 3];
}

impl<U: Ints> Draws<U::Floats> for LaneRng<U> {
    #[inline(always)]
    fn units(&mut self, mask: U::Mask) -> [U::Floats; 3] {
        LaneRng::units(self, mask)
    }
}

impl Draws<f32> for PathRng {
    #[inline(always)]
    fn units(&mut self, _: bool) -> [f32; 3] {
        [self.unit(), self.unit(), self.unit()]
    }
}

/// The random numbers of one path in every lane: a hash of the path's name and
/// a count, three numbers at a time (pcg3d of [Jarzynski2020]). A lane counts
/// only the numbers that its own path asked for.
///
/// The generator's first step, a linear congruence of each word, is taken of
/// the name once and of the count by adding up.
#[derive(Clone, Copy)]
pub struct LaneRng<U> {
    pixel: U,
    sample: U,
    count: U,
}

const FACTOR: u32 = 1_664_525;
const SUMMAND: u32 = 1_013_904_223;

/// The part of a path's name that a pixel's paths have in common.
pub fn pixel_key(seed: u64, pixel: u64) -> (u32, u32) {
    let key = mix64(seed ^ mix64(pixel));
    (key as u32, (key >> 32) as u32)
}

/// [`LaneRng::words`] of sample `index` of a pixel.
pub fn lane_name(key: (u32, u32), index: u32) -> [u32; 3] {
    let step = |x: u32| x.wrapping_mul(FACTOR).wrapping_add(SUMMAND);
    [step(key.0), step(key.1.wrapping_add(index)), SUMMAND]
}

impl<U: Ints> LaneRng<U> {
    /// The numbers of sample `index` of the pixels with these
    /// [keys](pixel_key).
    #[inline(always)]
    pub fn new(key: (U, U), index: U) -> LaneRng<U> {
        let (a, b) = (U::splat(FACTOR), U::splat(SUMMAND));
        LaneRng {
            pixel: key.0 * a + b,
            sample: (key.1 + index) * a + b,
            count: b,
        }
    }

    /// From [`LaneRng::words`].
    #[inline(always)]
    pub fn from_words([pixel, sample, count]: [U; 3]) -> LaneRng<U> {
        LaneRng {
            pixel,
            sample,
            count,
        }
    }

    /// All that it knows.
    #[inline(always)]
    pub fn words(&self) -> [U; 3] {
        [self.pixel, self.sample, self.count]
    }

    #[inline(always)]
    pub fn or_where_not(self, mask: U::Mask, o: LaneRng<U>) -> LaneRng<U> {
        LaneRng {
            pixel: self.pixel.or_where_not(mask, o.pixel),
            sample: self.sample.or_where_not(mask, o.sample),
            count: self.count.or_where_not(mask, o.count),
        }
    }

    /// The next three numbers on the grid of 24 bits in `[0, 1)`; lanes
    /// outside the mask get numbers too, but do not count them as taken.
    #[inline(always)]
    pub fn units(&mut self, mask: U::Mask) -> [U::Floats; 3] {
        let [x, y, z] = self.bits(mask);
        [unit(x), unit(y), unit(z)]
    }

    /// The same as whole numbers.
    #[inline(always)]
    pub fn bits(&mut self, mask: U::Mask) -> [U; 3] {
        let (mut x, mut y, mut z) = (self.pixel, self.sample, self.count);
        self.count = (self.count + U::splat(FACTOR)).or_where_not(mask, self.count);
        for round in 0..2 {
            x = x + y * z;
            y = y + z * x;
            z = z + x * y;
            if round == 0 {
                x = x ^ x.shr::<16>();
                y = y ^ y.shr::<16>();
                z = z ^ z.shr::<16>();
            }
        }
        [x, y, z]
    }
}

/// The upper 24 bits as a number in `[0, 1)`.
#[inline(always)]
fn unit<U: Ints>(bits: U) -> U::Floats {
    bits.shr::<8>().to_floats() * U::Floats::splat(1.0 / 16_777_216.0)
}

/// From `[0, 1)` to `(0, 1]` on the same grid, so that a logarithm is finite.
#[inline(always)]
pub fn positive<F: Floats>(unit: F) -> F {
    unit + F::splat(1.0 / 16_777_216.0)
}
