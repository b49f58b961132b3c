//! `flake = "sggx-specular"`: mirrors whose normals are distributed as those of an
//! ellipsoid \[Heitz2015].

use super::catalogue::FlakeRecord;
use crate::FlakeMaterials;

pub(super) const FAMILY: FlakeRecord = FlakeRecord {
    name: "sggx-specular",
    about: "mirrors distributed as the normals of an ellipsoid",
    of_materials: |optics| Box::new(FlakeMaterials::new(optics)),
};
