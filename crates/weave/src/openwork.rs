//! Openwork: threads that hold each other with holes between them. Plain bobbinet (the net of
//! tulle) and plain leno (gauze).
//!
//! Threads are drawn as curves that wind around each other at the distance at which they touch;
//! the cloth then pushes apart what still shares room. The warp runs along y.

use crate::{Error, error::did_you_mean};
use glam::{DVec2, DVec3};
use serde::Serialize;
use std::f64::consts::PI;

/// The structures that have a name.
pub const NAMES: [&str; 2] = ["bobbinet", "leno"];

/// Half turns of the bobbin threads around an end on the side of a mesh that runs along the
/// warp: an odd number, so that they leave it on the other side.
const HALF_TURNS: f64 = 3.0;
/// Share of a row that those sides take: of a regular hexagon.
const UPRIGHT: f64 = 2.0 / 3.0;
/// Passes that round the corners of threads, each over the neighbouring points.
const ROUNDING: usize = 10;
/// Points on a half turn.
const POINTS: usize = 10;

/// How threads hold each other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum OpenworkKind {
    /// Hexagonal net: bobbin threads run diagonally and twist around the ends.
    Bobbinet,
    /// Gauze: pairs of ends cross between picks.
    Leno,
}

impl OpenworkKind {
    /// The structure of a name.
    ///
    /// # Errors
    /// When the name is unknown.
    pub fn named(name: &str) -> Result<OpenworkKind, Error> {
        match name.trim().to_lowercase().as_str() {
            "bobbinet" => Ok(OpenworkKind::Bobbinet),
            "leno" => Ok(OpenworkKind::Leno),
            other => {
                let hint = did_you_mean(other, NAMES);
                let names = NAMES.join(", ");
                let message = format!("no openwork is called \"{name}\"{hint}; expected {names}");
                Err(Error::spec("draft.openwork", message))
            }
        }
    }

    /// Ends and rows after which it repeats, at least. Of a bobbinet a row is a row of holes, of
    /// a leno it is a pick.
    pub fn repeat(self) -> [usize; 2] {
        match self {
            OpenworkKind::Bobbinet => [1, 2],
            OpenworkKind::Leno => [2, 2],
        }
    }
}

/// The threads of a tile.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Openwork {
    pub kind: OpenworkKind,
    /// Ends and rows in the tile. The rows of a bobbinet are a multiple of twice its ends, so
    /// that its diagonal threads close.
    pub ends: usize,
    pub rows: usize,
    pub end_mm: f64,
    pub row_mm: f64,
    /// Largest radius of the ends, and of the other threads.
    pub warp_mm: f64,
    pub weft_mm: f64,
}

/// The line of a thread.
#[derive(Clone, Debug)]
pub(crate) struct Course {
    pub points: Vec<DVec3>,
    pub period: DVec3,
    /// Whether it is an end; otherwise a bobbin thread or a pick.
    pub is_end: bool,
}

impl Course {
    /// Length of a period, with its corners.
    pub fn length_mm(&self) -> f64 {
        let pieces = self.points.windows(2).map(|p| p[0].distance(p[1]));
        let last = match (self.points.first(), self.points.last()) {
            (Some(first), Some(last)) => (*first + self.period).distance(*last),
            _ => 0.0,
        };
        pieces.sum::<f64>() + last
    }

    /// Its points at equal distances of about `step_mm`, with rounded corners.
    pub fn rounded(&self, step_mm: f64) -> Vec<DVec3> {
        let n = self.points.len();
        let at = |i: usize| self.points[i % n] + (i / n) as f64 * self.period;
        let mut arc_mm = vec![0.0];
        for i in 0..n {
            arc_mm.push(arc_mm[i] + at(i).distance(at(i + 1)));
        }
        let count = (arc_mm[n] / step_mm).ceil().clamp(8.0, 1e6) as usize;
        let mut points: Vec<DVec3> = (0..count)
            .map(|k| {
                let wanted = arc_mm[n] * k as f64 / count as f64;
                let i = arc_mm.partition_point(|&a| a <= wanted).clamp(1, n) - 1;
                let piece_mm = (arc_mm[i + 1] - arc_mm[i]).max(f64::MIN_POSITIVE);
                at(i).lerp(at(i + 1), (wanted - arc_mm[i]) / piece_mm)
            })
            .collect();
        for _ in 0..ROUNDING {
            let before = points[count - 1] - self.period;
            let after = points[0] + self.period;
            let old = points.clone();
            for i in 0..count {
                let a = if i == 0 { before } else { old[i - 1] };
                let b = if i + 1 == count { after } else { old[i + 1] };
                points[i] = 0.5 * old[i] + 0.25 * (a + b);
            }
        }
        points
    }
}

impl Openwork {
    /// The ends, then the bobbin threads to the right and to the left, or the picks.
    pub fn courses(&self) -> Vec<Course> {
        match self.kind {
            OpenworkKind::Bobbinet => self.bobbinet(),
            OpenworkKind::Leno => self.leno(),
        }
    }

    /// Holes per square millimetre.
    pub fn holes_per_mm2(&self) -> f64 {
        let across = match self.kind {
            OpenworkKind::Bobbinet => self.end_mm,
            OpenworkKind::Leno => 2.0 * self.end_mm,
        };
        1.0 / (across * self.row_mm)
    }

    fn bobbinet(&self) -> Vec<Course> {
        let tall_mm = self.rows as f64 * self.row_mm;
        let along = (0..3).flat_map(|system| (0..self.ends).map(move |k| (system, k)));
        along
            .map(|(system, k)| {
                // Of the ends a period is two rows; the others move by half an end a row.
                let rows = if system == 0 { 2 } else { self.rows };
                let aside = 0.5 * rows as f64 * self.end_mm;
                let (points, period) = match system {
                    0 => (self.end(k), 2.0 * self.row_mm * DVec3::Y),
                    1 => (self.bobbin(k, 1.0), DVec3::new(aside, tall_mm, 0.0)),
                    _ => (self.bobbin(k, -1.0), DVec3::new(-aside, tall_mm, 0.0)),
                };
                let copies = if system == 0 { self.rows / 2 } else { 1 };
                let points = (0..copies)
                    .flat_map(|i| points.iter().map(move |p| *p + i as f64 * period))
                    .collect();
                Course {
                    points,
                    period: copies as f64 * period,
                    is_end: system == 0,
                }
            })
            .collect()
    }

    /// Two rows of an end: up a side of a mesh, to the right, up, and back to the left.
    fn end(&self, k: usize) -> Vec<DVec3> {
        let x = |row: usize| (k as f64 + 0.5 * (row % 2) as f64) * self.end_mm;
        let mut points = Vec::new();
        for row in 0..2 {
            let low = DVec2::new(x(row), row as f64 * self.row_mm);
            self.along_row(low, x(row + 1) - x(row), &mut |at, _, _| {
                points.push(at.extend(0.0));
            });
        }
        points
    }

    /// A bobbin thread over all rows, to the right (`side` 1) or to the left.
    fn bobbin(&self, k: usize, side: f64) -> Vec<DVec3> {
        let reach = self.warp_mm + self.weft_mm;
        let mut points = Vec::new();
        for row in 0..self.rows {
            let low = DVec2::new(
                (k as f64 + 0.5 * side * row as f64) * self.end_mm,
                row as f64 * self.row_mm,
            );
            // On every second row it runs aside together with an end.
            let is_alone = (row % 2 == 0) != (side > 0.0);
            self.along_row(low, 0.5 * side * self.end_mm, &mut |at, right, turn| {
                // It comes from the side that it does not go to. Both turn the same way.
                let angle = if side > 0.0 { PI } else { 0.0 } - turn;
                let (mut up, mut aside) = angle.sin_cos();
                let beyond = turn / PI - HALF_TURNS;
                if beyond > 0.0 && is_alone {
                    (up, aside) = (0.0, side * (1.0 - 2.0 * beyond));
                }
                points.push((at + reach * aside * right).extend(reach * up));
            });
        }
        points
    }

    /// The middle of a row's sides of a mesh from `low`: along the warp, then aside by
    /// `aside_mm`. Gives points, the direction to the right of the side, and the angle by which
    /// threads have turned.
    fn along_row(&self, low: DVec2, aside_mm: f64, push: &mut dyn FnMut(DVec2, DVec2, f64)) {
        let upright = UPRIGHT * self.row_mm;
        let steps = POINTS * HALF_TURNS as usize;
        for i in 0..steps {
            // Turns begin and end within the side, not at its ends.
            let s = (i as f64 + 0.5) / steps as f64;
            push(low + s * upright * DVec2::Y, DVec2::X, HALF_TURNS * PI * s);
        }
        let top = low + upright * DVec2::Y;
        let slant = DVec2::new(aside_mm, self.row_mm - upright);
        let right = -slant.perp().normalize();
        for i in 1..POINTS {
            let s = i as f64 / POINTS as f64;
            let turn = (HALF_TURNS + s) * PI;
            push(top + s * slant, right, turn);
        }
    }

    fn leno(&self) -> Vec<Course> {
        let tall_mm = self.rows as f64 * self.row_mm;
        let wide_mm = self.ends as f64 * self.end_mm;
        let steps = 4 * POINTS;
        let mut all = Vec::new();
        for end in 0..self.ends {
            let middle = (end / 2) as f64 * 2.0 * self.end_mm + self.end_mm;
            // Ground ends lie under the picks, doup ends above them. Between picks the doup end
            // passes under the ground end to its other side.
            let is_doup = end % 2 == 1;
            let at_pick = self.warp_mm + self.weft_mm;
            let points = (0..self.rows * steps).map(|i| {
                let s = i as f64 / steps as f64;
                let aside = (PI * s).cos() * self.warp_mm;
                let over = (2.0 * PI * s).cos();
                let height = 0.5 * (at_pick - self.warp_mm) + 0.5 * (at_pick + self.warp_mm) * over;
                let side = if is_doup { 1.0 } else { -1.0 };
                let y = (s + 0.5) * self.row_mm;
                DVec3::new(middle + side * aside, y, side * height)
            });
            all.push(Course {
                points: points.collect(),
                period: tall_mm * DVec3::Y,
                is_end: true,
            });
        }
        let steps = (wide_mm / (0.5 * self.weft_mm)).ceil().clamp(16.0, 1e5) as usize;
        for row in 0..self.rows {
            let y = (row as f64 + 0.5) * self.row_mm;
            let at = |i: usize| DVec3::new(wide_mm * i as f64 / steps as f64, y, 0.0);
            all.push(Course {
                points: (0..steps).map(at).collect(),
                period: wide_mm * DVec3::X,
                is_end: false,
            });
        }
        all
    }

    /// Why threads cannot fit, if they do not.
    pub fn jam(&self) -> Option<String> {
        let (a, b) = (self.warp_mm, self.weft_mm);
        let (across, along) = match self.kind {
            OpenworkKind::Bobbinet => (2.0 * a + 4.0 * b, 2.6 * b * HALF_TURNS / UPRIGHT),
            OpenworkKind::Leno => (2.0 * a, 2.0 * a + 2.0 * b),
        };
        let is_jammed = across > self.end_mm || along > self.row_mm;
        is_jammed.then(|| {
            format!(
                "the threads of a {} need {across:.3} mm for an end and {along:.3} mm for a row, \
                 and have {:.3} and {:.3} mm",
                NAMES[self.kind as usize], self.end_mm, self.row_mm
            )
        })
    }
}
