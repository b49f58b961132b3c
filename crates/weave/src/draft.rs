//! Weave drafts: which warp threads lie over which weft threads.

use crate::Error;
use crate::layers::{Layers, Sheds};
use organza_basis::Rgb;

/// The most threads of one system that a draft may have.
pub const MAX_THREADS: usize = 16_384;
/// The most crossings that a draft may have.
pub const MAX_CROSSINGS: usize = 1 << 26;

/// One thread of a draft, with the properties that the draft gives.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Thread {
    /// Linear colour.
    pub colour: Option<Rgb>,
    /// Distance that the thread takes up in the fabric, millimetres.
    pub spacing_mm: Option<f32>,
    /// Diameter as drawn, millimetres. A cloth has the diameters of its yarns instead, see
    /// [`crate::Sett::yarns`].
    pub thickness_mm: Option<f32>,
}

/// A weave: end `e` (warp, counted along x) and pick `p` (weft, counted along
/// y) cross once, and the draft says which lies on the face.
#[derive(Clone, Debug, PartialEq)]
pub struct Draft {
    /// Name or title, for people.
    pub title: String,
    /// Warp threads in order of growing x.
    pub warp: Vec<Thread>,
    /// Weft threads in order of growing y.
    pub weft: Vec<Thread>,
    /// Warnings about the file that the draft was read from.
    pub warnings: Vec<String>,
    /// Pick-major: `warp_up[p * ends + e]`.
    warp_up: Vec<bool>,
}

impl Draft {
    /// A draft of `ends` x `picks` without colours, from a rule for "end lies
    /// over pick".
    ///
    /// # Errors
    /// When there is no thread, or more than [`MAX_THREADS`] or
    /// [`MAX_CROSSINGS`].
    pub fn from_fn(
        ends: usize,
        picks: usize,
        mut warp_up: impl FnMut(usize, usize) -> bool,
    ) -> Result<Draft, Error> {
        check_size(ends, picks)?;
        let cells = (0..picks).flat_map(|p| (0..ends).map(move |e| (e, p)));
        Ok(Draft {
            title: String::new(),
            warp: vec![Thread::default(); ends],
            weft: vec![Thread::default(); picks],
            warnings: Vec::new(),
            warp_up: cells.map(|(e, p)| warp_up(e, p)).collect(),
        })
    }

    /// A draft from rows of `X` (warp on the face; also `x`, `#`, `1`) and `.`
    /// (weft on the face; also `-`, `0`, `_`), spaces ignored. Rows are written
    /// as seen on the face: the last row is the first pick.
    ///
    /// # Errors
    /// When a row is empty, differs in length or holds another character.
    pub fn from_drawdown<S: AsRef<str>>(rows: &[S]) -> Result<Draft, Error> {
        let mut cells = Vec::with_capacity(rows.len());
        for (i, row) in rows.iter().enumerate() {
            let row: Vec<bool> = row
                .as_ref()
                .chars()
                .filter(|c| !c.is_whitespace())
                .map(|c| match c {
                    'X' | 'x' | '#' | '1' => Ok(true),
                    '.' | '-' | '0' | '_' => Ok(false),
                    _ => Err(Error::spec(
                        "draft.drawdown",
                        format!("row {}: expected X or . but found '{c}'", i + 1),
                    )),
                })
                .collect::<Result<_, _>>()?;
            cells.push(row);
        }
        let ends = cells.first().map_or(0, Vec::len);
        if let Some(i) = cells.iter().position(|r| r.len() != ends) {
            return Err(Error::spec(
                "draft.drawdown",
                format!(
                    "row {} has {} ends where the first has {ends}",
                    i + 1,
                    cells[i].len()
                ),
            ));
        }
        let picks = cells.len();
        Draft::from_fn(ends, picks, |e, p| cells[picks - 1 - p][e])
    }

    /// Number of warp threads.
    pub fn ends(&self) -> usize {
        self.warp.len()
    }

    /// Number of weft threads.
    pub fn picks(&self) -> usize {
        self.weft.len()
    }

    /// True when the warp lies on the face where end `end` crosses pick
    /// `pick`; both are taken modulo the draft, which repeats without end.
    pub fn warp_up(&self, end: usize, pick: usize) -> bool {
        self.warp_up[(pick % self.picks()) * self.ends() + end % self.ends()]
    }

    /// The interlacing as text that [`Draft::from_drawdown`] reads: one line per pick, the last
    /// pick first.
    pub fn drawdown(&self) -> String {
        let mut text = String::with_capacity((self.ends() + 1) * self.picks());
        for p in (0..self.picks()).rev() {
            text.extend((0..self.ends()).map(|e| if self.warp_up(e, p) { 'X' } else { '.' }));
            text.push('\n');
        }
        text
    }

    /// Ends and picks of the smallest repeat of the interlacing alone.
    pub fn repeat(&self) -> (usize, usize) {
        (
            period(self.ends(), |a, b| {
                (0..self.picks()).all(|p| self.warp_up(a, p) == self.warp_up(b, p))
            }),
            period(self.picks(), |a, b| {
                (0..self.ends()).all(|e| self.warp_up(e, a) == self.warp_up(e, b))
            }),
        )
    }

    /// The draft cut down to its smallest repeat, colours, spacings and
    /// thicknesses included.
    pub fn smallest_repeat(&self) -> Draft {
        let ends = period(self.ends(), |a, b| {
            self.warp[a] == self.warp[b]
                && (0..self.picks()).all(|p| self.warp_up(a, p) == self.warp_up(b, p))
        });
        let picks = period(self.picks(), |a, b| {
            self.weft[a] == self.weft[b]
                && (0..self.ends()).all(|e| self.warp_up(e, a) == self.warp_up(e, b))
        });
        self.tiled(ends, picks)
    }

    /// The first `ends` x `picks` of the endless repetition of this draft.
    pub(crate) fn tiled(&self, ends: usize, picks: usize) -> Draft {
        let cells = (0..picks).flat_map(|p| (0..ends).map(move |e| (e, p)));
        Draft {
            title: self.title.clone(),
            warp: self.warp.iter().copied().cycle().take(ends).collect(),
            weft: self.weft.iter().copied().cycle().take(picks).collect(),
            warnings: self.warnings.clone(),
            warp_up: cells.map(|(e, p)| self.warp_up(e, p)).collect(),
        }
    }

    /// So many ends and picks of the endless repetition of this draft, from the end and the
    /// pick `first` on.
    ///
    /// # Errors
    /// As [`Draft::from_fn`].
    pub fn part(&self, first: [usize; 2], size: [usize; 2]) -> Result<Draft, Error> {
        let [ends, picks] = size;
        // Sums stay small.
        let first = [first[0] % self.ends(), first[1] % self.picks()];
        let mut part =
            Draft::from_fn(ends, picks, |e, p| self.warp_up(first[0] + e, first[1] + p))?;
        let threads = |all: &[Thread], first: usize, count: usize| {
            let from_first = all.iter().copied().cycle().skip(first);
            from_first.take(count).collect()
        };
        part.warp = threads(&self.warp, first[0], ends);
        part.weft = threads(&self.weft, first[1], picks);
        part.title.clone_from(&self.title);
        part.warnings.clone_from(&self.warnings);
        Ok(part)
    }

    /// The properties of the draft that a listing shows.
    pub fn summary(&self) -> DraftSummary {
        let repeat = self.repeat();
        DraftSummary {
            title: self.title.clone(),
            ends: self.ends(),
            picks: self.picks(),
            repeat_ends: repeat.0,
            repeat_picks: repeat.1,
            layers: self.layers(),
            floats: self.floats(),
            cover: self.cover(),
            warnings: self.warnings.clone(),
        }
    }

    /// How many layers its ends and its picks form, if there are several: threads of double
    /// cloth, backed cloth and extra weft lie over others of their system.
    pub fn layers(&self) -> Option<[usize; 2]> {
        let counts = [Sheds::Warp(self), Sheds::Weft(self)].map(|s| Layers::new(s).count);
        (counts != [1, 1]).then_some(counts)
    }

    /// Cover, from the spacings and thicknesses of the threads.
    fn cover(&self) -> Option<f64> {
        let bare = |threads: &[Thread]| {
            let sum = |f: fn(&Thread) -> Option<f32>| {
                threads
                    .iter()
                    .map(|t| f(t).map(f64::from))
                    .sum::<Option<f64>>()
            };
            let (thick, wide) = (sum(|t| t.thickness_mm)?, sum(|t| t.spacing_mm)?);
            Some((1.0 - thick / wide).max(0.0))
        };
        Some(1.0 - bare(&self.warp)? * bare(&self.weft)?)
    }

    /// The longest floats and the share of warp on the face.
    pub fn floats(&self) -> Floats {
        let mut floats = Floats::default();
        for e in 0..self.ends() {
            let column: Vec<bool> = (0..self.picks()).map(|p| self.warp_up(e, p)).collect();
            floats.warp_face = floats.warp_face.max(longest_run(&column, true));
            floats.warp_back = floats.warp_back.max(longest_run(&column, false));
            floats.loose_ends += usize::from(interlacings(&column) == 0);
        }
        for p in 0..self.picks() {
            let row: Vec<bool> = (0..self.ends()).map(|e| self.warp_up(e, p)).collect();
            floats.weft_face = floats.weft_face.max(longest_run(&row, false));
            floats.weft_back = floats.weft_back.max(longest_run(&row, true));
            floats.loose_picks += usize::from(interlacings(&row) == 0);
        }
        let up = self.warp_up.iter().filter(|&&u| u).count();
        floats.warp_share = up as f64 / self.warp_up.len() as f64;
        floats
    }
}

/// What a listing shows of a draft.
#[derive(Clone, Debug, serde::Serialize)]
pub struct DraftSummary {
    /// Name or title.
    pub title: String,
    /// Warp threads.
    pub ends: usize,
    /// Weft threads.
    pub picks: usize,
    /// Warp threads in the smallest repeat of the interlacing.
    pub repeat_ends: usize,
    /// Weft threads in the smallest repeat of the interlacing.
    pub repeat_picks: usize,
    /// Layers of ends and of picks, of a draft that has several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub layers: Option<[usize; 2]>,
    /// Floats and the share of warp on the face.
    pub floats: Floats,
    /// Share of the surface that any thread covers, when the draft gives a
    /// spacing and a thickness of every thread.
    pub cover: Option<f64>,
    /// Warnings about the file.
    pub warnings: Vec<String>,
}

/// Floats of a draft, counted in crossings around its endless repetition; a
/// thread that never interlaces floats over the whole repeat.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Floats {
    /// Longest run of an end over picks.
    pub warp_face: usize,
    /// Longest run of an end under picks.
    pub warp_back: usize,
    /// Longest run of a pick over ends.
    pub weft_face: usize,
    /// Longest run of a pick under ends.
    pub weft_back: usize,
    /// Ends that never interlace.
    pub loose_ends: usize,
    /// Picks that never interlace.
    pub loose_picks: usize,
    /// Share of the crossings with the warp on the face.
    pub warp_share: f64,
}

fn check_size(ends: usize, picks: usize) -> Result<(), Error> {
    if ends == 0 || picks == 0 {
        return Err(Error::spec("draft", "a draft needs an end and a pick"));
    }
    if ends > MAX_THREADS || picks > MAX_THREADS || ends * picks > MAX_CROSSINGS {
        return Err(Error::spec(
            "draft",
            format!(
                "{ends} ends x {picks} picks are more than {MAX_THREADS} threads \
                 or {MAX_CROSSINGS} crossings"
            ),
        ));
    }
    Ok(())
}

/// The smallest divisor `d` of `n` such that items `d` apart are equal.
fn period(n: usize, equal: impl Fn(usize, usize) -> bool) -> usize {
    (1..n)
        .filter(|d| n.is_multiple_of(*d))
        .find(|&d| (d..n).all(|i| equal(i, i - d)))
        .unwrap_or(n)
}

/// Longest run of `value` around a cyclic list.
fn longest_run(cells: &[bool], value: bool) -> usize {
    let (mut longest, mut run) = (0, 0);
    for &c in cells.iter().chain(cells) {
        run = if c == value { run + 1 } else { 0 };
        longest = longest.max(run);
    }
    longest.min(cells.len())
}

/// How often a thread changes sides around a cyclic list.
pub(crate) fn interlacings(cells: &[bool]) -> usize {
    (0..cells.len())
        .filter(|&i| cells[i] != cells[(i + 1) % cells.len()])
        .count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drawdown_comes_back_as_it_was_written() {
        let rows = ["XX..", ".XX.", "..XX", "X..X", "X.X."];
        let draft = Draft::from_drawdown(&rows).unwrap();
        assert_eq!((draft.ends(), draft.picks()), (4, 5));
        assert!(
            draft.warp_up(0, 0) && !draft.warp_up(1, 0),
            "last row is pick 1"
        );
        assert_eq!(draft.drawdown(), rows.join("\n") + "\n");
    }

    #[test]
    fn the_smallest_repeat_is_found_in_both_directions() {
        let twill = Draft::from_drawdown(&["X..", ".X.", "..X"]).unwrap();
        let big = twill.tiled(12, 9);
        assert_eq!(big.repeat(), (3, 3));
        assert_eq!(big.smallest_repeat(), twill);
        let mut striped = big;
        for (i, t) in striped.warp.iter_mut().enumerate() {
            t.colour = Some(Rgb::splat((i % 2) as f32));
        }
        assert_eq!(striped.smallest_repeat().ends(), 6);
        assert_eq!(striped.smallest_repeat().picks(), 3);
    }

    #[test]
    fn floats_run_around_the_repeat() {
        let draft = Draft::from_drawdown(&["XX.X", "X.XX", ".XXX", "XXX."]).unwrap();
        let floats = draft.floats();
        assert_eq!((floats.warp_face, floats.warp_back), (3, 1));
        assert_eq!((floats.weft_face, floats.weft_back), (1, 3));
        assert_eq!(floats.warp_share, 0.75);
        let loose = Draft::from_drawdown(&["XX", ".X"]).unwrap().floats();
        assert_eq!((loose.loose_ends, loose.loose_picks), (1, 1));
    }

    #[test]
    fn cover_is_known_where_every_thread_says_its_size() {
        let mut draft = Draft::named("plain").unwrap();
        assert_eq!(draft.summary().cover, None);
        for t in draft.warp.iter_mut().chain(&mut draft.weft) {
            (t.spacing_mm, t.thickness_mm) = (Some(0.5), Some(0.2));
        }
        assert!((draft.summary().cover.unwrap() - 0.64).abs() < 4.0 * f64::from(f32::EPSILON));
    }

    #[test]
    fn wrong_drawdowns_say_where() {
        for (rows, message) in [
            (vec!["X.", "X"], "draft.drawdown: row 2 has 1 ends"),
            (vec!["Xo"], "row 1: expected X or ."),
            (vec![], "needs an end and a pick"),
        ] {
            let error = Draft::from_drawdown(&rows).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
