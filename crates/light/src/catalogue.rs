//! The kinds of light that a scene file can name, and the `[[light]]` table that
//! names one.
//!
//! A kind is one file, with the type of its table, which implements [`LightKind`],
//! and one line in the list at the end of this file.

use crate::directional::DirectionalTable;
use crate::disc::DiscTable;
use crate::environment::EnvironmentTable;
use crate::light::Light;
use crate::rectangle::RectangleTable;
use crate::spot::SpotTable;
use glam::UVec2;
use organza_basis::Rgb;
use serde::Deserialize;

/// A picture that a light names, decoded.
#[derive(Clone, Debug)]
pub struct LoadedPicture {
    /// Where it is, for messages.
    pub name: String,
    /// Columns and rows.
    pub size: UVec2,
    /// Values in rows from the top.
    pub pixels: Vec<Rgb>,
}

/// Reads the picture of a name in a table; the error is what is wrong with it.
pub type LoadPicture<'a> = dyn Fn(&str) -> Result<LoadedPicture, String> + 'a;

/// Why a `[[light]]` table was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LightError {
    /// A value that the key does not take.
    #[error("{key}: {why}")]
    Value {
        /// The key, or several.
        key: &'static str,
        /// What was expected.
        why: String,
    },
    /// Keys that do not go together.
    #[error("{0}")]
    Keys(String),
}

impl LightError {
    pub(crate) fn of(key: &'static str, why: impl Into<String>) -> LightError {
        let why = why.into();
        LightError::Value { key, why }
    }
}

/// A colour of a table.
pub(crate) fn colour(c: [f32; 3], key: &'static str) -> Result<Rgb, LightError> {
    let c = Rgb::from(c);
    if c.is_valid() {
        return Ok(c);
    }
    let found = c.0.to_array();
    let why = format!("expected three finite numbers of at least 0, found {found:?}");
    Err(LightError::of(key, why))
}

/// The brightest radiance and irradiance that lights may have. Films hold samples below
/// 4.29e9, and a sample may be a few times as bright as what lights it.
pub const MAX_BRIGHTNESS: f32 = 1e9;

/// The message for a light brighter than [`MAX_BRIGHTNESS`].
pub(crate) fn too_bright(found: f32) -> String {
    format!(
        "expected at most {MAX_BRIGHTNESS:e}, the limit of samples, found {found:e}; scale all \
         lights alike and set render.exposure"
    )
}

/// A radiance or an irradiance of a table.
pub(crate) fn brightness(c: [f32; 3], key: &'static str) -> Result<Rgb, LightError> {
    let c = colour(c, key)?;
    if c.max_component() <= MAX_BRIGHTNESS {
        return Ok(c);
    }
    Err(LightError::of(key, too_bright(c.max_component())))
}

/// One kind of light, as a `[[light]]` table describes it. The type's own keys are
/// those of the table.
pub trait LightKind {
    /// Keys of a table that lights a cloth about the origin, as an editor adds it.
    fn example() -> &'static str
    where
        Self: Sized;

    /// The light.
    ///
    /// # Errors
    /// Names the key at fault and its valid values.
    fn build(&self, load: &LoadPicture<'_>) -> Result<Light, LightError>;

    /// Whether light may come from above a height, mm, and from below it.
    fn sides(&self, height_mm: f64) -> [bool; 2];

    /// The file that it names, if any.
    fn file(&self) -> Option<&str> {
        None
    }
}

macro_rules! lights {
    ($($variant:ident($table:ty) = $name:literal,)*) => {
        /// A `[[light]]` table: the key `kind` and the keys of that kind.
        #[derive(Clone, Debug, Deserialize)]
        #[serde(tag = "kind")]
        pub enum LightTable {
            $(
                #[doc = concat!("`kind = \"", $name, "\"`.")]
                #[serde(rename = $name)]
                $variant($table),
            )*
        }

        impl LightTable {
            /// All kinds, as files name them, each with the keys of an
            /// [example](LightKind::example).
            pub fn kinds() -> Vec<(&'static str, &'static str)> {
                vec![$(($name, <$table as LightKind>::example()),)*]
            }

            /// Its kind, as files name it.
            pub fn kind(&self) -> &'static str {
                match self { $(LightTable::$variant(_) => $name,)* }
            }

            fn described(&self) -> &dyn LightKind {
                match self { $(LightTable::$variant(table) => table,)* }
            }
        }
    };
}

impl LightTable {
    /// The light; pictures are read by `load`.
    ///
    /// # Errors
    /// Names the key at fault and its valid values.
    pub fn build(&self, load: &LoadPicture<'_>) -> Result<Light, LightError> {
        self.described().build(load)
    }

    /// Whether light may come from above a height, mm, and from below it.
    pub fn sides(&self, height_mm: f64) -> [bool; 2] {
        self.described().sides(height_mm)
    }

    /// The file that it names, if any.
    pub fn file(&self) -> Option<&str> {
        self.described().file()
    }
}

lights! {
    Directional(DirectionalTable) = "directional",
    Environment(EnvironmentTable) = "environment",
    Rectangle(RectangleTable) = "rectangle",
    Disc(DiscTable) = "disc",
    Spot(SpotTable) = "spot",
}
