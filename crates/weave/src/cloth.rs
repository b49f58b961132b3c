//! A cloth: threads at rest, each a strand of plies and fibres.

mod bending;
mod borders;
mod build;
mod cover;
mod displaced;
mod drawing;
mod exemplar;
mod figures;
mod flattening;
mod heights;
mod import;
mod irregularity;
mod missing;
mod nonwoven;
mod openwork;
mod pile;
mod pills;
mod ply_strands;
mod print;
mod ranges;
mod recolour;
mod repeats;
mod spacing;
mod spun;
mod unravelled;
mod wear;
mod yarn_warnings;
mod yarns;

use crate::Draft;
use crate::Error;
use crate::closure::Closure;
use crate::curve_file::PolyCurve;
use crate::dye::Dye;
use crate::felt::nap_mm;
use crate::knit::Knit;
use crate::neps;
use crate::openings::Openings;
use crate::path::{Hermite, Path};
use crate::pile::Tufts;
use crate::section::ThreadSection;
use crate::strand::Strand;
use crate::sway::Sway;
use crate::yarn::Yarn;
use glam::{DVec3, Vec3};
use organza_basis::{Rgb, Segment, SegmentSource, Tile};
use pills::Pill;
use spun::Spun;
use std::sync::Arc;
use wear::Wear;
use yarns::Materials;

pub use borders::BorderGaps;
pub use build::Loader;
pub use figures::{Figures, NonwovenFigures, OpenworkFigures, PileFigures, SystemFigures};
pub use irregularity::{Irregularity, SystemIrregularity};
pub use pills::PillSpec;
pub use ply_strands::{Plies, PlyStrand};
use print::Print;
pub use print::{PrintImage, PrintMode, PrintSide, PrintSpec};
pub use unravelled::{ThreadSystem, Unravelled};
pub use wear::WearSpec;

/// The properties that determine the optics of a segment.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name of the yarn, as in `[yarn.NAME]`.
    pub yarn: String,
    /// Name of the fibres of a blend of materials.
    pub fibre: Option<String>,
    /// Colour of the thread, when the fabric or the draft gives one.
    pub colour: Option<Rgb>,
    /// Mean fibre radius, millimetres.
    pub fibre_radius_mm: f32,
}

/// The detail of the curves of a cloth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveLevel {
    /// One curve per yarn.
    Yarn,
    /// One curve per ply.
    Ply,
    /// Every fibre.
    Fibre,
}

/// The course of a yarn.
#[derive(Clone, Debug)]
enum Centreline {
    /// Up and down over a straight line.
    Woven {
        curve: Hermite,
        axis: DVec3,
        origin: DVec3,
        sway: Option<Sway>,
    },
    /// A course of loops.
    Knitted { knit: Arc<Knit>, course: usize },
    /// Through given points, not periodic.
    Imported { points: Vec<DVec3>, closed: bool },
    /// Smooth and periodic, through given points.
    Laid { points: Arc<[DVec3]>, period: DVec3 },
    /// A single fibre, unchanged.
    Bare(PolyCurve),
}

/// One thread of the tile.
#[derive(Clone, Debug)]
struct ThreadAtRest {
    line: Centreline,
    /// Index of its kind of yarn.
    yarn: usize,
    /// The yarn as spun: with the mass of this thread.
    spun: Spun,
    dye: Dye,
    section: ThreadSection,
}

/// A piece of cloth that repeats in x and y, or imported curves that do not.
#[derive(Clone, Debug)]
pub struct Cloth {
    draft: Option<Draft>,
    yarns: Vec<Arc<Yarn>>,
    threads: Vec<ThreadAtRest>,
    materials: Vec<Material>,
    pile: Option<pile::Pile>,
    /// What a nonwoven has beside its fibres.
    web: Option<nonwoven::Web>,
    /// How the threads of openwork hold each other.
    net: Option<openwork::Net>,
    tile: Tile,
    print: Option<Arc<Print>>,
    wear: Option<Arc<Wear>>,
    /// Balls of fibre on the faces.
    pills: Arc<[Pill]>,
    /// Where the yarns are not, if any is fulled.
    openings: Option<Arc<Openings>>,
    seed: u64,
    compaction: f64,
    compression: f64,
    warnings: Vec<String>,
}

impl Cloth {
    /// Threads at rest without draft, pile, print and wear.
    fn at_rest(
        yarns: Vec<Arc<Yarn>>,
        threads: Vec<ThreadAtRest>,
        materials: Materials,
        tile: Tile,
    ) -> Cloth {
        Cloth {
            draft: None,
            yarns,
            threads,
            materials: materials.0,
            pile: None,
            web: None,
            net: None,
            tile,
            print: None,
            wear: None,
            pills: Arc::default(),
            openings: None,
            seed: 0,
            compaction: 1.0,
            compression: 0.0,
            warnings: Vec::new(),
        }
    }

    /// The draft of the whole tile, with the colours of its threads; `None`
    /// for knits, openwork, nonwovens and imported curves.
    pub fn draft(&self) -> Option<&Draft> {
        self.draft.as_ref()
    }

    /// What [`Segment::material`] refers to: one per yarn, fibre of a blend and thread colour.
    pub fn materials(&self) -> &[Material] {
        &self.materials
    }

    /// The yarns in use.
    pub fn yarns(&self) -> &[Arc<Yarn>] {
        &self.yarns
    }

    /// Warnings about the description, which was used nevertheless.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The curves of one level; one batch per thread, warp before weft,
    /// courses from the bottom up, then one per column of loops or tuft of the pile, then one per
    /// pill.
    pub fn curves(&self, level: CurveLevel) -> Curves<'_> {
        Curves { cloth: self, level }
    }

    /// Whether colours depend on the place in the cloth.
    fn is_recoloured(&self) -> bool {
        self.print.is_some() || self.wear.is_some()
    }

    /// A segment with the colours of its places: first of the print, then of the wear. The fibres
    /// of pills come from where nothing was rubbed off yet.
    fn emit_recoloured(&self, segment: &Segment, emit: &mut dyn FnMut(&Segment)) {
        let is_of_pill = segment.yarn as usize >= self.whole_batches();
        let mut rub = |s: &Segment| match &self.wear {
            Some(wear) if !is_of_pill => wear.rub(s, emit),
            _ => emit(s),
        };
        match &self.print {
            Some(print) => print.dye(segment, &mut rub),
            None => rub(segment),
        }
    }

    /// Threads and tufts.
    fn whole_batches(&self) -> usize {
        self.threads.len() + self.tufts().map_or(0, |t| t.tufts.len())
    }

    /// The tufts of cut pile.
    fn tufts(&self) -> Option<&Tufts> {
        self.pile.as_ref()?.tufts.as_deref()
    }

    /// The yarns of the threads that consist of fibres, each with the mass of its thread: all but
    /// cut pile, nonwovens and imported fibres.
    fn spun_yarns(&self) -> impl Iterator<Item = &Yarn> {
        let spun = |t: &&ThreadAtRest| !matches!(t.line, Centreline::Bare(_));
        self.threads.iter().filter(spun).map(|t| &*t.spun.yarn)
    }

    /// Refuses neps that are wider than the tile.
    fn check_neps(&self) -> Result<(), Error> {
        self.spun_yarns().try_for_each(|yarn| {
            let widest_mm = 2.0 * neps::reach_mm(yarn);
            self.check_width(|| format!("yarn.{}.neps", yarn.name), "nep", widest_mm)
        })
    }

    /// Refuses a clump of fibres that is wider than the tile: those who look for the fibres of a
    /// place look at its own tile and the neighbouring ones only.
    fn check_width(
        &self,
        key: impl FnOnce() -> String,
        what: &str,
        widest_mm: f64,
    ) -> Result<(), Error> {
        let least_mm = f64::from(self.tile.period_mm().min_element());
        if !self.tile.repeats || widest_mm <= least_mm {
            return Ok(());
        }
        let remedy = match self.web {
            Some(_) => "a larger nonwoven.tile_mm makes",
            None => "more tile.repeats make",
        };
        let message = format!(
            "expected a tile as wide as a {what}, {widest_mm:.2} mm, found {least_mm:.2} mm; \
             {remedy} it wider"
        );
        Err(Error::spec(key(), message))
    }

    /// Finds the openings between the yarns, if any is fulled.
    fn full(&mut self) -> Result<(), Error> {
        let Some(fulled) = self.spun_yarns().find(|y| y.fulling > 0.0) else {
            return Ok(());
        };
        if !self.tile.repeats {
            let key = format!("yarn.{}.fulling", fulled.name);
            let message = "expected a cloth that repeats, as weaves and knits do";
            return Err(Error::spec(key, message));
        }
        let nap_mm = self.spun_yarns().map(nap_mm).fold(0.0, f64::max);
        let openings = Openings::new(self.tile, &|visit| {
            for (batch, thread) in self.threads.iter().enumerate() {
                let path = self.path(thread, CurveLevel::Yarn);
                visit(&self.strand(batch, &path));
            }
        });
        let [low, high] = openings.faces_mm;
        let bounds = &mut self.tile.bounds_mm;
        bounds.min.z = bounds.min.z.min(((low - nap_mm) as f32).next_down());
        bounds.max.z = bounds.max.z.max(((high + nap_mm) as f32).next_up());
        self.openings = Some(Arc::new(openings));
        Ok(())
    }

    /// A thread's centreline in steps short enough for a level.
    fn path(&self, thread: &ThreadAtRest, level: CurveLevel) -> Path {
        let yarn = &*thread.spun.yarn;
        let plies = yarn.ply_twist_rad_per_mm.powi(2) * yarn.ply_centre_mm;
        let twist = match level {
            CurveLevel::Yarn => 0.0,
            CurveLevel::Ply => plies,
            CurveLevel::Fibre => {
                let wander = yarn.wander.map_or(0.0, |w| {
                    BEND_OF_WANDER * w.amplitude * yarn.ply_radius_mm / w.length_mm.powi(2)
                });
                let crimp = yarn.crimp.map_or(0.0, |c| c.bend_per_mm());
                plies + yarn.twist_rad_per_mm.powi(2) * yarn.ply_radius_mm + wander + crimp
            }
        };
        let step = |bend: f64| (8.0 * CHORD_ERROR * yarn.fibre_radius_mm / (bend + twist)).sqrt();
        match &thread.line {
            Centreline::Woven {
                curve,
                axis,
                origin,
                sway,
            } => {
                let bend = curve.max_bend_per_mm();
                let lean = lean(curve, thread.section.highest() * yarn.radius_mm());
                let interval = curve.period_mm() / curve.height_mm.len() as f64;
                let steps = (interval / step(bend)).ceil().clamp(4.0, 4096.0);
                Path::woven(curve, *axis, *origin, steps as usize, lean, sway.as_ref())
            }
            Centreline::Knitted { knit, course } => {
                knit.path(*course, step(knit.bend_per_mm(*course)))
            }
            Centreline::Imported { points, closed } => {
                let period = closed.then_some(DVec3::ZERO);
                Path::through(points, period, step(import::bend_per_mm(points)))
            }
            Centreline::Laid { points, period } => {
                Path::through(points, Some(*period), step(import::bend_per_mm(points)))
            }
            Centreline::Bare(curve) => {
                let points: Vec<DVec3> = curve.points_mm.iter().map(|p| p.as_dvec3()).collect();
                Path::through(&points, curve.closed.then_some(DVec3::ZERO), f64::INFINITY)
            }
        }
    }

    fn strand<'a>(&'a self, batch: usize, path: &'a Path) -> Strand<'a> {
        let thread = &self.threads[batch];
        let yarn = &*thread.spun.yarn;
        let profile = thread.spun.profile.as_deref();
        Strand {
            yarn,
            closure: Closure::of_profile(yarn, profile, path.length_mm()),
            path,
            profile,
            dye: &thread.dye,
            section: &thread.section,
            openings: self.openings.as_deref().filter(|_| yarn.fulling > 0.0),
            seed: (self.seed, batch as u64),
            template: Segment {
                yarn: batch as u32,
                material: thread.dye.main(),
                ..Segment::straight(Vec3::ZERO, Vec3::ZERO, 0.0)
            },
        }
    }
}

/// Brings the segments of fibres that are longer than the tile into it: whoever takes them looks
/// at the neighbouring copies only. Each piece of a fibre is a curve of its own.
struct Wrapped {
    tile: Tile,
    /// The number that the last fibre had, and how far its last segment was shifted.
    last: Option<(u32, Vec3)>,
    pieces: u32,
}

impl Wrapped {
    fn new(tile: Tile) -> Wrapped {
        Wrapped {
            tile,
            last: None,
            pieces: 0,
        }
    }

    fn place(&mut self, s: &Segment) -> Segment {
        if !self.tile.repeats {
            return *s;
        }
        let period = self.tile.period_mm();
        let middle = 0.5 * (s.start_mm + s.end_mm) - self.tile.bounds_mm.min;
        let shift = -((middle.truncate() / period).floor() * period).extend(0.0);
        if self.last.is_some_and(|last| last != (s.fibre, shift)) {
            self.pieces += 1;
        }
        self.last = Some((s.fibre, shift));
        Segment {
            start_mm: s.start_mm + shift,
            end_mm: s.end_mm + shift,
            fibre: self.pieces,
            ..*s
        }
    }
}

/// The curves of a cloth at one level.
#[derive(Clone, Copy, Debug)]
pub struct Curves<'a> {
    cloth: &'a Cloth,
    level: CurveLevel,
}

/// The largest distance between a chord and the fibre, as a share of the fibre's radius.
const CHORD_ERROR: f64 = 0.1;
/// Typical curvature of a fibre that wanders by one unit of length over another, as the spline
/// between independent knots has it.
const BEND_OF_WANDER: f64 = 4.0;
/// Where a yarn bends more sharply than its thickness allows, its cross-sections lean less than
/// the yarn does, so that inner fibres never fold: the curvature that they follow stays below
/// this value over the half-thickness.
const MAX_BEND: f64 = 0.8;

/// The share of a thread's slope by which its sections lean, of which half the height is given.
fn lean(curve: &Hermite, half_height_mm: f64) -> f64 {
    (MAX_BEND / (curve.max_bend_per_mm() * half_height_mm)).min(1.0)
}

impl SegmentSource for Curves<'_> {
    fn tile(&self) -> Tile {
        self.cloth.tile
    }

    fn batch_count(&self) -> usize {
        self.cloth.batch_count()
    }

    fn for_each_in_batch(&self, batch: usize, emit: &mut dyn FnMut(&Segment)) {
        match self.cloth.is_recoloured() {
            true => self.emit_plain(batch, &mut |s| self.cloth.emit_recoloured(s, emit)),
            false => self.emit_plain(batch, emit),
        }
    }

    fn material_count(&self) -> usize {
        self.cloth.materials.len()
    }
}

impl Curves<'_> {
    /// The segments of a thread, without the print.
    fn emit_plain(&self, batch: usize, emit: &mut dyn FnMut(&Segment)) {
        let threads = self.cloth.threads.len();
        if let Some(pill) = batch.checked_sub(self.cloth.whole_batches()) {
            // Pills are neither yarns nor plies.
            if self.level == CurveLevel::Fibre {
                self.cloth.emit_pill(&self.cloth.pills[pill], batch, emit);
            }
            return;
        }
        if let Some((tufts, tuft)) = self.cloth.tufts().zip(batch.checked_sub(threads)) {
            let as_fibres = self.level == CurveLevel::Fibre;
            tufts.emit(tuft, as_fibres, (self.cloth.seed, batch), emit);
            return;
        }
        if let Centreline::Bare(curve) = &self.cloth.threads[batch].line {
            let (yarn, material) = (batch as u32, self.cloth.threads[batch].dye.main());
            let mut wrapped = Wrapped::new(self.cloth.tile);
            curve.for_each_segment(&mut |s| {
                emit(&wrapped.place(&Segment {
                    yarn,
                    material,
                    ..*s
                }))
            });
            return;
        }
        if let Centreline::Imported { .. } = &self.cloth.threads[batch].line {
            let mut wrapped = Wrapped::new(self.cloth.tile);
            return self.emit_strand(batch, &mut |s| emit(&wrapped.place(s)));
        }
        self.emit_strand(batch, emit);
    }

    /// The segments of a thread that is spun of fibres.
    fn emit_strand(&self, batch: usize, emit: &mut dyn FnMut(&Segment)) {
        let path = self.cloth.path(&self.cloth.threads[batch], self.level);
        let strand = self.cloth.strand(batch, &path);
        match self.level {
            CurveLevel::Yarn => strand.emit_yarn(emit),
            CurveLevel::Ply => strand.emit_plies(emit),
            CurveLevel::Fibre => strand.emit_fibres(emit),
        }
    }
}

/// The fibres of the cloth.
impl SegmentSource for Cloth {
    fn tile(&self) -> Tile {
        self.tile
    }

    fn batch_count(&self) -> usize {
        self.whole_batches() + self.pills.len()
    }

    fn for_each_in_batch(&self, batch: usize, emit: &mut dyn FnMut(&Segment)) {
        self.curves(CurveLevel::Fibre)
            .for_each_in_batch(batch, emit);
    }

    fn material_count(&self) -> usize {
        self.materials.len()
    }
}

#[cfg(test)]
mod tests;
