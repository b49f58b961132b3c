//! A pinhole.

use super::{CameraKey, CameraKind};
use organza_transport::Projection;

/// `kind = "perspective"`
pub static PERSPECTIVE: CameraKind = CameraKind {
    name: "perspective",
    keys: &[
        // Horizontal angle of view.
        CameraKey::angle("fov_deg"),
    ],
    projection: |table| {
        Ok(Projection::Perspective {
            fov_rad: table.own.required("fov_deg")?.to_radians(),
        })
    },
};
