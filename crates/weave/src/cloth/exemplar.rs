//! The exemplar cloth of a design that is made of blocks.

use super::build::{check_colours, coloured_draft, weave};
use super::{Cloth, Loader};
use crate::draft::MAX_CROSSINGS;
use crate::fit::{Fit, Threads, fit, needed_room};
use crate::layers::Layers;
use crate::spec::{FabricGeometry, ThreadSetSpec};
use crate::synthesis::{Exemplar, Synthesis, SynthesisSpec};
use crate::{Draft, Error};
use std::collections::HashMap;

impl Cloth {
    /// Chooses the blocks of a design and weaves the exemplar cloth that holds them. `load`
    /// fetches the files that the description and `spec` name; `volumes` are those of the
    /// exemplars that are volumes, by name. In their place the cloth is woven, too.
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
        volumes: &HashMap<String, Exemplar>,
        load: Loader,
        seed: u64,
    ) -> Result<(Cloth, Synthesis), Error> {
        if fabric.ideal {
            let mut even = fabric.without_irregularity();
            even.ideal = false;
            return Cloth::build_exemplar(&even, spec, volumes, load, seed);
        }
        check(fabric)?;
        let mut even = fabric.clone();
        let (design, warnings) = design(&mut even, load)?;
        let exemplars: Vec<Exemplar> = spec
            .exemplars
            .iter()
            .map(|name| match volumes.get(name) {
                Some(volume) => Ok(volume.clone()),
                None => exemplar(name, load).map(|draft| Exemplar {
                    draft,
                    heights: None,
                }),
            })
            .collect::<Result<_, _>>()?;
        let synthesis = Synthesis::new(design, spec, exemplars, seed)?;
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
        cloth.check_neps()?;
        cloth.full()?;
        cloth.warn_of_yarns();
        for thread in &cloth.threads {
            let yarn = &*thread.spun.yarn;
            let several = |n: usize| n > 1;
            let flecked = yarn.neps.as_ref().is_some_and(|n| !n.colours.is_empty());
            let dyed = yarn.ring_dye.is_some() || !yarn.blend.is_empty() || flecked;
            if dyed
                && (several(synthesis.warp_colours.len()) || several(synthesis.weft_colours.len()))
            {
                let message = "ring_dye, blend and neps of other colours do not go with threads of \
                               several colours in a cloth of blocks";
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
}

/// Cross-sections of the exemplar's threads: those that the threads of the design have.
pub(super) fn fit_of_design(design: &Draft, warp: &Threads, weft: &Threads) -> Result<Fit, Error> {
    let [all_warp, all_weft] = threads_of_design(design, warp, weft);
    let fitted = fit(design, &all_warp, &all_weft)?;
    Ok(Fit {
        warp: vec![fitted.warp[0]; warp.yarns.len()],
        weft: vec![fitted.weft[0]; weft.yarns.len()],
        compaction: fitted.compaction,
    })
}

/// See [`needed_room`].
pub(super) fn needed_room_of_design(design: &Draft, warp: &Threads, weft: &Threads) -> Option<f64> {
    let [all_warp, all_weft] = threads_of_design(design, warp, weft);
    needed_room(design, &all_warp, &all_weft)
}

/// As many threads as the design has, each like the first of the exemplar.
fn threads_of_design(design: &Draft, warp: &Threads, weft: &Threads) -> [Threads; 2] {
    [(warp, design.ends()), (weft, design.picks())].map(|(threads, count)| {
        let spacing_mm = vec![threads.spacing_mm[0]; count];
        let yarns = vec![threads.yarns[0].clone(); count];
        Threads::new(threads.name, spacing_mm, yarns, Layers::single(count))
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
            ("missing", !spec.missing.is_empty(), "all threads"),
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
    let most = (MAX_CROSSINGS, "are more than a design may have");
    let (draft, mut warnings) = coloured_draft(fabric, load, [1, 1], most)?;
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
