//! A pinhole.

use super::CameraKind;
use organza_transport::Projection;

/// `kind = "perspective"`
pub static PERSPECTIVE: CameraKind = CameraKind {
    name: "perspective",
    keys: &["fov_deg"],
    projection: |table| {
        Ok(Projection::Perspective {
            fov_rad: table.fov_rad()?,
        })
    },
};
