//! Builds threads at rest from a description.

use super::borders::join_at_borders;
use super::displaced::{mark_by_reed, thread_sways};
use super::exemplar::{fit_of_design, needed_room_of_design};
use super::flattening::at_rest;
use super::import::imported;
use super::missing::{self, without_missing};
use super::nonwoven;
use super::openwork;
use super::pile;
use super::repeats::{lcm, repeats, threads};
use super::spacing::{WARP_SPACING, WEFT_SPACING, spacing_mm, spacings_mm};
use super::spun::Spun;
use super::yarns::{Materials, Yarns};
use super::{Centreline, Cloth, ThreadAtRest};
use crate::draft::MAX_THREADS;
use crate::dye::Dye;
use crate::fit::{Threads, fit, needed_room};
use crate::knit::Knit;
use crate::layers::{Layers, Sheds};
use crate::path::Hermite;
use crate::relax::System;
use crate::section::ThreadSection;
use crate::spec::{DraftSpec, FabricGeometry};
use crate::strand::{protruding_mm, reach_mm, thickest_fibre_mm};
use crate::sway::Sway;
use crate::synthesis::Synthesis;
use crate::yarn::Yarn;
use crate::{Draft, Error, Thread};
use glam::{DVec2, DVec3, Vec3};
use organza_basis::{Aabb, Rgb, Tile};
use std::sync::Arc;

/// Loads a file that a fabric names.
pub type Loader<'a> = &'a dyn Fn(&str) -> std::io::Result<Vec<u8>>;

/// The largest number of crossings or loops in a tile: the relaxation takes about 300 bytes for
/// each.
const MAX_IN_TILE: usize = 1 << 22;
/// The largest number of crossings of several layers: up to eight stacked threads at each take
/// about 60 bytes more.
const MAX_IN_LAYERS: usize = 1 << 20;

impl Cloth {
    /// Makes a cloth from its description. `load` fetches the files that the
    /// description names; equal seeds give equal cloths.
    ///
    /// # Errors
    /// When a key of the description cannot be used, a draft cannot be read,
    /// or the threads do not fit.
    pub fn build(fabric: &FabricGeometry, load: Loader, seed: u64) -> Result<Cloth, Error> {
        let d = &fabric.draft;
        if fabric.nonwoven.is_some() {
            let mut cloth = nonwoven::build(fabric, seed)?;
            cloth.warn_of_yarns();
            return Ok(cloth);
        }
        let ways = [
            d.weave.is_some(),
            d.wif.is_some(),
            d.drawdown.is_some(),
            d.knit.is_some(),
            d.openwork.is_some(),
            d.curves.is_some(),
        ];
        if ways.iter().filter(|w| **w).count() != 1 {
            let message = "expected exactly one of weave, wif, drawdown, knit, openwork, curves, or a \
                           [nonwoven] table instead of [draft]";
            return Err(Error::spec("draft", message));
        }
        check_colours("warp", &fabric.warp.colours)?;
        check_colours("weft", &fabric.weft.colours)?;
        if let Some(pile) = &fabric.pile {
            check_colours("pile", &pile.colours)?;
            pile::check(pile)?;
            if d.knit.is_some() || d.openwork.is_some() || d.curves.is_some() {
                let message = "needs a weave: draft.weave, draft.wif or draft.drawdown";
                return Err(Error::spec("pile", message));
            }
        }
        missing::check(fabric)?;
        if fabric.ideal {
            let mut even = fabric.without_irregularity();
            even.ideal = false;
            return Cloth::build(&even, load, seed);
        }
        let mut cloth = match (&d.knit, &d.curves) {
            _ if d.openwork.is_some() => openwork::build(fabric, seed)?,
            (Some(name), _) => knitted(fabric, name, seed)?,
            (_, Some(name)) => imported(fabric, name, load, seed)?,
            _ => woven(fabric, load, seed)?,
        };
        cloth.seed = seed;
        if let Some(spec) = &fabric.pile {
            pile::raise(&mut cloth, fabric, spec, seed)?;
        }
        cloth.check_neps()?;
        cloth.full()?;
        cloth.warn_of_yarns();
        Ok(cloth)
    }
}

/// No fibre reflects more light than it receives.
pub(super) fn check_colours(system: &str, colours: &[Rgb]) -> Result<(), Error> {
    for (i, colour) in colours.iter().enumerate() {
        let channels = <[f32; 3]>::from(*colour);
        if channels.iter().all(|c| (0.0..=1.0).contains(c)) {
            continue;
        }
        // Only values from 0 to 255 can be converted: they were probably meant as sRGB.
        let hint = if channels.iter().all(|c| (0.0..=255.0).contains(c)) {
            let [r, g, b] = channels.map(|c| Rgb::linear_from_srgb(c / 255.0));
            format!("; as sRGB from 0 to 255 this would be [{r:.3}, {g:.3}, {b:.3}]")
        } else {
            String::new()
        };
        let message = format!("expected linear RGB from 0 to 1, found {channels:?}{hint}");
        return Err(Error::spec(format!("{system}.colours[{i}]"), message));
    }
    Ok(())
}

/// Threads that never interlace are seldom intended.
fn warn_of_loose_threads(draft: &Draft, warnings: &mut Vec<String>) {
    let floats = draft.floats();
    for (loose, all, what) in [
        (floats.loose_ends, draft.ends(), "ends"),
        (floats.loose_picks, draft.picks(), "picks"),
    ] {
        if loose > 0 {
            warnings.push(format!(
                "draft: {loose} of {all} {what} never interlace and lie loose on the others"
            ));
        }
    }
}

/// The draft of a whole tile in its colours, and what to warn of. The tile holds whole repeats
/// of `repeat` ends and picks, and at most `most` crossings, or is refused in these words.
pub(super) fn coloured_draft(
    fabric: &FabricGeometry,
    load: Loader,
    repeat: [usize; 2],
    (most, refusal): (usize, &str),
) -> Result<(Draft, Vec<String>), Error> {
    let draft = read_draft(&fabric.draft, load)?;
    let mut warnings = draft.warnings.clone();
    warn_of_loose_threads(&draft, &mut warnings);
    let draft = draft.smallest_repeat();
    let mut yarns = Yarns::new(&fabric.yarn);
    let warp_yarns = yarns.of_system("warp", &fabric.warp)?;
    let weft_yarns = yarns.of_system("weft", &fabric.weft)?;
    let [rx, ry] = repeats(fabric)?;
    let ends = lcm(threads(draft.ends(), &warp_yarns, &fabric.warp), repeat[0]).saturating_mul(rx);
    let picks =
        lcm(threads(draft.picks(), &weft_yarns, &fabric.weft), repeat[1]).saturating_mul(ry);
    if ends > MAX_THREADS || picks > MAX_THREADS || ends * picks > most {
        let message = format!("{ends} ends x {picks} picks {refusal}");
        return Err(Error::spec("tile.repeats", message));
    }
    let mut draft = draft.tiled(ends, picks);
    colour(&mut draft.warp, &fabric.warp.colours);
    colour(&mut draft.weft, &fabric.weft.colours);
    Ok((draft, warnings))
}

fn woven(fabric: &FabricGeometry, load: Loader, seed: u64) -> Result<Cloth, Error> {
    let refusal = format!("in one tile are more than {MAX_IN_TILE} crossings");
    let (draft, warnings) =
        coloured_draft(fabric, load, pile::repeat(fabric), (MAX_IN_TILE, &refusal))?;
    let mut cloth = match without_missing(fabric, &draft)? {
        Some((fabric, rest)) => weave(&fabric, rest, None, seed)?,
        None => weave(fabric, draft, None, seed)?,
    };
    cloth.warnings.splice(0..0, warnings);
    Ok(cloth)
}

/// A thread of a weave in its place.
struct Woven<'a> {
    curve: Hermite,
    axis: DVec3,
    origin: DVec3,
    yarn: usize,
    spun: &'a Spun,
    colour: Option<Rgb>,
    section: ThreadSection,
    sway: Option<Sway>,
}

impl Woven<'_> {
    /// Between which heights its fibres lie, mm.
    fn heights_mm(&self) -> (f64, f64) {
        let yarn = &self.spun.yarn;
        let highest = self.section.highest();
        let body = highest * reach_mm(yarn);
        let hairs = highest * yarn.radius_mm() + protruding_mm(yarn);
        let reach = body.max(hairs) + thickest_fibre_mm(yarn);
        let (low, high) = self.curve.range_mm();
        (low - reach, high + reach)
    }

    fn at_rest(self, dye: Dye) -> ThreadAtRest {
        ThreadAtRest {
            line: Centreline::Woven {
                curve: self.curve,
                axis: self.axis,
                origin: self.origin,
                sway: self.sway,
            },
            yarn: self.yarn,
            spun: self.spun.clone(),
            dye,
            section: self.section,
        }
    }
}

/// A cloth of this very draft. Its threads have the cross-sections that they would have in the
/// cloth of a design, if there is one, and its yarns meet at the borders of its blocks.
pub(super) fn weave(
    fabric: &FabricGeometry,
    draft: Draft,
    design: Option<&Synthesis>,
    seed: u64,
) -> Result<Cloth, Error> {
    let mut warnings = Vec::new();
    let mut yarns = Yarns::new(&fabric.yarn);
    let warp_yarns = yarns.of_system("warp", &fabric.warp)?;
    let weft_yarns = yarns.of_system("weft", &fabric.weft)?;
    let yarns = yarns.built;
    let (ends, picks) = (draft.ends(), draft.picks());
    let warp_mm = spacings_mm("warp", &draft.warp, &fabric.warp, seed, WARP_SPACING)?;
    let weft_mm = spacings_mm("weft", &draft.weft, &fabric.weft, seed, WEFT_SPACING)?;
    // The ends are as long as the picks are wide together.
    let spin = |system: &[usize], threads: usize, along_mm: &[f64], first| {
        let of_thread = (0..threads).map(|i| system[i % system.len()]);
        Spun::system(&yarns, of_thread, along_mm.iter().sum(), seed, first)
    };
    let warp_spun = spin(&warp_yarns, ends, &weft_mm, 0);
    let weft_spun = spin(&weft_yarns, picks, &warp_mm, ends);
    let beside = |name, sheds, spacing_mm: Vec<f64>, spun: &'_ [Spun]| {
        let layers = match design {
            None => Layers::new(sheds),
            // Blocks of a design lie side by side.
            Some(_) => Layers::single(spacing_mm.len()),
        };
        let yarns = spun.iter().map(|s| s.yarn.clone()).collect();
        Threads::new(name, spacing_mm, yarns, layers)
    };
    let warp = beside("warp", Sheds::Warp(&draft), warp_mm, &warp_spun);
    let weft = beside("weft", Sheds::Weft(&draft), weft_mm, &weft_spun);
    if warp.layers.count.max(weft.layers.count) > 1 && ends * picks > MAX_IN_LAYERS {
        let message = format!(
            "{ends} ends x {picks} picks of several layers in one tile are more than \
             {MAX_IN_LAYERS} crossings"
        );
        return Err(Error::spec("tile.repeats", message));
    }
    if fabric.fit_yarn
        && let Some((finer, warning)) = finer_yarns(fabric, &yarns, &warp, &weft, &draft, design)
    {
        let mut cloth = weave(&finer, draft, design, seed)?;
        cloth.warnings.insert(0, warning);
        return Ok(cloth);
    }
    let fitted = match design {
        None => fit(&draft, &warp, &weft)?,
        Some(synthesis) => fit_of_design(&synthesis.design, &warp, &weft)?,
    };
    let threads = [&warp, &weft];
    let (mut warp, mut weft) = (system(&warp, &fitted.warp), system(&weft, &fitted.weft));
    let widths_mm = [
        widths_mm(threads[0], &fitted.warp),
        widths_mm(threads[1], &fitted.weft),
    ];
    mark_by_reed(fabric, &mut warp, &widths_mm[0])?;
    let sways = thread_sways(fabric, [&warp, &weft], widths_mm, seed)?;
    let systems = [&mut warp, &mut weft];
    let max_iterations = fabric.relaxation.max_iterations;
    let mut rest = at_rest(&draft, threads, systems, &fitted, &sways, max_iterations)?;
    if let Some(synthesis) = design {
        join_at_borders(synthesis, &mut rest.relaxed);
    }

    // Less than half a percent would be printed as 100 %.
    if fitted.compaction < 0.995 {
        warnings.push(format!(
            "yarns are pressed to {:.0} % of their thickness so that they fit",
            100.0 * fitted.compaction
        ));
    }
    let of_warp = rest.relaxed.warp.into_iter().zip(rest.warp).enumerate();
    let of_warp = of_warp.map(|(e, (curve, section))| Woven {
        curve,
        axis: DVec3::Y,
        origin: warp.position_mm[e] * DVec3::X,
        yarn: warp_yarns[e % warp_yarns.len()],
        spun: &warp_spun[e],
        colour: draft.warp[e].colour,
        section,
        sway: sways[0].get(e).cloned(),
    });
    let of_weft = rest.relaxed.weft.into_iter().zip(rest.weft).enumerate();
    let of_weft = of_weft.map(|(p, (curve, section))| Woven {
        curve,
        axis: DVec3::X,
        origin: weft.position_mm[p] * DVec3::Y,
        yarn: weft_yarns[p % weft_yarns.len()],
        spun: &weft_spun[p],
        colour: draft.weft[p].colour,
        section,
        sway: sways[1].get(p).cloned(),
    });
    let mut materials = Materials::default();
    let mut placed = Vec::with_capacity(ends + picks);
    let mut heights = (f64::INFINITY, f64::NEG_INFINITY);
    for thread in of_warp.chain(of_weft) {
        let (low, high) = thread.heights_mm();
        heights = (heights.0.min(low), heights.1.max(high));
        let dye = materials.dye(&yarns[thread.yarn], thread.colour)?;
        placed.push(thread.at_rest(dye));
    }
    let tile = tile(warp.period_mm, weft.period_mm, heights);
    Ok(Cloth {
        draft: Some(draft),
        compaction: fitted.compaction,
        compression: rest.relaxed.compression,
        warnings,
        ..Cloth::at_rest(yarns, placed, materials, tile)
    })
}

/// The fabric with yarns that its threads have room for, and what to warn of; `None` where they
/// fit as they are, or no yarn would.
fn finer_yarns(
    fabric: &FabricGeometry,
    yarns: &[Arc<Yarn>],
    warp: &Threads,
    weft: &Threads,
    draft: &Draft,
    design: Option<&Synthesis>,
) -> Option<(FabricGeometry, String)> {
    let room = match design {
        None => needed_room(draft, warp, weft),
        Some(synthesis) => needed_room_of_design(&synthesis.design, warp, weft),
    };
    let factor = room.filter(|room| *room > 1.0)?;
    // A count of whole fibres can come out a little above what was asked for.
    let share = (1.02 * factor).powi(-2);
    let mut finer = fabric.clone();
    finer.fit_yarn = false;
    let mut words = Vec::new();
    for yarn in yarns {
        let spec = finer.yarn.entry(yarn.name.clone()).or_default();
        match &mut spec.fibres_per_ply {
            Some(fibres) => *fibres = ((f64::from(*fibres) * share) as u32).max(1),
            None => spec.tex = Some(yarn.tex() * share),
        }
        if let Some(radius) = &mut spec.ply_radius_mm {
            *radius *= share.sqrt();
        }
        words.push(format!(
            "{} of tex {:.2} for {:.2}",
            yarn.name,
            yarn.tex() * share,
            yarn.tex()
        ));
    }
    let warning = format!("finer yarns, so that they fit: {}", words.join(", "));
    Some((finer, warning))
}

fn knitted(fabric: &FabricGeometry, name: &str, seed: u64) -> Result<Cloth, Error> {
    let draft = &fabric.draft;
    let wale_mm = match draft.wales_per_cm {
        Some(n) if n > 0.0 && n.is_finite() => 10.0 / n,
        found => {
            let found = found.map_or("none".to_owned(), |n| n.to_string());
            let message = format!("a knit needs a number above zero, found {found}");
            return Err(Error::spec("draft.wales_per_cm", message));
        }
    };
    let mut yarns = Yarns::new(&fabric.yarn);
    let course_yarns = yarns.of_system("weft", &fabric.weft)?;
    let yarns = yarns.built;
    let course_mm = spacing_mm("weft", &fabric.weft, None, 0)?;
    let thickest = course_yarns
        .iter()
        .map(|&y| yarns[y].radius_mm())
        .fold(0.0, f64::max);
    let knit = Knit::named(name, wale_mm, course_mm, thickest)?;
    let [rx, ry] = repeats(fabric)?;
    let courses = threads(knit.courses, &course_yarns, &fabric.weft).saturating_mul(ry);
    let wales = knit.wales.saturating_mul(rx);
    if wales > MAX_THREADS || courses > MAX_THREADS || wales * courses > MAX_IN_TILE {
        let message = format!(
            "{wales} wales x {courses} courses in one tile are more than {MAX_IN_TILE} loops"
        );
        return Err(Error::spec("tile.repeats", message));
    }
    let knit = Arc::new(knit.tiled(rx, courses / knit.courses));
    let mut materials = Materials::default();
    let mut placed = Vec::with_capacity(courses);
    let mut reach = 0.0f64;
    for course in 0..courses {
        let yarn = course_yarns[course % course_yarns.len()];
        let colours = &fabric.weft.colours;
        let colour = colours.get(course % colours.len().max(1)).copied();
        let length_mm = knit.path(course, 0.25 * wale_mm).length_mm();
        let spun = Spun::new(&yarns[yarn], length_mm, seed, course);
        let hairs = spun.yarn.radius_mm() + protruding_mm(&spun.yarn);
        let out = reach_mm(&spun.yarn).max(hairs);
        reach = reach.max(out + thickest_fibre_mm(&spun.yarn));
        placed.push(ThreadAtRest {
            line: Centreline::Knitted {
                knit: knit.clone(),
                course,
            },
            yarn,
            spun,
            dye: materials.dye(&yarns[yarn], colour)?,
            section: ThreadSection::even(DVec2::ONE),
        });
    }
    let half = knit.depth_mm() + reach;
    let [width_mm, height_mm] = [wales as f64 * wale_mm, courses as f64 * course_mm];
    let tile = tile(width_mm, height_mm, (-half, half));
    Ok(Cloth::at_rest(yarns, placed, materials, tile))
}

fn tile(width_mm: f64, height_mm: f64, z: (f64, f64)) -> Tile {
    let max = DVec3::new(width_mm, height_mm, z.1);
    Tile {
        bounds_mm: Aabb::new(Vec3::new(0.0, 0.0, z.0 as f32), max.as_vec3()),
        repeats: true,
    }
}

impl Draft {
    /// The draft that a description of a weave names, or the part of it that is asked for.
    ///
    /// # Errors
    /// It names none, or one that cannot be read.
    pub fn of_spec(spec: &DraftSpec, load: Loader) -> Result<Draft, Error> {
        read_draft(spec, load)
    }
}

/// The draft of a description, or the part of it that is asked for.
pub(crate) fn read_draft(spec: &DraftSpec, load: Loader) -> Result<Draft, Error> {
    let whole = whole_draft(spec, load)?;
    let Some(part) = spec.part else {
        return Ok(whole);
    };
    let [end, pick, ends, picks] = part.map(|n| n as usize);
    whole
        .part([end, pick], [ends, picks])
        .map_err(|e| Error::spec("draft.part", e.to_string()))
}

fn whole_draft(spec: &DraftSpec, load: Loader) -> Result<Draft, Error> {
    if let Some(name) = &spec.weave {
        return Draft::named(name);
    }
    let Some(file) = &spec.wif else {
        return Draft::from_drawdown(spec.drawdown.as_deref().unwrap_or_default());
    };
    let (key, name) = ("draft.wif".to_owned(), file.clone());
    match load(file) {
        Ok(bytes) => Draft::from_wif(&bytes).map_err(|why| Error::Draft {
            key,
            name,
            why: Box::new(why),
        }),
        Err(source) => Err(Error::Load { key, name, source }),
    }
}

fn colour(threads: &mut [Thread], colours: &[Rgb]) {
    if !colours.is_empty() {
        for (t, c) in threads.iter_mut().zip(colours.iter().cycle()) {
            t.colour = Some(*c);
        }
    }
}

fn widths_mm(threads: &Threads, flatten: &[DVec2]) -> Vec<f64> {
    let each = threads.yarns.iter().zip(flatten);
    each.map(|(y, f)| 2.0 * y.radius_mm() * f.x).collect()
}

/// The threads of a system with their cross-sections, at their positions.
fn system(threads: &Threads, flatten: &[DVec2]) -> System {
    let each = threads.yarns.iter().zip(flatten);
    System {
        position_mm: threads.position_mm.clone(),
        half_height_mm: each.map(|(y, f)| f.y * y.radius_mm()).collect(),
        stiffness: threads.yarns.iter().map(|y| y.stiffness).collect(),
        period_mm: threads.period_mm(),
        stacked: Vec::new(),
    }
}
