//! `flake = "sggx-specular"`: mirrors whose normals are distributed as those of an
//! ellipsoid \[Heitz2015].

use super::catalogue::FlakeRecord;
use super::distribution::{Ellipsoids, Mirrors};
use std::sync::Arc;

pub(super) const FAMILY: FlakeRecord = FlakeRecord {
    name: "sggx-specular",
    about: "mirrors distributed as the normals of an ellipsoid",
    scattering: |_| Arc::new(Mirrors(Ellipsoids)),
};
