//! Cameras: how they project, where they stand and what they refuse.

use glam::{DVec3, UVec2};

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

impl CameraPose {
    /// From a place toward another.
    pub const fn new(origin_mm: DVec3, target_mm: DVec3, up: DVec3) -> CameraPose {
        CameraPose {
            origin_mm,
            target_mm,
            up,
        }
    }
}

/// A camera with its film.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub(crate) projection: Projection,
    pub(crate) resolution: UVec2,
    pub(crate) filter: PixelFilter,
    pub(crate) origin_mm: DVec3,
    pub(crate) forward: DVec3,
    pub(crate) right: DVec3,
    pub(crate) up: DVec3,
    /// Film width in the units of `right`: mm, or the tangent at distance one.
    pub(crate) film_width: f64,
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
        CameraPose::new(self.origin_mm, self.origin_mm + self.forward, self.up)
    }

    /// How samples spread around a pixel's centre.
    pub fn filter(&self) -> PixelFilter {
        self.filter
    }

    /// Pixels in x and y.
    pub fn resolution(&self) -> UVec2 {
        self.resolution
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A 100 mm lens at life size stands 200 mm from cloth and sensor.
    #[test]
    fn f_numbers_follow_the_lens_equation() {
        let fov_rad = 2.0 * (18.0f64 / 200.0).atan();
        let aperture = aperture_mm(4.0, fov_rad, 200.0, 36.0);
        assert!((aperture - 25.0).abs() <= 25.0 * f64::EPSILON, "{aperture}");
    }

    #[test]
    fn lenses_out_of_range_are_refused() {
        let refuse = |aperture_mm, focus_mm| {
            let projection = Projection::ThinLens {
                fov_rad: 0.5,
                aperture_mm,
                focus_mm,
            };
            let pose = CameraPose::new(DVec3::Z, DVec3::ZERO, DVec3::Y);
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
            let pose = CameraPose::new(DVec3::ZERO, target, up);
            Camera::new(p, pose, UVec2::ONE, PixelFilter::Box).unwrap_err()
        };
        assert_eq!(pose(DVec3::ZERO, DVec3::Y), CameraError::NoDirection);
        assert_eq!(pose(DVec3::Y, DVec3::Y), CameraError::NoUp);
        assert_eq!(pose(DVec3::Y, DVec3::ZERO), CameraError::NoUp);
    }
}
