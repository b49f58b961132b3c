//! Classes of visual comfort from 0 to 4, by the tables of [EnBlinds2005].

use crate::ShadeFigures;
use serde::Serialize;

/// A class, and the range that the standard errors leave open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ShadeClass {
    /// By the values.
    pub class: u8,
    /// The lowest within two standard errors of both values.
    pub lowest: u8,
    /// The highest.
    pub highest: u8,
}

/// Classes of one side of a shade: 4 is best, 0 has no effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct ShadeClasses {
    /// How well it keeps glare away.
    pub glare_control: ShadeClass,
    /// How well it hides a lit room at night.
    pub night_privacy: ShadeClass,
    /// How well one sees through it to the outside.
    pub view_out: ShadeClass,
    /// How much daylight it lets in.
    pub daylight: ShadeClass,
}

impl ShadeClasses {
    /// The classes of light that arrives on one side, from its figures for light.
    pub fn of(visible: &ShadeFigures) -> ShadeClasses {
        let (beam, scattered) = (visible.normal_normal, visible.normal_diffuse);
        let class = |of: fn(f64, f64) -> u8| {
            let corners = [(-2.0, -2.0), (-2.0, 2.0), (2.0, -2.0), (2.0, 2.0)];
            let near = corners
                .map(|(a, b)| of(beam.value + a * beam.se, scattered.value + b * scattered.se));
            let own = of(beam.value, scattered.value);
            ShadeClass {
                class: own,
                lowest: near.into_iter().fold(own, u8::min),
                highest: near.into_iter().fold(own, u8::max),
            }
        };
        let light = visible.diffuse_hemispherical;
        ShadeClasses {
            glare_control: class(glare_control),
            night_privacy: class(night_privacy),
            view_out: class(view_out),
            daylight: ShadeClass {
                class: daylight(light.value),
                lowest: daylight(light.value - 2.0 * light.se),
                highest: daylight(light.value + 2.0 * light.se),
            },
        }
    }

    /// The classes with their names in tables.
    pub fn named(&self) -> [(&'static str, ShadeClass); 4] {
        [
            ("glare_control", self.glare_control),
            ("night_privacy", self.night_privacy),
            ("view_out", self.view_out),
            ("daylight", self.daylight),
        ]
    }
}

/// Rows of the tables: beams that pass by more than 10 %, 5 to 10 %, up to 5 %, and 0.00 in two
/// decimals.
fn row(normal_normal: f64) -> usize {
    match normal_normal {
        v if v > 0.10 => 0,
        v if v > 0.05 => 1,
        v if v >= 0.005 => 2,
        _ => 3,
    }
}

fn glare_control(normal_normal: f64, normal_diffuse: f64) -> u8 {
    let column = [0.02, 0.04, 0.08].map(|v| usize::from(normal_diffuse >= v));
    let column: usize = column.iter().sum();
    [[0, 0, 0, 0], [1, 1, 0, 0], [3, 2, 1, 1], [4, 3, 2, 2]][row(normal_normal)][column]
}

/// Columns of the two tables of what is seen through a shade.
fn seen_column(normal_diffuse: f64) -> usize {
    usize::from(normal_diffuse > 0.04) + usize::from(normal_diffuse > 0.15)
}

fn night_privacy(normal_normal: f64, normal_diffuse: f64) -> u8 {
    let table = [[0, 0, 0], [1, 1, 1], [2, 2, 2], [4, 3, 2]];
    table[row(normal_normal)][seen_column(normal_diffuse)]
}

fn view_out(normal_normal: f64, normal_diffuse: f64) -> u8 {
    let table = [[4, 3, 2], [3, 2, 1], [2, 1, 0], [0, 0, 0]];
    table[row(normal_normal)][seen_column(normal_diffuse)]
}

fn daylight(diffuse_hemispherical: f64) -> u8 {
    let steps = [0.02, 0.10, 0.25, 0.40].map(|v| u8::from(diffuse_hemispherical >= v));
    steps.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Share;

    #[test]
    fn classes_follow_both_values_and_their_errors() {
        let share = |value, se| Share { value, se };
        let of = |beam, scattered, light| {
            ShadeClasses::of(&ShadeFigures {
                normal_normal: beam,
                normal_diffuse: scattered,
                diffuse_hemispherical: light,
                ..ShadeFigures::default()
            })
        };
        // An open screen, a dense dark one, and a cloth without holes.
        let open = of(share(0.12, 0.0), share(0.1, 0.0), share(0.3, 0.0));
        assert_eq!(open.named().map(|c| c.1.class), [0, 0, 3, 3]);
        let dense = of(share(0.03, 0.0), share(0.015, 0.0), share(0.05, 0.0));
        assert_eq!(dense.named().map(|c| c.1.class), [3, 2, 2, 1]);
        let opaque = of(share(0.004, 0.0), share(0.01, 0.0), share(0.015, 0.0));
        assert_eq!(opaque.named().map(|c| c.1.class), [4, 4, 0, 0]);
        // Noise leaves open what lies near a border.
        let near = of(share(0.049, 0.001), share(0.03, 0.001), share(0.2, 0.01));
        let class = |class, lowest, highest| ShadeClass {
            class,
            lowest,
            highest,
        };
        assert_eq!(near.glare_control, class(2, 1, 2));
        assert_eq!(near.view_out, class(2, 2, 3));
        assert_eq!(near.daylight, class(2, 2, 2));
    }
}
