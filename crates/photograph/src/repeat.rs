//! How the crossings of a photograph repeat.

use crate::crossings::Crossings;
use organza_weave::Draft;

/// The most crossings of a repeat.
pub const MAX_CROSSINGS: usize = 16;
/// Repeats that the picture must show.
const MIN_REPEATS: usize = 3;
/// A repeat is chosen if it explains this share of what the best one does: threads that differ
/// by chance make larger repeats explain a little more, while one that is too small explains
/// much less.
const NEARLY: f64 = 0.75;

/// A way in which crossings repeat: after `ends` ends on one pick, and after `picks` picks
/// moved by `shift` ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Repeat {
    /// Ends after which a pick repeats.
    pub ends: usize,
    /// Ends by which the repeat moves after `picks` picks.
    pub shift: usize,
    /// Picks of one repeat.
    pub picks: usize,
}

impl Repeat {
    /// Different crossings.
    pub fn count(self) -> usize {
        self.ends * self.picks
    }

    /// Which crossing of the repeat a crossing is, from 0 to [`Repeat::count`].
    pub fn class(self, end: i64, pick: i64) -> usize {
        let row = pick.div_euclid(self.picks as i64);
        let end = end - row * self.shift as i64;
        let pick = pick.rem_euclid(self.picks as i64) as usize;
        pick * self.ends + end.rem_euclid(self.ends as i64) as usize
    }

    /// Whether this is another repeat several times over, so that it allows more drafts but
    /// shows no other likeness of crossings.
    pub fn is_multiple_of(self, other: Repeat) -> bool {
        other.class(self.ends as i64, 0) == 0
            && other.class(self.shift as i64, self.picks as i64) == 0
    }

    /// Picks after which the repeat comes back without a shift.
    pub fn all_picks(self) -> usize {
        let mut rows = 1;
        while !(rows * self.shift).is_multiple_of(self.ends) {
            rows += 1;
        }
        rows * self.picks
    }

    /// The repeat of a draft, of at most [`MAX_CROSSINGS`] threads of each system: the fewest
    /// crossings after which it comes back.
    pub fn of_draft(draft: &Draft) -> Repeat {
        let (ends, picks) = draft.repeat();
        let whole = Repeat {
            ends,
            shift: 0,
            picks,
        };
        let moved = (1..=picks)
            .filter(|p| picks.is_multiple_of(*p))
            .flat_map(|picks| (0..ends).map(move |shift| Repeat { ends, shift, picks }));
        let suits = |r: &Repeat| r.suits(draft);
        moved.into_iter().find(suits).unwrap_or(whole)
    }

    /// Every repeat of `2..=MAX_CROSSINGS` crossings, the smallest first.
    pub(crate) fn all() -> impl Iterator<Item = Repeat> {
        (2..=MAX_CROSSINGS).flat_map(|count| {
            (1..=count)
                .filter(move |e| count.is_multiple_of(*e))
                .flat_map(move |ends| {
                    (0..ends).map(move |shift| Repeat {
                        ends,
                        shift,
                        picks: count / ends,
                    })
                })
        })
    }

    /// The repeats that explain the differences between crossings, the best first, with the
    /// share that each explains: the smallest that explains nearly as much as any, then those
    /// that explain less or need more crossings. At most `count`, none a multiple of one before.
    pub(crate) fn of_crossings(crossings: &Crossings, count: usize) -> Vec<(Repeat, f64)> {
        let all = crossings.unexplained(|_, _| 0, 1).unwrap_or(0.0).max(1e-12);
        let explained = |r: Repeat| {
            let enough = crossings.len() >= MIN_REPEATS * r.count();
            let rest = enough.then(|| crossings.unexplained(|e, p| r.class(e, p), r.count()));
            rest.flatten().map(|rest| (r, 1.0 - rest / all))
        };
        let mut tried: Vec<(Repeat, f64)> = Repeat::all().filter_map(explained).collect();
        let most = tried.iter().map(|t| t.1).fold(0.0, f64::max);
        tried.retain(|t| t.1 > 0.0);
        // Nearly as good counts as the same; then the smaller repeat is the simpler answer.
        let rank = |t: &(Repeat, f64)| (t.1 < NEARLY * most, t.0.count());
        tried.sort_by(|a, b| rank(a).cmp(&rank(b)).then(b.1.total_cmp(&a.1)));
        let mut list: Vec<(Repeat, f64)> = Vec::new();
        for t in tried {
            let is_new = !list.iter().any(|l| t.0.is_multiple_of(l.0));
            if is_new && list.len() < count {
                list.push(t);
            }
        }
        list
    }
}
