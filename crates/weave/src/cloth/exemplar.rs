//! The exemplar cloth of a design that is made of blocks.

use super::build::{check_colours, colour, read_draft, warn_of_loose_threads, weave};
use super::repeats::{lcm, repeats, threads};
use super::yarns::Yarns;
use super::{Centreline, Cloth, Loader};
use crate::fit::{Fit, Threads, fit};
use crate::path::Hermite;
use crate::relax::Relaxed;
use crate::spec::{FabricGeometry, ThreadSetSpec};
use crate::synthesis::{Synthesis, SynthesisSpec};
use crate::{Draft, Error};
use std::collections::HashMap;

/// How well yarns go on across the borders of blocks, over all borders of a design.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct BorderGaps {
    /// Borders between two crossings that a yarn passes.
    pub borders: usize,
    /// Root mean square and greatest distance of the two ends of a yarn at a border, mm.
    pub position_rms_mm: f64,
    /// See `position_rms_mm`.
    pub position_max_mm: f64,
    /// The same of the angle between the tangents, radians.
    pub tangent_rms_rad: f64,
    /// See `tangent_rms_rad`.
    pub tangent_max_rad: f64,
}

impl Cloth {
    /// Chooses the blocks of a design and weaves the exemplar cloth that holds them. `load`
    /// fetches the files that the description and `spec` name.
    ///
    /// Where yarns pass from one crossing to the next, their heights and slopes are the means
    /// over all places of the exemplar with the same interlacing around the border. The windows
    /// of both crossings contain that interlacing, so that the blocks of two neighbours meet
    /// without a gap wherever both show their own windows.
    ///
    /// # Errors
    /// As [`Cloth::build`] and [`Synthesis::new`], and for what blocks cannot show: knits,
    /// curves, pile, several yarns or varying distances in a system.
    pub fn build_exemplar(
        fabric: &FabricGeometry,
        spec: &SynthesisSpec,
        load: Loader,
        seed: u64,
    ) -> Result<(Cloth, Synthesis), Error> {
        if fabric.ideal {
            let mut even = fabric.without_irregularity();
            even.ideal = false;
            return Cloth::build_exemplar(&even, spec, load, seed);
        }
        check(fabric)?;
        let mut even = fabric.clone();
        let (design, warnings) = design(&mut even, load)?;
        let exemplars: Vec<Draft> = spec
            .exemplars
            .iter()
            .map(|name| exemplar(name, load))
            .collect::<Result<_, _>>()?;
        let synthesis = Synthesis::new(design, spec, &exemplars, seed)?;
        let mut draft = synthesis.exemplar.clone();
        // Every colour occurs, so that the cloth has all materials of the design.
        for (threads, colours) in [
            (&mut draft.warp, &synthesis.warp_colours),
            (&mut draft.weft, &synthesis.weft_colours),
        ] {
            if colours.len() > threads.len() {
                let message = format!(
                    "the design has {} colours in one system of threads, its exemplar {} threads; \
                     allow more crossings",
                    colours.len(),
                    threads.len()
                );
                return Err(Error::spec("synthesis.exemplar_crossings", message));
            }
            for (thread, colour) in threads.iter_mut().zip(colours.iter().cycle()) {
                thread.colour = *colour;
            }
        }
        let mut cloth = weave(&even, draft, Some(&synthesis), seed)?;
        cloth.seed = seed;
        cloth.warnings.splice(0..0, warnings);
        let figures = synthesis.figures();
        if figures.replaced_crossings > 0 {
            let count = figures.crossings[0] * figures.crossings[1];
            cloth.warnings.push(format!(
                "synthesis: {} of {} windows, at {} of {count} crossings, are shown by windows of \
                 which the inner 3 x 3 crossings agree; more exemplar_crossings reduce them",
                figures.replaced_windows, figures.windows, figures.replaced_crossings
            ));
        }
        cloth.warn_of_yarns();
        for thread in &cloth.threads {
            let yarn = &*thread.spun.yarn;
            let several = |n: usize| n > 1;
            let dyed = yarn.ring_dye.is_some() || !yarn.blend.is_empty();
            if dyed
                && (several(synthesis.warp_colours.len()) || several(synthesis.weft_colours.len()))
            {
                let message = "ring_dye and blend do not go with threads of several colours in a \
                               cloth of blocks";
                return Err(Error::spec(format!("yarn.{}", yarn.name), message));
            }
        }
        Ok((cloth, synthesis))
    }

    /// The material in the design's cloth of a part of a block of this exemplar, which has
    /// `material` and belongs to thread `yarn`.
    pub fn block_material(
        &self,
        synthesis: &Synthesis,
        block: usize,
        yarn: u32,
        material: u16,
    ) -> u16 {
        let block = &synthesis.blocks[block];
        let (ends, picks) = (synthesis.exemplar.ends(), synthesis.exemplar.picks());
        let thread = yarn as usize;
        let (at, from, n, colours, all) = if thread < ends {
            let colours = &block.colours.warp;
            (
                thread,
                block.place[0],
                ends,
                colours,
                &synthesis.warp_colours,
            )
        } else {
            let colours = &block.colours.weft;
            (
                thread - ends,
                block.place[1],
                picks,
                colours,
                &synthesis.weft_colours,
            )
        };
        if all.len() < 2 {
            return material;
        }
        // Threads farther away than the next take its colour.
        let beside = match (at + n - from) % n {
            0 => 1,
            d if d <= n / 2 => 2,
            _ => 0,
        };
        let colour = all[usize::from(colours[beside])];
        let name = &self.materials[usize::from(material)].yarn;
        let found = self
            .materials
            .iter()
            .position(|m| m.yarn == *name && m.colour == colour);
        found.map_or(material, |m| m as u16)
    }

    /// The gaps of yarns at the borders of the blocks of a design that is made from this
    /// exemplar.
    pub fn border_gaps(&self, synthesis: &Synthesis) -> BorderGaps {
        let (ends, picks) = (synthesis.design.ends(), synthesis.design.picks());
        let exemplar_ends = synthesis.exemplar.ends();
        let curve = |thread: usize| match &self.threads[thread].line {
            Centreline::Woven { curve, .. } => Some(curve),
            _ => None,
        };
        let place = |e: usize, p: usize| {
            let number = synthesis.index[p % picks * ends + e % ends];
            synthesis.blocks[number as usize].place
        };
        let mut gaps = BorderGaps::default();
        let mut add = |before: Option<(f64, f64)>, after: Option<(f64, f64)>| {
            let (Some(a), Some(b)) = (before, after) else {
                return;
            };
            let position = (a.0 - b.0).abs();
            let angle = (a.1.atan() - b.1.atan()).abs();
            gaps.borders += 1;
            gaps.position_rms_mm += position * position;
            gaps.tangent_rms_rad += angle * angle;
            gaps.position_max_mm = gaps.position_max_mm.max(position);
            gaps.tangent_max_rad = gaps.tangent_max_rad.max(angle);
        };
        for p in 0..picks {
            for e in 0..ends {
                let ([end, pick], [_, above], [right, _]) =
                    (place(e, p), place(e, p + 1), place(e + 1, p));
                let [next_end, _] = place(e, p + 1);
                let [_, next_pick] = place(e + 1, p);
                add(
                    curve(end).map(|c| after(c, pick)),
                    curve(next_end).map(|c| before(c, above)),
                );
                add(
                    curve(exemplar_ends + pick).map(|c| after(c, end)),
                    curve(exemplar_ends + next_pick).map(|c| before(c, right)),
                );
            }
        }
        let count = gaps.borders.max(1) as f64;
        gaps.position_rms_mm = (gaps.position_rms_mm / count).sqrt();
        gaps.tangent_rms_rad = (gaps.tangent_rms_rad / count).sqrt();
        gaps
    }
}

/// The knot halfway to the crossing after `i`.
fn knot_after(i: usize) -> usize {
    2 * i + 1
}

/// The knot halfway to the crossing before `i`.
fn knot_before(curve: &Hermite, i: usize) -> usize {
    let knots = curve.height_mm.len();
    (2 * i + knots - 1) % knots
}

fn after(curve: &Hermite, i: usize) -> (f64, f64) {
    let k = knot_after(i);
    (curve.height_mm[k], curve.slope[k])
}

fn before(curve: &Hermite, i: usize) -> (f64, f64) {
    let k = knot_before(curve, i);
    (curve.height_mm[k], curve.slope[k])
}

/// Gives yarns the same height and slope at all borders of blocks around which the interlacing
/// is the same: the means.
pub(super) fn join_at_borders(synthesis: &Synthesis, relaxed: &mut Relaxed) {
    let draft = &synthesis.exemplar;
    let (ends, picks) = (draft.ends(), draft.picks());
    let radius = synthesis.radius;
    // The crossings that the windows on both sides of a border share.
    let shared = |end: usize, pick: usize, along_warp: bool| -> u32 {
        let (width, height) = if along_warp {
            (2 * radius + 1, 2 * radius)
        } else {
            (2 * radius, 2 * radius + 1)
        };
        let first_end = end + ends * radius - radius + usize::from(!along_warp);
        let first_pick = pick + picks * radius - radius + usize::from(along_warp);
        let mut bits = 0;
        for p in 0..height {
            for e in 0..width {
                bits = bits << 1 | u32::from(draft.warp_up(first_end + e, first_pick + p));
            }
        }
        bits
    };
    // Thread, knot and kind of every border of a block that is in use.
    let mut borders: Vec<(bool, usize, usize, u32)> = Vec::new();
    for block in &synthesis.blocks {
        let [end, pick] = block.place;
        let (below, left) = ((pick + picks - 1) % picks, (end + ends - 1) % ends);
        borders.push((true, end, knot_after(pick), shared(end, pick, true)));
        borders.push((true, end, knot_after(below), shared(end, below, true)));
        borders.push((false, pick, knot_after(end), shared(end, pick, false)));
        borders.push((false, pick, knot_after(left), shared(left, pick, false)));
    }
    borders.sort_unstable();
    borders.dedup();
    let mut sums: HashMap<(bool, u32), (f64, f64, f64)> = HashMap::new();
    for &(is_warp, thread, knot, kind) in &borders {
        let system = if is_warp {
            &relaxed.warp
        } else {
            &relaxed.weft
        };
        let curve = &system[thread];
        let sum = sums.entry((is_warp, kind)).or_default();
        sum.0 += curve.height_mm[knot];
        sum.1 += curve.slope[knot];
        sum.2 += 1.0;
    }
    for (is_warp, thread, knot, kind) in borders {
        let (height, slope, count) = sums[&(is_warp, kind)];
        let system = if is_warp {
            &mut relaxed.warp
        } else {
            &mut relaxed.weft
        };
        let curve = &mut system[thread];
        curve.height_mm[knot] = height / count;
        curve.slope[knot] = slope / count;
    }
}

/// Cross-sections of the exemplar's threads: those that the threads of the design have.
pub(super) fn fit_of_design(design: &Draft, warp: &Threads, weft: &Threads) -> Result<Fit, Error> {
    let like = |threads: &Threads, count: usize| Threads {
        name: threads.name,
        spacing_mm: vec![threads.spacing_mm[0]; count],
        yarns: vec![threads.yarns[0].clone(); count],
    };
    let fitted = fit(
        design,
        &like(warp, design.ends()),
        &like(weft, design.picks()),
    )?;
    Ok(Fit {
        warp: vec![fitted.warp[0]; warp.yarns.len()],
        weft: vec![fitted.weft[0]; weft.yarns.len()],
        compaction: fitted.compaction,
    })
}

/// Refuses what a cloth of blocks cannot show.
fn check(fabric: &FabricGeometry) -> Result<(), Error> {
    check_colours("warp", &fabric.warp.colours)?;
    check_colours("weft", &fabric.weft.colours)?;
    let draft = &fabric.draft;
    let ways = [
        draft.weave.is_some(),
        draft.wif.is_some(),
        draft.drawdown.is_some(),
    ];
    let is_woven = ways.iter().filter(|w| **w).count() == 1;
    let other = [&draft.knit, &draft.curves]
        .into_iter()
        .any(Option::is_some);
    if !is_woven || other || draft.openwork.is_some() || fabric.nonwoven.is_some() {
        let message = "a cloth of blocks needs exactly one of weave, wif, drawdown";
        return Err(Error::spec("draft", message));
    }
    if fabric.pile.is_some() {
        return Err(Error::spec("pile", "does not go with [synthesis]"));
    }
    for (system, spec) in [("warp", &fabric.warp), ("weft", &fabric.weft)] {
        let refused = [
            ("yarn", spec.yarn.len() > 1, "one yarn"),
            (
                "spacing_cv_percent",
                spec.spacing_cv_percent.is_some_and(|cv| cv != 0.0),
                "threads at equal distances",
            ),
            (
                "reed_dents",
                spec.reed_dents.is_some(),
                "threads at equal distances",
            ),
            ("wander", spec.wander.is_some(), "straight threads"),
        ];
        if let Some((key, _, needed)) = refused.iter().find(|r| r.1) {
            let message = format!("[synthesis] needs {needed}; leave this key out");
            return Err(Error::spec(format!("{system}.{key}"), message));
        }
    }
    Ok(())
}

/// The design in its colours, and what to warn of. Distances that the draft gives become the
/// fabric's own.
fn design(fabric: &mut FabricGeometry, load: Loader) -> Result<(Draft, Vec<String>), Error> {
    let draft = read_draft(&fabric.draft, load)?;
    let mut warnings = draft.warnings.clone();
    warn_of_loose_threads(&draft, &mut warnings);
    let draft = draft.smallest_repeat();
    let mut yarns = Yarns::new(&fabric.yarn);
    let warp = yarns.of_system("warp", &fabric.warp)?;
    let weft = yarns.of_system("weft", &fabric.weft)?;
    let [rx, ry] = repeats(fabric)?;
    let ends = lcm(threads(draft.ends(), &warp, &fabric.warp), 1).saturating_mul(rx);
    let picks = lcm(threads(draft.picks(), &weft, &fabric.weft), 1).saturating_mul(ry);
    let most = crate::draft::MAX_THREADS;
    if ends > most || picks > most || ends * picks > crate::draft::MAX_CROSSINGS {
        let message = format!("{ends} ends x {picks} picks are more than a design may have");
        return Err(Error::spec("tile.repeats", message));
    }
    let mut draft = draft.tiled(ends, picks);
    colour(&mut draft.warp, &fabric.warp.colours);
    colour(&mut draft.weft, &fabric.weft.colours);
    for (name, threads, spec) in [
        ("warp", &draft.warp, &mut fabric.warp),
        ("weft", &draft.weft, &mut fabric.weft),
    ] {
        if let Some(warning) = take_spacing(name, threads, spec) {
            warnings.push(warning);
        }
    }
    Ok((draft, warnings))
}

/// Sets the distance of threads to the mean that the draft gives, if the fabric gives none.
fn take_spacing(name: &str, threads: &[crate::Thread], spec: &mut ThreadSetSpec) -> Option<String> {
    if spec.per_cm.is_some() || spec.spacing_mm.is_some() {
        return None;
    }
    let given: Vec<f64> = threads
        .iter()
        .filter_map(|t| t.spacing_mm)
        .map(f64::from)
        .collect();
    if given.len() < threads.len() {
        // Whoever needs the distance reports that it is missing.
        return None;
    }
    let mean = given.iter().sum::<f64>() / given.len() as f64;
    spec.spacing_mm = Some(mean);
    let is_even = given.iter().all(|s| (s / mean - 1.0).abs() < 1e-3);
    (!is_even).then(|| {
        format!(
            "{name}: the draft's distances vary; a cloth of blocks has their mean, {mean:.4} mm"
        )
    })
}

/// A weave by name, or the draft of a WIF file.
fn exemplar(name: &str, load: Loader) -> Result<Draft, Error> {
    let key = "synthesis.exemplars";
    let is_file = name.to_ascii_lowercase().ends_with(".wif");
    let draft = if is_file {
        match load(name) {
            Ok(bytes) => Draft::from_wif(&bytes),
            Err(source) => {
                return Err(Error::Load {
                    key: key.into(),
                    name: name.into(),
                    source,
                });
            }
        }
    } else {
        Draft::named(name)
    };
    draft.map_err(|why| Error::Draft {
        key: key.into(),
        name: name.into(),
        why: Box::new(why),
    })
}
