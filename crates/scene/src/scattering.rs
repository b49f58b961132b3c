//! Which model scatters light off a cloth: `[scattering]` of a fabric file and the
//! same keys of a scene's cloth.

use crate::error::Result;
use crate::fabric_file::Fabric;
use crate::scene_file::{EventName, FlakeName, ModelName};
use organza_transport::{
    AnyMedium, ClothMedium, FibreEvent, FibreMedium, FlakeFamily, FlakeMedium,
};
use organza_volume::{Footprint, Octree};
use serde::Deserialize;
use std::path::Path;
use std::sync::Arc;

/// `[scattering]`
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScatteringTable {
    /// The representation.
    pub model: Option<ModelName>,
    /// Micro-flakes: their family.
    pub flake: Option<FlakeName>,
    /// Virtual scattering: what a collision with a fibre is.
    pub event: Option<EventName>,
}

/// A model of how the fibres in a voxel scatter light.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScatteringModel {
    /// As micro-flakes.
    Flakes(FlakeName),
    /// As fibres.
    Fibres(FibreEvent),
    /// No voxels: every fibre as it is.
    Explicit,
    /// No volume: the fabric's `[surface]`.
    Surface,
}

impl ScatteringTable {
    /// The model that a scene's keys name, those of the `fabric` where they are
    /// silent.
    ///
    /// # Errors
    /// `.key: why` for a key of the scene that belongs to another model; a fabric
    /// may have keys for both.
    pub fn over(self, fabric: ScatteringTable) -> Result<ScatteringModel, &'static str> {
        let flake = self.flake.or(fabric.flake).unwrap_or_default();
        let event = self.event.or(fabric.event).unwrap_or_default();
        match self.model.or(fabric.model).unwrap_or_default() {
            ModelName::Microflake if self.event.is_some() => {
                Err(".event: belongs to model = \"virtual-scattering\"")
            }
            ModelName::Microflake => Ok(ScatteringModel::Flakes(flake)),
            ModelName::Fibres | ModelName::Surface if self.event.is_some() => {
                Err(".event: belongs to model = \"virtual-scattering\"")
            }
            ModelName::Fibres | ModelName::Surface if self.flake.is_some() => {
                Err(".flake: belongs to model = \"microflake\"")
            }
            ModelName::Auto => {
                Err(".model: \"auto\" chooses for the pictures of a scene; name a model")
            }
            ModelName::Fibres => Ok(ScatteringModel::Explicit),
            ModelName::Surface => Ok(ScatteringModel::Surface),
            ModelName::VirtualScattering if self.flake.is_some() => {
                Err(".flake: belongs to model = \"microflake\"")
            }
            ModelName::VirtualScattering => Ok(ScatteringModel::Fibres(event.into())),
        }
    }
}

impl ScatteringModel {
    /// Its keys' values in a scene file.
    pub fn words(self) -> &'static str {
        match self {
            ScatteringModel::Flakes(FlakeName::SggxSpecular) => "microflake, sggx-specular",
            ScatteringModel::Flakes(FlakeName::SggxDiffuse) => "microflake, sggx-diffuse",
            ScatteringModel::Flakes(FlakeName::Gaussian) => "microflake, gaussian",
            ScatteringModel::Flakes(FlakeName::SinPower) => "microflake, sin-power",
            ScatteringModel::Fibres(FibreEvent::Packed) => "virtual-scattering, packed",
            ScatteringModel::Fibres(FibreEvent::Plain) => "virtual-scattering, plain",
            ScatteringModel::Explicit => "fibres",
            ScatteringModel::Surface => "surface",
        }
    }

    /// Where an octree for the model holds the length of thick fibres.
    pub fn footprint(self) -> Footprint {
        match self {
            ScatteringModel::Fibres(FibreEvent::Packed) => Footprint::Axis,
            _ => Footprint::Covered,
        }
    }

    /// The cloth's voxels at a level as a medium; `None` when there is no such
    /// level, or the model has no voxels.
    ///
    /// # Errors
    /// A fibre's parameters are wrong; `path` is the fabric's.
    pub fn medium(
        self,
        fabric: &Fabric,
        path: &Path,
        octree: impl Into<Arc<Octree>>,
        level: u8,
    ) -> Result<Option<AnyMedium>> {
        let family = match self {
            ScatteringModel::Explicit | ScatteringModel::Surface => return Ok(None),
            ScatteringModel::Fibres(event) => {
                let fibres = fabric.fibres(path)?;
                return Ok(FibreMedium::new(octree, level, fibres, event).map(AnyMedium::Fibres));
            }
            ScatteringModel::Flakes(FlakeName::SggxSpecular) => {
                return Ok(ClothMedium::new(octree, level, fabric.optics()).map(AnyMedium::Cloth));
            }
            ScatteringModel::Flakes(FlakeName::SggxDiffuse) => FlakeFamily::SggxDiffuse,
            ScatteringModel::Flakes(FlakeName::Gaussian) => FlakeFamily::Gaussian,
            ScatteringModel::Flakes(FlakeName::SinPower) => FlakeFamily::SinePower,
        };
        let medium = FlakeMedium::new(octree, level, fabric.optics(), family);
        Ok(medium.map(AnyMedium::Flakes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> ScatteringTable {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn scenes_speak_before_fabrics_and_packed_is_the_default() {
        let silent = ScatteringTable::default();
        let sggx = ScatteringModel::Flakes(FlakeName::SggxSpecular);
        assert_eq!(silent.over(silent), Ok(sggx));
        let fibres = table("model = 'virtual-scattering'");
        let packed = ScatteringModel::Fibres(FibreEvent::Packed);
        assert_eq!(fibres.over(silent), Ok(packed));
        assert_eq!(silent.over(fibres), Ok(packed));
        assert_eq!(packed.footprint(), Footprint::Axis);
        let plain = table("event = 'plain'");
        assert_eq!(
            plain.over(fibres),
            Ok(ScatteringModel::Fibres(FibreEvent::Plain))
        );
        assert!(plain.over(silent).is_err());
        let gaussian = table("flake = 'gaussian'\nevent = 'plain'");
        assert_eq!(
            silent.over(gaussian),
            Ok(ScatteringModel::Flakes(FlakeName::Gaussian))
        );
        assert!(table("flake = 'gaussian'").over(fibres).is_err());
        let explicit = table("model = 'fibres'");
        assert_eq!(explicit.over(gaussian), Ok(ScatteringModel::Explicit));
        assert!(
            table("model = 'fibres'\nflake = 'gaussian'")
                .over(silent)
                .is_err()
        );
    }
}
