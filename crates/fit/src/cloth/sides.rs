//! Photographs, and how they were taken.

use super::photographs::{Photographs, Shot};
use crate::{BACK_LIGHT, FitJob, LIGHT, VIEW};
use glam::{DVec2, DVec3};
use organza_measure::Angles;
use organza_photograph::{Fold, Repeat, Shading, ThreadGrid, Vignetting};
use std::f64::consts::PI;

/// One photograph, folded, and how it was taken.
pub struct Side {
    /// Its name in messages.
    pub name: &'static str,
    /// Which photograph it is: 0 is the front.
    pub index: usize,
    /// The photograph.
    pub shot: Shot,
    grid: ThreadGrid,
    /// The photograph's mean repeat.
    pub fold: Fold,
    /// The camera and the lamp.
    pub view: View,
}

impl Side {
    /// Folds the photograph anew, as it is without another shading.
    pub fn reshade(&mut self, shading: Shading) {
        self.shot.shading = shading;
        self.fold = fold(&self.shot, &self.grid, self.fold.repeat);
    }

    /// The mean repeat as it is if a cloth of another shading decides what the vignetting is, where that
    /// is not known.
    pub fn mean_beside(&self, shading: Option<Shading>) -> Vec<[f64; 3]> {
        match (shading, self.shot.vignetting) {
            (Some(shading), None) => {
                let shaded = shading.removed(&self.shot.photograph);
                let known = Shot {
                    vignetting: Some(Vignetting::find(&shaded, |_, _| true)),
                    ..self.shot.clone()
                };
                fold(&known, &self.grid, self.fold.repeat).mean
            }
            _ => self.fold.mean.clone(),
        }
    }

    /// What is printed of the vignetting, if it was found.
    pub fn vignetting(&self) -> Option<String> {
        let found = self.fold.vignetting;
        self.shot.vignetting.is_none().then(|| {
            format!(
                "{}: vignetting 1 {:+.4} r^2 {:+.4} r^4",
                self.name, found.a, found.b
            )
        })
    }
}

fn fold(shot: &Shot, grid: &ThreadGrid, repeat: Repeat) -> Fold {
    let unevenness = (&shot.shading, shot.vignetting);
    Fold::new(&shot.photograph, grid, repeat, unevenness)
}

/// A camera and a lamp over a cloth whose weft runs along x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Direction towards the lamp by the flags, degrees.
    pub light_deg: [f64; 2],
    /// Distance of the lamp; parallel light if none.
    pub light_mm: Option<f64>,
    /// Direction towards the camera, degrees.
    pub camera_deg: [f64; 2],
    /// Distance of the camera; parallel rays if none.
    pub camera_mm: Option<f64>,
    /// Azimuth of the direction that is to the right in the photograph, degrees.
    pub right_deg: f64,
    /// Size of the photographed cloth.
    pub size_mm: DVec2,
    /// Value of white paper in the middle of the photograph.
    pub white: f64,
}

/// The unit vector of a direction in degrees.
pub fn direction([theta_deg, phi_deg]: [f64; 2]) -> DVec3 {
    Angles { theta_deg, phi_deg }.direction().as_dvec3()
}

impl View {
    /// Whether all of the photograph is seen and lit from the same directions.
    pub fn is_parallel(&self) -> bool {
        self.light_mm.is_none() && self.camera_mm.is_none()
    }

    /// Radiant quantities for which white paper has the stated value: the irradiance on a plane
    /// across parallel light, or the intensity of a lamp at a distance.
    pub fn strength(&self, light_deg: [f64; 2]) -> f64 {
        let cos = direction(light_deg).z.abs();
        PI * self.white / cos * self.light_mm.map_or(1.0, |d| d * d)
    }
}

/// How the photographs of a cloth were taken.
pub struct Taken<'a> {
    args: &'a FitJob,
    /// By how much the cloth is turned in the photograph, degrees.
    pub turn_deg: f64,
    photographs: &'a Photographs,
    grid: &'a ThreadGrid,
}

impl<'a> Taken<'a> {
    /// Photographs of a cloth whose threads lie so.
    pub fn new(args: &'a FitJob, photographs: &'a Photographs, grid: &'a ThreadGrid) -> Self {
        let [warp, weft] = grid.angles_deg();
        Taken {
            args,
            turn_deg: 0.5 * (warp + weft),
            photographs,
            grid,
        }
    }

    /// The photograph with the lamp in front, folded.
    pub fn front(&self, repeat: Repeat) -> Side {
        self.side(0, &self.photographs.front, *self.grid, repeat)
    }

    /// The photograph with the lamp behind, if there is one.
    pub fn back(&self, repeat: Repeat) -> Option<Side> {
        let shot = self.photographs.back.as_ref()?;
        let grid = match self.photographs.is_even {
            true => *self.grid,
            false => self.grid.refined(&shot.photograph),
        };
        Some(self.side(1, shot, grid, repeat))
    }

    fn side(&self, index: usize, shot: &Shot, grid: ThreadGrid, repeat: Repeat) -> Side {
        let cloth = self.args;
        let (name, light, light_mm) = match index {
            0 => ("front", self.args.light.unwrap_or(LIGHT), cloth.light_mm),
            _ => {
                let light = self.args.back_light.unwrap_or(BACK_LIGHT);
                ("back", light, cloth.back_light_mm)
            }
        };
        let is_even = self.photographs.is_even;
        let turned = |[theta, phi]: [f64; 2]| [theta, phi - self.turn_deg];
        Side {
            name,
            index,
            shot: shot.clone(),
            grid,
            fold: fold(shot, &grid, repeat),
            view: View {
                light_deg: turned(light),
                light_mm: light_mm.filter(|_| !is_even),
                camera_deg: turned(self.args.view.unwrap_or(VIEW)),
                camera_mm: cloth.camera_mm.filter(|_| !is_even),
                right_deg: -self.turn_deg,
                size_mm: self.photographs.size_mm,
                white: self.args.white.unwrap_or(1.0),
            },
        }
    }
}
