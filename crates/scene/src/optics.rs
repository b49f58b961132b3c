//! How fibres scatter light, as written in TOML: `[optics.YARN]` of fabric files
//! and `[object.optics.YARN]` of scenes, and which of it holds for a material.

use crate::fibre_model;
use organza_basis::{Rgb, nearest_name};
use organza_scatter::flake::band::MIN_GAMMA;
use organza_scatter::{BandProfile, FibreKind, FibreTable, FittedTable, GaussianBand, SineBand};
use organza_transport::FlakeOptics;
use organza_weave::Material;
use serde::Deserialize;
use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Deserializer, MapAccess, SeqAccess, Visitor};
use std::collections::BTreeMap;
use std::fmt;

mod band;

pub use band::{Band, BandTable};

/// Tables by yarn; [`EVERY_YARN`] stands for all.
pub type OpticsFile = BTreeMap<String, OpticsList>;

/// The name under which tables hold for every yarn.
pub const EVERY_YARN: &str = "*";

/// Estimated: the width of the highlight of a dyed staple fibre, about 6
/// degrees, seen as the end-on ratio of its flakes.
const END_ON_RATIO: f32 = 0.1;

/// Estimated: the colour of undyed bleached cloth.
pub const UNDYED: Rgb = Rgb::splat(0.8);

/// Colours of threads count as one up to this difference in a channel, about a
/// step of eight bits.
const SAME_COLOUR: f32 = 0.005;

/// One table, or a list with one table per colour of thread.
#[derive(Clone, Debug, Default)]
pub struct OpticsList(pub(crate) Vec<OpticsTable>);

/// `[optics.YARN]`: micro-flakes read `albedo` and a width, virtual scattering the
/// others. Every key may be left out.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct OpticsTable {
    /// Only threads of this colour; all of the yarn's if none.
    pub thread: Option<[f32; 3]>,
    /// Only fibres of this material in a blend; all of the yarn's if none.
    pub fibre: Option<String>,
    /// Single-scattering albedo of the fibres. Without it the thread's colour
    /// in the draft is taken for the colour of a thick heap of its fibres.
    pub albedo: Option<[f32; 3]>,
    /// Ratio of end-on to broadside extinction of a straight bundle: how rough
    /// single fibres are.
    pub end_on_ratio: Option<f32>,
    /// The same as the width of the Gaussian flakes that have this ratio.
    pub gamma: Option<f32>,
    /// The same as the exponent of the sine-power flakes that have this ratio.
    pub sin_power: Option<f32>,
    /// Index of refraction of the fibres.
    pub ior: Option<f32>,
    /// Colour of a thick heap of the fibres: that of the thread, if none.
    pub colour: Option<[f32; 3]>,
    /// Absorption inside the fibres, instead of `colour`.
    pub absorption_per_mm: Option<[f32; 3]>,
    /// Width of highlights along the fibres.
    pub longitudinal_deg: Option<f32>,
    /// Width of the lobes about the fibres.
    pub azimuthal_deg: Option<f32>,
    /// Outline of the fibres' cross-section, where they are not round.
    pub section: Option<String>,
    /// A fibre fitted to photographs, instead of all that.
    pub fitted: Option<FittedValue>,
    /// A model of fibres of the catalogue, likewise.
    pub model: Option<FibreTable>,
    /// The fibres in the near infrared.
    pub nir: Option<BandTable>,
    /// The fibres under all of the sun's radiation.
    pub solar: Option<BandTable>,
}

/// `fitted`: the name of a preset, or a table.
#[derive(Clone, Debug)]
pub struct FittedValue(pub FittedTable);

impl OpticsTable {
    /// Keys that describe a dielectric fibre, and whether they are given.
    pub fn dielectric_keys(&self) -> [(&'static str, bool); 6] {
        [
            ("ior", self.ior.is_some()),
            ("colour", self.colour.is_some()),
            ("absorption_per_mm", self.absorption_per_mm.is_some()),
            ("longitudinal_deg", self.longitudinal_deg.is_some()),
            ("azimuthal_deg", self.azimuthal_deg.is_some()),
            ("section", self.section.is_some()),
        ]
    }

    /// The model that fibres have instead of the keys of dielectric ones, and its key.
    pub fn own_model(&self) -> Option<(&'static str, &dyn FibreKind)> {
        let fitted = self.fitted.as_ref().map(|value| &value.0 as _);
        let model = self.model.as_ref().map(|table| table as _);
        let fitted = fitted.map(|kind| ("fitted", kind));
        fitted.or(model.map(|kind| ("model", kind)))
    }

    /// This table, and `under` where it is silent. Keys that say the same in
    /// different words give way together.
    fn over(self, under: OpticsTable) -> OpticsTable {
        let widths = [self.end_on_ratio, self.gamma, self.sin_power];
        let width = |under: Option<f32>| under.filter(|_| widths == [None; 3]);
        let dyed = self.colour.is_some() || self.absorption_per_mm.is_some();
        let colour = |under: Option<[f32; 3]>| under.filter(|_| !dyed);
        let dielectric = self.dielectric_keys().iter().any(|k| k.1);
        let fitted = self.own_model().is_some();
        let clear = |under: Option<f32>| under.filter(|_| !fitted);
        let clear3 = |under: Option<[f32; 3]>| under.filter(|_| !fitted);
        OpticsTable {
            thread: None,
            fibre: None,
            albedo: self.albedo.or(under.albedo),
            end_on_ratio: self.end_on_ratio.or(width(under.end_on_ratio)),
            gamma: self.gamma.or(width(under.gamma)),
            sin_power: self.sin_power.or(width(under.sin_power)),
            ior: self.ior.or(clear(under.ior)),
            colour: self.colour.or(clear3(colour(under.colour))),
            absorption_per_mm: self
                .absorption_per_mm
                .or(clear3(colour(under.absorption_per_mm))),
            longitudinal_deg: self.longitudinal_deg.or(clear(under.longitudinal_deg)),
            azimuthal_deg: self.azimuthal_deg.or(clear(under.azimuthal_deg)),
            section: self.section.or(under.section.filter(|_| !fitted)),
            model: self
                .model
                .or(under.model.filter(|_| !dielectric && !fitted)),
            fitted: self
                .fitted
                .or(under.fitted.filter(|_| !dielectric && !fitted)),
            nir: self.nir.or(under.nir),
            solar: self.solar.or(under.solar),
        }
    }

    /// The error is the key at fault, as `.key: what was expected`.
    fn check(&self) -> Result<(), String> {
        let unit = |c: &f32| (0.0..=1.0).contains(c);
        for (key, colour) in [("thread", self.thread), ("albedo", self.albedo)] {
            if let Some(c) = colour.filter(|c| !c.iter().all(unit)) {
                return Err(format!(
                    ".{key}: expected three numbers from 0 to 1, found {c:?}"
                ));
            }
        }
        if let Some(r) = self.end_on_ratio.filter(|r| !unit(r)) {
            return Err(format!(
                ".end_on_ratio: expected a number from 0 to 1, found {r}"
            ));
        }
        let gammas = MIN_GAMMA..=10.0;
        if let Some(g) = self.gamma.filter(|g| !gammas.contains(g)) {
            return Err(format!(
                ".gamma: expected a number from 0.0001 to 10, found {g}"
            ));
        }
        if let Some(p) = self.sin_power.filter(|p| !(0.0..=1e8).contains(p)) {
            return Err(format!(
                ".sin_power: expected a number from 0 to 1e8, found {p}"
            ));
        }
        let widths = [
            ("end_on_ratio", self.end_on_ratio.is_some()),
            ("gamma", self.gamma.is_some()),
            ("sin_power", self.sin_power.is_some()),
        ];
        let mut given = widths.iter().filter(|w| w.1);
        if let (Some(first), Some(second)) = (given.next(), given.next()) {
            return Err(format!(
                ".{}: sets the same property as `{}`; give one of them",
                second.0, first.0
            ));
        }
        for band in [Band::Nir, Band::Solar] {
            let own = self.band(band).map_or(Ok(()), BandTable::check);
            own.map_err(|why| format!(".{}{why}", band.name()))?;
        }
        fibre_model::check(self)
    }

    /// As micro-flakes, of threads of `colour`.
    pub fn flakes(&self, colour: Option<Rgb>) -> FlakeOptics {
        let end_on_ratio = match (self.end_on_ratio, self.gamma, self.sin_power) {
            (Some(ratio), _, _) => ratio,
            (_, Some(gamma), _) => GaussianBand::new(gamma).end_on_ratio(),
            (_, _, Some(power)) => SineBand::new(power).end_on_ratio(),
            _ => END_ON_RATIO,
        };
        FlakeOptics {
            albedo: self
                .albedo
                .map_or_else(|| albedo_for_colour(colour.unwrap_or(UNDYED)), Rgb::from),
            end_on_ratio: end_on_ratio.min(1.0),
        }
    }
}

impl OpticsList {
    /// What holds for a fibre of threads of `colour`: the tables of that fibre and colour over
    /// those of one of them, and these over the others.
    pub(crate) fn of(&self, colour: Option<Rgb>, fibre: Option<&str>) -> OpticsTable {
        let conditions = [2, 1, 0];
        conditions
            .iter()
            .flat_map(|n| self.0.iter().filter(move |t| t.conditions() == *n))
            .filter(|t| t.is_for(colour, fibre))
            .fold(OpticsTable::default(), |sum, t| sum.over(t.clone()))
    }
}

impl OpticsTable {
    /// How many of colour and fibre the table names.
    fn conditions(&self) -> usize {
        usize::from(self.thread.is_some()) + usize::from(self.fibre.is_some())
    }

    /// Whether the colour and the fibre are those that the table names, if any.
    fn is_for(&self, colour: Option<Rgb>, fibre: Option<&str>) -> bool {
        self.is_for_colour(colour) && (self.fibre.is_none() || self.fibre.as_deref() == fibre)
    }

    fn is_for_colour(&self, colour: Option<Rgb>) -> bool {
        match (self.thread, colour) {
            (None, _) => true,
            (Some(_), None) => false,
            (Some(thread), Some(colour)) => {
                let off = (Rgb::from(thread).0 - colour.0).abs().max_element();
                off <= SAME_COLOUR
            }
        }
    }
}

/// What holds for a material: its yarn's tables over those for every yarn, and
/// earlier files over later ones.
pub fn of_material(files: &[OpticsFile], material: &Material) -> OpticsTable {
    files
        .iter()
        .flat_map(|f| [f.get(&material.yarn), f.get(EVERY_YARN)])
        .flatten()
        .fold(OpticsTable::default(), |sum, list| {
            sum.over(list.of(material.colour, material.fibre.as_deref()))
        })
}

/// Checks the tables against the cloth; `more_yarns` are those that threads beside it may have.
///
/// # Errors
/// `.yarn.key: what was expected`, to be put after the name of the section.
pub fn check<'a>(
    file: &OpticsFile,
    materials: &'a [Material],
    more_yarns: impl Iterator<Item = &'a String>,
) -> Result<(), String> {
    let of_cloth = materials.iter().map(|m| &m.yarn);
    let names: Vec<&str> = of_cloth.chain(more_yarns).map(String::as_str).collect();
    for (yarn, list) in file {
        if yarn != EVERY_YARN && !names.contains(&yarn.as_str()) {
            let near = nearest_name(yarn, names.iter().copied())
                .map_or(String::new(), |n| format!("; did you mean `{n}`?"));
            return Err(format!(".{yarn}: no yarn of the cloth has this name{near}"));
        }
        for table in &list.0 {
            table.check().map_err(|why| format!(".{yarn}{why}"))?;
            let of_yarn = || {
                materials
                    .iter()
                    .filter(|m| yarn == EVERY_YARN || m.yarn == *yarn)
            };
            if let Some(fibre) = &table.fibre {
                let mut fibres: Vec<&str> = of_yarn().filter_map(|m| m.fibre.as_deref()).collect();
                if !fibres.contains(&fibre.as_str()) {
                    fibres.sort_unstable();
                    fibres.dedup();
                    let near = nearest_name(fibre, fibres.iter().copied())
                        .map_or(String::new(), |n| format!("; did you mean `{n}`?"));
                    return Err(format!(
                        ".{yarn}.fibre: no `blend` has a fibre `{fibre}`{near}; there are {}",
                        if fibres.is_empty() {
                            "no fibres with names".into()
                        } else {
                            fibres.join(", ")
                        }
                    ));
                }
            }
            if table.thread.is_some() && !of_yarn().any(|m| table.is_for_colour(m.colour)) {
                let mut colours: Vec<String> = of_yarn()
                    .filter_map(|m| m.colour)
                    .map(|c| format!("[{:.3}, {:.3}, {:.3}]", c.0.x, c.0.y, c.0.z))
                    .collect();
                colours.dedup();
                return Err(format!(
                    ".{yarn}.thread: no thread has this colour; there are {}",
                    if colours.is_empty() {
                        "none with colours".into()
                    } else {
                        colours.join(", ")
                    }
                ));
            }
        }
    }
    Ok(())
}

/// The single-scattering albedo at which a half-space of isotropic scatterers
/// has the diffuse albedo `colour`.
///
/// Van de Hulst's fit R = (1 - s)(1 - 0.139 s) / (1 + 1.17 s) with
/// s = sqrt(1 - albedo) [vanDeHulst1980], solved for s.
/// Cloth is neither thick nor isotropic, so this is an estimate of what was
/// dyed, not a fit of a measurement.
pub fn albedo_for_colour(colour: Rgb) -> Rgb {
    let channel = |r: f32| {
        let r = r.clamp(0.0, 1.0);
        // 0.139 s^2 - (1.139 + 1.17 R) s + (1 - R) = 0, the smaller root.
        let b = 1.139 + 1.17 * r;
        let s = (b - (b * b - 4.0 * 0.139 * (1.0 - r)).max(0.0).sqrt()) / (2.0 * 0.139);
        (1.0 - s * s).clamp(0.0, 1.0)
    };
    Rgb::from(<[f32; 3]>::from(colour).map(channel))
}

/// The diffuse albedo of a half-space of isotropic scatterers, the inverse of
/// [`albedo_for_colour`].
fn colour_for_albedo(albedo: Rgb) -> Rgb {
    let channel = |a: f32| {
        let s = (1.0 - a.clamp(0.0, 1.0)).sqrt();
        (1.0 - s) * (1.0 - 0.139 * s) / (1.0 + 1.17 * s)
    };
    Rgb::from(<[f32; 3]>::from(albedo).map(channel))
}

impl<'de> Deserialize<'de> for OpticsList {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<OpticsList, D::Error> {
        struct OneOrMany;
        impl<'de> Visitor<'de> for OneOrMany {
            type Value = OpticsList;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table, or a list of tables with `thread` colours")
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<OpticsList, A::Error> {
                OpticsTable::deserialize(MapAccessDeserializer::new(map))
                    .map(|t| OpticsList(vec![t]))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<OpticsList, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(seq)).map(OpticsList)
            }
        }
        deserializer.deserialize_any(OneOrMany)
    }
}

impl<'de> Deserialize<'de> for FittedValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<FittedValue, D::Error> {
        struct NameOrTable;
        impl<'de> Visitor<'de> for NameOrTable {
            type Value = FittedValue;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("the name of a preset, or a table")
            }
            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<FittedValue, E> {
                Ok(FittedValue(FittedTable {
                    preset: Some(name.to_owned()),
                    ..FittedTable::default()
                }))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<FittedValue, A::Error> {
                FittedTable::deserialize(MapAccessDeserializer::new(map)).map(FittedValue)
            }
        }
        deserializer.deserialize_any(NameOrTable)
    }
}

#[cfg(test)]
mod tests;
