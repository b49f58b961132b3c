//! Symmetric 3 x 3 matrices: second-moment tensors and SGGX matrices.

use glam::Vec3;

/// A symmetric matrix, stored in the order xx, yy, zz, xy, xz, yz that volume
/// files use.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sym3 {
    /// Diagonal: xx, yy, zz.
    pub diagonal: Vec3,
    /// Off the diagonal: xy, xz, yz.
    pub off_diagonal: Vec3,
}

impl Sym3 {
    /// The unit matrix.
    pub const IDENTITY: Sym3 = Sym3 {
        diagonal: Vec3::ONE,
        off_diagonal: Vec3::ZERO,
    };

    /// From xx, yy, zz, xy, xz, yz.
    pub fn from_array(s: [f32; 6]) -> Sym3 {
        Sym3 {
            diagonal: Vec3::new(s[0], s[1], s[2]),
            off_diagonal: Vec3::new(s[3], s[4], s[5]),
        }
    }

    /// xx, yy, zz, xy, xz, yz.
    pub fn to_array(self) -> [f32; 6] {
        let (d, o) = (self.diagonal, self.off_diagonal);
        [d.x, d.y, d.z, o.x, o.y, o.z]
    }

    /// `v v^T`.
    pub fn outer(v: Vec3) -> Sym3 {
        Sym3 {
            diagonal: v * v,
            off_diagonal: Vec3::new(v.x * v.y, v.x * v.z, v.y * v.z),
        }
    }

    /// Eigenvalue `across` in the plane perpendicular to the unit vector
    /// `axis` and `along` on it.
    pub fn axial(axis: Vec3, across: f32, along: f32) -> Sym3 {
        Sym3::IDENTITY
            .scaled(across)
            .plus(Sym3::outer(axis).scaled(along - across))
    }

    /// Sum.
    pub fn plus(self, o: Sym3) -> Sym3 {
        Sym3 {
            diagonal: self.diagonal + o.diagonal,
            off_diagonal: self.off_diagonal + o.off_diagonal,
        }
    }

    /// Product with a number.
    pub fn scaled(self, k: f32) -> Sym3 {
        Sym3 {
            diagonal: k * self.diagonal,
            off_diagonal: k * self.off_diagonal,
        }
    }

    /// `S v`.
    pub fn mul_vec(self, v: Vec3) -> Vec3 {
        let (d, o) = (self.diagonal, self.off_diagonal);
        Vec3::new(
            d.x * v.x + o.x * v.y + o.y * v.z,
            o.x * v.x + d.y * v.y + o.z * v.z,
            o.y * v.x + o.z * v.y + d.z * v.z,
        )
    }

    /// `v^T S v`.
    pub fn quadratic(self, v: Vec3) -> f32 {
        v.dot(self.mul_vec(v))
    }

    /// Sum of the diagonal.
    pub fn trace(self) -> f32 {
        self.diagonal.element_sum()
    }

    /// Determinant.
    pub fn determinant(self) -> f32 {
        let (d, o) = (self.diagonal, self.off_diagonal);
        d.x * d.y * d.z + 2.0 * o.x * o.y * o.z
            - d.x * o.z * o.z
            - d.y * o.y * o.y
            - d.z * o.x * o.x
    }

    /// Eigenvalues in falling order with their unit eigenvectors, by Jacobi
    /// rotations in `f64` (accurate for nearly equal and for tiny values).
    pub fn eigen(self) -> [(f32, Vec3); 3] {
        let (d, o) = (self.diagonal.as_dvec3(), self.off_diagonal.as_dvec3());
        let mut a = [[d.x, o.x, o.y], [o.x, d.y, o.z], [o.y, o.z, d.z]];
        let mut v = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0f64]];
        // Six sweeps bring any 3 x 3 matrix below f64 rounding; more costs nothing.
        for _ in 0..12 {
            let off = a[0][1].abs() + a[0][2].abs() + a[1][2].abs();
            if off <= f64::MIN_POSITIVE {
                break;
            }
            for (p, q) in [(0usize, 1usize), (0, 2), (1, 2)] {
                if a[p][q] == 0.0 {
                    continue;
                }
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = 1f64.copysign(theta) / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for row in &mut a {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                let (ap, aq) = (a[p], a[q]);
                a[p] = std::array::from_fn(|k| c * ap[k] - s * aq[k]);
                a[q] = std::array::from_fn(|k| s * ap[k] + c * aq[k]);
                for row in &mut v {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
            }
        }
        let column = |k: usize| Vec3::new(v[0][k] as f32, v[1][k] as f32, v[2][k] as f32);
        let mut pairs = [0, 1, 2].map(|k| (a[k][k] as f32, column(k).normalize_or(Vec3::Z)));
        pairs.sort_by(|x, y| y.0.total_cmp(&x.0));
        pairs
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Frame, PathRng, warp};

    #[test]
    fn eigen_recovers_planted_values_and_axes() {
        let mut rng = PathRng::from_seed(5);
        for _ in 0..500 {
            let f = Frame::from_normal(warp::uniform_sphere(rng.unit2()));
            let mut values = [rng.unit(), rng.unit(), rng.unit() * 1e-3];
            values.sort_by(|a, b| b.total_cmp(a));
            let axes = [f.s, f.t, f.n];
            let s = (0..3).fold(Sym3::default(), |s, k| {
                s.plus(Sym3::outer(axes[k]).scaled(values[k]))
            });
            for (k, (value, axis)) in s.eigen().into_iter().enumerate() {
                assert!((value - values[k]).abs() < 3e-7, "seed 5");
                assert!((s.mul_vec(axis) - value * axis).length() < 1e-6, "seed 5");
            }
        }
    }

    #[test]
    fn multiples_of_the_identity_and_zero_have_unit_axes() {
        for s in [Sym3::default(), Sym3::IDENTITY.scaled(3.0)] {
            for (_, axis) in s.eigen() {
                assert!((axis.length() - 1.0).abs() <= 2.0 * f32::EPSILON);
            }
        }
    }
}
