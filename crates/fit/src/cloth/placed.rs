//! The place of a computed picture under a photograph.

use super::pictures::Computed;
use super::sides::Side;
use organza_photograph::{Likeness, blurred};

/// Bounds of the blur, texels.
const BLURS: [f64; 2] = [0.1, 4.0];
/// Steps of the search for a place, texels.
const STEPS: [f64; 4] = [1.0, 0.5, 0.25, 0.12];
/// Moves by one step, at most.
const MOVES: usize = 12;

/// The place of a computed picture under a photograph.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// How far it is moved right and up, texels.
    pub shift: [f64; 2],
    /// Standard deviation of its blur, texels in the mean.
    pub blur: f64,
}

impl Placed {
    /// Where a picture is most like a photograph.
    pub fn of(likeness: &Likeness) -> Placed {
        Placed {
            shift: likeness.shift,
            blur: likeness.blur,
        }
    }

    /// Places beside this one: moved by a step along either axis, and sharper or softer.
    fn neighbours(&self, step: f64) -> [Placed; 6] {
        let moved = |dx: f64, dy: f64| Placed {
            shift: [self.shift[0] + dx * step, self.shift[1] + dy * step],
            ..*self
        };
        let blurred = |sign: f64| Placed {
            blur: (self.blur * (1.0 + 0.5 * sign * step)).clamp(BLURS[0], BLURS[1]),
            ..*self
        };
        [
            moved(1.0, 0.0),
            moved(-1.0, 0.0),
            moved(0.0, 1.0),
            moved(0.0, -1.0),
            blurred(1.0),
            blurred(-1.0),
        ]
    }

    /// A computed photograph in this place.
    pub fn shown(&self, picture: &Computed, side: &Side) -> Vec<[f64; 3]> {
        self.blurred(&picture.folded(self.shift), side)
    }

    /// The same without a strip of an axis.
    pub fn shown_without(
        &self,
        strip: (usize, usize),
        picture: &Computed,
        side: &Side,
    ) -> Vec<[f64; 3]> {
        self.blurred(&picture.folded_without(strip, self.shift), side)
    }

    fn blurred(&self, picture: &[[f64; 3]], side: &Side) -> Vec<[f64; 3]> {
        blurred(picture, side.fold.size(), side.fold.blur(self.blur))
    }

    /// The nearest place where a picture is most like the photograph, by steps that become smaller.
    /// `weights` are those of the texels.
    pub fn nearest(self, picture: &Computed, side: &Side, weights: &[[f64; 3]]) -> Placed {
        let cost = |at: &Placed| -> f64 {
            let shown = at.shown(picture, side);
            let texels = shown.iter().zip(&side.fold.mean).zip(weights);
            let square = |((a, b), w): ((&[f64; 3], &[f64; 3]), &[f64; 3])| {
                (0..3).map(|c| ((a[c] - b[c]) * w[c]).powi(2)).sum::<f64>()
            };
            texels.map(square).sum()
        };
        let mut best = (cost(&self), self);
        for step in STEPS {
            for _ in 0..MOVES {
                let beside = best.1.neighbours(step).map(|p| (cost(&p), p));
                let Some(next) = beside.into_iter().min_by(|a, b| a.0.total_cmp(&b.0)) else {
                    break;
                };
                if next.0 >= best.0 {
                    break;
                }
                best = next;
            }
        }
        best.1
    }
}
