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

/// [`MicroFlake::eval`] of SGGX flakes without normalising the half vector: the
/// distribution of normals is a quadratic form to the power -2, so its length
/// comes out as a power.
#[inline]
fn mirror(
    flakes: &impl MicroFlake,
    w_out: Vec3,
    w_in: Vec3,
    sqrt_determinant: f32,
    inverse_quadratic: impl Fn(Vec3) -> f32,
) -> f32 {
    let h = w_out + w_in;
    let squared = h.length_squared();
    let area = flakes.projected_area(w_out);
    if squared <= MIN_HALF_SQUARED {
        return 0.25 * flakes.ndf_mean_across(w_out) / area;
    }
    let q = inverse_quadratic(h);
    (0.25 * FRAC_1_PI) * squared * squared / (sqrt_determinant * q * q * area)
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

    fn eval(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        mirror(self, w_out, w_in, self.sqrt_determinant(), |h| {
            self.inverse_quadratic(h)
        })
    }
}

/// SGGX flakes of a fibre: S = I - (1 - e^2) t t^T for the axis t and the
/// end-on ratio e, so that the projected area is one broadside and e end-on.
///
/// The form without a matrix: the axis is kept scaled by `sqrt(1 - e^2)`.
/// As e goes to zero the area becomes the sine of the angle to the axis: the
/// extinction of a medium of smooth parallel fibres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxialFlake {
    scaled_axis: Vec3,
    end_on: f32,
}

impl AxialFlake {
    /// From a unit axis (its sign does not matter) and the ratio of the end-on
    /// to the broadside area, raised to [`MIN_RATIO`] and cut at one.
    pub fn new(axis: Vec3, end_on: f32) -> AxialFlake {
        let end_on = end_on.clamp(MIN_RATIO, 1.0);
        AxialFlake {
            scaled_axis: axis * (1.0 - end_on * end_on).sqrt(),
            end_on,
        }
    }

    /// The flakes of a matrix S and their broadside area, when S is that of a
    /// fibre: `a^2 I - a^2 (1 - e^2) t t^T`, within a 10,000th of its trace.
    ///
    /// The deviator of such a matrix has the eigenvalues d, d and -2 d.
    pub fn from_matrix(s: Sym3) -> Option<(f32, AxialFlake)> {
        let third = s.trace() / 3.0;
        let deviator = s.plus(Sym3::IDENTITY.scaled(-third));
        let (d, o) = (deviator.diagonal, deviator.off_diagonal);
        let d = ((d.length_squared() + 2.0 * o.length_squared()) / 6.0).sqrt();
        let (across, along) = (third + d, (third - 2.0 * d).max(0.0));
        if across.is_nan() || across <= 0.0 {
            return None;
        }
        // 3 d t t^T, whose longest row runs along t.
        let rest = Sym3::IDENTITY.scaled(across).plus(s.scaled(-1.0));
        let axis = [Vec3::X, Vec3::Y, Vec3::Z]
            .map(|e| rest.mul_vec(e))
            .into_iter()
            .max_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))?
            .normalize_or(Vec3::Z);
        let wrong = rest.plus(Sym3::outer(axis).scaled(-3.0 * d)).to_array();
        let slack = 1e-4 * s.trace();
        if wrong.iter().any(|x| x.abs() > slack) {
            return None;
        }
        let flake = AxialFlake::new(axis, (along / across).sqrt());
        Some((across.sqrt(), flake))
    }

    /// The axis times `sqrt(1 - e^2)`.
    pub fn scaled_axis(&self) -> Vec3 {
        self.scaled_axis
    }

    /// The end-on ratio e.
    pub fn end_on(&self) -> f32 {
        self.end_on
    }

    /// The same flakes as a matrix, for files and as an oracle.
    pub fn matrix(&self) -> Sym3 {
        Sym3::IDENTITY.plus(Sym3::outer(self.scaled_axis).scaled(-1.0))
    }

    /// S^1/2 v; (1 - e) / (1 - e^2) = 1 / (1 + e) keeps e = 1 harmless.
    fn root(&self, v: Vec3) -> Vec3 {
        v - self.scaled_axis * (self.scaled_axis.dot(v) / (1.0 + self.end_on))
    }

    fn inverse_quadratic(&self, m: Vec3) -> f32 {
        let along = self.scaled_axis.dot(m) / self.end_on;
        m.length_squared() + along * along
    }
}

impl MicroFlake for AxialFlake {
    /// `sqrt(e^2 + |t' x w|^2)` for the scaled axis t': equal to
    /// `sqrt(1 - (t' . w)^2)`, but exact when looking along the fibre.
    fn projected_area(&self, w: Vec3) -> f32 {
        let across = self.scaled_axis.cross(w).length_squared();
        (self.end_on * self.end_on + across).sqrt()
    }

    fn ndf(&self, m: Vec3) -> f32 {
        let q = self.inverse_quadratic(m);
        FRAC_1_PI / (self.end_on * q * q)
    }

    /// See [`Sggx::ndf_mean_across`]; here |S| = e^2 and the two eigenvalues of
    /// S^-1 across w are 1 and `projected_area^2 / e^2`.
    fn ndf_mean_across(&self, w: Vec3) -> f32 {
        let (e, area) = (self.end_on, self.projected_area(w));
        0.5 * FRAC_1_PI * (e * e + area * area) / (area * area * area)
    }

    fn visible_direction_sample(&self, w: Vec3, rng: &mut PathRng) -> Vec3 {
        let seen = self.root(w).normalize_or(Vec3::Z);
        self.root(seen + warp::uniform_sphere(rng.unit2()))
    }

    fn eval(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        mirror(self, w_out, w_in, self.end_on, |h| {
            self.inverse_quadratic(h)
        })
    }
}
