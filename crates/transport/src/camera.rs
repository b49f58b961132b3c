//! Cameras: rays through pixels.

use glam::{DVec3, UVec2, Vec2};
use organza_basis::PathRng;

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
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CameraError {
    /// Origin and target coincide.
    #[error("camera.origin_mm and camera.target_mm are the same point")]
    NoDirection,
    /// The up vector says nothing.
    #[error("camera.up is zero or parallel to the view direction")]
    NoUp,
    /// A picture without pixels.
    #[error("camera.resolution must be at least 1 x 1")]
    NoPixels,
    /// A width or an angle out of range.
    #[error("{0}")]
    Range(&'static str),
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
            Projection::Orthographic { .. } => {
                return Err(CameraError::Range("camera.width_mm must be positive"));
            }
            Projection::Perspective { fov_rad }
                if fov_rad > 0.0 && fov_rad < std::f64::consts::PI =>
            {
                2.0 * (0.5 * fov_rad).tan()
            }
            Projection::Perspective { .. } => {
                return Err(CameraError::Range(
                    "camera.fov_deg must lie between 0 and 180",
                ));
            }
        };
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

    /// Pixels in x and y.
    pub fn resolution(&self) -> UVec2 {
        self.resolution
    }

    /// Origin and unit direction of a random ray of a pixel; pixel (0, 0) is
    /// the upper left one. In `f64`, so that a camera far away still resolves
    /// single fibres.
    pub fn ray(&self, pixel: UVec2, rng: &mut PathRng) -> (DVec3, DVec3) {
        let at = pixel.as_vec2() + 0.5 + self.filter.sample(rng);
        let scale = self.film_width / f64::from(self.resolution.x);
        let x = (f64::from(at.x) - 0.5 * f64::from(self.resolution.x)) * scale;
        let y = (0.5 * f64::from(self.resolution.y) - f64::from(at.y)) * scale;
        let offset = x * self.right + y * self.up;
        match self.projection {
            Projection::Orthographic { .. } => (self.origin_mm + offset, self.forward),
            Projection::Perspective { .. } => (self.origin_mm, (self.forward + offset).normalize()),
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
