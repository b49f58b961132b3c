//! The figures by which textile engineers describe a cloth.

use super::bending::{bending_length_mm, fibre_rigidity_n_mm2, rigidity_un_m};
use super::cover::{cover_factor, openness};
use super::nonwoven::Web;
use super::pile::{Pile, loop_cover};
use super::{Centreline, Cloth, CurveLevel, ThreadAtRest};
use crate::closure::Closure;
use crate::curve_file::PolyCurve;
use crate::openwork::OpenworkKind;
use crate::pile::Tufts;
use crate::spec::PileKind;
use crate::yarn::Yarn;
use organza_basis::Segment;
use std::f64::consts::PI;

/// Figures of one system of threads, means over its threads in the tile.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct SystemFigures {
    /// Threads per centimetre: ends, picks or courses.
    pub threads_per_cm: f64,
    /// Linear density of the yarn, grams per kilometre.
    pub tex: f64,
    /// Crimp: by how much the yarn is longer than the cloth that it runs through, per cent.
    pub crimp_percent: f64,
    /// Share of the cloth's surface that the threads cover: the mean over their length of the
    /// union of their widths.
    pub cover_factor: f64,
    /// Mean width and height of the yarn's cross-section, millimetres.
    pub width_mm: f64,
    /// See `width_mm`.
    pub height_mm: f64,
    /// Flexural rigidity per width of the cloth where it bends along these threads, of woven
    /// threads, estimated from their fibres: uN m.
    pub bending_rigidity_un_m: Option<f64>,
    /// The same as the bending length of the cantilever test, millimetres.
    pub bending_length_mm: Option<f64>,
}

/// Figures of the pile.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct PileFigures {
    /// Kind of pile.
    pub kind: PileKind,
    /// Mean height of tips, or of the centres of loops at their tops, above the ground's face,
    /// millimetres.
    pub height_mm: f64,
    /// Tufts or loops per square centimetre.
    pub tufts_per_cm2: f64,
    /// Fibre ends per square millimetre; 0 of loops.
    pub tips_per_mm2: f64,
    /// Length of pile yarn in a tuft or loop, its share of the ground included, millimetres.
    pub yarn_per_tuft_mm: f64,
    /// Length of a pile end over the length of the cloth: the pile ratio of a terry.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pile_ratio: Option<f64>,
    /// Share of the face that the yarns of loops hide from above.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub loop_cover: Option<f64>,
    /// Mass of the pile per area.
    pub areal_density_g_per_m2: f64,
}

/// Figures of a net or gauze.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct OpenworkFigures {
    /// Kind of openwork.
    pub kind: OpenworkKind,
    /// Ends per centimetre; rows of holes of a bobbinet, picks of a leno, per centimetre.
    pub ends_per_cm: f64,
    /// See `ends_per_cm`.
    pub rows_per_cm: f64,
    /// Holes per square centimetre.
    pub holes_per_cm2: f64,
    /// Length of thread around a hole, millimetres.
    pub thread_per_hole_mm: f64,
    /// By how much threads that touch still reach into each other, as a mean share of the sum
    /// of their radii, and the largest such share.
    pub overlap: f64,
    /// See `overlap`.
    pub greatest_overlap: f64,
}

/// Figures of a nonwoven.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct NonwovenFigures {
    /// Distance of the heights between which 98 % of the fibres' length lies, millimetres.
    pub thickness_mm: f64,
    /// Share of the volume between those heights that is fibre.
    pub fill: f64,
    /// Mean of the outer product of the fibres' direction with itself over their length: xx, yy
    /// (machine direction), zz, xy. The first three sum to 1.
    pub orientation_tensor: [f64; 4],
    /// Component yy over xx.
    pub anisotropy: f64,
    /// Fibres in the tile, and their mean length, millimetres.
    pub fibres: usize,
    /// See `fibres`.
    pub mean_length_mm: f64,
    /// Punches of needles per square centimetre.
    pub punches_per_cm2: f64,
    /// Share of the fibres' length in the tufts of punches, per cent.
    pub carried_percent: f64,
    /// Bonding points per square centimetre.
    pub bonding_points_per_cm2: f64,
    /// By how much touching fibres still reach into each other outside bonding points, as a mean
    /// share of the sum of their radii.
    pub overlap: f64,
}

/// Figures of a cloth. Hairs, neps and pills are left out.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Figures {
    /// Size of the tile, millimetres.
    pub tile_mm: [f64; 2],
    /// Warp of a woven cloth.
    pub warp: Option<SystemFigures>,
    /// Weft of a woven cloth, courses of a knit.
    pub weft: Option<SystemFigures>,
    /// Loops per centimetre and millimetres of yarn per loop, of a knit.
    pub wales_per_cm: Option<f64>,
    /// See `wales_per_cm`.
    pub loop_length_mm: Option<f64>,
    /// The pile of a cloth that has one. `thickness_mm`, `areal_density_g_per_m2` and the
    /// lengths include it; covers, `warp` and `weft` are those of the ground.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pile: Option<PileFigures>,
    /// The meshes of a net or gauze.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub openwork: Option<OpenworkFigures>,
    /// The fibres of a nonwoven.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nonwoven: Option<NonwovenFigures>,
    /// Share of the surface that any thread covers. Where threads do not run straight, the
    /// share that the length and width of the yarn would cover without overlap, at most 1.
    pub cover_factor: f64,
    /// From the lowest to the highest yarn surface, millimetres.
    pub thickness_mm: f64,
    /// Mass per area.
    pub areal_density_g_per_m2: f64,
    /// Share of the cloth's volume that is fibre.
    pub fibre_volume_fraction: f64,
    /// The same inside the most densely packed ply.
    pub ply_fibre_volume_fraction: f64,
    /// Length of yarn in a tile, millimetres.
    pub yarn_length_mm: f64,
    /// Length of fibre in a tile, millimetres.
    pub fibre_length_mm: f64,
    /// Linear factor by which yarns were pressed to fit.
    pub compaction: f64,
    /// Largest overlap of crossing threads, as a share of the sum of their radii.
    pub compression: f64,
}

/// Steps of height in which the fibres of a nonwoven are counted.
const HEIGHTS: usize = 4000;

/// Sums over the threads of a system.
#[derive(Default)]
struct Sum<'a> {
    woven: Vec<&'a ThreadAtRest>,
    threads: f64,
    tex: f64,
    length_mm: f64,
    period_mm: f64,
    width_mm: f64,
    height_mm: f64,
    /// Flexural rigidity of woven threads, as if their fibres were free.
    bending_n_mm2: f64,
}

impl Sum<'_> {
    fn figures(&self, across_mm: f64, g_per_m2: f64) -> Option<SystemFigures> {
        let rigidity =
            (!self.woven.is_empty()).then(|| rigidity_un_m(self.bending_n_mm2, across_mm));
        (self.threads > 0.0).then(|| SystemFigures {
            threads_per_cm: 10.0 * self.threads / across_mm,
            tex: self.tex / self.threads,
            crimp_percent: 100.0 * (self.length_mm / self.period_mm - 1.0),
            cover_factor: match self.woven.as_slice() {
                [] => (self.width_mm / across_mm).min(1.0),
                woven => cover_factor(woven, across_mm),
            },
            width_mm: self.width_mm / self.threads,
            height_mm: self.height_mm / self.threads,
            bending_rigidity_un_m: rigidity,
            bending_length_mm: rigidity.map(|g| bending_length_mm(g, g_per_m2)),
        })
    }
}

/// What the threads of a tile add up to.
struct Sums<'a> {
    warp: Sum<'a>,
    weft: Sum<'a>,
    /// Threads of neither system; imported curves are in none, which have neither courses nor
    /// crimp.
    other: Sum<'a>,
    wales: usize,
    fibre_length_mm: f64,
    fibre_volume_mm3: f64,
    mass_mg: f64,
    low_mm: f64,
    high_mm: f64,
    /// Fibre volume fraction of the densest ply.
    packing: f64,
    covered_mm2: f64,
    /// Threads that are laid as curves: their length, mass and number.
    laid_mm: f64,
    laid_mg: f64,
    laid: f64,
}

impl<'a> Sums<'a> {
    fn new() -> Sums<'a> {
        Sums {
            warp: Sum::default(),
            weft: Sum::default(),
            other: Sum::default(),
            wales: 0,
            fibre_length_mm: 0.0,
            fibre_volume_mm3: 0.0,
            mass_mg: 0.0,
            low_mm: f64::INFINITY,
            high_mm: f64::NEG_INFINITY,
            packing: 0.0,
            covered_mm2: 0.0,
            laid_mm: 0.0,
            laid_mg: 0.0,
            laid: 0.0,
        }
    }

    fn reach(&mut self, low_mm: f64, high_mm: f64) {
        self.low_mm = self.low_mm.min(low_mm);
        self.high_mm = self.high_mm.max(high_mm);
    }

    fn add_fibre(&mut self, yarn: &Yarn, length_mm: f64, radius_mm: f64) {
        let volume = length_mm * PI * radius_mm * radius_mm;
        self.fibre_length_mm += length_mm;
        self.fibre_volume_mm3 += volume;
        self.mass_mg += volume * yarn.fibre_density_g_per_cm3;
    }

    fn add_bare(&mut self, yarn: &Yarn, curve: &PolyCurve) {
        curve.for_each_segment(&mut |s| {
            let radius = 0.5 * f64::from(s.start_radius_mm + s.end_radius_mm);
            self.add_fibre(yarn, f64::from(s.length_mm()), radius);
            self.covered_mm2 += f64::from(s.length_mm()) * 2.0 * radius;
        });
        for (p, &r) in curve.points_mm.iter().zip(&curve.radii_mm) {
            self.reach(f64::from(p.z - r), f64::from(p.z + r));
        }
    }

    fn add(&mut self, cloth: &Cloth, thread: &'a ThreadAtRest) {
        let yarn = &*thread.spun.yarn;
        if let Centreline::Bare(curve) = &thread.line {
            return self.add_bare(yarn, curve);
        }
        let path = cloth.path(thread, CurveLevel::Ply);
        let length = path.length_mm();
        let profile = thread.spun.profile.as_deref();
        let closure = Closure::of_profile(yarn, profile, length);
        // Of the fibres of the thickest place, those that are there on average.
        let present = profile.map_or(1.0, |p| p.mean(|mass| mass / p.most()));
        let per_length = yarn.fibre_per_length_at(
            closure.twist_rad_per_mm(length),
            closure.ply_twist_rad_per_mm(yarn.plies, length),
        );
        let fibres = f64::from(closure.fibres_per_ply() * yarn.plies);
        let fibre_mm = length * present * fibres * per_length;
        self.add_fibre(yarn, fibre_mm, yarn.fibre_radius_mm);

        let diameter = 2.0 * yarn.radius_mm() * thread.mean_size();
        if let Centreline::Laid { .. } = thread.line {
            self.laid_mm += length;
            self.laid += 1.0;
            let volume = fibre_mm * PI * yarn.fibre_radius_mm.powi(2);
            self.laid_mg += volume * yarn.fibre_density_g_per_cm3;
        }
        let sum = match &thread.line {
            Centreline::Woven { axis, .. } if axis.y > 0.5 => &mut self.warp,
            Centreline::Knitted { knit, .. } => {
                self.wales = knit.wales;
                &mut self.weft
            }
            Centreline::Woven { .. } => &mut self.weft,
            _ => &mut self.other,
        };
        if let Centreline::Woven { .. } = thread.line {
            sum.woven.push(thread);
            // Crimp and twist spread the bending over a longer fibre.
            let stretched = per_length * length / path.period.length();
            sum.bending_n_mm2 += present * fibres * fibre_rigidity_n_mm2(yarn) / stretched;
        }
        sum.threads += 1.0;
        sum.tex += yarn.tex();
        sum.length_mm += length;
        sum.period_mm += path.period.length();
        sum.width_mm += diameter.x;
        sum.height_mm += diameter.y;
        self.covered_mm2 += length * diameter.x;
        for (p, arc) in path.points.iter().zip(&path.arc_mm) {
            let half = yarn.radius_mm() * thread.section.at(arc / length).y;
            self.reach(p.z - half, p.z + half);
        }
        let packing = yarn.fibre_volume_fraction() / thread.section.area();
        self.packing = self.packing.max(packing);
    }

    /// The figures of a pile; cut pile is added to the sums first.
    fn pile(&mut self, cloth: &Cloth, pile: &Pile) -> PileFigures {
        let size = cloth.tile.bounds_mm.size().as_dvec3();
        let area = size.x * size.y;
        let (mut height_mm, mut tips) = (pile.loop_height_mm, 0.0);
        if let Some(tufts) = &pile.tufts {
            let sums = cloth.sum_of_tufts(tufts);
            self.fibre_length_mm += sums.length_mm;
            self.fibre_volume_mm3 += sums.volume_mm3;
            self.laid_mg = sums.volume_mm3 * tufts.yarn.fibre_density_g_per_cm3;
            self.mass_mg += self.laid_mg;
            self.reach(sums.low_mm, sums.high_mm);
            tips = sums.tips;
            height_mm = sums.tip_height_mm / tips.max(1.0) - pile.face_mm;
            self.laid_mm = sums.length_mm / f64::from(tufts.fibres());
            self.other.length_mm += self.laid_mm;
        }
        let is_looped = pile.tufts.is_none();
        PileFigures {
            kind: pile.kind,
            height_mm,
            tufts_per_cm2: 100.0 * pile.count as f64 / area,
            tips_per_mm2: tips / area,
            yarn_per_tuft_mm: self.laid_mm / pile.count.max(1) as f64,
            pile_ratio: is_looped.then(|| self.laid_mm / (self.laid.max(1.0) * size.y)),
            loop_cover: is_looped.then(|| loop_cover(cloth, pile.face_mm)),
            areal_density_g_per_m2: 1000.0 * self.laid_mg / area,
        }
    }
}

impl Cloth {
    /// The textile figures of the cloth, from closed forms over the threads
    /// at rest; fibres are generated of cut pile only.
    pub fn figures(&self) -> Figures {
        let size = self.tile.bounds_mm.size().as_dvec3();
        let area = size.x * size.y;
        let mut sums = Sums::new();
        for thread in &self.threads {
            sums.add(self, thread);
        }
        let pile = self.pile.as_ref().map(|pile| sums.pile(self, pile));
        let wales = (sums.wales > 0).then_some(sums.wales as f64);
        let yarn_length_mm = sums.warp.length_mm + sums.weft.length_mm + sums.other.length_mm;
        let areal_density_g_per_m2 = 1000.0 * sums.mass_mg / area;
        let warp = sums.warp.figures(size.x, areal_density_g_per_m2);
        let weft = sums.weft.figures(size.y, areal_density_g_per_m2);
        let cover_factor = match (&warp, &weft) {
            (Some(a), Some(b)) => {
                let each = (1.0 - a.cover_factor) * (1.0 - b.cover_factor);
                let open = openness(&sums.warp.woven, &sums.weft.woven, size.truncate());
                1.0 - open.unwrap_or(each)
            }
            // Fibres that lie anywhere leave a place free with the probability of Poisson.
            _ if self.web.is_some() => 1.0 - (-sums.covered_mm2 / area).exp(),
            _ => (sums.covered_mm2 / area).min(1.0),
        };
        let thickness_mm = sums.high_mm - sums.low_mm;
        Figures {
            tile_mm: [size.x, size.y],
            warp,
            weft,
            wales_per_cm: wales.map(|wales| 10.0 * wales / size.x),
            loop_length_mm: wales.map(|wales| yarn_length_mm / (sums.weft.threads * wales)),
            pile,
            openwork: self.net.as_ref().map(|net| OpenworkFigures {
                kind: net.kind,
                ends_per_cm: 10.0 / net.end_mm,
                rows_per_cm: 10.0 / net.row_mm,
                holes_per_cm2: 100.0 * net.holes_per_mm2,
                thread_per_hole_mm: yarn_length_mm / (net.holes_per_mm2 * area),
                overlap: net.overlap.0,
                greatest_overlap: net.overlap.1,
            }),
            nonwoven: self.web.as_ref().map(|w| self.nonwoven_figures(w)),
            cover_factor,
            thickness_mm,
            areal_density_g_per_m2,
            fibre_volume_fraction: sums.fibre_volume_mm3 / (area * thickness_mm),
            ply_fibre_volume_fraction: sums.packing,
            yarn_length_mm,
            fibre_length_mm: sums.fibre_length_mm,
            compaction: self.compaction,
            compression: self.compression,
        }
    }

    fn nonwoven_figures(&self, web: &Web) -> NonwovenFigures {
        let size = self.tile.bounds_mm.size().as_dvec3();
        let (mut tensor, mut length_mm, mut volume_mm3) = ([0.0; 4], 0.0, 0.0);
        let (low, high) = (f64::from(self.tile.bounds_mm.min.z), size.z);
        let mut by_height = vec![0.0; HEIGHTS];
        for thread in &self.threads {
            let Centreline::Bare(curve) = &thread.line else {
                continue;
            };
            for (p, r) in curve.points_mm.windows(2).zip(&curve.radii_mm) {
                let [a, b] = [p[0], p[1]].map(|p| p.as_dvec3());
                let piece_mm = a.distance(b);
                let t = (b - a).normalize_or_zero();
                for (sum, part) in
                    tensor
                        .iter_mut()
                        .zip([t.x * t.x, t.y * t.y, t.z * t.z, t.x * t.y])
                {
                    *sum += piece_mm * part;
                }
                length_mm += piece_mm;
                volume_mm3 += piece_mm * PI * f64::from(*r).powi(2);
                let share = (0.5 * (a.z + b.z) - low) / high;
                by_height[((share * HEIGHTS as f64) as usize).min(HEIGHTS - 1)] += piece_mm;
            }
        }
        // The heights below which a share of the length lies.
        let height = |share: f64| {
            let mut below = 0.0;
            let found = by_height.iter().position(|part| {
                below += part;
                below >= share * length_mm
            });
            found.unwrap_or(HEIGHTS) as f64 / HEIGHTS as f64 * high
        };
        let thickness_mm = height(0.99) - height(0.01);
        let tensor = tensor.map(|t| t / length_mm);
        let area = size.x * size.y;
        NonwovenFigures {
            thickness_mm,
            fill: 0.98 * volume_mm3 / (area * thickness_mm),
            orientation_tensor: tensor,
            anisotropy: tensor[1] / tensor[0],
            fibres: self.threads.len(),
            mean_length_mm: length_mm / self.threads.len().max(1) as f64,
            punches_per_cm2: 100.0 * web.punches as f64 / area,
            carried_percent: 100.0 * web.carried,
            bonding_points_per_cm2: 100.0 * web.points as f64 / area,
            overlap: web.overlap,
        }
    }

    fn sum_of_tufts(&self, tufts: &Tufts) -> TuftSums {
        let mut sums = TuftSums {
            low_mm: f64::INFINITY,
            high_mm: f64::NEG_INFINITY,
            ..TuftSums::default()
        };
        let first = self.threads.len();
        for tuft in 0..tufts.tufts.len() {
            let mut last: Option<Segment> = None;
            let mut tip = |z: f32| {
                sums.tips += 1.0;
                sums.tip_height_mm += f64::from(z);
            };
            let seed = (self.seed, first + tuft);
            tufts.emit(tuft, true, seed, &mut |s| {
                if last.is_none_or(|l| l.fibre != s.fibre) {
                    if let Some(l) = last {
                        tip(l.end_mm.z);
                    }
                    tip(s.start_mm.z);
                }
                last = Some(*s);
                let length = f64::from(s.length_mm());
                sums.length_mm += length;
                sums.volume_mm3 += length * PI * f64::from(s.start_radius_mm).powi(2);
                sums.low_mm = sums.low_mm.min(f64::from(s.start_mm.z.min(s.end_mm.z)));
                sums.high_mm = sums.high_mm.max(f64::from(s.start_mm.z.max(s.end_mm.z)));
            });
            if let Some(l) = last {
                tip(l.end_mm.z);
            }
        }
        sums
    }
}

/// Sums over the fibres of cut pile.
#[derive(Default)]
struct TuftSums {
    length_mm: f64,
    volume_mm3: f64,
    tips: f64,
    tip_height_mm: f64,
    low_mm: f64,
    high_mm: f64,
}
