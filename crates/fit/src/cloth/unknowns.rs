//! What a fit to photographs changes, and by which measure.

use super::model::{ClothModel, SYSTEMS, Trial};
use super::sides::Side;
use organza_measure::fit::Determined;

/// Bounds of colours.
const COLOURS: [f64; 2] = [0.002, 0.98];
/// Step of the measure of colours for derivatives.
pub const COLOUR_STEP: f64 = -0.2;
/// A value is fixed by the data if its standard error is below this share of it.
pub const FIXED: f64 = 0.25;

/// One unknown. Counts, roughness and exposure change by their logarithms, directions by radians,
/// and a colour `c` by `ln c - c`, in which the light of a cloth is nearly linear: of a white
/// thread, which scatters most light several times already, it changes little with the colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unknown {
    /// Count of a system's yarn.
    Count(usize),
    /// Colour of a system in a channel.
    Colour { system: usize, channel: usize },
    /// Width of the highlight.
    Roughness,
    /// Exposure of the photographs.
    Exposure,
    /// A direction towards the lamp of a photograph: along its polar angle, or across.
    Light { side: usize, axis: usize },
}

fn measure(colour: f64) -> f64 {
    colour.ln() - colour
}

/// The colour whose measure differs by `change`.
fn colour_moved(value: f64, change: f64) -> f64 {
    let wanted = measure(value.clamp(COLOURS[0], COLOURS[1])) + change;
    let [mut low, mut high] = COLOURS;
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if measure(middle) < wanted {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

impl Unknown {
    /// Those of a fit, in the order of its parameters.
    pub fn all(model: &ClothModel<'_>, sides: &[Side]) -> Vec<Unknown> {
        let mut all = vec![Unknown::Count(0), Unknown::Count(1)];
        for system in 0..2 {
            all.extend((0..3).map(|channel| Unknown::Colour { system, channel }));
        }
        all.push(Unknown::Roughness);
        if model.args.fit_white {
            all.push(Unknown::Exposure);
        }
        if model.args.fit_light {
            for side in sides {
                all.extend((0..2).map(|axis| Unknown::Light {
                    side: side.index,
                    axis,
                }));
            }
        }
        all
    }

    /// The step of difference quotients. Thinner threads always fit.
    pub fn step(self) -> f64 {
        match self {
            Unknown::Count(_) => -0.2,
            Unknown::Colour { .. } => COLOUR_STEP,
            Unknown::Roughness => 0.3,
            Unknown::Exposure => 0.1,
            Unknown::Light { .. } => 0.1,
        }
    }

    /// The change that is expected of a first guess.
    pub fn range(self) -> f64 {
        match self {
            Unknown::Count(_) | Unknown::Roughness => 0.5,
            Unknown::Colour { .. } => 0.4,
            Unknown::Exposure | Unknown::Light { .. } => 0.2,
        }
    }

    /// A trial with another value.
    pub fn changed(self, model: &ClothModel<'_>, trial: &Trial, change: f64) -> Trial {
        let mut next = *trial;
        match self {
            Unknown::Count(k) => next.tex[k] *= change.exp(),
            Unknown::Colour { system, channel } => {
                let value = &mut next.colours[system][channel];
                *value = colour_moved(*value, change);
            }
            Unknown::Roughness => {
                let [low, high] = model.fitted.range;
                next.roughness = (trial.roughness * change.exp()).clamp(low, high);
            }
            Unknown::Exposure => next.exposure *= change.exp(),
            Unknown::Light { side, axis } => {
                let [theta, phi] = &mut next.lights_deg[side];
                match axis {
                    0 => *theta = turned(*theta, change.to_degrees()),
                    _ => *phi += change.to_degrees() / theta.to_radians().sin().max(0.1),
                }
            }
        }
        next
    }

    /// By how much one trial has more of it than another.
    pub fn difference(self, from: &Trial, to: &Trial) -> f64 {
        match self {
            Unknown::Count(k) => (to.tex[k] / from.tex[k]).ln(),
            Unknown::Colour { system, channel } => {
                let value = |t: &Trial| measure(t.colours[system][channel]);
                value(to) - value(from)
            }
            Unknown::Roughness => (to.roughness / from.roughness).ln(),
            Unknown::Exposure => (to.exposure / from.exposure).ln(),
            Unknown::Light { side, axis } => {
                let [from, to] = [from, to].map(|t| t.lights_deg[side].map(f64::to_radians));
                match axis {
                    0 => to[0] - from[0],
                    _ => (to[1] - from[1]) * from[0].sin().max(0.1),
                }
            }
        }
    }

    /// A trial with all channels of a system's colour changed.
    pub fn all_channels(trial: &Trial, system: usize, change: f64) -> Trial {
        let mut next = *trial;
        next.colours[system] = trial.colours[system].map(|v| colour_moved(v, change));
        next
    }

    /// The value of a trial with its standard error, from the standard error `se` of the unknown.
    pub fn determined(self, model: &ClothModel<'_>, trial: &Trial, se: f64) -> Determined {
        let (name, value, se, range) = match self {
            Unknown::Count(k) => {
                let tex = trial.tex[k];
                (format!("yarn.{}.tex", SYSTEMS[k]), tex, tex * se, tex)
            }
            Unknown::Colour { system, channel } => {
                let value = trial.colours[system][channel];
                let letter = ["r", "g", "b"][channel];
                let name = format!("{}.colour.{letter}", SYSTEMS[system]);
                (name, value, value / (1.0 - value) * se, value.max(0.02))
            }
            Unknown::Roughness => {
                let rough = trial.roughness;
                (model.fitted.roughness.into(), rough, rough * se, rough)
            }
            Unknown::Exposure => {
                let white = model.args.white.unwrap_or(1.0) * trial.exposure;
                ("white".into(), white, white * se, white)
            }
            Unknown::Light { side, axis } => {
                let [theta, phi] = trial.lights_deg[side];
                let lamp = ["light", "back_light"][side];
                let (angle, value, scale) = match axis {
                    0 => ("theta_deg", theta, 1.0),
                    _ => (
                        "phi_deg",
                        phi + model.turn_deg,
                        1.0 / theta.to_radians().sin().max(0.1),
                    ),
                };
                let se = se.to_degrees() * scale;
                (format!("{lamp}.{angle}"), value, se, 90.0)
            }
        };
        Determined {
            name,
            value,
            se,
            is_fixed: se < FIXED * range,
        }
    }
}

/// A polar angle that stays on its side of the cloth, at least 3 degrees from its plane and from
/// its normal.
fn turned(theta_deg: f64, change_deg: f64) -> f64 {
    let next = theta_deg + change_deg;
    if theta_deg < 90.0 {
        next.clamp(3.0, 87.0)
    } else {
        next.clamp(93.0, 177.0)
    }
}
