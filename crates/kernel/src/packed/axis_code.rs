//! Unit axes in a few bits: projected to the octahedron `|x| + |y| + |z| = 1`, whose lower
//! half is folded over the upper one [Cigolle2014].

use glam::Vec3;
use organza_lanes::math::{V3, with_sign_of};
use organza_lanes::{Floats, Ints};

/// The code of an axis, of `bits` bits for each of two coordinates.
pub fn encoded(axis: Vec3, bits: u32) -> u32 {
    let zero = zero(bits);
    let on_octahedron = axis / (axis.x.abs() + axis.y.abs() + axis.z.abs()).max(1e-20);
    let fold = (-on_octahedron.z).max(0.0);
    let code = |x: f32| ((x + fold.copysign(x) + 1.0) * zero).round() as u32;
    let most = (1 << bits) - 1;
    code(on_octahedron.x).min(most) << bits | code(on_octahedron.y).min(most)
}

/// The code of the coordinate zero.
fn zero(bits: u32) -> f32 {
    ((1u32 << (bits - 1)) - 1) as f32
}

/// The axis of a code in the lowest bits of words; its length is between `3^-1/2` and one.
#[inline(always)]
pub fn decoded<F: Floats, const BITS: u32>(code: F::Ints) -> V3<F> {
    let one = F::splat(1.0);
    let x = coordinate::<F, BITS>(code.shr::<BITS>());
    let y = coordinate::<F, BITS>(code);
    let z = one - x.abs() - y.abs();
    let fold = (-z).max(F::splat(0.0));
    V3::new(x - with_sign_of(fold, x), y - with_sign_of(fold, y), z)
}

#[inline(always)]
fn coordinate<F: Floats, const BITS: u32>(code: F::Ints) -> F {
    let code = (code & F::Ints::splat((1 << BITS) - 1)).to_floats();
    code.mul_add(F::splat(1.0 / zero(BITS)), F::splat(-1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::{PathRng, warp};
    use organza_lanes::one;

    #[test]
    fn axes_come_back() {
        let mut rng = PathRng::from_seed(5);
        for _ in 0..2000 {
            let axis = warp::uniform_sphere(rng.unit2());
            let near = |v: V3<one::F>| Vec3::new(v.x.0, v.y.0, v.z.0).normalize().distance(axis);
            let fine = decoded::<one::F, 12>(one::U(encoded(axis, 12) | 0xab00_0000));
            let rough = decoded::<one::F, 10>(one::U(encoded(axis, 10) | 0xabc0_0000));
            assert!(near(fine) < 1.1e-3 && near(rough) < 4.4e-3, "{axis}");
        }
    }
}
