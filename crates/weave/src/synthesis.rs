//! A large design made of a few woven crossings: which exemplar crossing each crossing of the
//! design shows [Zhao2012].
//!
//! What a crossing looks like depends on the interlacing around it, its *window*. The windows
//! that occur in a design are few even if its crossings are many. So a small exemplar cloth is
//! woven in which all of them occur, and every crossing of the design is a copy of a crossing
//! of the exemplar with the same window. The exemplar consists of patches, cut from the design
//! itself or from given weaves; crossings near the edge of a patch have other neighbours than in
//! their source and are not used.

mod patches;
mod window;

pub use window::Window;

use crate::{Draft, Error};
use organza_basis::Rgb;
use patches::{Origin, PATCH, cut_from, cut_from_design};
use serde::Deserialize;
use std::collections::{BTreeMap, HashMap};

/// Pictures of windows in a message.
const MAX_PICTURES: usize = 6;
/// Most crossings of an exemplar cloth.
const MAX_EXEMPLAR_CROSSINGS: u32 = 1 << 20;

/// The `[synthesis]` section of a fabric: the cloth is made of blocks.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct SynthesisSpec {
    /// Crossings along the edge of a window: 3 or 5.
    pub window: u32,
    /// Different blocks for one window, at most: they break repeats.
    pub variants: u32,
    /// Crossings of the exemplar cloth, at most.
    pub exemplar_crossings: u32,
    /// Weaves by name, WIF files, or volumes (`.ovox`) that the exemplar is made of; the design
    /// itself if none.
    pub exemplars: Vec<String>,
}

impl Default for SynthesisSpec {
    fn default() -> SynthesisSpec {
        SynthesisSpec {
            window: 5,
            variants: 4,
            exemplar_crossings: 4096,
            exemplars: Vec::new(),
        }
    }
}

impl SynthesisSpec {
    fn check(&self) -> Result<(), Error> {
        let fail =
            |key: &str, message: String| Err(Error::spec(format!("synthesis.{key}"), message));
        if ![3, 5].contains(&self.window) {
            return fail("window", format!("expected 3 or 5, found {}", self.window));
        }
        if !(1..=64).contains(&self.variants) {
            let message = format!("expected 1 to 64, found {}", self.variants);
            return fail("variants", message);
        }
        let patch = (PATCH * PATCH) as u32;
        if !(patch..=MAX_EXEMPLAR_CROSSINGS).contains(&self.exemplar_crossings) {
            let message = format!(
                "expected {patch} to {MAX_EXEMPLAR_CROSSINGS}, found {}",
                self.exemplar_crossings
            );
            return fail("exemplar_crossings", message);
        }
        Ok(())
    }

    /// Crossings of a window beside its middle.
    fn radius(&self) -> usize {
        (self.window / 2) as usize
    }
}

/// The colours of the threads of a crossing and of those beside it, as numbers of
/// [`Synthesis::warp_colours`] and [`Synthesis::weft_colours`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CrossingColours {
    /// Of the ends before, at and after the crossing.
    pub warp: [u16; 3],
    /// Of the picks before, at and after the crossing.
    pub weft: [u16; 3],
}

/// A given exemplar.
#[derive(Clone, Debug)]
pub struct Exemplar {
    /// How its threads interlace.
    pub draft: Draft,
    /// Where its yarns run, if it is a volume; others are woven.
    pub heights: Option<YarnHeights>,
}

/// Where the yarns of a volume pass from one crossing to the next: height in mm and slope there,
/// by crossing, ends fastest.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct YarnHeights {
    /// Of each end halfway from each pick to the next.
    pub warp: Vec<(f64, f64)>,
    /// Of each pick halfway from each end to the next.
    pub weft: Vec<(f64, f64)>,
}

/// A block: a crossing of the exemplar, in the colours of the design.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CrossingBlock {
    /// End and pick of the exemplar.
    pub place: [usize; 2],
    /// Colours in the design.
    pub colours: CrossingColours,
}

/// The counts that `info` shows.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SynthesisFigures {
    /// Crossings of the design along x and y.
    pub crossings: [usize; 2],
    /// Crossings along the edge of a window.
    pub window: u32,
    /// Different windows in the design.
    pub windows: usize,
    /// Those that the exemplar does not have: their crossings show one whose inner 3 x 3
    /// crossings agree.
    pub replaced_windows: usize,
    /// Crossings of the design with such a window.
    pub replaced_crossings: usize,
    /// Blocks.
    pub blocks: usize,
    /// Those from volumes.
    pub volume_blocks: usize,
    /// Crossings of the exemplar cloth along x and y.
    pub exemplar: [usize; 2],
}

/// A design and the exemplar that it is made of.
#[derive(Clone, Debug)]
pub struct Synthesis {
    /// The design.
    pub design: Draft,
    /// The exemplar, without colours.
    pub exemplar: Draft,
    /// Different colours of the design's ends, and of its picks.
    pub warp_colours: Vec<Option<Rgb>>,
    /// See `warp_colours`.
    pub weft_colours: Vec<Option<Rgb>>,
    /// The blocks.
    pub blocks: Vec<CrossingBlock>,
    /// The block of each crossing of the design, x fastest.
    pub index: Vec<u32>,
    /// Crossings of a window beside its middle.
    pub(crate) radius: usize,
    /// The given exemplars.
    exemplars: Vec<Exemplar>,
    /// Where the patches of the exemplar cloth are from, and how many lie along the x axis.
    origins: Vec<Origin>,
    patches_across: usize,
    figures: SynthesisFigures,
}

impl Synthesis {
    /// Chooses exemplars and blocks for a design. `exemplars` are those that the spec names.
    /// Equal seeds give equal choices.
    ///
    /// # Errors
    /// Values of the spec out of range, a design with more windows than the exemplar has room
    /// for, and given exemplars without a window that the design has.
    pub fn new(
        design: Draft,
        spec: &SynthesisSpec,
        exemplars: Vec<Exemplar>,
        seed: u64,
    ) -> Result<Synthesis, Error> {
        spec.check()?;
        let radius = spec.radius();
        let windows = Windows::of(&design, radius);
        let room = (spec.exemplar_crossings as usize) / (PATCH * PATCH);
        let patches = if exemplars.is_empty() {
            cut_from_design(&design, &windows, radius, room)?
        } else {
            cut_from(&exemplars, radius, room)?
        };
        let variants = spec.variants as usize;
        let found = patches.places_by_window(radius, variants);
        let choices = choices(&design, &windows, &found, variants)?;
        let warp_colours = distinct(design.warp.iter().map(|t| t.colour));
        let weft_colours = distinct(design.weft.iter().map(|t| t.colour));
        let number_of = |all: &[Option<Rgb>], colour: Option<Rgb>| {
            all.iter().position(|c| *c == colour).unwrap_or(0) as u16
        };
        let warp: Vec<u16> = design
            .warp
            .iter()
            .map(|t| number_of(&warp_colours, t.colour))
            .collect();
        let weft: Vec<u16> = design
            .weft
            .iter()
            .map(|t| number_of(&weft_colours, t.colour))
            .collect();
        let around = |all: &[u16], i: usize| {
            let n = all.len();
            [all[(i + n - 1) % n], all[i], all[(i + 1) % n]]
        };
        let (ends, picks) = (design.ends(), design.picks());
        let mut blocks = Vec::new();
        let mut numbers: HashMap<CrossingBlock, u32> = HashMap::new();
        let mut index = Vec::with_capacity(ends * picks);
        let mut replaced_crossings = 0;
        for p in 0..picks {
            for e in 0..ends {
                let choice = &choices[&windows.of_crossing[p * ends + e]];
                replaced_crossings += usize::from(choice.is_replaced);
                let drawn = mix(seed, (p * ends + e) as u64) % choice.places.len() as u64;
                let block = CrossingBlock {
                    place: choice.places[drawn as usize],
                    colours: CrossingColours {
                        warp: around(&warp, e),
                        weft: around(&weft, p),
                    },
                };
                index.push(*numbers.entry(block).or_insert_with(|| {
                    blocks.push(block);
                    blocks.len() as u32 - 1
                }));
            }
        }
        let exemplar = patches.draft()?;
        let figures = SynthesisFigures {
            crossings: [ends, picks],
            window: spec.window,
            windows: choices.len(),
            replaced_windows: choices.values().filter(|c| c.is_replaced).count(),
            replaced_crossings,
            blocks: blocks.len(),
            volume_blocks: 0,
            exemplar: [exemplar.ends(), exemplar.picks()],
        };
        let mut synthesis = Synthesis {
            design,
            exemplar,
            warp_colours,
            weft_colours,
            blocks,
            index,
            radius,
            exemplars,
            origins: patches.origins().to_vec(),
            patches_across: patches.across(),
            figures,
        };
        let of_volumes = synthesis.blocks.iter();
        let of_volumes = of_volumes.filter(|b| synthesis.volume_at(b.place).is_some());
        synthesis.figures.volume_blocks = of_volumes.count();
        Ok(synthesis)
    }

    /// The given exemplar that is a volume, and the crossing of it, which stand at a crossing of
    /// the exemplar cloth; `None` where that is woven.
    pub fn volume_at(&self, [end, pick]: [usize; 2]) -> Option<(usize, [usize; 2])> {
        let patch = pick / PATCH * self.patches_across + end / PATCH;
        let origin = self.origins.get(patch % self.origins.len().max(1))?;
        let Exemplar { draft, heights } = &self.exemplars[origin.exemplar];
        heights.as_ref()?;
        let [first_end, first_pick] = origin.first;
        let place = [
            (first_end + end % PATCH) % draft.ends(),
            (first_pick + pick % PATCH) % draft.picks(),
        ];
        Some((origin.exemplar, place))
    }

    /// Height and slope of the end, or of the pick, of a volume behind a crossing of the exemplar
    /// cloth, or before it; `None` where that is woven.
    pub(crate) fn volume_height(
        &self,
        place: [usize; 2],
        is_warp: bool,
        is_after: bool,
    ) -> Option<(f64, f64)> {
        let (number, [mut end, mut pick]) = self.volume_at(place)?;
        let Exemplar { draft, heights } = &self.exemplars[number];
        let heights = heights.as_ref()?;
        let (ends, picks) = (draft.ends(), draft.picks());
        let all = if is_warp {
            pick = if is_after {
                pick
            } else {
                (pick + picks - 1) % picks
            };
            &heights.warp
        } else {
            end = if is_after {
                end
            } else {
                (end + ends - 1) % ends
            };
            &heights.weft
        };
        all.get(pick * ends + end).copied()
    }

    /// Counts.
    pub fn figures(&self) -> &SynthesisFigures {
        &self.figures
    }
}

/// The windows of all crossings of a draft.
struct Windows {
    /// x fastest.
    of_crossing: Vec<Window>,
}

impl Windows {
    fn of(draft: &Draft, radius: usize) -> Windows {
        let (ends, picks) = (draft.ends(), draft.picks());
        let all = (0..picks).flat_map(|p| (0..ends).map(move |e| (e, p)));
        Windows {
            of_crossing: all
                .map(|(e, p)| Window::around(draft, e, p, radius))
                .collect(),
        }
    }

    /// How often each window occurs, and where first.
    fn counts(&self) -> BTreeMap<Window, (usize, usize)> {
        let mut counts: HashMap<Window, (usize, usize)> = HashMap::new();
        for (i, &window) in self.of_crossing.iter().enumerate() {
            counts.entry(window).or_insert((0, i)).0 += 1;
        }
        counts.into_iter().collect()
    }
}

/// The places of the exemplar that stand for a window.
struct Choice {
    places: Vec<[usize; 2]>,
    is_replaced: bool,
}

/// For each window of the design the places with that window, otherwise those with the same
/// inner 3 x 3 crossings whose windows are most alike.
fn choices(
    design: &Draft,
    windows: &Windows,
    found: &BTreeMap<Window, Vec<[usize; 2]>>,
    variants: usize,
) -> Result<HashMap<Window, Choice>, Error> {
    let mut by_inner: BTreeMap<Window, Vec<Window>> = BTreeMap::new();
    for &window in found.keys() {
        by_inner.entry(window.inner()).or_default().push(window);
    }
    let mut missing: Vec<(Window, usize, usize)> = Vec::new();
    let mut choices = HashMap::new();
    for (window, (count, first)) in windows.counts() {
        if let Some(places) = found.get(&window) {
            let choice = Choice {
                places: places.clone(),
                is_replaced: false,
            };
            choices.insert(window, choice);
            continue;
        }
        let Some(alike) = by_inner.get(&window.inner()) else {
            missing.push((window.inner(), count, first));
            continue;
        };
        let least = alike.iter().map(|w| w.difference(&window)).min();
        let nearest = alike
            .iter()
            .filter(|w| Some(w.difference(&window)) == least);
        let places = nearest.flat_map(|w| &found[w]).take(variants);
        let choice = Choice {
            places: places.copied().collect(),
            is_replaced: true,
        };
        choices.insert(window, choice);
    }
    if missing.is_empty() {
        return Ok(choices);
    }
    Err(not_covered(design, missing))
}

/// The message about windows that no exemplar has, with pictures.
fn not_covered(design: &Draft, missing: Vec<(Window, usize, usize)>) -> Error {
    let mut by_window: BTreeMap<Window, (usize, usize)> = BTreeMap::new();
    for (window, count, first) in missing {
        let entry = by_window.entry(window).or_insert((0, first));
        *entry = (entry.0 + count, entry.1.min(first));
    }
    let mut missing: Vec<_> = by_window.into_iter().collect();
    missing.sort_by_key(|&(window, (count, _))| (std::cmp::Reverse(count), window));
    let mut message = format!(
        "no exemplar has {} of the design's neighbourhoods of 3 x 3 crossings; add an exemplar \
         that has them, or leave exemplars out. The most frequent (X: warp on the face):",
        missing.len()
    );
    for (window, (count, first)) in missing.iter().take(MAX_PICTURES) {
        let (end, pick) = (first % design.ends() + 1, first / design.ends() + 1);
        for (i, row) in window.picture().lines().enumerate() {
            message.push_str("\n  ");
            message.push_str(row);
            if i == 1 {
                message.push_str(&format!(
                    "   at {count} crossings, the first at end {end}, pick {pick}"
                ));
            }
        }
        message.push('\n');
    }
    Error::spec("synthesis.exemplars", message.trim_end().to_owned())
}

fn distinct(all: impl Iterator<Item = Option<Rgb>>) -> Vec<Option<Rgb>> {
    let mut found = Vec::new();
    for colour in all {
        if !found.contains(&colour) {
            found.push(colour);
        }
    }
    found
}

/// A number without visible pattern from a seed and an index (the finaliser of SplitMix64).
fn mix(seed: u64, index: u64) -> u64 {
    let mut z = seed ^ index.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests;
