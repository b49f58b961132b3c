//! Bands of wavelengths beyond the colours, and what fibres do there.

use super::{OpticsTable, albedo_for_colour, colour_for_albedo};
use organza_basis::Rgb;
use serde::Deserialize;

/// A band of wavelengths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Band {
    /// Light, in three channels.
    #[default]
    Visible,
    /// Near infrared, 780 to 2500 nm, weighted as the sun's.
    Nir,
    /// All of the sun's radiation, 300 to 2500 nm.
    Solar,
}

impl Band {
    /// Share of the near infrared in the sun's radiation, as [EnGlazing2011] weighs it (table 2, from
    /// 780 nm on).
    pub const NIR_SHARE: f64 = 0.41;

    /// The key of its table in `[optics.YARN]`, and its name for people.
    pub fn name(self) -> &'static str {
        match self {
            Band::Visible => "visible",
            Band::Nir => "nir",
            Band::Solar => "solar",
        }
    }
}

/// `[optics.YARN.nir]` and `[optics.YARN.solar]`: one of two keys, or both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct BandTable {
    /// Reflectance of a thick heap of the fibres in the band.
    pub colour: Option<f32>,
    /// Single-scattering albedo of the fibres there, for micro-flakes.
    pub albedo: Option<f32>,
}

impl BandTable {
    /// The error is the key at fault, as `.key: what was expected`.
    pub(super) fn check(self) -> Result<(), String> {
        let outside = |v: &f32| !(0.0..=1.0).contains(v);
        for (key, value) in [("colour", self.colour), ("albedo", self.albedo)] {
            if let Some(v) = value.filter(outside) {
                return Err(format!(".{key}: expected a number from 0 to 1, found {v}"));
            }
        }
        match (self.colour, self.albedo) {
            (None, None) => Err(".colour: is missing, as is `albedo`".into()),
            _ => Ok(()),
        }
    }
}

impl OpticsTable {
    /// The table of a band, if it has one.
    pub fn band(&self, band: Band) -> Option<BandTable> {
        match band {
            Band::Visible => None,
            Band::Nir => self.nir,
            Band::Solar => self.solar,
        }
    }

    /// The fibres as the band sees them, grey: as wide, but as bright as the band's table says.
    /// The same table where the band has none.
    pub(crate) fn in_band(self, band: Band) -> OpticsTable {
        let Some(own) = self.band(band) else {
            return self;
        };
        let of_albedo = own.albedo.map(|a| colour_for_albedo(Rgb::splat(a)).0.x);
        let colour = own.colour.or(of_albedo).unwrap_or_default();
        let albedo = own
            .albedo
            .unwrap_or_else(|| albedo_for_colour(Rgb::splat(colour)).0.x);
        OpticsTable {
            albedo: Some([albedo; 3]),
            colour: Some([colour; 3]),
            absorption_per_mm: None,
            fitted: None,
            model: None,
            ..self
        }
    }
}
