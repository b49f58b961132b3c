//! A picture lit from the front and one lit from behind, and the same of plies.
//!
//! The left halves are fitted, the right halves are held out.

use super::target::{Part, Value, WHOLE};
use crate::picture::Seen;
use crate::{BACK_LIGHT, FitJob, LIGHT, VIEW};
use anyhow::Result;
use glam::UVec2;
use organza_measure::{Pair, PictureStatistics, TexelGrid, measure_texture};
use organza_scene::fabric_file::Fabric;
use organza_scene::patches::AnyPatch;
use organza_work::{after_option, of_file};
use std::path::Path;

/// Texels of the longer side at most: larger pictures are averaged to it.
const MAX_TEXELS: u32 = 64;

/// Least texels of a side: halves of fewer have no contrast.
const MIN_TEXELS: u32 = 8;

/// Expected error of the contrast, as a share, measured for jersey: plies show no single fibres,
/// and what is missing must not pull the means.
const CONTRAST: f64 = 0.25;

/// Paths of a texel without `--spp`.
const PATHS: u64 = 32;

/// One picture and how it was taken.
struct Side {
    names: [&'static str; 2],
    pair: Pair,
    grid: TexelGrid,
    halves: [PictureStatistics; 2],
}

/// Both pictures.
pub struct Pictures(Vec<Side>);

impl Pictures {
    /// Reads both.
    ///
    /// # Errors
    /// Names the file or the flag.
    pub fn read(args: &FitJob, front: &Path, back: &Path, fabric: &Fabric) -> Result<Pictures> {
        let front_light = args.light.unwrap_or(LIGHT);
        let back_light = args.back_light.unwrap_or(BACK_LIGHT);
        for (flag, light, is_behind) in [
            ("--light", front_light, false),
            ("--back-light", back_light, true),
        ] {
            let view = args.view.unwrap_or(VIEW);
            if ((light[0] > 90.0) != (view[0] > 90.0)) != is_behind {
                let side = if is_behind { "opposite" } else { "same" };
                return Err(after_option(
                    flag,
                    format!(
                        "{},{}: expected a lamp on the {side} side of the cloth as the camera",
                        light[0], light[1]
                    ),
                ));
            }
        }
        let side = |path: &Path, names, light| Side::read(args, path, names, light, fabric);
        Ok(Pictures(vec![
            side(front, ["front-lit mean", "front-lit contrast"], front_light)?,
            side(back, ["back-lit mean", "back-lit contrast"], back_light)?,
        ]))
    }

    /// What was observed.
    pub fn values(&self, part: Part) -> Vec<Value> {
        let sides = self.0.iter();
        sides
            .flat_map(|s| s.values(&s.halves[part as usize], [0.0; 4]))
            .collect()
    }

    /// The same of a patch.
    ///
    /// # Errors
    /// Those of the measurement.
    pub fn simulate(&self, args: &FitJob, patch: &AnyPatch, part: Part) -> Result<Vec<Value>> {
        let mut all = Vec::new();
        for side in &self.0 {
            let paths = args.spp.unwrap_or(PATHS);
            let watch = |_| args.context.flow();
            let texture = measure_texture(patch, side.pair, &side.grid, paths, args.seed, &watch)?;
            let mean = half(&texture.mean, side.grid.texels, part);
            let se = half(&texture.se, side.grid.texels, part);
            let statistics = PictureStatistics::new(&mean, &se);
            all.extend(side.values(&statistics, noise(&se, statistics.deviation)));
        }
        Ok(all)
    }
}

impl Side {
    fn read(
        args: &FitJob,
        path: &Path,
        names: [&'static str; 2],
        light: [f64; 2],
        fabric: &Fabric,
    ) -> Result<Side> {
        let Seen { pixels, grid, pair } = Seen::read(args, path, MAX_TEXELS, light, fabric)?;
        let size = grid.texels;
        if size.min_element() < MIN_TEXELS {
            return Err(of_file(
                path,
                format!(
                    "has {} x {} pixels when its longer side is averaged to at most {MAX_TEXELS}; \
                     expected at least {MIN_TEXELS} along each side",
                    size.x, size.y
                ),
            ));
        }
        let none = vec![[0.0; 3]; pixels.len()];
        let of =
            |part| PictureStatistics::new(&half(&pixels, size, part), &half(&none, size, part));
        Ok(Side {
            names,
            pair,
            grid,
            halves: [of(Part::Fitted), of(Part::HeldOut)],
        })
    }

    fn values(&self, statistics: &PictureStatistics, se: [f64; 4]) -> Vec<Value> {
        let [mean, contrast] = self.names;
        let mut all: Vec<Value> = (0..3)
            .map(|c| Value {
                group: mean,
                channel: Some(c),
                expected: WHOLE,
                mean: statistics.mean[c],
                se: se[c],
            })
            .collect();
        all.push(Value {
            group: contrast,
            channel: None,
            expected: CONTRAST,
            mean: statistics.deviation,
            se: se[3],
        });
        all
    }
}

/// The left half of rows of texels, or the right one.
fn half(texels: &[[f32; 3]], size: UVec2, part: Part) -> Vec<[f32; 3]> {
    let middle = size.x as usize / 2;
    let rows = texels.chunks_exact(size.x as usize);
    let part = |row: &[[f32; 3]]| match part {
        Part::Fitted => row[..middle].to_vec(),
        Part::HeldOut => row[middle..].to_vec(),
    };
    rows.flat_map(part).collect()
}

/// Standard errors of the means of texels with such errors, and of their deviation, from which
/// the mean square error was taken off.
fn noise(se: &[[f32; 3]], deviation: f64) -> [f64; 4] {
    let count = se.len().max(1) as f64;
    let square = |c: usize| se.iter().map(|e| f64::from(e[c]).powi(2)).sum::<f64>();
    let mean_square = [0, 1, 2].map(square).iter().sum::<f64>() / (3.0 * count);
    let of_square = (2.0 * mean_square.powi(2) + 4.0 * deviation.powi(2) * mean_square).sqrt()
        / (3.0 * count).sqrt();
    let [r, g, b] = [0, 1, 2].map(|c| square(c).sqrt() / count);
    [r, g, b, of_square / (2.0 * deviation.max(1e-9))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_are_left_and_right_of_every_row() {
        let texels: Vec<[f32; 3]> = (0..10).map(|k| [k as f32; 3]).collect();
        let size = UVec2::new(5, 2);
        let values =
            |part| -> Vec<f32> { half(&texels, size, part).iter().map(|t| t[0]).collect() };
        assert_eq!(values(Part::Fitted), [0.0, 1.0, 5.0, 6.0]);
        assert_eq!(values(Part::HeldOut), [2.0, 3.0, 4.0, 7.0, 8.0, 9.0]);
    }
}
