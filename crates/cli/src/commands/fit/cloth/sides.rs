//! Photographs and how they were taken.

use crate::commands::fit::{BACK_LIGHT, FitArgs, VIEW};
use organza_measure::{Angles, Pair};
use organza_photograph::{Fold, Photograph, Repeat, ThreadGrid};
use std::f64::consts::PI;

/// Direction towards the lamp in front of the cloth by default, degrees.
const LIGHT: [f64; 2] = super::super::LIGHT;

/// One photograph, folded, and how it was taken.
pub struct Side {
    /// Its name in messages.
    pub name: &'static str,
    /// Directions to light and camera, seen from the cloth's threads.
    pub pair: Pair,
    /// The photograph's mean repeat.
    pub fold: Fold,
    /// Value of the photograph for a BSDF of 1/sr.
    pub value_per_bsdf: f64,
}

/// How the photographs of a cloth were taken.
pub struct Taken<'a> {
    args: &'a FitArgs,
    /// By how much the cloth is turned in the photograph, degrees.
    turn_deg: f64,
}

impl<'a> Taken<'a> {
    /// Photographs of a cloth whose threads lie so.
    pub fn new(args: &'a FitArgs, grid: &ThreadGrid) -> Taken<'a> {
        let [warp, weft] = grid.angles_deg();
        Taken {
            args,
            turn_deg: 0.5 * (warp + weft),
        }
    }

    fn side(
        &self,
        name: &'static str,
        light: [f64; 2],
        (photograph, grid, repeat): (&Photograph, &ThreadGrid, Repeat),
    ) -> Side {
        let angles = |[theta_deg, phi_deg]: [f64; 2]| Angles {
            theta_deg,
            phi_deg: phi_deg - self.turn_deg,
        };
        Side {
            name,
            pair: Pair {
                incident: angles(light),
                exitant: angles(self.args.view.unwrap_or(VIEW)),
            },
            fold: Fold::new(photograph, grid, repeat),
            // White sends 1/pi of the light on it into every direction.
            value_per_bsdf: PI * self.args.white.unwrap_or(1.0),
        }
    }

    /// The photograph with the lamp in front.
    pub fn front(&self, photograph: &Photograph, grid: &ThreadGrid, repeat: Repeat) -> Side {
        let light = self.args.light.unwrap_or(LIGHT);
        self.side("front", light, (photograph, grid, repeat))
    }

    /// The photograph with the lamp behind.
    pub fn back(&self, photograph: &Photograph, grid: &ThreadGrid, repeat: Repeat) -> Side {
        let light = self.args.back_light.unwrap_or(BACK_LIGHT);
        self.side("back", light, (photograph, grid, repeat))
    }
}
