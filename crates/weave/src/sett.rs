//! Threads per centimetre and yarn of a draft that gives none: those of a good cloth.
//!
//! Ashenhurst's rule of diameters and intersections [Ashenhurst1884]: beside every thread there
//! must be room for the crossing threads that pass between it and the next. Over a repeat of `W`
//! threads between which crossing threads pass `I` times, on the average, `W` threads and `I`
//! crossing threads lie side by side at the highest sett, so that threads lie `1 + I / W`
//! diameters apart: two in a plain weave, one and a half in a 2/2 twill, one and a quarter in a
//! satin of eight. Threads of cloth flatten, so that they lie closer by [`CLOSENESS`].

use crate::fit::{Changes, Threads, room_factor};
use crate::layers::{Layers, Sheds};
use crate::spec::YarnSpec;
use crate::yarn::Yarn;
use crate::{Draft, Error, Thread};
use std::sync::Arc;

/// Distance of threads over that of Ashenhurst's rule, which counts with round threads: cloths
/// of the shop are woven at this share of it or above (estimated).
const CLOSENESS: f64 = 0.85;
/// Width over height of the yarn in the cloth (estimated).
const ASPECT: f64 = 1.4;
/// Count of the yarn where the draft gives no distances, g/km: a shirting or a dress.
const USUAL_TEX: f64 = 20.0;
/// Fibres of a yarn at most: thicker yarn gets thicker fibres, so that all can be traced.
const MAX_FIBRES: f64 = 400.0;
/// Count above which cloth is of wool: thicker cotton is seldom spun.
const WOOL_TEX: f64 = 250.0;
/// Distances of threads that are believed, mm.
const BELIEVED_MM: [f64; 2] = [0.02, 6.0];
/// Distances of single threads are kept while they ask for threads that lie at most so much
/// closer than their mean.
const MAX_UNEVEN: f64 = 1.5;

/// What a draft is woven with.
#[derive(Clone, Debug, PartialEq)]
pub struct Sett {
    /// Threads per centimetre of warp and weft, where the draft's own distances are not used.
    pub per_cm: [Option<f64>; 2],
    /// The preset of the yarn, one for all threads.
    pub preset: &'static str,
    /// How it is spun, see [`crate::spinning::NAMES`].
    pub irregularity: &'static str,
    /// Its count, g/km.
    pub tex: f64,
    /// Width over height of its cross-section.
    pub aspect: f64,
    /// Mean radius of its fibres where that is not the preset's, micrometres.
    pub fibre_radius_um: Option<f64>,
}

impl Sett {
    /// The yarn of a count.
    fn yarn(preset: &str, tex: f64) -> Result<Yarn, Error> {
        let spec = YarnSpec {
            preset: Some(preset.to_owned()),
            tex: Some(tex),
            aspect: Some(ASPECT),
            ..YarnSpec::default()
        };
        Yarn::new(preset, &spec)
    }
}

impl Draft {
    /// Distances and yarn that make a good cloth of this draft: its own distances where it gives
    /// them, with a yarn that fits, and otherwise the distances that suit a usual yarn.
    ///
    /// # Errors
    /// No yarn can be made that fits.
    pub fn sett(&self) -> Result<Sett, Error> {
        let layers = [Sheds::Warp(self), Sheds::Weft(self)].map(Layers::new);
        let changes = Changes::of_layers(self, &layers[0], &layers[1]);
        let shares = Changes::mean_shares(&changes);
        // Layers lie over each other.
        let apart = [0, 1].map(|i| CLOSENESS * (1.0 + shares[i]) * layers[i].fullest_share());
        let given = [&self.warp, &self.weft].map(|threads| mean_spacing_mm(threads));
        // The diameter that fills given distances as the rule says.
        let filled: Vec<f64> = given
            .iter()
            .zip(apart)
            .filter_map(|(g, a)| Some((*g)? / a))
            .collect();
        let (preset, tex) = if filled.is_empty() {
            ("cotton", USUAL_TEX)
        } else {
            let room =
                |(given, layers): (Option<f64>, &Layers)| Some(given? / layers.fullest_share());
            let rooms = given.into_iter().zip(&layers).filter_map(room);
            let narrowest = rooms.fold(f64::INFINITY, f64::min);
            let mean = filled.iter().sum::<f64>() / filled.len() as f64;
            let diameter_mm = mean.min(narrowest);
            let count = |preset| -> Result<f64, Error> {
                // The diameter goes with the root of the count.
                let unit_mm = 2.0 * Sett::yarn(preset, 100.0)?.radius_mm();
                Ok(100.0 * (diameter_mm / unit_mm).powi(2))
            };
            match count("cotton")? {
                tex if tex <= WOOL_TEX => ("cotton", tex),
                _ => ("wool", count("wool")?),
            }
        };
        let yarn = Arc::new(Sett::yarn(preset, tex)?);
        let diameter_mm = 2.0 * yarn.radius_mm();
        let mean_mm = [0, 1].map(|i| given[i].unwrap_or(diameter_mm * apart[i]));
        let even = |i: usize, count| vec![mean_mm[i]; count];
        let counts = [self.ends(), self.picks()];
        let needed = |spacings: [Vec<f64>; 2]| {
            let [warp, weft] = spacings;
            let threads = |name, spacing_mm: Vec<f64>, layers: &Layers| {
                let yarns = vec![yarn.clone(); spacing_mm.len()];
                Threads::new(name, spacing_mm, yarns, layers.clone())
            };
            let [warp, weft] = [
                threads("warp", warp, &layers[0]),
                threads("weft", weft, &layers[1]),
            ];
            room_factor(&changes, &warp, &weft)
                .ok_or_else(|| Error::Jammed("no yarn fits the distances of the draft".into()))
        };
        let factor = needed([even(0, counts[0]), even(1, counts[1])])?;
        let own = [&self.warp, &self.weft].map(|threads| own_spacings_mm(threads));
        let uneven = match (&own[0], &own[1]) {
            (Some(warp), Some(weft)) => needed([warp.clone(), weft.clone()]).ok(),
            _ => None,
        };
        let keeps_own = uneven.is_some_and(|u| u <= MAX_UNEVEN * factor);
        let factor = uneven.filter(|_| keeps_own).unwrap_or(factor);
        let is_free = given.iter().all(Option::is_none);
        // A yarn of whole fibres may come out a little thicker.
        let (room, finer) = match (is_free, factor > 1.0) {
            (_, false) => (1.0, 1.0),
            (true, true) => (1.01 * factor, 1.0),
            (false, true) => (1.0, 1.01 * factor),
        };
        let tex = round3(tex / (finer * finer));
        Ok(Sett {
            per_cm: [0, 1].map(|i| (!keeps_own).then(|| round3(10.0 / (room * mean_mm[i])))),
            preset,
            irregularity: match preset {
                "wool" => "worsted wool",
                _ => "ring-spun cotton",
            },
            tex,
            aspect: ASPECT,
            fibre_radius_um: thicker_fibres_um(&Sett::yarn(preset, tex)?),
        })
    }
}

/// The radius with which a yarn has few enough fibres; `None` if it has.
fn thicker_fibres_um(yarn: &Yarn) -> Option<f64> {
    let ratio = yarn.radius_mm() / yarn.fibre_radius_mm;
    let fibres = yarn.fibre_volume_fraction() * ratio * ratio;
    (fibres > MAX_FIBRES).then(|| round3(1e3 * yarn.fibre_radius_mm * (fibres / MAX_FIBRES).sqrt()))
}

/// Three significant digits, downwards: what fits still fits.
fn round3(x: f64) -> f64 {
    let unit = 10f64.powf(x.log10().floor() - 2.0);
    let digits = (2.0 - x.log10().floor()).max(0.0);
    let text = format!("{:.*}", digits as usize, (x / unit).floor() * unit);
    text.parse().unwrap_or(x)
}

/// The distances that a draft gives, if it gives one for every thread and all are believed.
fn own_spacings_mm(threads: &[Thread]) -> Option<Vec<f64>> {
    let believed = |mm: &f64| (BELIEVED_MM[0]..=BELIEVED_MM[1]).contains(mm);
    let each = threads
        .iter()
        .map(|t| t.spacing_mm.map(f64::from).filter(believed));
    each.collect()
}

fn mean_spacing_mm(threads: &[Thread]) -> Option<f64> {
    let given: Vec<f64> = threads
        .iter()
        .filter_map(|t| t.spacing_mm.map(f64::from))
        .filter(|mm| (BELIEVED_MM[0]..=BELIEVED_MM[1]).contains(mm))
        .collect();
    (!given.is_empty()).then(|| given.iter().sum::<f64>() / given.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Cloth, FabricGeometry};

    fn cloth(draft: &Draft, sett: &Sett) -> Cloth {
        let rows: Vec<String> = draft.drawdown().lines().map(|l| format!("{l:?}")).collect();
        let text = format!(
            "draft = {{ drawdown = [{}] }}\nwarp.per_cm = {:?}\nweft.per_cm = {:?}\n\
             [yarn.y]\npreset = {:?}\ntex = {:?}\naspect = {:?}\n",
            rows.join(","),
            sett.per_cm[0].unwrap(),
            sett.per_cm[1].unwrap(),
            sett.preset,
            sett.tex,
            sett.aspect
        );
        let geometry: FabricGeometry = toml::from_str(&text).unwrap();
        let no_files = |_: &str| Err(std::io::ErrorKind::NotFound.into());
        Cloth::build(&geometry, &no_files, 1).unwrap()
    }

    #[test]
    fn named_weaves_become_covered_cloth_and_floats_pack_closer() {
        let mut per_cm = Vec::new();
        for name in ["plain", "twill-2-2", "satin-8-3", "basket-3-3", "twill-7-1"] {
            let draft = Draft::named(name).unwrap();
            let sett = draft.sett().unwrap();
            let cover = cloth(&draft, &sett).figures().cover_factor;
            assert!((0.8..=1.0).contains(&cover), "{name}: {cover}, {sett:?}");
            per_cm.push(sett.per_cm[0].unwrap());
        }
        assert!(per_cm[0] < per_cm[1] && per_cm[1] < per_cm[2], "{per_cm:?}");
    }

    #[test]
    fn a_yarn_fills_the_distances_that_a_draft_gives() {
        for (mm, preset) in [
            (0.1, "cotton"),
            (0.5, "cotton"),
            (2.12, "wool"),
            (5.0, "wool"),
        ] {
            let mut draft = Draft::named("plain").unwrap();
            for thread in draft.warp.iter_mut().chain(&mut draft.weft) {
                thread.spacing_mm = Some(mm);
            }
            let sett = draft.sett().unwrap();
            assert_eq!((sett.preset, sett.per_cm), (preset, [None; 2]), "{mm}");
            let spaced = Sett {
                per_cm: [Some(10.0 / f64::from(mm)); 2],
                ..sett
            };
            let cover = cloth(&draft, &spaced).figures().cover_factor;
            assert!(cover > 0.8, "{mm}: {cover}, {spaced:?}");
        }
    }
}
