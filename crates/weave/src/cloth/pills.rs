//! Pills: balls of entangled fibre that rubbing leaves on the faces of worn cloth.
//!
//! They lie on the yarns as a Poisson process. Their fibres are of the yarns beneath them, and
//! some of them come out of these yarns, which anchors the ball. The yarns keep what fibres they
//! have: pills come on top, as hairs do.

use super::heights::Heights;
use super::{Centreline, Cloth, CurveLevel, PrintSide, ThreadAtRest};
use crate::Error;
use crate::clump::{Clump, LEAST, MAX_DEVIATION, STRAY_EXTENT};
use crate::strand::{MAX_DEVIATIONS, any_fibre, normal, unit};
use glam::{DVec2, DVec3};
use organza_basis::{PathRng, Segment, SegmentSource};
use serde::Deserialize;
use std::f64::consts::{PI, TAU};

/// Height over width: they were rubbed flat (estimated).
const FLATNESS: f64 = 0.7;
/// Length over width in the plane, at most (estimated).
const ELONGATION: f64 = 1.35;
/// Share of the height by which a ball sinks in between the yarns (estimated).
const SINK: f64 = 0.15;
/// Share of the fibres that come out of yarns (estimated).
const ANCHORED: f64 = 0.25;
/// Length of a fibre in the ball: fibres break before pills form (estimated).
const FIBRE_MM: f64 = 14.0;
/// Threads from which the fibres of a pill come, the nearest, and how far they lie from its
/// middle, in half widths of the pill.
const THREADS: usize = 6;
const NEAR: f64 = 1.2;
/// How much of the face pills may cover, as if none overlapped.
const MAX_COVER: f64 = 0.5;
/// Pills in a tile at most, about 400 bytes each.
const MAX_PILLS: f64 = (1u32 << 18) as f64;
/// Families of random numbers: places, and fibres.
const PLACES: u64 = 12 << 40;
const FIBRES: u64 = 13 << 40;

/// `pills` of `[wear]`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct PillSpec {
    /// Mean number on a square centimetre of a face, 0 to 1e4; they lie at random.
    pub per_cm2: f64,
    /// Diameter of the ball of the same volume, mean and standard deviation, millimetres.
    pub size_mm: [f64; 2],
}

/// A pill in its place.
#[derive(Clone, Debug)]
pub(super) struct Pill {
    pub clump: Clump,
    /// Where its fibres come from.
    anchors: Vec<Anchor>,
}

/// A place on a thread near a pill.
#[derive(Clone, Copy, Debug)]
struct Anchor {
    thread: u32,
    at_mm: DVec3,
    along: DVec3,
    away_mm: f64,
}

/// The pills of a cloth.
///
/// # Errors
/// The key at fault.
pub(super) fn pills(
    cloth: &Cloth,
    spec: &PillSpec,
    side: PrintSide,
    heights: &Heights,
) -> Result<Vec<Pill>, Error> {
    check(cloth, spec)?;
    let mut all = Vec::new();
    for (is_back, other) in [(false, PrintSide::Back), (true, PrintSide::Face)] {
        if side != other {
            place(cloth, spec, is_back, heights, &mut all);
        }
    }
    find_anchors(cloth, spec, &mut all);
    // What lies over a hole has nothing to hang on.
    all.retain(|pill| !pill.anchors.is_empty());
    Ok(all)
}

fn check(cloth: &Cloth, spec: &PillSpec) -> Result<(), Error> {
    let [mean, deviation] = spec.size_mm;
    for (key, value, from, to) in [
        ("per_cm2", spec.per_cm2, 0.0, 1e4),
        ("size_mm[0]", mean, 0.1, 10.0),
        ("size_mm[1]", deviation, 0.0, MAX_DEVIATION * mean),
    ] {
        if !(from..=to).contains(&value) {
            let message = format!("expected a number from {from} to {to}, found {value}");
            return Err(Error::spec(format!("wear.pills.{key}"), message));
        }
    }
    let fail = |message: String| Err(Error::spec("wear.pills", message));
    if cloth.pile.is_some() || !cloth.tile.repeats {
        return fail("expected a cloth that repeats, without pile".to_owned());
    }
    let square = mean * mean + deviation * deviation;
    let cover = 0.01 * spec.per_cm2 * 0.25 * PI * square;
    if cover > MAX_COVER {
        return fail(format!(
            "{} per cm2 of {mean} mm would cover {:.0} % of a face, and {:.0} % are the most; \
             fewer or smaller ones cover less",
            spec.per_cm2,
            100.0 * cover,
            100.0 * MAX_COVER
        ));
    }
    let size_mm = cloth.tile.period_mm();
    let count = 0.02 * spec.per_cm2 * f64::from(size_mm.x) * f64::from(size_mm.y);
    if count > MAX_PILLS {
        return fail(format!(
            "the tile has about {count:.0} of them, and {MAX_PILLS} are the most; a smaller tile \
             has fewer"
        ));
    }
    let widest = 2.0 * STRAY_EXTENT * half_widths(mean + MAX_DEVIATIONS * deviation, ELONGATION)[0];
    cloth.check_width(|| "wear.pills".to_owned(), "pill", widest)
}

/// Half the length, width and height of a pill of the volume of a ball.
fn half_widths(size_mm: f64, elongation: f64) -> [f64; 3] {
    let width = 0.5 * size_mm * FLATNESS.powf(-1.0 / 3.0);
    let stretch = elongation.sqrt();
    [width * stretch, width / stretch, width * FLATNESS]
}

/// Pills at random on one face.
fn place(cloth: &Cloth, spec: &PillSpec, is_back: bool, heights: &Heights, all: &mut Vec<Pill>) {
    let mut rng = PathRng::new(cloth.seed, u64::from(is_back), PLACES);
    let size_mm = cloth.tile.period_mm().as_dvec2();
    let corner = cloth.tile.bounds_mm.min.truncate().as_dvec2();
    let up = if is_back { -1.0 } else { 1.0 };
    let expected = 0.01 * spec.per_cm2 * size_mm.x * size_mm.y;
    let mut so_far = f64::from(rng.exponential());
    while so_far < expected {
        so_far += f64::from(rng.exponential());
        let [u, v] = [unit(&mut rng), unit(&mut rng)];
        let at = corner + size_mm * DVec2::new(u, v);
        let [mean, _] = spec.size_mm;
        let size_mm = normal(&mut rng, spec.size_mm, 1.0).max(LEAST * mean);
        let elongation = 1.0 + (ELONGATION - 1.0) * unit(&mut rng);
        let [length, width, height] = half_widths(size_mm, elongation);
        // It rests on the highest of what lies beneath it.
        let beneath = [DVec2::ZERO, DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y];
        let rest = beneath.iter().map(|aside| {
            let [low, high] = heights.at((at + 0.5 * width * *aside).as_vec2());
            f64::from(if is_back { -low } else { high })
        });
        let rest = rest.fold(f64::NEG_INFINITY, f64::max);
        if !rest.is_finite() {
            continue;
        }
        let middle = rest + (1.0 - 2.0 * SINK) * height;
        let turned = DVec2::from_angle(TAU * unit(&mut rng));
        all.push(Pill {
            clump: Clump {
                middle_mm: at.extend(up * middle),
                half_axes_mm: [
                    length * turned.extend(0.0),
                    width * turned.perp().extend(0.0),
                    up * height * DVec3::Z,
                ],
            },
            anchors: Vec::new(),
        });
    }
}

/// Finds the threads near each pill.
fn find_anchors(cloth: &Cloth, spec: &PillSpec, all: &mut [Pill]) {
    let size_mm = cloth.tile.period_mm().as_dvec2();
    let [mean, deviation] = spec.size_mm;
    let reach = NEAR * half_widths(mean + MAX_DEVIATIONS * deviation, ELONGATION)[0];
    let cells = crate::web::Cells::new(size_mm, reach);
    let mut of_cell = vec![Vec::new(); cells.count()];
    for (i, pill) in all.iter().enumerate() {
        of_cell[cells.index(pill.clump.middle_mm.truncate())].push(i);
    }
    let yarns = cloth.curves(CurveLevel::Yarn);
    for batch in 0..yarns.batch_count() {
        yarns.for_each_in_batch(batch, &mut |s| {
            let at_mm = (0.5 * (s.start_mm + s.end_mm)).as_dvec3();
            for cell in cells.around(at_mm.truncate()) {
                for &i in &of_cell[cell] {
                    let pill = &mut all[i];
                    let middle = pill.clump.middle_mm;
                    let apart = (at_mm - middle).truncate();
                    let copy = ((apart / size_mm).round() * size_mm).extend(0.0);
                    let away = at_mm - copy - middle;
                    if away.truncate().length() > NEAR * pill.clump.half_axes_mm[0].length() {
                        continue;
                    }
                    pill.note(Anchor {
                        thread: s.yarn,
                        at_mm: at_mm - copy,
                        along: (s.end_mm - s.start_mm).normalize_or_zero().as_dvec3(),
                        away_mm: away.length(),
                    });
                }
            }
        });
    }
}

impl Pill {
    /// Takes a place on a thread into account: the nearest place of each of the nearest threads
    /// is kept.
    fn note(&mut self, anchor: Anchor) {
        let anchors = &mut self.anchors;
        match anchors.iter_mut().find(|a| a.thread == anchor.thread) {
            Some(known) if known.away_mm <= anchor.away_mm => {}
            Some(known) => *known = anchor,
            None => anchors.push(anchor),
        }
        if anchors.len() > THREADS {
            let farthest = (0..anchors.len())
                .max_by(|&a, &b| anchors[a].away_mm.total_cmp(&anchors[b].away_mm));
            anchors.swap_remove(farthest.unwrap_or(0));
        }
    }

    /// Where it ends, outwards, on the face or on the back.
    pub fn top_mm(&self) -> f64 {
        self.clump.middle_mm.z + STRAY_EXTENT * self.clump.half_axes_mm[2].z
    }
}

impl ThreadAtRest {
    /// Radius in millimetres and material of a fibre of the thread at random.
    fn any_fibre(&self, rng: &mut PathRng) -> (f64, u16) {
        // A thread that is a single fibre is of one part of a blend: it has that part's radius
        // and material alone.
        if let Centreline::Bare(curve) = &self.line {
            return (f64::from(curve.radii_mm[0]), self.dye.main());
        }
        let (radius_mm, dye) = any_fibre(&self.spun.yarn, &self.dye, rng);
        (radius_mm, dye.at(|| 1.0))
    }
}

impl Cloth {
    /// The fibres of a pill, as the batch `batch`.
    pub(super) fn emit_pill(&self, pill: &Pill, batch: usize, emit: &mut dyn FnMut(&Segment)) {
        let mut rng = PathRng::new(self.seed, batch as u64, FIBRES);
        let rng = &mut rng;
        let clump = &pill.clump;
        let mut wound = 0.0;
        let all = clump.fibre_mm(1.0);
        let mut fibre = 0;
        while wound < all {
            let anchor = &pill.anchors[rng.below(pill.anchors.len() as u32) as usize];
            let thread = &self.threads[anchor.thread as usize];
            let (radius_mm, material) = thread.any_fibre(rng);
            let left_mm = (all - wound) / (radius_mm * radius_mm);
            let length_mm = FIBRE_MM.min(left_mm);
            let mut points = Vec::new();
            if unit(rng) < ANCHORED {
                pill.lead(anchor, radius_mm, &mut points, rng);
            }
            clump.wind(&mut points, length_mm, radius_mm, rng);
            wound += length_mm * radius_mm * radius_mm;
            let curve = crate::curve_file::PolyCurve {
                radii_mm: vec![radius_mm as f32; points.len()],
                points_mm: points.iter().map(|p| p.as_vec3()).collect(),
                closed: false,
            };
            curve.for_each_segment(&mut |s| {
                emit(&Segment {
                    yarn: batch as u32,
                    fibre,
                    material,
                    ..*s
                });
            });
            fibre += 1;
        }
    }
}

impl Pill {
    /// The way of a fibre from a thread into the lower half of the pill: it leaves along the
    /// thread and bends up.
    fn lead(&self, anchor: &Anchor, radius_mm: f64, points: &mut Vec<DVec3>, rng: &mut PathRng) {
        let clump = &self.clump;
        let [a, b, c] = clump.half_axes_mm;
        let turn = DVec2::from_angle(TAU * unit(rng));
        let aside = 0.7 * unit(rng).sqrt();
        let to = clump.middle_mm + aside * (turn.x * a + turn.y * b) - 0.6 * unit(rng) * c;
        let side = if unit(rng) < 0.5 { 1.0 } else { -1.0 };
        let reach = anchor.at_mm.distance(to);
        let [leave, arrive] = [
            side * reach * anchor.along,
            reach * c.normalize_or(DVec3::Z),
        ];
        let steps = (1.3 * reach / clump.step_mm(radius_mm))
            .ceil()
            .clamp(2.0, 256.0) as usize;
        points.extend((0..=steps).map(|i| {
            let t = i as f64 / steps as f64;
            let u = 1.0 - t;
            u * u * (1.0 + 2.0 * t) * anchor.at_mm
                + t * t * (3.0 - 2.0 * t) * to
                + t * u * (u * leave - t * arrive)
        }));
    }
}
