//! Nets and gauzes: threads that are laid as curves and pushed apart.

use super::import::bend_per_mm;
use super::repeats::{lcm, repeats, threads};
use super::spacing::spacing_mm;
use super::spun::Spun;
use super::yarns::{Materials, Yarns};
use super::{Centreline, Cloth, ThreadAtRest};
use crate::Error;
use crate::draft::MAX_THREADS;
use crate::openwork::{Course, Openwork, OpenworkKind};
use crate::section::ThreadSection;
use crate::separate::{Line, Room, overlap, separate};
use crate::spec::FabricGeometry;
use crate::strand::{protruding_mm, reach_mm, thickest_fibre_mm};
use crate::yarn::Yarn;
use glam::{DVec2, Vec3};
use organza_basis::{Aabb, Tile};
use std::sync::Arc;

/// The largest number of meshes in a tile.
const MAX_MESHES: usize = 1 << 14;
/// The largest number of points on its threads: pushing them apart takes about 200 bytes for
/// each.
const MAX_POINTS: f64 = (1u64 << 19) as f64;

/// What is known of openwork beyond its threads.
#[derive(Clone, Debug)]
pub(super) struct Net {
    pub kind: OpenworkKind,
    pub end_mm: f64,
    pub row_mm: f64,
    pub holes_per_mm2: f64,
    /// By how much touching threads still reach into each other: mean and largest share of the
    /// sum of their radii, where they touch.
    pub overlap: (f64, f64),
}

/// The openwork that a description names.
pub(super) fn build(fabric: &FabricGeometry, seed: u64) -> Result<Cloth, Error> {
    let name = fabric.draft.openwork.as_deref().unwrap_or_default();
    let kind = OpenworkKind::named(name)?;
    let mut yarns = Yarns::new(&fabric.yarn);
    let threads = Threads {
        of_warp: yarns.of_system("warp", &fabric.warp)?,
        of_weft: yarns.of_system("weft", &fabric.weft)?,
        yarns: yarns.built,
    };
    refuse_keys_of_weaves(fabric)?;
    let open = threads.openwork(fabric, kind)?;
    let courses = open.courses();
    let step_mm = 0.5 * open.warp_mm.min(open.weft_mm);
    check_length(&open, &courses, step_mm)?;
    let size_mm = DVec2::new(
        open.ends as f64 * open.end_mm,
        open.rows as f64 * open.row_mm,
    );
    let room = Room {
        size_mm,
        faces_mm: [f64::NEG_INFINITY, f64::INFINITY],
    };
    let mut lines: Vec<Line> = courses
        .iter()
        .enumerate()
        .map(|(i, c)| Line {
            points: c.rounded(step_mm),
            radius_mm: threads.yarn(&open, i).radius_mm(),
            period: Some(c.period),
            held: Vec::new(),
        })
        .collect();
    separate(&mut lines, room);
    let (mean, most, _) = overlap(&lines, room);
    let laid = threads.laid(fabric, &open, lines, &courses, seed)?;
    let tile = Tile {
        bounds_mm: Aabb::new(
            Vec3::new(0.0, 0.0, (laid.low_mm as f32).next_down()),
            size_mm.extend(laid.high_mm).as_vec3(),
        ),
        repeats: true,
    };
    let mut cloth = Cloth::at_rest(threads.yarns, laid.threads, laid.materials, tile);
    cloth.net = Some(Net {
        kind,
        end_mm: open.end_mm,
        row_mm: open.row_mm,
        holes_per_mm2: open.holes_per_mm2(),
        overlap: (mean, most),
    });
    cloth.warn_of_sharp_bends();
    Ok(cloth)
}

/// Refuses what only weaves have.
fn refuse_keys_of_weaves(fabric: &FabricGeometry) -> Result<(), Error> {
    let keys = [
        ("warp.wander", fabric.warp.wander.is_some()),
        ("weft.wander", fabric.weft.wander.is_some()),
        ("warp.reed_dents", fabric.warp.reed_dents.is_some()),
        ("weft.reed_dents", fabric.weft.reed_dents.is_some()),
    ];
    let Some((key, _)) = keys.iter().find(|(_, is_given)| *is_given) else {
        return Ok(());
    };
    let message = "belongs to a weave (draft.weave, draft.wif or draft.drawdown)";
    Err(Error::spec(*key, message))
}

/// Refuses threads of more points than are pushed apart.
fn check_length(open: &Openwork, courses: &[Course], step_mm: f64) -> Result<(), Error> {
    let length_mm: f64 = courses.iter().map(Course::length_mm).sum();
    if length_mm / step_mm <= MAX_POINTS {
        return Ok(());
    }
    let message = format!(
        "the threads of {} ends and {} rows are {:.0} m long, and at most {:.0} m of \
         them are laid; more threads per cm or fewer repeats are shorter",
        open.ends,
        open.rows,
        1e-3 * length_mm,
        1e-3 * MAX_POINTS * step_mm
    );
    Err(Error::spec("tile.repeats", message))
}

/// The yarns of a net, and which of them its ends and its other threads repeat.
struct Threads {
    yarns: Vec<Arc<Yarn>>,
    of_warp: Vec<usize>,
    of_weft: Vec<usize>,
}

/// Threads in their places, with the lowest and the highest point of their fibres.
struct Laid {
    threads: Vec<ThreadAtRest>,
    materials: Materials,
    low_mm: f64,
    high_mm: f64,
}

impl Threads {
    /// The net of one tile.
    fn openwork(&self, fabric: &FabricGeometry, kind: OpenworkKind) -> Result<Openwork, Error> {
        let [rx, ry] = repeats(fabric)?;
        let [ends, rows] = kind.repeat();
        let ends = threads(ends, &self.of_warp, &fabric.warp).saturating_mul(rx);
        // The colours of diagonal threads repeat over the ends.
        let (ends, rows) = match kind {
            OpenworkKind::Bobbinet => {
                let ends = lcm(ends, threads(1, &self.of_weft, &fabric.weft));
                (ends, ends.saturating_mul(2).saturating_mul(ry))
            }
            OpenworkKind::Leno => (
                ends,
                threads(rows, &self.of_weft, &fabric.weft).saturating_mul(ry),
            ),
        };
        if ends > MAX_THREADS || rows > MAX_THREADS || ends.saturating_mul(rows) > MAX_MESHES {
            let message =
                format!("{ends} ends x {rows} rows in one tile are more than {MAX_MESHES} meshes");
            return Err(Error::spec("tile.repeats", message));
        }
        let thickest = |used: &[usize]| {
            let radii = used.iter().map(|&y| self.yarns[y].radius_mm());
            radii.fold(0.0, f64::max)
        };
        let open = Openwork {
            kind,
            ends,
            rows,
            end_mm: spacing_mm("warp", &fabric.warp, None, 0)?,
            row_mm: spacing_mm("weft", &fabric.weft, None, 0)?,
            warp_mm: thickest(&self.of_warp),
            weft_mm: thickest(&self.of_weft),
        };
        match open.jam() {
            Some(why) => Err(Error::Jammed(why)),
            None => Ok(open),
        }
    }

    /// The index of the yarn of a course.
    fn yarn_index(&self, open: &Openwork, course: usize) -> usize {
        let (used, number) = match course < open.ends {
            true => (&self.of_warp, course),
            false => (&self.of_weft, course - open.ends),
        };
        used[number % used.len()]
    }

    fn yarn(&self, open: &Openwork, course: usize) -> &Arc<Yarn> {
        &self.yarns[self.yarn_index(open, course)]
    }

    /// Threads along lines that no longer overlap.
    fn laid(
        &self,
        fabric: &FabricGeometry,
        open: &Openwork,
        lines: Vec<Line>,
        courses: &[Course],
        seed: u64,
    ) -> Result<Laid, Error> {
        let mut laid = Laid {
            threads: Vec::with_capacity(lines.len()),
            materials: Materials::default(),
            low_mm: f64::INFINITY,
            high_mm: f64::NEG_INFINITY,
        };
        for (i, (line, course)) in lines.into_iter().zip(courses).enumerate() {
            let yarn = self.yarn(open, i);
            let spec = if course.is_end {
                &fabric.warp
            } else {
                &fabric.weft
            };
            let number = if i < open.ends { i } else { i - open.ends };
            let colour = spec.colours.get(number % spec.colours.len().max(1));
            let spun = Spun::new(yarn, line.length_mm(), seed, i);
            let hairs = spun.yarn.radius_mm() + protruding_mm(&spun.yarn);
            let out = reach_mm(&spun.yarn).max(hairs) + 2.0 * thickest_fibre_mm(&spun.yarn);
            // The smooth line bulges between points by less than an eighth of a step.
            let step = line.length_mm() / line.points.len() as f64;
            for p in &line.points {
                laid.low_mm = laid.low_mm.min(p.z - out - step);
                laid.high_mm = laid.high_mm.max(p.z + out + step);
            }
            laid.threads.push(ThreadAtRest {
                line: Centreline::Laid {
                    points: line.points.into(),
                    period: course.period,
                },
                yarn: self.yarn_index(open, i),
                spun,
                dye: laid.materials.dye(yarn, colour.copied())?,
                section: ThreadSection::even(DVec2::ONE),
            });
        }
        Ok(laid)
    }
}

impl Cloth {
    /// Warns of threads that bend more sharply than their thickness allows.
    fn warn_of_sharp_bends(&mut self) {
        let sharpest = self.threads.iter().filter_map(|t| match &t.line {
            Centreline::Laid { points, .. } => Some(bend_per_mm(points) * t.spun.yarn.radius_mm()),
            _ => None,
        });
        let sharpest = sharpest.fold(0.0, f64::max);
        if sharpest > 1.5 {
            self.warnings.push(format!(
                "draft.openwork: threads bend to {:.2} of their radius, where their fibres overlap; \
                 thinner yarns or fewer threads per centimetre bend less",
                1.0 / sharpest
            ));
        }
    }
}
