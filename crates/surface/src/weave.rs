//! The visible segments of yarn of a weave draft, and the lookup of a point among them.

use crate::error::Error;
use glam::{UVec2, Vec2, Vec2Swizzles};
use serde::{Deserialize, Serialize};

/// The two systems of yarn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Yarn {
    /// Along the cloth, the fabric's y.
    Warp,
    /// Across the cloth, the fabric's x.
    Weft,
}

/// The yarn on top at every crossing, and the widths and distances of yarns.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Weave {
    /// One text per weft yarn, the top of the picture first; one character per warp yarn, `1`
    /// (or `X`) where the warp is on top and `0` (or `.`) where the weft is. An empty list
    /// stands for the draft of the cloth.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub draft: Vec<String>,
    /// Distance between the middles of neighbouring warp yarns, mm.
    pub warp_pitch_mm: f64,
    /// Distance between the middles of neighbouring weft yarns, mm.
    pub weft_pitch_mm: f64,
    /// Visible width of a warp yarn, mm; the pitch by default. Beside a narrower yarn the other
    /// yarns are visible.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub warp_width_mm: Option<f64>,
    /// Visible width of a weft yarn, mm; the pitch by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weft_width_mm: Option<f64>,
}

impl Weave {
    /// A weave from a warp-up matrix: `rows` weft yarns from the bottom up,
    /// each a list of crossings from left to right, true where the warp is on
    /// top. Yarns are as wide as their pitch.
    pub fn from_warp_up(rows: &[Vec<bool>], warp_pitch_mm: f64, weft_pitch_mm: f64) -> Weave {
        let text = |row: &Vec<bool>| row.iter().map(|&up| if up { '1' } else { '0' }).collect();
        Weave {
            draft: rows.iter().rev().map(text).collect(),
            warp_pitch_mm,
            weft_pitch_mm,
            warp_width_mm: None,
            weft_width_mm: None,
        }
    }

    /// The warp-up matrix, bottom row first.
    fn warp_up(&self) -> Result<Vec<Vec<bool>>, Error> {
        let mut rows = Vec::with_capacity(self.draft.len());
        for (number, text) in self.draft.iter().enumerate() {
            let mut row = Vec::with_capacity(text.len());
            for c in text.chars() {
                row.push(match c {
                    '1' | 'X' | 'x' => true,
                    '0' | '.' => false,
                    other => {
                        return Err(Error::Draft(format!(
                            "row {}: '{other}' is neither 1 nor 0",
                            number + 1
                        )));
                    }
                });
            }
            rows.push(row);
        }
        rows.reverse();
        Ok(rows)
    }
}

/// One visible piece of a yarn in the tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedSegment {
    /// The system that it belongs to.
    pub yarn: Yarn,
    /// Lower left corner, mm, in the tile; the rectangle may reach over the
    /// tile's edge into its next copy.
    pub corner_mm: Vec2,
    /// Extent across the yarn, mm.
    pub width_mm: f32,
    /// Extent along the yarn, mm.
    pub length_mm: f32,
}

/// The position of a point of the cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// Index into [`Tiling::segments`].
    pub segment: usize,
    /// Distance from the middle of the segment across the yarn, mm, along the
    /// segment frame's x.
    pub across_mm: f32,
    /// Distance from the middle along the yarn, mm.
    pub along_mm: f32,
    /// The copy of the tile that holds the corner of the segment, counted in x and y.
    pub copy: [i32; 2],
}

/// One repeat of the cloth, cut into segment rectangles that cover it exactly.
#[derive(Clone, Debug)]
pub struct Tiling {
    segments: Vec<PlacedSegment>,
    /// Middle of every segment, mm.
    middles_mm: Vec<Vec2>,
    /// Segment at each strip: yarn strips and the free strips between them alternate in both
    /// directions. The highest bit is set for weft, the next where the segment began in the
    /// previous copy of the tile.
    owner: Vec<u32>,
    columns: usize,
    rows: usize,
    pitch_mm: Vec2,
    /// The position where free space begins after the edge of a yarn; infinite if there is
    /// none.
    free_from_mm: Vec2,
    yarns_per_mm: Vec2,
    period_mm: Vec2,
    repeats_per_mm: Vec2,
}

/// Marks of [`Tiling::owner`].
const WEFT: u32 = 1 << 31;
const WRAPPED: u32 = 1 << 30;

/// The maximum number of crossings of a draft: a jacquard of 4,000 by 4,000 ends and picks.
const MAX_CROSSINGS: usize = 1 << 24;

impl Tiling {
    /// Cuts a weave into its segments.
    ///
    /// A segment is a run of strips over which one yarn stays on top; runs continue around the
    /// repeat, and a yarn that never dips is cut once per repeat.
    ///
    /// # Errors On a draft that is empty, ragged or too large, on pitches and widths out of
    /// range, and when both systems are narrower than their pitch, because transmission
    /// describes the holes of an open cloth.
    pub fn new(weave: &Weave) -> Result<Tiling, Error> {
        let up = weave.warp_up()?;
        Self::build(weave, &up)
    }

    /// The same cloth seen from behind: turned over about the y axis.
    pub fn seen_from_behind(weave: &Weave) -> Result<Tiling, Error> {
        let mut up = weave.warp_up()?;
        for row in &mut up {
            row.reverse();
            row.iter_mut().for_each(|warp| *warp = !*warp);
        }
        Self::build(weave, &up)
    }

    fn build(weave: &Weave, up: &[Vec<bool>]) -> Result<Tiling, Error> {
        let (rows, columns) = (up.len(), up.first().map_or(0, Vec::len));
        if columns == 0 {
            return Err(Error::Draft("there are no crossings".into()));
        }
        if let Some(row) = up.iter().rev().position(|r| r.len() != columns) {
            return Err(Error::Draft(format!(
                "row {} is not as long as the last row, {columns} crossings",
                row + 1
            )));
        }
        if rows.saturating_mul(columns) > MAX_CROSSINGS {
            return Err(Error::Draft(format!(
                "{columns} by {rows} crossings, more than {MAX_CROSSINGS}"
            )));
        }
        let (px, py) = (weave.warp_pitch_mm, weave.weft_pitch_mm);
        Error::check("weave.warp_pitch_mm", px, 1e-6, 1e6)?;
        Error::check("weave.weft_pitch_mm", py, 1e-6, 1e6)?;
        let wx = weave.warp_width_mm.unwrap_or(px);
        let wy = weave.weft_width_mm.unwrap_or(py);
        Error::check("weave.warp_width_mm", wx, 1e-3 * px, px)?;
        Error::check("weave.weft_width_mm", wy, 1e-3 * py, py)?;
        if wx < px && wy < py {
            return Err(Error::Draft(
                "warp and weft are both narrower than their pitch; make one as wide as its pitch \
                 and give the holes as warp_cover and weft_cover under transmission"
                    .into(),
            ));
        }
        let pitch_mm = Vec2::new(px as f32, py as f32);
        let period_mm = pitch_mm * Vec2::new(columns as f32, rows as f32);
        let free_from = |width: f64, pitch: f64| {
            if width < pitch {
                width as f32
            } else {
                f32::INFINITY
            }
        };
        let mut tiling = Tiling {
            segments: Vec::new(),
            middles_mm: Vec::new(),
            owner: vec![u32::MAX; 4 * columns * rows],
            columns,
            rows,
            pitch_mm,
            free_from_mm: Vec2::new(free_from(wx, px), free_from(wy, py)),
            yarns_per_mm: pitch_mm.recip(),
            period_mm,
            repeats_per_mm: period_mm.recip(),
        };
        // Strip 2 i is yarn i, strip 2 i + 1 the free space after it.
        let warp_is_up = |column: usize, row: usize| up[row][column];
        for i in 0..columns {
            let on_top = |strip: usize| strip % 2 == 1 || warp_is_up(i, strip / 2);
            tiling.cut(Yarn::Warp, i, rows, [wy, py - wy], [wx, px], on_top);
        }
        for j in 0..rows {
            let on_top = |strip: usize| strip % 2 == 1 || !warp_is_up(strip / 2, j);
            tiling.cut(Yarn::Weft, j, columns, [wx, px - wx], [wy, py], on_top);
        }
        Ok(tiling)
    }

    /// Adds the runs of one yarn: `strips` are the extents of a crossing and
    /// of the free space after it, `across` width and pitch of this yarn.
    fn cut(
        &mut self,
        yarn: Yarn,
        index: usize,
        crossings: usize,
        strips: [f64; 2],
        across: [f64; 2],
        on_top: impl Fn(usize) -> bool,
    ) {
        let count = 2 * crossings;
        let extent = |strip: usize| strips[strip % 2];
        // Begin after a dip, so that no run is cut at the end of the repeat.
        let first = (0..count).find(|&s| !on_top(s)).map_or(0, |s| s + 1);
        let mut s = 0;
        while s < count {
            let begin = s;
            let mut length = 0.0;
            while s < count && on_top((first + s) % count) {
                length += extent((first + s) % count);
                s += 1;
            }
            if length > 0.0 {
                let strip = (first + begin) % count;
                let start =
                    (strip / 2) as f64 * (strips[0] + strips[1]) + (strip % 2) as f64 * strips[0];
                let side = index as f64 * across[1];
                let corner = match yarn {
                    Yarn::Warp => Vec2::new(side as f32, start as f32),
                    Yarn::Weft => Vec2::new(start as f32, side as f32),
                };
                let id = self.segments.len() as u32;
                let half = 0.5 * Vec2::new(across[0] as f32, length as f32);
                self.middles_mm.push(match yarn {
                    Yarn::Warp => corner + half,
                    Yarn::Weft => corner + half.yx(),
                });
                self.segments.push(PlacedSegment {
                    yarn,
                    corner_mm: corner,
                    width_mm: across[0] as f32,
                    length_mm: length as f32,
                });
                for k in begin..s {
                    let along = (first + k) % count;
                    let cell = match yarn {
                        Yarn::Warp => along * 2 * self.columns + 2 * index,
                        Yarn::Weft => 2 * index * 2 * self.columns + along,
                    };
                    let wrapped = if along < strip { WRAPPED } else { 0 };
                    self.owner[cell] = id | wrapped | if yarn == Yarn::Weft { WEFT } else { 0 };
                }
            }
            s += 1;
        }
    }

    /// The visible pieces of one repeat.
    pub fn segments(&self) -> &[PlacedSegment] {
        &self.segments
    }

    /// Middle of a segment, mm, in the copy of the tile that holds its corner.
    pub(crate) fn middle_mm(&self, segment: usize) -> Vec2 {
        self.middles_mm[segment]
    }

    /// Size of one repeat, mm.
    pub fn period_mm(&self) -> Vec2 {
        self.period_mm
    }

    /// Number of yarns of a system in one repeat, and their pitch in mm.
    pub fn yarns(&self, yarn: Yarn) -> (usize, f32) {
        match yarn {
            Yarn::Warp => (self.columns, self.pitch_mm.x),
            Yarn::Weft => (self.rows, self.pitch_mm.y),
        }
    }

    /// The segment under a point of the fabric plane.
    #[inline]
    pub fn locate(&self, position_mm: Vec2) -> Spot {
        let period = self.period_mm;
        let mut copy = [
            floor(position_mm.x * self.repeats_per_mm.x),
            floor(position_mm.y * self.repeats_per_mm.y),
        ];
        let turns = Vec2::new(copy[0] as f32, copy[1] as f32);
        // A tiny negative position may round up to the whole period.
        let p = (position_mm - turns * period).clamp(Vec2::ZERO, period);
        let strip = |x: f32, per_mm: f32, pitch: f32, free_from: f32, count: usize| {
            let i = ((x * per_mm) as i32 as usize).min(count - 1);
            2 * i + usize::from(x - i as f32 * pitch >= free_from)
        };
        let (per_mm, pitch, free_from) = (self.yarns_per_mm, self.pitch_mm, self.free_from_mm);
        let sx = strip(p.x, per_mm.x, pitch.x, free_from.x, self.columns);
        let sy = strip(p.y, per_mm.y, pitch.y, free_from.y, self.rows);
        let owner = self.owner[sy * 2 * self.columns + sx];
        let segment = (owner & !(WEFT | WRAPPED)) as usize;
        // Without branches, which would be unpredictable: the weft is turned, and a run that
        // continues around the repeat began in the previous copy.
        let (weft, wrapped) = (owner >> 31, owner >> 30 & 1);
        let turn = UVec2::new(weft, 1 - weft) * wrapped;
        copy[0] = copy[0].wrapping_sub(turn.x as i32);
        copy[1] = copy[1].wrapping_sub(turn.y as i32);
        let from = p + turn.as_vec2() * period - self.middles_mm[segment];
        // The weft's frame has its x along the fabric's -y.
        let (sin, cos) = (weft as f32, (1 - weft) as f32);
        let (across_mm, along_mm) = (cos * from.x - sin * from.y, sin * from.x + cos * from.y);
        Spot {
            segment,
            across_mm,
            along_mm,
            copy,
        }
    }
}

/// Largest integer not above `x`, without a function call.
#[inline(always)]
pub(crate) fn floor(x: f32) -> i32 {
    let i = x as i32;
    i.wrapping_sub(i32::from(x < i as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn weave(draft: &[&str], pitch: [f64; 2], width: [f64; 2]) -> Weave {
        Weave {
            draft: draft.iter().map(|s| String::from(*s)).collect(),
            warp_pitch_mm: pitch[0],
            weft_pitch_mm: pitch[1],
            warp_width_mm: Some(width[0]),
            weft_width_mm: Some(width[1]),
        }
    }

    #[test]
    fn segments_cover_the_repeat_exactly_once() {
        for w in [
            weave(&["10", "01"], [1.0, 1.0], [1.0, 1.0]),
            weave(&["110", "011", "101"], [1.0, 2.0], [1.0, 1.0]),
            weave(&["11011", "01111", "11101"], [0.7, 0.4], [0.5, 0.4]),
            weave(&["11", "11"], [1.0, 1.0], [1.0, 1.0]),
            weave(&["0"], [1.0, 3.0], [0.5, 3.0]),
        ] {
            let t = Tiling::new(&w).unwrap();
            let area: f32 = t.segments().iter().map(|s| s.width_mm * s.length_mm).sum();
            let period = t.period_mm();
            let off = (area - period.x * period.y).abs();
            assert!(off < 4.0 * f32::EPSILON * area, "{w:?}");
            // Every point lies inside the rectangle that it is said to be in,
            // at coordinates on both sides of zero.
            for k in 0..4000 {
                let at = Vec2::new(
                    (k as f32 * 0.618_034).fract(),
                    (k as f32 * 0.381_97).fract(),
                );
                let spot = t.locate((at * 6.0 - Vec2::splat(3.0)) * period);
                let s = t.segments()[spot.segment];
                assert!(spot.across_mm.abs() <= 0.5 * s.width_mm + 1e-5, "{w:?}");
                assert!(spot.along_mm.abs() <= 0.5 * s.length_mm + 1e-5, "{w:?}");
            }
        }
    }

    #[test]
    fn twill_and_satin_have_the_floats_of_the_thesis() {
        // Denim: a 2/1 twill whose weft fills half its pitch.
        let t = Tiling::new(&weave(&["110", "011", "101"], [1.0, 2.0], [1.0, 1.0])).unwrap();
        for s in t.segments() {
            let expected = if s.yarn == Yarn::Warp { 5.0 } else { 1.0 };
            assert_eq!((s.width_mm, s.length_mm), (1.0, expected));
        }
        assert_eq!(t.segments().len(), 6);
    }

    #[test]
    fn behind_a_warp_float_lies_a_weft_float() {
        let w = weave(&["1110", "0111", "1011", "1101"], [1.0, 1.0], [1.0, 1.0]);
        let front = Tiling::new(&w).unwrap();
        let back = Tiling::seen_from_behind(&w).unwrap();
        for k in 0..500 {
            let at = Vec2::new(
                (k as f32 * 0.618_034).fract(),
                (k as f32 * 0.754_877).fract(),
            ) * 4.0;
            let here = front.segments()[front.locate(at).segment].yarn;
            let there = back.segments()[back.locate(Vec2::new(-at.x, at.y)).segment].yarn;
            assert_ne!(here, there, "{at}");
        }
    }

    #[test]
    fn bad_drafts_are_refused_with_a_place() {
        let message = |draft: &[&str], width: [f64; 2]| {
            Tiling::new(&weave(draft, [1.0, 1.0], width))
                .unwrap_err()
                .to_string()
        };
        assert!(message(&[], [1.0, 1.0]).contains("no crossings"));
        assert!(message(&["10", "1"], [1.0, 1.0]).contains("row 1 is not as long"));
        assert!(message(&["10", "1a"], [1.0, 1.0]).contains("row 2: 'a'"));
        assert!(message(&["10", "01"], [0.5, 0.5]).contains("warp_cover"));
        assert!(message(&["10", "01"], [2.0, 1.0]).contains("warp_width_mm"));
    }
}
