//! Which representation shows a cloth: `[scattering]` of a fabric file and the same
//! keys of a scene's cloth.

use crate::representation::{
    MICROFLAKE, ModelKey, PackedFrom, Representation, Settings, ShownAs, owners,
};
use organza_scatter::FlakeFamily;
use serde::Deserialize;

/// `[scattering]`
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ScatteringTable {
    /// The representation.
    pub model: Option<ModelKey>,
    /// Micro-flakes: their family.
    pub flake: Option<FlakeFamily>,
    /// Packed fibres: so many events of a path are with explicit fibres.
    pub first_events: Option<u32>,
    /// Packed fibres: events are with explicit fibres while the path carries at least this
    /// share of what it began with.
    pub while_weight: Option<f32>,
}

impl ScatteringTable {
    /// The representation that a scene's keys name; where they name none, that of
    /// the `fabric`, and micro-flakes where it names none.
    ///
    /// # Errors
    /// `.key: why` for a key of the scene that belongs to another representation; a
    /// fabric may have keys for several.
    pub fn over(self, fabric: ScatteringTable) -> Result<ShownAs, String> {
        let own = self.model.or(fabric.model);
        let representation = match own.unwrap_or(ModelKey::Is(&MICROFLAKE)) {
            ModelKey::Is(r) => r,
            ModelKey::Auto => {
                return Err(
                    ".model: \"auto\" chooses for the pictures of a scene; name a representation"
                        .into(),
                );
            }
        };
        if self.flake.is_some() && !representation.has_key("flake") {
            return Err(format!(".flake: belongs to {}", owners("flake")));
        }
        self.check_packed_from(&fabric, representation)?;
        Ok(ShownAs {
            representation,
            settings: Settings {
                flake: self.flake.or(fabric.flake).unwrap_or_default(),
                local_visibility: false,
                packed_from: if representation.has_key("first_events") {
                    PackedFrom {
                        first_events: self.first_events.or(fabric.first_events),
                        while_weight: self.while_weight.or(fabric.while_weight),
                    }
                } else {
                    PackedFrom::default()
                },
            },
        })
    }

    /// Checks the keys of packed fibres.
    fn check_packed_from(
        &self,
        fabric: &ScatteringTable,
        shown: &Representation,
    ) -> Result<(), String> {
        let keys = [
            ("first_events", self.first_events.is_some()),
            ("while_weight", self.while_weight.is_some()),
        ];
        let foreign = keys
            .iter()
            .find(|(key, is_set)| *is_set && !shown.has_key(key));
        if let Some((key, _)) = foreign {
            return Err(format!(".{key}: belongs to {}", owners(key)));
        }
        match self.while_weight.or(fabric.while_weight) {
            Some(weight) if !(weight > 0.0 && weight <= 1.0) => Err(format!(
                ".while_weight: expected a share above 0 and at most 1 such as 0.25, found {weight}"
            )),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::representation::EXPLICIT_FIBRES;

    fn table(text: &str) -> ScatteringTable {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn scenes_come_before_fabrics_and_micro_flakes_are_the_default() {
        let shown = |scene: &str, fabric: &str| table(scene).over(table(fabric));
        let name = |scene, fabric| shown(scene, fabric).map(|s| s.representation.name);
        assert_eq!(name("", ""), Ok("microflake"));
        assert_eq!(name("model = 'packed'", ""), Ok("packed"));
        assert_eq!(name("", "model = 'plain'"), Ok("plain"));
        assert_eq!(name("model = 'fibres'", "flake = 'gaussian'"), Ok("fibres"));
        let gaussian = shown("", "flake = 'gaussian'").unwrap();
        assert_eq!(
            gaussian.settings.flake,
            FlakeFamily::named("gaussian").unwrap()
        );
        assert_eq!(gaussian.to_string(), "microflake, gaussian");
        assert_eq!(ShownAs::usual(&EXPLICIT_FIBRES).to_string(), "fibres");
        for wrong in ["flake = 'gaussian'", "model = 'auto'"] {
            assert!(shown(wrong, "model = 'packed'").is_err(), "{wrong}");
        }
    }
}
