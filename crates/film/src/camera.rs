//! Cameras: rays through pixels.

use crate::PixelCone;
use glam::{DVec3, UVec2, Vec2, Vec3};
use organza_basis::{Aabb, CellGrid, PathRng, warp::concentric_disk};

/// How film points become rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Parallel rays.
    Orthographic {
        /// Width of the picture on the film plane.
        width_mm: f64,
    },
    /// A pinhole.
    Perspective {
        /// Horizontal angle of view.
        fov_rad: f64,
    },
    /// A lens that is sharp in one plane and has no other fault.
    ThinLens {
        /// Horizontal angle of view.
        fov_rad: f64,
        /// Diameter of the lens.
        aperture_mm: f64,
        /// Distance of the plane in focus from the lens, along the axis.
        focus_mm: f64,
    },
}

/// Diameter of a lens from its f-number.
///
/// The lens equation gives the focal length from the distance in focus and
/// from the distance of the sensor, which its width and the angle of view
/// give: `1/f = 1/focus + 1/sensor`, aperture `f / N`. At macro distances the
/// focal length is well below the sensor's distance.
pub fn aperture_mm(f_number: f64, fov_rad: f64, focus_mm: f64, sensor_width_mm: f64) -> f64 {
    let sensor_distance = 0.5 * sensor_width_mm / (0.5 * fov_rad).tan();
    1.0 / (1.0 / focus_mm + 1.0 / sensor_distance) / f_number
}

/// How samples spread around a pixel's centre. Positions are drawn from the
/// filter, so every sample weighs the same and pixels stay independent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PixelFilter {
    /// The pixel's own square.
    #[default]
    Box,
    /// A pyramid over two pixels.
    Tent,
    /// A Gaussian of deviation half a pixel.
    Gaussian,
}

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

/// A camera that cannot see.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CameraError {
    /// Origin and target coincide.
    #[error("origin_mm and target_mm are the same point")]
    NoDirection,
    /// The up vector is zero or parallel to the view.
    #[error("up is zero or parallel to the view direction")]
    NoUp,
    /// A picture without pixels.
    #[error("resolution must be at least 1 x 1")]
    NoPixels,
    /// A width or an angle out of range.
    #[error("{must}, found {found}")]
    Range {
        /// The key and what it must be.
        must: &'static str,
        /// What it is.
        found: f64,
    },
}

/// Where a camera stands and where it looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraPose {
    /// Position; for an orthographic camera the middle of the film plane.
    pub origin_mm: DVec3,
    /// A point on the optical axis.
    pub target_mm: DVec3,
    /// A direction that is up in the picture.
    pub up: DVec3,
}

/// A camera with its film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    projection: Projection,
    resolution: UVec2,
    filter: PixelFilter,
    origin_mm: DVec3,
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    /// Film width in the units of `right`: mm, or the tangent at distance one.
    film_width: f64,
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
    /// A camera from its pose.
    ///
    /// # Errors
    /// When the pose gives no frame or a size is out of range.
    pub fn new(
        projection: Projection,
        pose: CameraPose,
        resolution: UVec2,
        filter: PixelFilter,
    ) -> Result<Camera, CameraError> {
        if resolution.min_element() == 0 {
            return Err(CameraError::NoPixels);
        }
        let refuse = |must, found| Err(CameraError::Range { must, found });
        let forward = (pose.target_mm - pose.origin_mm)
            .try_normalize()
            .ok_or(CameraError::NoDirection)?;
        let side = forward.cross(pose.up);
        if side.length() <= 1e-9 * pose.up.length() {
            return Err(CameraError::NoUp);
        }
        let right = side.try_normalize().ok_or(CameraError::NoUp)?;
        let film_width = match projection {
            Projection::Orthographic { width_mm } if width_mm > 0.0 && width_mm.is_finite() => {
                width_mm
            }
            Projection::Orthographic { width_mm } => {
                return refuse("width_mm must be positive", width_mm);
            }
            Projection::Perspective { fov_rad } | Projection::ThinLens { fov_rad, .. }
                if fov_rad > 0.0 && fov_rad < std::f64::consts::PI =>
            {
                2.0 * (0.5 * fov_rad).tan()
            }
            Projection::Perspective { fov_rad } | Projection::ThinLens { fov_rad, .. } => {
                // Degrees as they were written, without the noise of two conversions.
                let fov_deg = (fov_rad.to_degrees() * 1e9).round() / 1e9;
                return refuse("fov_deg must lie between 0 and 180", fov_deg);
            }
        };
        if let Projection::ThinLens {
            aperture_mm,
            focus_mm,
            ..
        } = projection
        {
            if !(aperture_mm >= 0.0 && aperture_mm.is_finite()) {
                return refuse("aperture_mm must be at least 0", aperture_mm);
            }
            if !(focus_mm > 0.0 && focus_mm.is_finite()) {
                return refuse("focus_mm must be positive", focus_mm);
            }
        }
        Ok(Camera {
            projection,
            resolution,
            filter,
            origin_mm: pose.origin_mm,
            forward,
            right,
            up: right.cross(forward),
            film_width,
        })
    }

    /// How film points become rays.
    pub fn projection(&self) -> Projection {
        self.projection
    }

    /// Where the camera stands and looks: its target is 1 mm ahead.
    pub fn pose(&self) -> CameraPose {
        CameraPose {
            origin_mm: self.origin_mm,
            target_mm: self.origin_mm + self.forward,
            up: self.up,
        }
    }

    /// How samples spread around a pixel's centre.
    pub fn filter(&self) -> PixelFilter {
        self.filter
    }

    /// Pixels in x and y.
    pub fn resolution(&self) -> UVec2 {
        self.resolution
    }

    /// How wide a pixel is along a ray with this unit direction, across the
    /// optical axis. What a lens adds out of focus is left out: it hides
    /// detail but does not ask for less.
    pub fn pixel_cone(&self, direction: DVec3) -> PixelCone {
        let pixel = self.film_width / f64::from(self.resolution.x);
        match self.projection {
            Projection::Orthographic { .. } => PixelCone {
                width_mm: pixel,
                growth: 0.0,
            },
            _ => PixelCone {
                width_mm: 0.0,
                growth: pixel * direction.dot(self.forward),
            },
        }
    }

    /// Least and greatest width of a pixel where its ray comes to a flat cloth,
    /// mm, with room for what lens and filter add; infinite with a horizon.
    ///
    /// Between the corners of the picture the width has no extreme: the inverse
    /// of a plane's depth is linear over the film.
    pub fn footprints_mm(&self, cloth: &CellGrid) -> (f32, f32) {
        const ROOM: f64 = 1.05;
        if let Projection::Orthographic { .. } = self.projection {
            let width = self.pixel_cone(self.forward).width_mm as f32;
            return (width, width);
        }
        let size = self.resolution.as_vec2();
        let corners = [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE];
        let widths = corners.map(|c| {
            let offset = self.film_offset(c * (size + 2.0) - 1.0);
            let direction = (self.forward + offset).normalize();
            let distance_mm = cloth.distance_mm(self.origin_mm, direction);
            self.pixel_cone(direction).width_at_mm(distance_mm)
        });
        let least = widths.iter().copied().fold(f64::INFINITY, f64::min);
        let most = widths.iter().copied().fold(0.0, f64::max);
        let least = if least.is_finite() { least } else { 0.0 };
        ((least / ROOM) as f32, (most * ROOM) as f32)
    }

    /// The same for anything inside a box.
    pub fn footprints_in_mm(&self, bounds_mm: Aabb) -> (f32, f32) {
        let cone = self.pixel_cone(self.forward);
        let depth = |corner: Vec3| (corner.as_dvec3() - self.origin_mm).dot(self.forward);
        let (centre, half) = (bounds_mm.centre(), 0.5 * bounds_mm.size());
        let middle = depth(centre);
        let reach = f64::from(half.dot(self.forward.abs().as_vec3()));
        let width = |depth: f64| cone.width_at_mm(depth.max(0.0)) as f32;
        (width(middle - reach), width(middle + reach))
    }

    /// A film point, in pixels from the upper left, along the picture's axes:
    /// in mm, or in tangents at distance one.
    fn film_offset(&self, at: Vec2) -> DVec3 {
        let scale = self.film_width / f64::from(self.resolution.x);
        let x = (f64::from(at.x) - 0.5 * f64::from(self.resolution.x)) * scale;
        let y = (0.5 * f64::from(self.resolution.y) - f64::from(at.y)) * scale;
        x * self.right + y * self.up
    }

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

    fn from_above(projection: Projection) -> Camera {
        let pose = CameraPose {
            origin_mm: DVec3::new(0.5, 0.5, 5.0),
            target_mm: DVec3::new(0.5, 0.5, 0.0),
            up: DVec3::Y,
        };
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
            assert!((at(ray, 0.0) - at(sharp, 0.0)).length() < 1e-12);
            assert!((ray.1.length() - 1.0).abs() < 1e-12);
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

    /// A 100 mm lens at life size stands 200 mm from cloth and sensor.
    #[test]
    fn f_numbers_follow_the_lens_equation() {
        let fov_rad = 2.0 * (18.0f64 / 200.0).atan();
        let aperture = aperture_mm(4.0, fov_rad, 200.0, 36.0);
        assert!((aperture - 25.0).abs() < 1e-12, "{aperture}");
    }

    #[test]
    fn lenses_out_of_range_are_refused() {
        let refuse = |aperture_mm, focus_mm| {
            let projection = Projection::ThinLens {
                fov_rad: 0.5,
                aperture_mm,
                focus_mm,
            };
            let pose = CameraPose {
                origin_mm: DVec3::Z,
                target_mm: DVec3::ZERO,
                up: DVec3::Y,
            };
            let made = Camera::new(projection, pose, UVec2::ONE, PixelFilter::Box);
            made.unwrap_err().to_string()
        };
        assert_eq!(refuse(1.0, 0.0), "focus_mm must be positive, found 0");
        for wrong in [-1.0, f64::NAN, f64::INFINITY] {
            assert!(refuse(wrong, 1.0).starts_with("aperture_mm must be at least 0"));
        }
    }

    #[test]
    fn poses_without_a_frame_are_refused() {
        let p = Projection::Orthographic { width_mm: 1.0 };
        let pose = |target: DVec3, up: DVec3| {
            let pose = CameraPose {
                origin_mm: DVec3::ZERO,
                target_mm: target,
                up,
            };
            Camera::new(p, pose, UVec2::ONE, PixelFilter::Box).unwrap_err()
        };
        assert_eq!(pose(DVec3::ZERO, DVec3::Y), CameraError::NoDirection);
        assert_eq!(pose(DVec3::Y, DVec3::Y), CameraError::NoUp);
        assert_eq!(pose(DVec3::Y, DVec3::ZERO), CameraError::NoUp);
    }
}
