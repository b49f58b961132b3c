//! The surface models that a fabric file can name, and the `[surface]` section
//! that names one.
//!
//! A model is one file, with a type that describes it and implements
//! [`SurfaceKind`], and one line in the list at the end of this file.

use crate::diffuse::DiffuseSpec;
use crate::error::Error;
use crate::spec::SurfaceSpec;
use glam::Vec2;
use organza_scatter::Surface;
use organza_weave::Cloth;
use serde::de::value::MapAccessDeserializer;
use serde::de::{DeserializeOwned, DeserializeSeed, Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::any::Any;
use std::fmt;

/// The surface of one cloth, with its position on the cloth.
pub struct ClothSurface {
    /// The model, in its own coordinates.
    pub surface: Box<dyn Surface>,
    /// The position of the cloth's origin in those coordinates, mm.
    pub origin_mm: Vec2,
    /// The longer side of one repeat, mm. Wider footprints see the mean.
    pub repeat_mm: f32,
}

/// One surface model, as a `[surface]` section describes it. The fields of the type are the
/// keys of the section.
pub trait SurfaceKind: DeserializeOwned + Clone + fmt::Debug + PartialEq + 'static {
    /// Its name in the key `model`.
    const NAME: &'static str;

    /// The surface of a cloth.
    ///
    /// # Errors Names the first key that is missing or out of range, or gives the reason why
    /// the model does not suit the cloth.
    fn of_cloth(&self, cloth: &Cloth) -> Result<ClothSurface, Error>;

    /// The longer side of one repeat of the surface of a cloth, mm, without the surface.
    ///
    /// # Errors
    /// Those of [`SurfaceKind::of_cloth`] that need no surface to be found.
    fn repeat_mm(&self, cloth: &Cloth) -> Result<f32, Error>;
}

macro_rules! surface_models {
    ($($variant:ident($spec:ty),)*) => {
        /// A `[surface]` section: the key `model` and the keys of that model. A
        /// section without `model` describes an `irawan` surface.
        #[derive(Clone, Debug, PartialEq)]
        // A cloth has one of them, so the unused memory of a small variant does not matter.
        #[allow(clippy::large_enum_variant)]
        pub enum SurfaceTable {
            $(#[doc = concat!("See [`", stringify!($spec), "`].")] $variant($spec),)*
        }

        /// The names alone.
        const NAMES: &[&str] = &[$(<$spec>::NAME,)*];

        impl SurfaceTable {
            /// The name of its model.
            pub fn name(&self) -> &'static str {
                match self { $(SurfaceTable::$variant(_) => <$spec>::NAME,)* }
            }

            /// The description, if it is that of a model `K`.
            pub fn described_as<K: SurfaceKind>(&self) -> Option<&K> {
                match self {
                    $(SurfaceTable::$variant(spec) => (spec as &dyn Any).downcast_ref(),)*
                }
            }

            /// The surface of a cloth.
            ///
            /// # Errors
            /// As [`SurfaceKind::of_cloth`].
            pub fn of_cloth(&self, cloth: &Cloth) -> Result<ClothSurface, Error> {
                match self { $(SurfaceTable::$variant(spec) => spec.of_cloth(cloth),)* }
            }

            /// The longer side of one repeat of the surface of a cloth, mm.
            ///
            /// # Errors
            /// As [`SurfaceKind::repeat_mm`].
            pub fn repeat_mm(&self, cloth: &Cloth) -> Result<f32, Error> {
                match self { $(SurfaceTable::$variant(spec) => spec.repeat_mm(cloth),)* }
            }

            fn read<'de, D: Deserializer<'de>>(model: &str, keys: D) -> Result<Self, D::Error> {
                $(if model == <$spec>::NAME {
                    return <$spec>::deserialize(keys).map(SurfaceTable::$variant);
                })*
                Err(D::Error::unknown_variant(model, NAMES))
            }
        }
    };
}

impl Default for SurfaceTable {
    fn default() -> SurfaceTable {
        SurfaceTable::Irawan(SurfaceSpec::default())
    }
}

impl<'de> Deserialize<'de> for SurfaceTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<SurfaceTable, D::Error> {
        deserializer.deserialize_map(ByModel)
    }
}

/// Finds the model before it reads the other keys, so that errors in these keep line and
/// column. TOML tables are visited in the order of their keys, so only keys before `model` have
/// to be kept.
struct ByModel;

impl<'de> Visitor<'de> for ByModel {
    type Value = SurfaceTable;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<SurfaceTable, A::Error> {
        const KEY: &str = "model";
        let (mut kept, mut model, mut next) = (Vec::new(), None, None);
        while let Some(key) = map.next_key::<String>()? {
            if key == KEY {
                model = Some(map.next_value::<String>()?);
                break;
            }
            if key.as_str() > KEY {
                next = Some(key);
                break;
            }
            kept.push((key, map.next_value::<toml::Value>()?));
        }
        let rest = Rest {
            kept: kept.into_iter(),
            value: None,
            next,
            map,
        };
        let model = model.as_deref().unwrap_or(SurfaceSpec::NAME);
        SurfaceTable::read(model, MapAccessDeserializer::new(rest))
    }
}

/// A table from which some entries have already been read.
struct Rest<A> {
    kept: std::vec::IntoIter<(String, toml::Value)>,
    /// The value of the kept key that was just returned.
    value: Option<toml::Value>,
    /// A key whose value is still in `map`.
    next: Option<String>,
    map: A,
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for Rest<A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, A::Error> {
        let key = match self.kept.next() {
            Some((key, value)) => {
                self.value = Some(value);
                key
            }
            None => match self.next.take() {
                Some(key) => key,
                None => return self.map.next_key_seed(seed),
            },
        };
        let key = serde::de::value::StringDeserializer::<A::Error>::new(key);
        seed.deserialize(key).map(Some)
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, A::Error> {
        match self.value.take() {
            Some(value) => seed.deserialize(value).map_err(A::Error::custom),
            None => self.map.next_value_seed(seed),
        }
    }
}

surface_models! {
    Irawan(SurfaceSpec),
    Diffuse(DiffuseSpec),
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::Rgb;

    fn read(text: &str) -> Result<SurfaceTable, toml::de::Error> {
        toml::from_str(text)
    }

    #[test]
    fn a_section_without_a_model_is_read_as_before() {
        let text = "accuracy = 0.01\npreset = \"denim\"\n[warp]\npsi_deg = 3.0\n";
        let spec = SurfaceSpec::from_toml(text).unwrap();
        assert_eq!(spec.accuracy, Some(0.01));
        assert_eq!(read(text).unwrap(), SurfaceTable::Irawan(spec.clone()));
        let named = format!("model = \"irawan\"\n{text}");
        assert_eq!(read(&named).unwrap(), SurfaceTable::Irawan(spec));
    }

    #[test]
    fn a_model_reads_its_own_keys() {
        let text = "model = \"diffuse\"\nreflectance = [0.5, 0.4, 0.3]\nopenness = 0.1\n";
        let spec = DiffuseSpec {
            reflectance: Rgb::new(0.5, 0.4, 0.3),
            openness: 0.1,
            ..DiffuseSpec::default()
        };
        assert_eq!(read(text).unwrap(), SurfaceTable::Diffuse(spec));
    }

    #[test]
    fn mistakes_keep_their_place() {
        let text = "preset = \"denim\"\n[warp]\npsi_dg = 3.0\n";
        let e = read(text).unwrap_err();
        assert!(e.message().contains("unknown field `psi_dg`"), "{e}");
        assert_eq!(e.span().map(|s| s.start), text.find("psi_dg"));
        let e = read("model = \"difuse\"\n").unwrap_err();
        assert!(e.message().contains("`irawan` or `diffuse`"), "{e}");
        let e = read("model = \"diffuse\"\npreset = \"denim\"\n").unwrap_err();
        assert!(e.message().contains("unknown field `preset`"), "{e}");
    }

    #[test]
    fn names_are_unique() {
        for (i, name) in NAMES.iter().enumerate() {
            assert!(!NAMES[i + 1..].contains(name), "{name}");
        }
    }
}
