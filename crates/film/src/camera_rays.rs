//! Camera rays: from a pixel and random numbers to an origin and a direction.

use crate::{Camera, PixelFilter, Projection};
use glam::{DVec3, UVec2, Vec2};
use organza_basis::{PathRng, warp::concentric_disk};

impl PixelFilter {
    /// A random offset from the pixel's centre, in pixels.
    fn sample(self, rng: &mut PathRng) -> Vec2 {
        match self {
            PixelFilter::Box => rng.unit2() - 0.5,
            PixelFilter::Tent => rng.unit2() + rng.unit2() - 1.0,
            PixelFilter::Gaussian => 0.5 * rng.normal2(),
        }
    }
}

/// A camera taken apart, for those who make its rays themselves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraParts {
    /// How film points become rays.
    pub projection: Projection,
    /// How samples spread around a pixel's centre.
    pub filter: PixelFilter,
    /// Position.
    pub origin_mm: DVec3,
    /// Unit direction of the optical axis.
    pub forward: DVec3,
    /// Unit direction to the right in the picture.
    pub right: DVec3,
    /// Unit direction up in the picture.
    pub up: DVec3,
    /// Film width: mm for parallel rays, else the tangent at distance one.
    pub film_width: f64,
}

impl Camera {
    /// The camera taken apart.
    pub fn parts(&self) -> CameraParts {
        CameraParts {
            projection: self.projection,
            filter: self.filter,
            origin_mm: self.origin_mm,
            forward: self.forward,
            right: self.right,
            up: self.up,
            film_width: self.film_width,
        }
    }

    /// A film point, in pixels from the upper left, along the picture's axes:
    /// in mm, or in tangents at distance one.
    pub(crate) fn film_offset(&self, at: Vec2) -> DVec3 {
        let scale = self.film_width / f64::from(self.resolution.x);
        let x = (f64::from(at.x) - 0.5 * f64::from(self.resolution.x)) * scale;
        let y = (0.5 * f64::from(self.resolution.y) - f64::from(at.y)) * scale;
        x * self.right + y * self.up
    }

    /// Origin and unit direction of a random ray of a pixel; pixel (0, 0) is
    /// the upper left one. In `f64`, so that a camera far away still resolves
    /// single fibres.
    pub fn ray(&self, pixel: UVec2, rng: &mut PathRng) -> (DVec3, DVec3) {
        let at = pixel.as_vec2() + 0.5 + self.filter.sample(rng);
        let offset = self.film_offset(at);
        match self.projection {
            Projection::Orthographic { .. } => (self.origin_mm + offset, self.forward),
            Projection::Perspective { .. } => (self.origin_mm, (self.forward + offset).normalize()),
            Projection::ThinLens {
                aperture_mm,
                focus_mm,
                ..
            } => {
                let on_disk = concentric_disk(rng.unit2()).as_dvec2() * (0.5 * aperture_mm);
                let on_lens = on_disk.x * self.right + on_disk.y * self.up;
                let direction = (self.forward + offset) * focus_mm - on_lens;
                (self.origin_mm + on_lens, direction.normalize())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::CameraPose;

    fn from_above(projection: Projection) -> Camera {
        let pose = CameraPose::new(
            DVec3::new(0.5, 0.5, 5.0),
            DVec3::new(0.5, 0.5, 0.0),
            DVec3::Y,
        );
        Camera::new(projection, pose, UVec2::new(4, 2), PixelFilter::Box).unwrap()
    }

    #[test]
    fn the_first_pixel_is_upper_left() {
        let mut rng = PathRng::from_seed(0);
        let ortho = from_above(Projection::Orthographic { width_mm: 4.0 });
        let (o, d) = ortho.ray(UVec2::ZERO, &mut rng);
        assert!(o.x >= -1.5 && o.x <= -0.5 && o.y >= 0.5 && o.y <= 1.5);
        assert_eq!(d, DVec3::NEG_Z);
        let right_angle = std::f64::consts::FRAC_PI_2;
        let pinhole = from_above(Projection::Perspective {
            fov_rad: right_angle,
        });
        for _ in 0..100 {
            let (_, d) = pinhole.ray(UVec2::new(3, 1), &mut rng);
            assert!(d.x > 0.0 && d.y < 0.0 && d.x / -d.z <= 1.0);
        }
    }

    const LENS: Projection = Projection::ThinLens {
        fov_rad: 0.5,
        aperture_mm: 2.0,
        focus_mm: 5.0,
    };

    /// Rays of one film point meet in the plane of focus; elsewhere they fill
    /// the disk that similar triangles give.
    #[test]
    fn a_thin_lens_is_sharp_in_its_plane_of_focus() {
        let (lens, mut rng) = (from_above(LENS), PathRng::from_seed(3));
        let pinhole = from_above(Projection::Perspective { fov_rad: 0.5 });
        let at = |(o, d): (DVec3, DVec3), z: f64| o + d * ((z - o.z) / d.z);
        let (mut widest, mut second_moment) = (0.0f64, 0.0);
        let rays = 20_000;
        for _ in 0..rays {
            let pixel = UVec2::new(1, 0);
            let sharp = pinhole.ray(pixel, &mut rng.clone());
            let ray = lens.ray(pixel, &mut rng);
            assert!((at(ray, 0.0) - at(sharp, 0.0)).length() < 4.0 * f64::EPSILON);
            assert!((ray.1.length() - 1.0).abs() < 4.0 * f64::EPSILON);
            // 2 mm in front of the focus, 3 mm from the lens: a disk 2/5 as wide.
            let blur = (at(ray, 2.0) - at(sharp, 2.0)).length();
            widest = widest.max(blur);
            second_moment += blur * blur / f64::from(rays);
        }
        assert!(widest <= 0.4 && widest > 0.39, "seed 3: {widest}");
        // A uniform disk of radius R has mean square R^2 / 2; one value deviates
        // by R^2 / sqrt(12).
        let tolerance = 4.0 * 0.16 / (12.0 * f64::from(rays)).sqrt();
        assert!(
            (second_moment - 0.08).abs() < tolerance,
            "seed 3: {second_moment}"
        );
    }

    #[test]
    fn a_closed_lens_is_a_pinhole() {
        let closed = Projection::ThinLens {
            fov_rad: 0.5,
            aperture_mm: 0.0,
            focus_mm: 7.0,
        };
        let (lens, pinhole) = (
            from_above(closed),
            from_above(Projection::Perspective { fov_rad: 0.5 }),
        );
        for seed in 0..50 {
            let pixel = UVec2::new(2, 1);
            let a = lens.ray(pixel, &mut PathRng::from_seed(seed));
            let b = pinhole.ray(pixel, &mut PathRng::from_seed(seed));
            assert!(a.0 == b.0 && (a.1 - b.1).length() < 1e-15);
        }
    }
}
