//! SGGX micro-flakes of a fibre [Heitz2015]: of one path, or of many side by side.

use crate::flake::{MIN_HALF_SQUARED, MicroFlake, mirrored};
use crate::sggx::MIN_RATIO;
use glam::Vec3;
use organza_basis::{PathRng, Sym3};
use organza_lanes::math::on_sphere;
use organza_lanes::{Floats, Mask, V3};
use std::f32::consts::FRAC_1_PI;

/// SGGX flakes of a fibre: S = I - (1 - e^2) t t^T for the axis t and the
/// end-on ratio e, so that the projected area is one broadside and e end-on.
///
/// The form without a matrix: the axis is kept scaled by `sqrt(1 - e^2)`.
/// As e goes to zero the area becomes the sine of the angle to the axis: the
/// extinction of a medium of smooth parallel fibres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxialFlake<F = f32> {
    scaled_axis: V3<F>,
    end_on: F,
}

impl AxialFlake {
    /// From a unit axis (its sign does not matter) and the ratio of the end-on
    /// to the broadside area, raised to [`MIN_RATIO`] and cut at one.
    pub fn new(axis: Vec3, end_on: f32) -> AxialFlake {
        let end_on = end_on.clamp(MIN_RATIO, 1.0);
        AxialFlake {
            scaled_axis: V3::splat(axis * (1.0 - end_on * end_on).sqrt()),
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
        self.scaled_axis.into()
    }

    /// The end-on ratio e.
    pub fn end_on(&self) -> f32 {
        self.end_on
    }

    /// The same flakes as a matrix, for files and as an oracle.
    pub fn matrix(&self) -> Sym3 {
        Sym3::IDENTITY.plus(Sym3::outer(self.scaled_axis()).scaled(-1.0))
    }
}

impl<F: Floats> AxialFlake<F> {
    /// From an axis of any length and an end-on ratio of at least [`MIN_RATIO`].
    #[inline(always)]
    pub fn about(axis: V3<F>, end_on: F) -> AxialFlake<F> {
        let square = (-end_on).mul_add(end_on, F::splat(1.0));
        let length = (square.max(F::splat(0.0)) / axis.dot(axis)).sqrt();
        AxialFlake {
            scaled_axis: axis.scaled(length),
            end_on,
        }
    }

    /// Area shown to `w`, `sqrt(e^2 + |t' x w|^2)` for the scaled axis t': equal to
    /// `sqrt(1 - (t' . w)^2)`, but exact when looking along the fibre.
    #[inline(always)]
    pub fn area(&self, w: V3<F>) -> F {
        let across = self.scaled_axis.cross(w);
        self.end_on.mul_add(self.end_on, across.dot(across)).sqrt()
    }

    /// S^1/2 v, given one over 1 + e; (1 - e) / (1 - e^2) = 1 / (1 + e) keeps e = 1 harmless.
    #[inline(always)]
    fn root(&self, v: V3<F>, per_one_and_end_on: F) -> V3<F> {
        let along = self.scaled_axis.dot(v) * per_one_and_end_on;
        self.scaled_axis.scaled_add(-along, v)
    }

    /// Phase function of mirrors toward `w_in`, given one over the area that `w_out` sees;
    /// see [`MicroFlake::eval`]. The half vector is not normalised: the distribution of normals
    /// is a quadratic form to the power -2, so its length comes out as a power. Quadratic forms
    /// are times e^2, so that there is one division.
    #[inline(always)]
    pub fn phase(&self, w_out: V3<F>, per_area: F, w_in: V3<F>) -> F {
        let h = w_out + w_in;
        let squared = h.dot(h);
        let along = self.scaled_axis.dot(h);
        let e2 = self.end_on * self.end_on;
        let q = along.mul_add(along, squared * e2);
        let scale = F::splat(0.25 * FRAC_1_PI) * e2 * self.end_on * per_area;
        let value = scale * squared * squared / (q * q).max(F::splat(f32::MIN_POSITIVE));
        let opposite = squared.below(F::splat(MIN_HALF_SQUARED));
        if opposite.any() {
            return self.straight_on(per_area).or_where_not(opposite, value);
        }
        value
    }

    /// The phase function straight on, where the half vector is undefined: the mean over the
    /// circle of possible ones. See [`Sggx`](crate::Sggx); here |S| = e^2, and the two
    /// eigenvalues of S^-1 across `w_out` are 1 and the squared area over e^2.
    #[inline(always)]
    fn straight_on(&self, per_area: F) -> F {
        let per_square = per_area * per_area;
        let e2 = self.end_on * self.end_on;
        let sum = e2.mul_add(per_square, F::splat(1.0)) * per_square;
        F::splat(0.125 * FRAC_1_PI) * sum
    }

    /// Draws a visible normal of any length, given one over the area that `w` sees and two
    /// numbers in `[0, 1)`; see [`MicroFlake::visible_direction_sample`]. A unit vector plus a
    /// uniform one has a cosine around the first.
    #[inline(always)]
    pub fn visible_direction(&self, w: V3<F>, per_area: F, turns: F, height: F) -> V3<F> {
        let one = F::splat(1.0);
        let on_sphere = on_sphere(turns, height);
        let per_one_and_end_on = one / (one + self.end_on);
        let seen = self
            .root(w, per_one_and_end_on)
            .scaled_add(per_area, on_sphere);
        self.root(seen, per_one_and_end_on)
    }

    /// Draws where a mirror sends `w_out`, from the same.
    #[inline(always)]
    pub fn mirror(&self, w_out: V3<F>, per_area: F, turns: F, height: F) -> V3<F> {
        mirrored(
            w_out,
            self.visible_direction(w_out, per_area, turns, height),
        )
    }
}

impl MicroFlake for AxialFlake {
    fn projected_area(&self, w: Vec3) -> f32 {
        self.area(V3::splat(w))
    }

    fn ndf(&self, m: Vec3) -> f32 {
        let along = self.scaled_axis.dot(V3::splat(m)) / self.end_on;
        let q = m.length_squared() + along * along;
        FRAC_1_PI / (self.end_on * q * q)
    }

    fn ndf_mean_across(&self, w: Vec3) -> f32 {
        let area = self.projected_area(w);
        4.0 * area * self.straight_on(1.0 / area)
    }

    fn visible_direction_sample(&self, w: Vec3, rng: &mut PathRng) -> Vec3 {
        let (u, w) = (rng.unit2(), V3::splat(w));
        self.visible_direction(w, 1.0 / self.area(w), u.y, u.x)
            .into()
    }

    fn eval(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        let (w_out, w_in) = (V3::splat(w_out), V3::splat(w_in));
        self.phase(w_out, 1.0 / self.area(w_out), w_in)
    }
}
