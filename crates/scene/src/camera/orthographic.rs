//! Parallel rays.

use super::CameraKind;
use organza_transport::Projection;

/// `kind = "orthographic"`
pub static ORTHOGRAPHIC: CameraKind = CameraKind {
    name: "orthographic",
    keys: &["width_mm"],
    projection: |table| {
        Ok(Projection::Orthographic {
            width_mm: table.width_mm.ok_or("width_mm is missing")?,
        })
    },
};
