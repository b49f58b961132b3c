//! The drafts that a repeat may have.

use crate::Repeat;
use organza_weave::Draft;

/// The most crossings of a repeat of which every interlacing is tried.
const EVERY: usize = 6;

/// Names of the weaves that are recognised.
pub(crate) fn names() -> Vec<String> {
    let mut names = vec!["plain".to_owned()];
    for n in 3..=8usize {
        for over in 1..n {
            names.extend(["z", "s"].map(|turn| format!("twill-{over}-{}-{turn}", n - over)));
        }
        for step in 2..n.saturating_sub(1) {
            names.extend(["satin", "sateen"].map(|kind| format!("{kind}-{n}-{step}")));
        }
    }
    for ends in 1..=4 {
        for picks in (1..=4).filter(|&picks| (ends, picks) != (1, 1)) {
            names.push(format!("basket-{ends}-{picks}"));
        }
    }
    names
}

/// Whether two drafts are the same but for where their repeat begins.
pub fn is_same_weave(a: &Draft, b: &Draft) -> bool {
    let (ends, picks) = a.repeat();
    b.repeat() == (ends, picks)
        && (0..ends).any(|e| {
            (0..picks).any(|p| {
                (0..ends).all(|i| (0..picks).all(|j| a.warp_up(i + e, j + p) == b.warp_up(i, j)))
            })
        })
}

/// The named weave that a draft is, wherever its repeat begins.
pub fn name_of(draft: &Draft) -> Option<String> {
    names()
        .into_iter()
        .find(|name| Draft::named(name).is_ok_and(|named| is_same_weave(&named, draft)))
}

/// Whether every thread of a draft passes from one side of the cloth to the other.
fn interlaces(draft: &Draft) -> bool {
    let floats = draft.floats();
    floats.loose_ends == 0 && floats.loose_picks == 0
}

impl Repeat {
    /// Whether a draft comes back after this repeat.
    pub fn suits(self, draft: &Draft) -> bool {
        let (ends, picks) = draft.repeat();
        let same = |e: usize, p: usize| {
            (0..ends)
                .all(|i| (0..picks).all(|j| draft.warp_up(i, j) == draft.warp_up(i + e, j + p)))
        };
        same(self.ends, 0) && same(self.shift, self.picks)
    }

    /// The drafts with this repeat: named weaves, their complements, and for small repeats every
    /// interlacing. Each is of the size of the whole repeat, and no two are the same weave.
    pub fn drafts(self) -> Vec<Draft> {
        let (ends, picks) = (self.ends, self.all_picks());
        let mut list: Vec<Draft> = Vec::new();
        let mut add = |draft: Draft| {
            let is_new = !list.iter().any(|d| is_same_weave(d, &draft));
            if is_new && interlaces(&draft) {
                list.push(draft);
            }
        };
        let named = names().into_iter().filter_map(|n| Draft::named(&n).ok());
        for draft in named.filter(|d| self.suits(d)) {
            for is_face in [true, false] {
                let whole = Draft::from_fn(ends, picks, |e, p| draft.warp_up(e, p) == is_face);
                whole.into_iter().for_each(&mut add);
            }
        }
        let n = self.count();
        if n <= EVERY {
            for bits in 1u32..(1 << n) - 1 {
                let up = |e: usize, p: usize| bits >> self.class(e as i64, p as i64) & 1 == 1;
                Draft::from_fn(ends, picks, up)
                    .into_iter()
                    .for_each(&mut add);
            }
        }
        list
    }
}
