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
use crate::spec::{HairinessSpec, YarnSpec};
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
/// Fibres of a yarn at most: thicker yarn gets thicker fibres, so that those of some forty threads
/// of each system can be traced.
const MAX_FIBRES: f64 = 100.0;
/// Count above which cloth is of wool: thicker cotton is seldom spun.
const WOOL_TEX: f64 = 250.0;
/// Distances of threads that are believed, mm.
const BELIEVED_MM: [f64; 2] = [0.02, 6.0];
/// Distances of single threads are kept while they ask for threads that lie at most so much
/// closer than their mean.
const MAX_UNEVEN: f64 = 1.5;

/// Threads are of one yarn while the thickest is at most so much thicker than the finest of them:
/// finer differences are seldom meant.
const ALIKE: f64 = 1.2;
/// Yarns of a draft at most.
const MAX_YARNS: usize = 4;

/// A yarn of a draft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SettYarn {
    /// How thick its finest thread is drawn, mm; 0 of the only yarn.
    pub from_mm: f64,
    /// Its count, g/km.
    pub tex: f64,
    /// Where few fibres stand for many: their mean radius, micrometres, and as many hairs as
    /// cover what those of the thinner fibres would.
    pub thicker: Option<(f64, HairinessSpec)>,
}

/// What a draft is woven with.
#[derive(Clone, Debug, PartialEq)]
pub struct Sett {
    /// Threads per centimetre of warp and weft, where the draft's own distances are not used.
    pub per_cm: [Option<f64>; 2],
    /// The preset of all yarns.
    pub preset: &'static str,
    /// How it is spun, see [`crate::spinning::NAMES`].
    pub irregularity: &'static str,
    /// Width over height of their cross-sections.
    pub aspect: f64,
    /// The yarns, the finest first: one, or as many as the draft has thicknesses where it gives
    /// these and the distances of all threads.
    pub yarns: Vec<SettYarn>,
}

impl Sett {
    /// Which of the yarns a thread of the draft is.
    pub fn yarn_of(&self, thread: &Thread) -> usize {
        which(&self.yarns, thread)
    }

    /// The yarn of a count.
    fn yarn(preset: &str, tex: f64) -> Result<Yarn, Error> {
        Yarn::new(preset, &Sett::spec(preset, tex))
    }

    fn spec(preset: &str, tex: f64) -> YarnSpec {
        YarnSpec {
            preset: Some(preset.to_owned()),
            tex: Some(tex),
            aspect: Some(ASPECT),
            ..YarnSpec::default()
        }
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
        let diameter_mm = 2.0 * Sett::yarn(preset, tex)?.radius_mm();
        let mean_mm = [0, 1].map(|i| given[i].unwrap_or(diameter_mm * apart[i]));
        let systems = [&self.warp, &self.weft];
        // A yarn of whole fibres may come out a little thicker; some threads do by more, for which
        // those of layers, and where distances differ, have no room.
        let is_even =
            |mm: &Vec<f64>| layers.iter().all(|l| l.count == 1) && mm.iter().all(|d| *d == mm[0]);
        let spare = |spacings_mm: &[Vec<f64>; 2]| match spacings_mm.iter().all(is_even) {
            true => 1.01,
            false => 1.15,
        };
        let needed = |spacings_mm: [Vec<f64>; 2], yarns: &[SettYarn]| {
            let built = yarns
                .iter()
                .map(|y| Sett::yarn(preset, y.tex).map(Arc::new));
            let built: Vec<Arc<Yarn>> = built.collect::<Result<_, Error>>()?;
            let threads = |name, spacing_mm, i: usize| {
                let yarns = systems[i].iter().map(|t| built[which(yarns, t)].clone());
                Threads::new(name, spacing_mm, yarns.collect(), layers[i].clone())
            };
            let spare = spare(&spacings_mm);
            let [warp, weft] = spacings_mm.map(|mut mm| {
                mm.iter_mut().for_each(|mm| *mm /= spare);
                mm
            });
            room_factor(
                &changes,
                &threads("warp", warp, 0),
                &threads("weft", weft, 1),
            )
            .ok_or_else(|| Error::Jammed("no yarn fits the distances of the draft".into()))
        };
        let one = SettYarn {
            from_mm: 0.0,
            tex,
            thicker: None,
        };
        let even = [0, 1].map(|i| vec![mean_mm[i]; systems[i].len()]);
        let factor = needed(even, &[one])?;
        let own = systems.map(|threads| own_spacings_mm(threads));
        let mut kept = None;
        if let [Some(warp), Some(weft)] = own {
            let mut choices = of_thicknesses(self, one).into_iter().chain([vec![one]]);
            kept = choices.find_map(|yarns| {
                let uneven = needed([warp.clone(), weft.clone()], &yarns).ok()?;
                (uneven <= MAX_UNEVEN * factor).then_some((uneven, yarns))
            });
        }
        let keeps_own = kept.is_some();
        let (factor, mut yarns) = kept.unwrap_or((factor, vec![one]));
        let is_free = given.iter().all(Option::is_none);
        let (room, finer) = match is_free {
            true => (factor, 1.0),
            false => (1.0, factor),
        };
        let irregularity = match preset {
            "wool" => "worsted wool",
            _ => "ring-spun cotton",
        };
        for yarn in &mut yarns {
            yarn.tex = round3(yarn.tex / (finer * finer));
            yarn.thicker = thicker_fibres(preset, irregularity, yarn.tex)?;
        }
        Ok(Sett {
            per_cm: [0, 1].map(|i| (!keeps_own).then(|| round3(10.0 / (room * mean_mm[i])))),
            preset,
            irregularity,
            aspect: ASPECT,
            yarns,
        })
    }
}

/// A yarn for each thickness of a draft's threads, the finest first, where `mean` is that of their
/// mean thickness. `None` where they are alike or not all given.
fn of_thicknesses(draft: &Draft, mean: SettYarn) -> Option<Vec<SettYarn>> {
    let all = draft.warp.iter().chain(&draft.weft);
    let all = all.map(|t| t.thickness_mm.map(f64::from));
    let mut mm: Vec<f64> = all.collect::<Option<_>>()?;
    mm.sort_by(f64::total_cmp);
    if !(mm[0] >= BELIEVED_MM[0] && mm[mm.len() - 1] <= BELIEVED_MM[1]) {
        return None;
    }
    let mean_mm = |mm: &[f64]| mm.iter().sum::<f64>() / mm.len() as f64;
    let mut yarns = Vec::new();
    let mut left = &mm[..];
    while let Some(&from_mm) = left.first() {
        let (alike, thicker) = left.split_at(left.partition_point(|t| *t <= ALIKE * from_mm));
        yarns.push(SettYarn {
            from_mm,
            tex: mean.tex * (mean_mm(alike) / mean_mm(&mm)).powi(2),
            ..mean
        });
        left = thicker;
    }
    (2..=MAX_YARNS).contains(&yarns.len()).then_some(yarns)
}

/// Which of the yarns a thread is.
fn which(yarns: &[SettYarn], thread: &Thread) -> usize {
    let mm = thread.thickness_mm.map_or(0.0, f64::from);
    let finer = yarns.iter().take_while(|yarn| yarn.from_mm <= mm);
    finer.count().saturating_sub(1)
}

/// The fibres with which a yarn has few enough; `None` if it has.
fn thicker_fibres(
    preset: &str,
    irregularity: &str,
    tex: f64,
) -> Result<Option<(f64, HairinessSpec)>, Error> {
    let spun = YarnSpec {
        irregularity: Some(irregularity.to_owned()),
        ..Sett::spec(preset, tex)
    };
    let yarn = Yarn::new(preset, &spun)?;
    let ratio = yarn.radius_mm() / yarn.fibre_radius_mm;
    let fibres = yarn.fibre_volume_fraction() * ratio * ratio;
    let thicker = (fibres / MAX_FIBRES).sqrt();
    Ok(yarn.hairiness.filter(|_| thicker > 1.0).map(|hairs| {
        let hairs = HairinessSpec {
            index: round3(hairs.index / thicker),
            ..hairs
        };
        (round3(1e3 * yarn.fibre_radius_mm * thicker), hairs)
    }))
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
    use organza_basis::PathRng;
    use std::fmt::Write as _;

    fn cloth(draft: &Draft, sett: &Sett) -> Cloth {
        let rows: Vec<String> = draft.drawdown().lines().map(|l| format!("{l:?}")).collect();
        let text = format!(
            "draft = {{ drawdown = [{}] }}\nwarp.per_cm = {:?}\nweft.per_cm = {:?}\n\
             [yarn.y]\npreset = {:?}\ntex = {:?}\naspect = {:?}\n",
            rows.join(","),
            sett.per_cm[0].unwrap(),
            sett.per_cm[1].unwrap(),
            sett.preset,
            sett.yarns[0].tex,
            sett.aspect
        );
        let geometry: FabricGeometry = toml::from_str(&text).unwrap();
        let no_files = |_: &str| Err(std::io::ErrorKind::NotFound.into());
        Cloth::build(&geometry, &no_files, 1).unwrap()
    }

    /// The cloth of a draft that gives the distances of its threads, read from a file.
    fn of_file(draft: &Draft, sett: &Sett) -> Cloth {
        let mut wif = format!(
            "[WIF]\nVersion=1.1\n[WEAVING]\nShafts={}\nTreadles={}\nRising Shed=true\n",
            draft.ends(),
            draft.picks()
        );
        for (name, threads) in [("WARP", &draft.warp), ("WEFT", &draft.weft)] {
            let _ = writeln!(
                wif,
                "[{name}]\nThreads={}\nUnits=centimeters",
                threads.len()
            );
            let _ = writeln!(wif, "[{name} SPACING]");
            for (i, thread) in threads.iter().enumerate() {
                let _ = writeln!(wif, "{}={:.5}", i + 1, thread.spacing_mm.unwrap() / 10.0);
            }
        }
        wif += "[THREADING]\n";
        for e in 1..=draft.ends() {
            let _ = writeln!(wif, "{e}={e}");
        }
        wif += "[LIFTPLAN]\n";
        for p in 0..draft.picks() {
            let up = (0..draft.ends()).filter(|e| draft.warp_up(*e, p));
            let up: Vec<String> = up.map(|e| (e + 1).to_string()).collect();
            let _ = writeln!(wif, "{}={}", p + 1, up.join(","));
        }
        let mut text = format!(
            "draft = {{ wif = \"d.wif\" }}\n[yarn.y]\npreset = {:?}\ntex = {:?}\naspect = {:?}\n\
             irregularity = {:?}\n",
            sett.preset, sett.yarns[0].tex, sett.aspect, sett.irregularity
        );
        if let Some((um, _)) = sett.yarns[0].thicker {
            let _ = writeln!(text, "fibre_radius_um = {um:?}");
        }
        for (name, per_cm) in ["warp", "weft"].into_iter().zip(sett.per_cm) {
            if let Some(per_cm) = per_cm {
                let _ = write!(text, "[{name}]\nper_cm = {per_cm:?}\n");
            }
        }
        let geometry: FabricGeometry = toml::from_str(&text).unwrap();
        Cloth::build(&geometry, &|_: &str| Ok(wif.clone().into_bytes()), 1).unwrap()
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

    /// Threadings that wander over the shafts make long floats, and threads that lie side by side
    /// or loose.
    #[test]
    fn wandering_twills_become_cloth() {
        for seed in 0..organza_testing::sized(4u64, 12) {
            let mut rng = PathRng::new(seed, 0, 0);
            let shafts = 3 + rng.below(12) as usize;
            let lifted = 1 + rng.below(shafts as u32 - 1) as usize;
            let mut walk = |n: usize| {
                let mut at = 0;
                let step = |_| {
                    at += if rng.below(2) == 0 { 1 } else { shafts - 1 };
                    at % shafts
                };
                (0..n).map(step).collect::<Vec<_>>()
            };
            let (shaft, treadle) = (walk(24), walk(150));
            let draft = Draft::from_fn(shaft.len(), treadle.len(), |e, p| {
                (shaft[e] + shafts - treadle[p]) % shafts < lifted
            });
            let draft = draft.unwrap();
            let cover = cloth(&draft, &draft.sett().unwrap()).figures().cover_factor;
            assert!(cover > 0.6, "seed {seed}: {cover}");
        }
    }

    #[test]
    fn threads_drawn_thick_and_fine_are_two_yarns() {
        let mut draft = Draft::named("plain").unwrap().tiled(4, 4);
        for (i, thread) in draft.warp.iter_mut().chain(&mut draft.weft).enumerate() {
            let mm = if i % 2 == 0 { 0.3 } else { 0.6 };
            (thread.thickness_mm, thread.spacing_mm) = (Some(mm), Some(1.3 * mm));
        }
        let sett = draft.sett().unwrap();
        let [fine, thick] = sett.yarns[..] else {
            panic!("{sett:?}");
        };
        assert!((3.8..4.2).contains(&(thick.tex / fine.tex)), "{sett:?}");
        assert_eq!([0, 1].map(|i| sett.yarn_of(&draft.warp[i])), [0, 1]);
        // Without distances they could not lie where they fit.
        draft.warp[0].spacing_mm = None;
        assert_eq!(draft.sett().unwrap().yarns.len(), 1);
    }

    /// Distances that differ, and layers, leave single threads less room than the mean has.
    #[test]
    fn uneven_threads_and_layers_are_given_a_yarn_that_fits() {
        for weave in ["plain", "twill-2-2", "double-plain-5-4", "weft-backed-8-3"] {
            for seed in 0..6u64 {
                let mut rng = PathRng::new(seed, 0, 0);
                let mut draft = Draft::named(weave).unwrap();
                let scale = 0.1 * 40f64.powf(f64::from(rng.unit()));
                for thread in draft.warp.iter_mut().chain(&mut draft.weft) {
                    let mm = scale * (1.0 + 0.4 * f64::from(rng.unit()));
                    thread.spacing_mm = Some(mm as f32);
                }
                let sett = draft.sett().unwrap();
                let cover = of_file(&draft, &sett).figures().cover_factor;
                assert!(cover > 0.7, "{weave}, seed {seed}: {cover}, {sett:?}");
            }
        }
    }

    #[test]
    fn coarse_yarn_has_few_fibres() {
        for mm in [0.2, 1.0, 5.0] {
            let mut draft = Draft::named("plain").unwrap();
            for thread in draft.warp.iter_mut().chain(&mut draft.weft) {
                thread.spacing_mm = Some(mm);
            }
            let sett = draft.sett().unwrap();
            let spec = Sett::spec(sett.preset, sett.yarns[0].tex);
            let thicker = sett.yarns[0].thicker;
            let spec = YarnSpec {
                fibre_radius_um: thicker.map(|(um, _)| um),
                irregularity: Some(sett.irregularity.into()),
                ..spec
            };
            let yarn = Yarn::new("y", &spec).unwrap();
            let ratio = yarn.radius_mm() / yarn.fibre_radius_mm;
            let fibres = yarn.fibre_volume_fraction() * ratio * ratio;
            assert!(fibres < 1.05 * MAX_FIBRES, "{mm} mm: {fibres}");
            assert!(thicker.is_some() || fibres > 20.0, "{mm} mm: {fibres}");
        }
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
