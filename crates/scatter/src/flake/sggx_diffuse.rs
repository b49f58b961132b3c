//! `flake = "sggx-diffuse"`: diffuse flakes whose normals are distributed as those
//! of an ellipsoid \[Heitz2015].

use super::catalogue::FlakeRecord;
use super::populations::Diffuse;
use crate::FlakeMaterials;

pub(super) const FAMILY: FlakeRecord = FlakeRecord {
    name: "sggx-diffuse",
    about: "diffuse flakes distributed as the normals of an ellipsoid",
    of_materials: |optics| Box::new(Diffuse(FlakeMaterials::new(optics))),
};
