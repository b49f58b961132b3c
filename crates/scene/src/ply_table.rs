//! Corrections of plies, as written in TOML: `[plies.YARN]` of fabric files.

use crate::optics::EVERY_YARN;
use organza_basis::{Rgb, nearest_name};
use organza_scatter::PlyCorrection;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Tables by yarn; [`EVERY_YARN`] stands for all.
pub type PlyFile = BTreeMap<String, PlyTable>;

/// `[plies.YARN]`: what the fibres of the yarn do not settle about its plies. Keys that are left
/// out change nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PlyTable {
    /// Factor of the radius of the plies, [`RADIUS_SCALE`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_scale: Option<f64>,
    /// Factor of how strongly their fibres stop light, [`EXTINCTION_SCALE`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub extinction_scale: Option<f64>,
    /// Factor of the absorption of light that is scattered more than once, of each channel,
    /// [`ABSORPTION_SCALE`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub absorption_scale: Option<[f64; 3]>,
    /// Factor of the odds that light that is scattered more than once goes through a ply,
    /// [`THROUGH_ODDS_SCALE`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub through_odds_scale: Option<f64>,
    /// Deviation of the fibres from their helix, degrees, [`SPREAD_DEG`].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spread_deg: Option<f64>,
}

/// Range of `radius_scale`: thinner plies are yarns of another count, thicker ones fill the
/// cloth.
pub const RADIUS_SCALE: [f64; 2] = [0.5, 2.0];
/// Range of `extinction_scale`.
pub const EXTINCTION_SCALE: [f64; 2] = [0.05, 20.0];
/// Range of `absorption_scale`.
pub const ABSORPTION_SCALE: [f64; 2] = [0.0, 20.0];
/// Range of `through_odds_scale`.
pub const THROUGH_ODDS_SCALE: [f64; 2] = [0.05, 20.0];
/// Range of `spread_deg`: at 45 degrees fibres are nearly without direction.
pub const SPREAD_DEG: [f64; 2] = [0.0, 45.0];

impl PlyTable {
    /// Refuses values out of range.
    fn check(&self) -> Result<(), String> {
        let [r, g, b] = self.absorption_scale.map_or([None; 3], |a| a.map(Some));
        for (key, value, [low, high]) in [
            ("radius_scale", self.radius_scale, RADIUS_SCALE),
            ("extinction_scale", self.extinction_scale, EXTINCTION_SCALE),
            ("absorption_scale", r, ABSORPTION_SCALE),
            ("absorption_scale", g, ABSORPTION_SCALE),
            ("absorption_scale", b, ABSORPTION_SCALE),
            (
                "through_odds_scale",
                self.through_odds_scale,
                THROUGH_ODDS_SCALE,
            ),
            ("spread_deg", self.spread_deg, SPREAD_DEG),
        ] {
            if let Some(value) = value.filter(|v| !(low..=high).contains(v)) {
                return Err(format!(
                    ".{key}: expected a number from {low} to {high}, found {value}"
                ));
            }
        }
        Ok(())
    }

    /// This table, and `under` where it has no value.
    fn over(self, under: PlyTable) -> PlyTable {
        PlyTable {
            radius_scale: self.radius_scale.or(under.radius_scale),
            extinction_scale: self.extinction_scale.or(under.extinction_scale),
            absorption_scale: self.absorption_scale.or(under.absorption_scale),
            through_odds_scale: self.through_odds_scale.or(under.through_odds_scale),
            spread_deg: self.spread_deg.or(under.spread_deg),
        }
    }

    /// The correction of the scattering; the radius is one of the geometry.
    pub fn correction(&self) -> PlyCorrection {
        let none = PlyCorrection::default();
        let or = |value: Option<f64>, none: f32| value.map_or(none, |v| v as f32);
        PlyCorrection {
            extinction: or(self.extinction_scale, none.extinction),
            absorption: self
                .absorption_scale
                .map_or(none.absorption, |a| Rgb::from(a.map(|v| v as f32))),
            through_odds: or(self.through_odds_scale, none.through_odds),
            spread_rad: self
                .spread_deg
                .map_or(none.spread_rad, |deg| deg.to_radians() as f32),
        }
    }
}

/// The table that holds for a yarn.
pub fn of_yarn(file: &PlyFile, yarn: &str) -> PlyTable {
    let table = |name: &str| file.get(name).copied().unwrap_or_default();
    table(yarn).over(table(EVERY_YARN))
}

/// Refuses names of no yarn and values out of range.
///
/// # Errors
/// `.YARN.key: what was expected`.
pub fn check<'a>(file: &PlyFile, yarns: impl Iterator<Item = &'a str>) -> Result<(), String> {
    let yarns: Vec<&str> = yarns.collect();
    for (yarn, table) in file {
        if yarn != EVERY_YARN && !yarns.contains(&yarn.as_str()) {
            let near = nearest_name(yarn, yarns.iter().copied())
                .map_or(String::new(), |n| format!("; did you mean `{n}`?"));
            return Err(format!(".{yarn}: no yarn of the cloth has this name{near}"));
        }
        table.check().map_err(|why| format!(".{yarn}{why}"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> PlyFile {
        toml::from_str(text).unwrap()
    }

    #[test]
    fn a_yarns_table_comes_before_that_of_every_yarn() {
        let file = file(
            "['*']\nextinction_scale = 2.0\nspread_deg = 9.0\n\
             [silk]\nextinction_scale = 0.5\nabsorption_scale = [1.0, 2.0, 3.0]",
        );
        let silk = of_yarn(&file, "silk").correction();
        assert_eq!((silk.extinction, silk.through_odds), (0.5, 1.0));
        assert_eq!(silk.absorption, Rgb::new(1.0, 2.0, 3.0));
        assert!((silk.spread_rad - 9f32.to_radians()).abs() < 4.0 * f32::EPSILON);
        let other = of_yarn(&file, "wool").correction();
        assert_eq!((other.extinction, other.absorption), (2.0, Rgb::WHITE));
        let none = of_yarn(&PlyFile::new(), "wool").correction();
        assert_eq!(none, PlyCorrection::default());
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        for (text, expected) in [
            (
                "[sikl]\nspread_deg = 1.0",
                ".sikl: no yarn of the cloth has this name; did you mean `silk`?",
            ),
            (
                "[silk]\nradius_scale = 3.0",
                ".silk.radius_scale: expected a number from 0.5 to 2, found 3",
            ),
            (
                "['*']\nabsorption_scale = [1.0, -1.0, 1.0]",
                ".*.absorption_scale: expected a number from 0 to 20, found -1",
            ),
            (
                "['*']\nextinction_scale = nan",
                ".*.extinction_scale: expected a number from 0.05 to 20, found NaN",
            ),
        ] {
            let names = ["silk", "wool"].into_iter();
            assert_eq!(check(&file(text), names), Err(expected.to_owned()));
        }
    }
}
