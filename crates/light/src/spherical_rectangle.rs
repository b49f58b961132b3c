//! The solid angle of a rectangle, and directions drawn evenly from it \[Urena2013].

use glam::{DVec3, Vec2, Vec3};

/// Solid angle below which the even draw loses digits, sr. Seen so small, points drawn evenly
/// from the area serve as well.
const MIN_SOLID_ANGLE: f64 = 1e-6;

/// A rectangle in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Face {
    corner_mm: DVec3,
    /// Units along the edges, and the normal.
    along: DVec3,
    up: DVec3,
    normal: DVec3,
    size_mm: [f64; 2],
}

impl Face {
    /// From a corner, the two edges that start there, and the unit normal.
    pub fn new([corner_mm, u_mm, v_mm]: [Vec3; 3], normal: Vec3) -> Face {
        let (u, v) = (u_mm.as_dvec3(), v_mm.as_dvec3());
        let size_mm = [u.length(), v.length()];
        Face {
            corner_mm: corner_mm.as_dvec3(),
            along: u / size_mm[0],
            up: v / size_mm[1],
            normal: normal.as_dvec3(),
            size_mm,
        }
    }

    /// Where a ray crosses it, mm.
    pub fn distance_mm(&self, origin_mm: DVec3, direction: DVec3) -> Option<f64> {
        let from_corner = origin_mm - self.corner_mm;
        let (height, slope) = (from_corner.dot(self.normal), direction.dot(self.normal));
        // A ray away from it, or in its plane.
        if height * slope >= 0.0 {
            return None;
        }
        let t = -height / slope;
        let p = from_corner + t * direction;
        let inside = |axis: DVec3, size: f64| (0.0..=size).contains(&p.dot(axis));
        let is_met = inside(self.along, self.size_mm[0]) && inside(self.up, self.size_mm[1]);
        (is_met && t.is_finite()).then_some(t)
    }
}

/// An angle, by its cosine and sine.
type Turn = [f64; 2];

/// The sum of two angles.
fn turned([a, b]: Turn, [c, d]: Turn) -> Turn {
    [a * c - b * d, a * d + b * c]
}

/// A rectangle as it is seen from a point: its projection to the unit sphere.
///
/// Coordinates are along the edges and away from the point, which is the origin: the rectangle
/// lies at the depth `z`, which is negative.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SphericalRectangle {
    axes: [DVec3; 3],
    x: [f64; 2],
    y: [f64; 2],
    z: f64,
    /// Depth components of the normals of the planes through the point and the edges at the
    /// least and the greatest y.
    edges: [f64; 2],
    /// Angle that the draw begins with.
    first: Turn,
    solid_angle: f64,
}

impl SphericalRectangle {
    /// `None` when the rectangle is seen edge-on or is too small for exact angles.
    pub fn new(from_mm: Vec3, face: &Face) -> Option<SphericalRectangle> {
        let to = face.corner_mm - from_mm.as_dvec3();
        // Edges may be askew by a thousandth; the distance to the plane is what counts.
        let distance = to.dot(face.normal);
        let normal = if distance > 0.0 {
            -face.normal
        } else {
            face.normal
        };
        let z = -distance.abs();
        let (x0, y0) = (to.dot(face.along), to.dot(face.up));
        let (x, y) = ([x0, x0 + face.size_mm[0]], [y0, y0 + face.size_mm[1]]);
        // Depth components of the normals of the four planes, which point inward.
        let depth = |c: f64| c / (c * c + z * z).sqrt();
        let [left, right] = [-depth(x[0]), depth(x[1])];
        let edges = [-depth(y[0]), depth(y[1])];
        // The angles of the corners, of which the solid angle is the sum less a full turn.
        let corner = |a: f64, b: f64| {
            let cos = -a * b;
            [cos, (1.0 - cos * cos).max(0.0).sqrt()]
        };
        let of_left = turned(corner(edges[1], left), corner(left, edges[0]));
        let of_right = turned(corner(edges[0], right), corner(right, edges[1]));
        let [cos, sin] = turned(of_left, of_right);
        let angle = sin.atan2(cos);
        // From a point that touches it, it fills half of all directions.
        let is_over = |c: [f64; 2]| c[0] < 0.0 && c[1] > 0.0;
        let fills = angle <= 0.0 && is_over(x) && is_over(y);
        let solid_angle = match fills || angle < -MIN_SOLID_ANGLE {
            true => angle + std::f64::consts::TAU,
            false => angle,
        };
        (solid_angle > MIN_SOLID_ANGLE).then_some(SphericalRectangle {
            axes: [face.along, face.up, normal],
            x,
            y,
            z,
            edges,
            first: [of_left[0], -of_left[1]],
            solid_angle,
        })
    }

    /// Solid angle, sr.
    pub fn solid_angle(&self) -> f64 {
        self.solid_angle
    }

    /// A unit direction from two even numbers in `[0, 1)`; its density is one over the solid
    /// angle.
    pub fn direction(&self, even: Vec2) -> Vec3 {
        let (sin, cos) = (f64::from(even.x) * self.solid_angle).sin_cos();
        let [cos, sin] = turned(self.first, [cos, sin]);
        let f = (cos * self.edges[0] - self.edges[1]) / sin;
        let c =
            (1.0f64.copysign(f) / (f * f + self.edges[0] * self.edges[0]).sqrt()).clamp(-1.0, 1.0);
        let x = (-c * self.z / (1.0 - c * c).max(1e-30).sqrt()).clamp(self.x[0], self.x[1]);
        // At this x, the sine of the elevation is even.
        let square = x * x + self.z * self.z;
        let sine = |y: f64| y / (square + y * y).sqrt();
        let (low, high) = (sine(self.y[0]), sine(self.y[1]));
        let s = low + f64::from(even.y) * (high - low);
        let y = (s * (square / (1.0 - s * s).max(1e-30)).sqrt()).clamp(self.y[0], self.y[1]);
        (self.axes[0] * x + self.axes[1] * y + self.axes[2] * self.z)
            .normalize()
            .as_vec3()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RectangleLight;
    use organza_basis::quadrature::gauss_legendre;
    use organza_basis::{Moments, PathRng, Rgb};

    /// A panel of 300 x 233 mm, askew in space.
    fn panel() -> RectangleLight {
        let (u, v) = (Vec3::new(0.0, -300.0, 0.0), Vec3::new(120.0, 0.0, 200.0));
        RectangleLight::new(Vec3::new(-330.0, 260.0, 60.0), u, v, Rgb::WHITE, true).unwrap()
    }

    /// From before it, from far away beside it, from close by, and from a few millimetres.
    const PLACES: [Vec3; 4] = [
        Vec3::new(0.0, 0.0, 0.0),
        Vec3::new(-300.0, -900.0, 100.0),
        Vec3::new(-200.0, 100.0, 160.0),
        Vec3::new(-268.0, 100.0, 158.0),
    ];

    /// Sum over the panel of a function of the direction, per solid angle.
    fn sum(panel: &RectangleLight, from: Vec3, f: impl Fn(DVec3) -> f64) -> f64 {
        let [corner, u, v] = panel.corner_and_edges_mm().map(|p| p.as_dvec3());
        let area = u.cross(v);
        // Pieces of the panel, so that the near ones are resolved.
        let (pieces, rule) = (24, gauss_legendre(16));
        let nodes: Vec<(f64, f64)> = (0..pieces)
            .flat_map(|k| rule.iter().map(move |&(x, w)| (k, x, w)))
            .map(|(k, x, w)| {
                let n = f64::from(pieces);
                ((f64::from(k) + 0.5 * (x + 1.0)) / n, 0.5 * w / n)
            })
            .collect();
        let mut sum = 0.0;
        for &(a, wa) in &nodes {
            for &(b, wb) in &nodes {
                let to = corner + a * u + b * v - from.as_dvec3();
                let r = to.length();
                sum += wa * wb * f(to / r) * (area.dot(to) / r).abs() / (r * r);
            }
        }
        sum
    }

    #[test]
    fn the_face_of_a_cube_is_a_sixth_of_the_sphere() {
        let corner = Vec3::new(-1.0, -1.0, -1.0);
        let edges = [corner, 2.0 * Vec3::X, 2.0 * Vec3::Y];
        let face = Face::new(edges, Vec3::Z);
        let seen = SphericalRectangle::new(Vec3::ZERO, &face).unwrap();
        assert!((seen.solid_angle() - 4.0 * std::f64::consts::PI / 6.0).abs() < 8.0 * f64::EPSILON);
        let touching = SphericalRectangle::new(Vec3::new(0.2, -0.3, -1.0), &face).unwrap();
        assert!((touching.solid_angle() - 2.0 * std::f64::consts::PI).abs() < 1e-14);
        assert!(SphericalRectangle::new(Vec3::new(3.0, 0.0, -1.0), &face).is_none());
        assert!(SphericalRectangle::new(Vec3::new(0.0, 0.0, 1e4), &face).is_none());
    }

    /// Solid angles and means over the draws are those of the sum over the area. The twin draws
    /// evenly from the area and calls it even in solid angle.
    #[test]
    fn directions_are_even_in_solid_angle() {
        let panel = panel();
        let [corner, u, v] = panel.corner_and_edges_mm();
        let functions: [fn(DVec3) -> f64; 3] = [|w| w.z, |w| w.x * w.x, |w| w.y * w.z];
        for (k, from) in PLACES.into_iter().enumerate() {
            let face = Face::new([corner, u, v], panel_normal());
            let seen = SphericalRectangle::new(from, &face).unwrap();
            let exact = sum(&panel, from, |_| 1.0);
            let error = (seen.solid_angle() / exact - 1.0).abs();
            assert!(error < 1e-5, "{k}: {} {exact}", seen.solid_angle());
            let mut rng = PathRng::from_seed(61);
            let mut right = [Moments::default(); 3];
            let mut twin = [Moments::default(); 3];
            for _ in 0..20_000 {
                let even = rng.unit2();
                let w = seen.direction(even).as_dvec3();
                let by_area = (corner + even.x * u + even.y * v - from)
                    .normalize()
                    .as_dvec3();
                for (i, f) in functions.iter().enumerate() {
                    right[i].add(f(w));
                    twin[i].add(f(by_area));
                }
            }
            let mut found = 0;
            for (i, f) in functions.iter().enumerate() {
                let mean = sum(&panel, from, f) / exact;
                let off = |m: &Moments| (m.mean - mean).abs() / m.standard_error();
                let sigmas = off(&right[i]);
                assert!(sigmas < 4.5, "seed 61, {k} {i}: {sigmas} standard errors");
                found += usize::from(off(&twin[i]) > 4.5);
            }
            // From the second place, far away and near the plane, the two hardly differ.
            assert!(found > 0 || k == 1, "seed 61, {k}: the twin was not found");
        }
    }

    fn panel_normal() -> Vec3 {
        let [_, u, v] = panel().corner_and_edges_mm();
        u.cross(v).normalize()
    }

    /// The light samples: their density is the one that walks ask for, they end on the panel,
    /// and they estimate the irradiance of the sum.
    #[test]
    fn samples_estimate_the_irradiance() {
        let panel = panel();
        for (k, from) in PLACES.into_iter().enumerate() {
            let normal = DVec3::new(-0.6, 0.48, 0.64);
            let exact = sum(&panel, from, |w| w.dot(normal).abs());
            let mut rng = PathRng::from_seed(62);
            let (mut estimate, mut missed) = (Moments::default(), 0);
            for _ in 0..20_000 {
                let (w, pdf) = panel.sample_toward(from, &mut rng).unwrap();
                estimate.add(w.as_dvec3().dot(normal).abs() / f64::from(pdf));
                match panel.pdf_toward(from, w) {
                    0.0 => missed += 1,
                    asked => assert!(
                        (asked / pdf - 1.0).abs() <= 4.0 * f32::EPSILON,
                        "seed 62, {k}"
                    ),
                }
            }
            // Directions in single precision may pass the edge.
            assert!(missed <= 2, "seed 62, {k}: {missed} draws miss");
            let bound = 4.5 * estimate.standard_error() + 1e-5 * exact;
            assert!((estimate.mean - exact).abs() < bound, "seed 62, {k}");
            assert!(
                (0.9 * estimate.mean - exact).abs() > bound,
                "seed 62, {k}: {bound}"
            );
        }
    }
}
