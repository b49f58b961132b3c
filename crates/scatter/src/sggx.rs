//! SGGX micro-flakes [Heitz2015]: flakes distributed as the normals of an
//! ellipsoid, with closed forms for everything.
//!
//! With a symmetric positive matrix S, the projected area is
//! `sqrt(w^T S w)` and normals have the density
//! `1 / (pi sqrt|S| (m^T S^-1 m)^2)`. **Normalisation**: S = I shows the area
//! one to every direction (its faces sum to 4), where a unit area of isotropic
//! flakes in the convention of [Jakob2010] shows one half.

use crate::flake::{MIN_HALF_SQUARED, MicroFlake};
use glam::Vec3;
use organza_basis::{Frame, PathRng, Sym3, warp};
use std::f32::consts::FRAC_1_PI;

/// Least ratio of the smallest to the largest semi-axis that single precision
/// carries: a normal's error of 1e-7 is then below 1e-3 of the lobe's width.
pub const MIN_RATIO: f32 = 1e-3;

/// SGGX flakes of any symmetric matrix, held as its Cholesky factor.
///
/// With S = L L^T the unit ball is mapped by L onto the ellipsoid, whatever
/// factor L is, so visible normals need neither a frame around the view
/// direction (where a transposed frame goes unnoticed until it is tilted) nor a
/// matrix root, and no determinant of six numbers loses its digits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sggx {
    /// Diagonal of L.
    diagonal: Vec3,
    /// Below the diagonal: rows and columns 21, 31, 32.
    below: Vec3,
}

impl Sggx {
    /// From S (its unit is an area squared; see the module for scale).
    ///
    /// Eigenvalues below [`MIN_RATIO`]^2 of the largest are raised to it, as
    /// quantised or interpolated matrices need. A matrix without a positive
    /// finite part stands for no flakes: projected area about 1e-6, isotropic.
    pub fn new(s: Sym3) -> Sggx {
        let s = if s.to_array().iter().all(|x| x.is_finite()) {
            s
        } else {
            Sym3::default()
        };
        match cholesky(s) {
            Some(sggx) if sggx.is_well_conditioned() => sggx,
            _ => Sggx::floored(s),
        }
    }

    /// True when no eigenvalue can lie below the floor: the smallest is at least
    /// |S| over the square of half the trace (the product of the other two at
    /// their mean), and the trace bounds the largest.
    fn is_well_conditioned(&self) -> bool {
        let trace = self.matrix().trace();
        let volume = self.sqrt_determinant();
        4.0 * volume * volume >= MIN_RATIO * MIN_RATIO * trace * trace * trace
    }

    fn floored(s: Sym3) -> Sggx {
        let eigen = s.eigen();
        let floor = (MIN_RATIO * MIN_RATIO * eigen[0].0).max(1e-12);
        let raised = eigen.iter().fold(Sym3::default(), |sum, &(value, axis)| {
            sum.plus(Sym3::outer(axis).scaled(value.max(floor)))
        });
        // Rounding of the sum is far below the floor, except when the floor is
        // the absolute one; the ball is then as good as any matrix.
        cholesky(raised).unwrap_or(Sggx {
            diagonal: Vec3::splat(floor.sqrt()),
            below: Vec3::ZERO,
        })
    }

    /// The matrix S.
    pub fn matrix(&self) -> Sym3 {
        let (d, b) = (self.diagonal, self.below);
        Sym3 {
            diagonal: Vec3::new(
                d.x * d.x,
                b.x * b.x + d.y * d.y,
                b.y * b.y + b.z * b.z + d.z * d.z,
            ),
            off_diagonal: Vec3::new(d.x * b.x, d.x * b.y, b.x * b.y + d.y * b.z),
        }
    }

    /// Largest projected area over all directions, to bound extinction with.
    pub fn max_projected_area(&self) -> f32 {
        self.matrix().eigen()[0].0.sqrt()
    }

    /// L^T w, whose length is the projected area toward w.
    fn ball_from_world(&self, w: Vec3) -> Vec3 {
        let (d, b) = (self.diagonal, self.below);
        Vec3::new(
            d.x * w.x + b.x * w.y + b.y * w.z,
            d.y * w.y + b.z * w.z,
            d.z * w.z,
        )
    }

    /// L v.
    fn world_from_ball(&self, v: Vec3) -> Vec3 {
        let (d, b) = (self.diagonal, self.below);
        Vec3::new(
            d.x * v.x,
            b.x * v.x + d.y * v.y,
            b.y * v.x + b.z * v.y + d.z * v.z,
        )
    }

    /// m^T S^-1 m, by forward substitution.
    fn inverse_quadratic(&self, m: Vec3) -> f32 {
        let (d, b) = (self.diagonal, self.below);
        let x = m.x / d.x;
        let y = (m.y - b.x * x) / d.y;
        let z = (m.z - b.y * x - b.z * y) / d.z;
        x * x + y * y + z * z
    }

    fn sqrt_determinant(&self) -> f32 {
        self.diagonal.element_product()
    }
}

/// The factor of `s`, unless a squared pivot is not positive.
fn cholesky(s: Sym3) -> Option<Sggx> {
    let (d, o) = (s.diagonal, s.off_diagonal);
    if d.x <= 0.0 {
        return None;
    }
    let l11 = d.x.sqrt();
    let (l21, l31) = (o.x / l11, o.y / l11);
    let p22 = d.y - l21 * l21;
    if p22 <= 0.0 {
        return None;
    }
    let l22 = p22.sqrt();
    let l32 = (o.z - l31 * l21) / l22;
    let p33 = d.z - l31 * l31 - l32 * l32;
    (p33 > 0.0).then(|| Sggx {
        diagonal: Vec3::new(l11, l22, p33.sqrt()),
        below: Vec3::new(l21, l31, l32),
    })
}

impl MicroFlake for Sggx {
    fn projected_area(&self, w: Vec3) -> f32 {
        self.ball_from_world(w).length()
    }

    fn ndf(&self, m: Vec3) -> f32 {
        let q = self.inverse_quadratic(m);
        FRAC_1_PI / (self.sqrt_determinant() * q * q)
    }

    /// `|S| (tr S^-1 - w^T S^-1 w) / (2 pi projected_area^3)`: around the
    /// circle, `m^T S^-1 m` is a quadratic form in two dimensions, and the mean
    /// of its inverse square over angles is `(a + b) / (2 (a b)^(3/2))`.
    fn ndf_mean_across(&self, w: Vec3) -> f32 {
        let frame = Frame::from_normal(w);
        let trace = self.inverse_quadratic(frame.s) + self.inverse_quadratic(frame.t);
        let ratio = self.sqrt_determinant() / self.projected_area(w);
        0.5 * FRAC_1_PI * trace * ratio * ratio / self.projected_area(w)
    }

    fn visible_direction_sample(&self, w: Vec3, rng: &mut PathRng) -> Vec3 {
        // A unit vector plus a uniform one has a cosine around the first.
        let seen = self.ball_from_world(w).normalize_or(Vec3::Z);
        self.world_from_ball(seen + warp::uniform_sphere(rng.unit2()))
    }

    /// Without normalising the half vector: the distribution of normals is a quadratic form
    /// to the power -2, so its length comes out as a power.
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        let h = w_out + w_in;
        let squared = h.length_squared();
        let area = self.projected_area(w_out);
        if squared <= MIN_HALF_SQUARED {
            return 0.25 * self.ndf_mean_across(w_out) / area;
        }
        let q = self.inverse_quadratic(h);
        (0.25 * FRAC_1_PI) * squared * squared / (self.sqrt_determinant() * q * q * area)
    }
}
