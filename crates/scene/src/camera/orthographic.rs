//! Parallel rays.

use super::{CameraKey, CameraKind};
use organza_transport::Projection;

/// `kind = "orthographic"`
pub static ORTHOGRAPHIC: CameraKind = CameraKind {
    name: "orthographic",
    keys: &[
        // Width of the picture on the film plane.
        CameraKey::length("width_mm"),
    ],
    projection: |table| {
        Ok(Projection::Orthographic {
            width_mm: table.own.required("width_mm")?,
        })
    },
};
