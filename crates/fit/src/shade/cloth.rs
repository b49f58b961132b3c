//! The unknowns of a shade, and the keys of a fabric file that they stand for.

use crate::FitJob;
use crate::fibres::{optics_given_way, own_colour, yarns};
use anyhow::Result;
use organza_scene::fabric_file::Fabric;
use organza_scene::file_kind::Wanted;
use organza_scene::representation::FittedOptics;
use organza_weave::Yarn;
use std::sync::Arc;
use toml::{Table, Value};

/// Flattest yarns.
const MOST_ASPECT: f64 = 4.0;
/// How much finer or thicker fibres may be than the fabric's own: six times as many take six times
/// the memory.
const FINEST: f64 = 2.5;

/// What is searched: how wide the yarns are and how much they scatter, against the fabric's own,
/// and the colour of thick heaps of the fibres of each group of yarns.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// Logarithm of the square of the widths' ratio.
    pub width: f64,
    /// Logarithm of the ratio of scattering along a way through the yarn: that of finer fibres of
    /// the same weight.
    pub strength: f64,
    /// By group and channel: logarithm of absorption over scattering.
    pub darkness: Vec<[f64; 3]>,
}

/// Colours that fibres may have.
const COLOURS: [f64; 2] = [0.004, 0.985];

/// The darkness of a thick heap of fibres of a colour, by [KubelkaMunk1931].
pub fn darkness(colour: f64) -> f64 {
    let c = colour.clamp(COLOURS[0], COLOURS[1]);
    ((1.0 - c).powi(2) / (2.0 * c)).ln()
}

/// The inverse.
pub fn colour(darkness: f64) -> f64 {
    let q = darkness.exp();
    (1.0 + q - (q * q + 2.0 * q).sqrt()).clamp(COLOURS[0], COLOURS[1])
}

/// A fabric whose yarns are to be fitted.
pub struct Cloth<'a> {
    args: &'a FitJob,
    fitted: &'static FittedOptics,
    /// Yarns of the fabric, and those that a group of them becomes.
    groups: Vec<Vec<String>>,
    /// A yarn that the weft gets in place of the warp's.
    weft: Option<[String; 2]>,
    /// Yarns as the fabric has them, by name.
    yarns: Vec<Arc<Yarn>>,
    /// Keys that give way.
    pub given_way: Vec<String>,
    own: Table,
    start: Place,
}

impl<'a> Cloth<'a> {
    /// # Errors
    /// Optics that tell threads apart by their colour.
    pub fn new(
        args: &'a FitJob,
        fabric: &Fabric,
        fitted: &'static FittedOptics,
    ) -> Result<Cloth<'a>> {
        let names = yarns(fabric);
        let mut given_way = optics_given_way(args, fitted, &names)?;
        given_way.extend(names.iter().flat_map(|name| {
            // Fibres follow from `tex`, the yarn's size from the fraction.
            ["fibres_per_ply", "ply_radius_mm"].map(|key| format!("yarn.{name}.{key}"))
        }));
        let loader = args.context.loader();
        let own: Table = loader.toml_of(args.fabric_path(), &args.set, Wanted::Fabric)?;
        let [warp, weft] = [&fabric.file.warp.yarn, &fabric.file.weft.yarn];
        let is_woven = fabric.cloth.draft().is_some();
        let all_of = |list: &[String]| names.iter().all(|n| list.contains(n));
        let mut new_weft = None;
        let groups = match (&warp[..], &weft[..]) {
            ([one], [other]) if is_woven && one == other && names.len() == 1 => {
                let new = free_name(&own, one);
                new_weft = Some([one.clone(), new.clone()]);
                vec![vec![one.clone()], vec![new]]
            }
            _ if is_woven && !all_of(warp) && !all_of(weft) => {
                let (first, second): (Vec<_>, Vec<_>) =
                    names.iter().cloned().partition(|n| warp.contains(n));
                vec![first, second]
            }
            _ => vec![names.clone()],
        };
        let heap = |group: &Vec<String>| {
            let name = match &new_weft {
                Some([own, new]) if group[0] == *new => own,
                _ => &group[0],
            };
            own_colour(fabric, name).map(darkness)
        };
        let start = Place {
            width: 0.0,
            strength: 0.0,
            darkness: groups.iter().map(heap).collect(),
        };
        let yarns = fabric.cloth.yarns().iter();
        let yarns = yarns.filter(|y| names.contains(&y.name)).cloned().collect();
        Ok(Cloth {
            args,
            fitted,
            groups,
            weft: new_weft,
            yarns,
            given_way,
            own,
            start,
        })
    }

    /// The fabric as it is.
    pub fn start(&self) -> Place {
        self.start.clone()
    }

    /// Whether warp and weft have colours of their own.
    pub fn has_two_colours(&self) -> bool {
        self.groups.len() > 1
    }

    /// Range of the strength; fibres of blends stay as thick as they are.
    pub fn strengths(&self) -> [f64; 2] {
        if self.yarns.iter().any(|y| y.blends_materials) {
            return [0.0, 0.0];
        }
        [-FINEST.ln(), FINEST.ln()]
    }

    /// Overrides of the fabric file: shapes and colours of its yarns, and under the sun, if `solar`
    /// has the darkness of each group there.
    pub fn keys(&self, place: &Place, solar: Option<&[f64]>) -> Vec<String> {
        let mut keys = self.args.set.clone();
        let ratio = place.width.exp();
        for yarn in &self.yarns {
            let of = |key: &str, value: f64| format!("yarn.{}.{key}={value:?}", yarn.name);
            let flattest = yarn.aspect.max(MOST_ASPECT);
            let aspect = (yarn.aspect * ratio).clamp(yarn.aspect.min(1.0), flattest);
            let heavier = yarn.aspect * ratio / aspect;
            keys.push(of("tex", yarn.tex() * heavier));
            keys.push(of("fibre_volume_fraction", yarn.fibre_volume_fraction()));
            keys.push(of("aspect", aspect));
            if place.strength != 0.0 {
                let radius_um = 1e3 * yarn.fibre_radius_mm / place.strength.exp();
                keys.push(of("fibre_radius_um", radius_um));
            }
        }
        if let Some([own, new]) = &self.weft {
            keys.push(format!("yarn.{new}={}", self.copied("yarn", own)));
            for key in keys.clone() {
                if let Some(rest) = key.strip_prefix(&format!("yarn.{own}.")) {
                    keys.push(format!("yarn.{new}.{rest}"));
                }
            }
            keys.push(format!("weft.yarn={new:?}"));
            keys.push(format!("optics.{new}={}", self.copied("optics", own)));
        }
        for (place_of, group) in self.groups.iter().enumerate() {
            for name in group {
                let heap = place.darkness[place_of].map(colour);
                let (key, value) = (self.fitted.colour)(heap);
                keys.push(format!("optics.{name}.{key}={value}"));
                if let Some(grey) = solar.and_then(|s| s.get(place_of)) {
                    keys.push(format!(
                        "optics.{name}.solar={{ colour = {:?} }}",
                        colour(*grey)
                    ));
                }
            }
        }
        keys
    }

    /// A table of the fabric without the keys that give way, in one line.
    fn copied(&self, section: &str, yarn: &str) -> String {
        let table = self.own.get(section).and_then(|s| s.get(yarn));
        let mut table = table.and_then(Value::as_table).cloned().unwrap_or_default();
        for key in &self.given_way {
            if let Some(key) = key.strip_prefix(&format!("{section}.{yarn}.")) {
                table.remove(key);
            }
        }
        Value::Table(table).to_string()
    }

    /// What the unknowns are called.
    pub fn names(&self) -> Vec<String> {
        self.groups.iter().map(|g| g.join(", ")).collect()
    }
}

/// A name for the yarn of the weft that no yarn has.
fn free_name(own: &Table, yarn: &str) -> String {
    let mut name = format!("{yarn}_weft");
    while own.get("yarn").is_some_and(|y| y.get(&name).is_some()) {
        name.push('_');
    }
    name
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_and_darkness_invert_each_other() {
        for c in [0.01, 0.2, 0.5, 0.9, 0.98] {
            assert!((colour(darkness(c)) - c).abs() < 1e-12, "{c}");
        }
        assert!(darkness(0.1) > darkness(0.2));
        assert_eq!(colour(darkness(1.0)), colour(darkness(0.985)));
    }
}
