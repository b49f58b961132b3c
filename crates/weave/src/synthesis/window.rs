//! The interlacing around a crossing.

use crate::Draft;

/// Which threads lie on the face in a square of crossings around one of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Window {
    /// Crossings beside the middle: 1 or 2.
    radius: u8,
    /// One bit for each crossing, end by end, then pick by pick: set where the warp is up.
    warp_up: u32,
}

impl Window {
    /// The window around a crossing of a draft, which repeats without end.
    pub(crate) fn around(draft: &Draft, end: usize, pick: usize, radius: usize) -> Window {
        let edge = 2 * radius + 1;
        let (ends, picks) = (draft.ends(), draft.picks());
        let first = (end + ends * radius - radius, pick + picks * radius - radius);
        let mut warp_up = 0;
        for p in 0..edge {
            for e in 0..edge {
                let bit = u32::from(draft.warp_up(first.0 + e, first.1 + p));
                warp_up |= bit << (p * edge + e);
            }
        }
        Window {
            radius: radius as u8,
            warp_up,
        }
    }

    fn edge(&self) -> u32 {
        2 * u32::from(self.radius) + 1
    }

    fn is_up(&self, end: u32, pick: u32) -> bool {
        self.warp_up >> (pick * self.edge() + end) & 1 == 1
    }

    /// The middle 3 x 3 crossings.
    pub fn inner(&self) -> Window {
        let margin = u32::from(self.radius) - 1;
        let mut warp_up = 0;
        for p in 0..3 {
            for e in 0..3 {
                warp_up |= u32::from(self.is_up(e + margin, p + margin)) << (3 * p + e);
            }
        }
        Window { radius: 1, warp_up }
    }

    /// Number of crossings in which two windows of one size differ.
    pub(crate) fn difference(&self, other: &Window) -> u32 {
        (self.warp_up ^ other.warp_up).count_ones()
    }

    /// Rows of `X` (warp on the face) and `.`, the last pick first.
    pub fn picture(&self) -> String {
        let row = |p: u32| -> String {
            let cell = |e| if self.is_up(e, p) { 'X' } else { '.' };
            (0..self.edge()).map(cell).chain(['\n']).collect()
        };
        (0..self.edge()).rev().map(row).collect()
    }
}
