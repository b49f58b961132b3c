//! A ray against one piece of a fibre.

use glam::DVec3;

/// The hull of two spheres, cut by the planes in which it meets its neighbours.
///
/// Pieces of one radius meet in an ellipse, exactly, when cut by the plane that
/// bisects the bend; where they turn, the sphere at the joint closes the outer
/// side. A curve of them has no gap for a ray from outside and no wall inside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FibrePiece {
    /// First end, mm.
    pub a: DVec3,
    /// Second end, mm.
    pub b: DVec3,
    /// Radius at the first end, mm.
    pub radius_a: f64,
    /// Radius at the second end, mm.
    pub radius_b: f64,
    /// What the piece keeps lies ahead of this plane through the first end;
    /// zero where nothing is cut.
    pub cut_a: DVec3,
    /// And behind this one through the second.
    pub cut_b: DVec3,
}

/// How far a point may lie beyond a cut, mm: both pieces own the plane.
const CUT_SLACK_MM: f64 = 1e-9;

impl FibrePiece {
    /// Distance in units of `d`, which need not be of unit length, at which the
    /// ray enters the piece from outside, between `t_min` and `t_max`.
    ///
    /// In `f64`, from any distance: in `f32` the discriminant of a fibre a few
    /// hundred radii away is noise.
    pub fn entry(&self, o: DVec3, d: DVec3, t_min: f64, t_max: f64) -> Option<f64> {
        let oa = o - self.a;
        let along = self.b - self.a;
        let square = along.length_squared();
        let narrowing = self.radius_a - self.radius_b;
        let d_square = d.length_squared();
        if square <= narrowing * narrowing {
            // One sphere holds the other.
            let t = if narrowing > 0.0 {
                sphere_entry(oa, d, d_square, self.radius_a)
            } else {
                sphere_entry(o - self.b, d, d_square, self.radius_b)
            }?;
            return self.keeps(o, d, t, t_min, t_max);
        }
        let length = square.sqrt();
        let axis = along / length;
        // Across and along the axis. With s the sine of the half-angle, the side
        // is where rho sqrt(1 - s^2) + y s = radius_a.
        let s = narrowing / length;
        let c_square = 1.0 - s * s;
        let (v, y) = (d.dot(axis), oa.dot(axis));
        let (q, p) = (d - axis * v, oa - axis * y);
        let wide = self.radius_a - s * y;
        let a = c_square * q.length_squared() - s * s * v * v;
        let b = c_square * p.dot(q) + s * v * wide;
        let c = c_square * p.length_squared() - wide * wide;
        let discriminant = b * b - a * c;
        if discriminant < 0.0 {
            // The cone around both spheres is missed.
            return None;
        }
        let t = (-b - discriminant.sqrt()) / a;
        let at = y + t * v;
        let side = [s * self.radius_a, length + s * self.radius_b];
        if side[0] <= at && at <= side[1] {
            return self.keeps(o, d, t, t_min, t_max);
        }
        let first = sphere_entry(oa, d, d_square, self.radius_a).filter(|t| y + t * v <= side[0]);
        let second =
            sphere_entry(o - self.b, d, d_square, self.radius_b).filter(|t| y + t * v >= side[1]);
        let t = first.into_iter().chain(second).reduce(f64::min)?;
        self.keeps(o, d, t, t_min, t_max)
    }

    fn keeps(&self, o: DVec3, d: DVec3, t: f64, t_min: f64, t_max: f64) -> Option<f64> {
        // A NaN, of a ray along the side, is no distance.
        if !(t > t_min && t <= t_max) {
            return None;
        }
        let p = o + t * d;
        let kept = (p - self.a).dot(self.cut_a) >= -CUT_SLACK_MM
            && (p - self.b).dot(self.cut_b) <= CUT_SLACK_MM;
        kept.then_some(t)
    }

    /// The point of the axis nearest to `p`, as the share of the way from the
    /// first end to the second.
    pub fn nearest(&self, p: DVec3) -> f64 {
        let along = self.b - self.a;
        let square = along.length_squared();
        if square > 0.0 {
            ((p - self.a).dot(along) / square).clamp(0.0, 1.0)
        } else {
            0.0
        }
    }

    /// The point at a share of the way.
    pub fn axis_point(&self, share: f64) -> DVec3 {
        self.a.lerp(self.b, share)
    }

    /// True when `p` lies inside.
    pub fn contains(&self, p: DVec3) -> bool {
        let along = self.b - self.a;
        let length = along.length();
        let narrowing = self.radius_a - self.radius_b;
        let kept = (p - self.a).dot(self.cut_a) >= 0.0 && (p - self.b).dot(self.cut_b) < 0.0;
        let in_sphere = |centre: DVec3, radius: f64| p.distance_squared(centre) <= radius * radius;
        let in_side = length > narrowing.abs() && {
            let axis = along / length;
            let s = narrowing / length;
            let y = (p - self.a).dot(axis);
            let rho = (p - self.a - axis * y).length();
            (s * self.radius_a..=length + s * self.radius_b).contains(&y)
                && rho * (1.0 - s * s).sqrt() + y * s <= self.radius_a
        };
        kept && (in_side || in_sphere(self.a, self.radius_a) || in_sphere(self.b, self.radius_b))
    }
}

/// Where the ray enters a sphere about the origin.
fn sphere_entry(o: DVec3, d: DVec3, d_square: f64, radius: f64) -> Option<f64> {
    let b = o.dot(d);
    let discriminant = b * b - d_square * (o.length_squared() - radius * radius);
    (discriminant >= 0.0).then(|| (-b - discriminant.sqrt()) / d_square)
}
