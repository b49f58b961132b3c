//! `flake = "sggx-diffuse"`: diffuse flakes whose normals are distributed as those
//! of an ellipsoid \[Heitz2015].

use super::catalogue::FlakeRecord;
use super::distribution::{Diffuse, Ellipsoids};
use std::sync::Arc;

pub(super) const FAMILY: FlakeRecord = FlakeRecord {
    name: "sggx-diffuse",
    about: "diffuse flakes distributed as the normals of an ellipsoid",
    scattering: |_| Arc::new(Diffuse(Ellipsoids)),
};
