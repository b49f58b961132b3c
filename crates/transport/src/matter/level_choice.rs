//! Which level of detail a path meets.

use crate::Integrator;
use glam::Vec2;
use organza_scatter::Footprint;

/// What decides which representation of a cloth a path meets: drawn once, so
/// that a path meets one and the same cloth however often it comes back, and so
/// that the mean over paths is the blend of the representations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Detail {
    /// Width of the pixel where its ray first comes to a cloth of several
    /// levels; zero asks for the finest.
    pub footprint_mm: f32,
    /// Uniform in `[0, 1)`: sides with the coarser of two representations when
    /// below its weight.
    pub choice: f32,
}

impl Detail {
    /// The piece of a sheet around a place that the path sees.
    pub(crate) fn footprint_at(self, position_mm: Vec2) -> Footprint {
        Footprint::new(position_mm, self.footprint_mm)
    }

    /// The finest representation of everything.
    pub const FINEST: Detail = Detail {
        footprint_mm: 0.0,
        choice: 0.0,
    };
}

/// How far a path has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Events so far.
    pub events: u32,
    /// The least that it has carried after an event, before roulette: the mean of the
    /// channels of its throughput.
    pub least_weight: f32,
}

impl Progress {
    /// At the camera.
    pub const NONE: Progress = Progress {
        events: 0,
        least_weight: 1.0,
    };
}

/// How a path finds collisions, and with what.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracking {
    /// How distances and transmittances are found.
    pub integrator: Integrator,
    /// How closely the path looks.
    pub detail: Detail,
    /// How far it has come: cloth of several kinds of fibres shows one after the other.
    pub progress: Progress,
}

impl From<Integrator> for Tracking {
    /// Through the finest representations.
    fn from(integrator: Integrator) -> Tracking {
        Tracking {
            integrator,
            detail: Detail::FINEST,
            progress: Progress::NONE,
        }
    }
}

/// The representations of a cloth from fine to coarse, and at which footprints
/// each gives way to the next.
///
/// Between the two widths of a step the coarser one's weight is a smooth
/// function of the footprint's logarithm, so that neither a zoom nor a floor
/// that runs to the horizon shows where levels change.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LevelSteps {
    steps: Vec<(f32, f32)>,
}

impl LevelSteps {
    /// Step `i` leads from representation `i` to `i + 1` as the footprint grows
    /// from the first of its widths in mm to the second.
    ///
    /// `None` unless widths are positive and rise through all steps.
    pub fn new(steps: Vec<(f32, f32)>) -> Option<LevelSteps> {
        let widths = steps.iter().flat_map(|s| [s.0, s.1]);
        let risen = |w: &[f32]| w[0] < w[1];
        let good = steps.iter().all(|s| risen(&[s.0, s.1]))
            && steps.windows(2).all(|s| s[0].1 <= s[1].0)
            && widths.clone().all(|w| w > 0.0 && w.is_finite());
        good.then_some(LevelSteps { steps })
    }

    /// Number of representations.
    pub fn count(&self) -> usize {
        self.steps.len() + 1
    }

    /// The representation a path meets.
    pub fn choose(&self, detail: Detail) -> usize {
        let (finer, weight) = self.blend(detail.footprint_mm);
        finer + usize::from(detail.choice < weight)
    }

    /// The finer of the two representations at a footprint, and the weight of
    /// the next coarser one.
    pub fn blend(&self, footprint_mm: f32) -> (usize, f32) {
        for (i, &(from, to)) in self.steps.iter().enumerate() {
            if footprint_mm <= from {
                return (i, 0.0);
            }
            if footprint_mm < to {
                let x = (footprint_mm / from).ln() / (to / from).ln();
                return (i, x * x * (3.0 - 2.0 * x));
            }
        }
        (self.steps.len(), 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_pass_smoothly_from_each_level_to_the_next() {
        let steps = LevelSteps::new(vec![(0.02, 0.04), (0.04, 0.08), (0.5, 1.0)]).unwrap();
        assert_eq!(steps.count(), 4);
        let mean_level = |f: f32| {
            let (finer, weight) = steps.blend(f);
            finer as f32 + weight
        };
        let mut before = mean_level(0.001);
        assert_eq!(before, 0.0);
        for i in 1..4000 {
            let f = 0.001 * (i as f32 * 0.002).exp();
            let here = mean_level(f);
            // Slope 3/2 over an octave, 350 steps of it.
            assert!(here >= before && here - before < 1.6 / 346.0, "{f}");
            before = here;
        }
        assert_eq!(before, 3.0);
        assert_eq!(mean_level(0.3), 2.0);
    }

    #[test]
    fn a_choice_is_the_blend_in_the_mean() {
        let steps = LevelSteps::new(vec![(1.0, 2.0)]).unwrap();
        let (_, weight) = steps.blend(1.3);
        let n = 10_000;
        let coarse = (0..n)
            .filter(|&i| {
                steps.choose(Detail {
                    footprint_mm: 1.3,
                    choice: i as f32 / n as f32,
                }) == 1
            })
            .count();
        assert!((coarse as f32 / n as f32 - weight).abs() < 2e-4);
        assert_eq!(steps.choose(Detail::FINEST), 0);
    }

    #[test]
    fn steps_that_fall_or_overlap_are_refused() {
        for wrong in [
            vec![(2.0, 1.0)],
            vec![(0.0, 1.0)],
            vec![(1.0, 3.0), (2.0, 4.0)],
            vec![(1.0, f32::NAN)],
        ] {
            assert_eq!(LevelSteps::new(wrong), None);
        }
    }
}
