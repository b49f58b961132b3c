//! The patches that an exemplar cloth is put together from.

use super::{Exemplar, Window, Windows};
use crate::{Draft, Error};
use std::cmp::Reverse;
use std::collections::{BTreeMap, HashMap, HashSet};

/// Crossings along the edge of a patch.
pub const PATCH: usize = 16;
/// Places of a window at which a patch is tried.
const MAX_TRIES: usize = 8;

/// Patches of [`PATCH`] x [`PATCH`] crossings, side by side.
pub struct Patches {
    patches: Vec<Draft>,
    /// Where each is from, of patches of given exemplars.
    origins: Vec<Origin>,
}

/// Where a patch of a given exemplar is from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Origin {
    /// Number of the exemplar.
    pub exemplar: usize,
    /// End and pick of its first crossing.
    pub first: [usize; 2],
}

impl Patches {
    fn push(&mut self, source: &Draft, end: usize, pick: usize) -> Result<(), Error> {
        let patch = Draft::from_fn(PATCH, PATCH, |e, p| source.warp_up(end + e, pick + p));
        self.patches.push(patch?);
        Ok(())
    }

    /// Where the patches are from, if exemplars were given.
    pub fn origins(&self) -> &[Origin] {
        &self.origins
    }

    /// Patches along the x axis.
    pub fn across(&self) -> usize {
        (self.patches.len() as f64).sqrt().ceil().max(1.0) as usize
    }

    /// The whole exemplar. Places without a patch of their own repeat the first ones.
    pub fn draft(&self) -> Result<Draft, Error> {
        let across = self.across();
        let up = self.patches.len().div_ceil(across);
        Draft::from_fn(across * PATCH, up * PATCH, |e, p| {
            let patch = (p / PATCH * across + e / PATCH) % self.patches.len();
            self.patches[patch].warp_up(e % PATCH, p % PATCH)
        })
    }

    /// Crossings of the exemplar by their windows, at most so many of each. Windows that reach
    /// beyond a patch are left out.
    pub fn places_by_window(
        &self,
        radius: usize,
        variants: usize,
    ) -> BTreeMap<Window, Vec<[usize; 2]>> {
        let across = self.across();
        let mut places: BTreeMap<Window, Vec<[usize; 2]>> = BTreeMap::new();
        for (i, patch) in self.patches.iter().enumerate() {
            for p in radius..PATCH - radius {
                for e in radius..PATCH - radius {
                    places
                        .entry(Window::around(patch, e, p, radius))
                        .or_default()
                        .push([i % across * PATCH + e, i / across * PATCH + p]);
                }
            }
        }
        // Evenly among all: those of one row or patch would be alike.
        for found in places.values_mut().filter(|f| f.len() > variants) {
            let all = std::mem::take(found);
            let step = |i: usize| (2 * i + 1) * all.len() / (2 * variants);
            *found = (0..variants).map(|i| all[step(i)]).collect();
        }
        places
    }
}

/// Patches that hold one repeat of every draft, with all its windows.
///
/// # Errors
/// When they are more than there is room for.
pub fn cut_from(exemplars: &[Exemplar], radius: usize, room: usize) -> Result<Patches, Error> {
    let inside = PATCH - 2 * radius;
    let mut patches = Patches {
        patches: Vec::new(),
        origins: Vec::new(),
    };
    for (exemplar, Exemplar { draft, .. }) in exemplars.iter().enumerate() {
        let (ends, picks) = match exemplars[exemplar].heights {
            None => draft.repeat(),
            // Every crossing of a volume looks different.
            Some(_) => (draft.ends(), draft.picks()),
        };
        for pick in (0..picks).step_by(inside) {
            for end in (0..ends).step_by(inside) {
                if patches.patches.len() == room {
                    return Err(no_room("the exemplars need", room));
                }
                patches.push(draft, end, pick)?;
                patches.origins.push(Origin {
                    exemplar,
                    first: [end, pick],
                });
            }
        }
    }
    Ok(patches)
}

/// Patches of a design that hold the inner 3 x 3 crossings of all its windows and, as far as
/// there is room, all its windows, the most frequent first.
///
/// # Errors
/// When there is no room for the inner crossings.
pub fn cut_from_design(
    design: &Draft,
    windows: &Windows,
    radius: usize,
    room: usize,
) -> Result<Patches, Error> {
    let mut cutting = Cutting {
        design,
        windows,
        radius,
        room,
        patches: Patches {
            patches: Vec::new(),
            origins: Vec::new(),
        },
    };
    if !cutting.cover(Window::inner)? {
        return Err(no_room("the design's neighbourhoods need", room));
    }
    cutting.cover(|window| *window)?;
    Ok(cutting.patches)
}

fn no_room(what: &str, room: usize) -> Error {
    let more = 2 * room * PATCH * PATCH;
    let message = format!(
        "{what} more than {room} patches of {PATCH} x {PATCH} crossings; set exemplar_crossings to \
         {more} or more"
    );
    Error::spec("synthesis.exemplar_crossings", message)
}

/// A design from which patches are cut.
struct Cutting<'a> {
    design: &'a Draft,
    windows: &'a Windows,
    radius: usize,
    room: usize,
    patches: Patches,
}

/// What is known of the windows of one kind.
#[derive(Default)]
struct Occurrences {
    count: usize,
    first: Vec<usize>,
}

impl Cutting<'_> {
    /// Adds patches until they hold every kind of window. False when there is no room for all.
    fn cover<K: Copy + Ord + std::hash::Hash>(
        &mut self,
        kind: impl Fn(&Window) -> K,
    ) -> Result<bool, Error> {
        let mut occurrences: HashMap<K, Occurrences> = HashMap::new();
        for (i, window) in self.windows.of_crossing.iter().enumerate() {
            let found = occurrences.entry(kind(window)).or_default();
            found.count += 1;
            if found.first.len() < MAX_TRIES {
                found.first.push(i);
            }
        }
        let mut covered: HashSet<K> = HashSet::new();
        let known = self.patches.places_by_window(self.radius, 1);
        covered.extend(known.keys().map(&kind));
        let mut order: Vec<K> = occurrences.keys().copied().collect();
        order.sort_by_key(|k| (Reverse(occurrences[k].count), *k));
        for key in order {
            if covered.contains(&key) {
                continue;
            }
            if self.patches.patches.len() == self.room {
                return Ok(false);
            }
            let mut best = (0, (0, 0), HashSet::new());
            for &place in &occurrences[&key].first {
                for corner in self.corners(place) {
                    let new: HashSet<K> = self
                        .inside(corner)
                        .map(|i| kind(&self.windows.of_crossing[i]))
                        .filter(|k| !covered.contains(k))
                        .collect();
                    let gain: usize = new.iter().map(|k| occurrences[k].count).sum();
                    if gain > best.0 {
                        best = (gain, corner, new);
                    }
                }
            }
            let (_, (end, pick), new) = best;
            self.patches.push(self.design, end, pick)?;
            covered.extend(new);
        }
        Ok(true)
    }

    /// Corners of patches that hold a crossing well inside: near each of their edges, and in
    /// the middle.
    fn corners(&self, place: usize) -> impl Iterator<Item = (usize, usize)> {
        let (ends, picks) = (self.design.ends(), self.design.picks());
        let (end, pick) = (place % ends, place / ends);
        let last = PATCH - self.radius - 1;
        let before = [self.radius, PATCH / 2, last];
        let back = |at: usize, n: usize, by: usize| (at + n * PATCH - by) % n;
        before
            .into_iter()
            .flat_map(move |y| before.map(|x| (back(end, ends, x), back(pick, picks, y))))
    }

    /// Crossings of the design whose windows lie inside the patch with this corner.
    fn inside(&self, (end, pick): (usize, usize)) -> impl Iterator<Item = usize> {
        let (ends, picks) = (self.design.ends(), self.design.picks());
        let range = self.radius..PATCH - self.radius;
        range.clone().flat_map(move |p| {
            let row = (pick + p) % picks * ends;
            range.clone().map(move |e| row + (end + e) % ends)
        })
    }
}
