//! A linear light that moves around the cloth, as in scanners of fabrics [Montazeri2020]
//! (section 6).

use crate::goniometer::{Gathered, gather};
use crate::{Effort, MeasureError, Measured, PatchResponse, PathNames};
use glam::Vec3;
use organza_basis::{PathRng, Rgb, Watch};
use organza_transport::Stats;

/// Direction of the lamp's axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum LampAxis {
    /// Along the weft: the lamp moves in the plane of the warp.
    Weft,
    /// Along the warp: the lamp moves in the plane of the weft.
    Warp,
}

/// One position of the lamp.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LampPosition {
    /// Direction of the lamp's axis.
    pub axis: LampAxis,
    /// Angle of its middle from the normal of the face; above 90 it lights the back.
    pub angle_deg: f64,
}

/// Mean intensity of the patch seen along its normal.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SweepValue {
    /// The lamp.
    pub lamp: LampPosition,
    /// Radiance relative to a white diffuser that the middle of the lamp lights at normal
    /// incidence.
    pub intensity: Measured,
}

/// Half the length of the lamp over its distance: the lamp is as long as its distance.
const HALF_LENGTH: f64 = 0.5;

/// Lamp positions every `step_deg` degrees on both axes, in front and behind.
pub fn lamp_positions(step_deg: f64) -> Vec<LampPosition> {
    let mut list = Vec::new();
    for axis in [LampAxis::Weft, LampAxis::Warp] {
        for centre in [0.0, 180.0] {
            let count = (75.0 / step_deg).floor() as i32;
            list.extend((-count..=count).map(|k| LampPosition {
                axis,
                angle_deg: centre + f64::from(k) * step_deg,
            }));
        }
    }
    list
}

/// Measures the mean intensity at each lamp position. The lamp is a line that emits like a
/// diffuse cylinder.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_sweep(
    patch: &impl PatchResponse,
    lamps: &[LampPosition],
    effort: &Effort,
    watch: Watch<'_>,
) -> Result<Vec<SweepValue>, MeasureError> {
    if effort.paths < 2 {
        return Err(MeasureError::TooFewPaths(effort.paths));
    }
    let enough = |m: &organza_basis::Moments, target: f64| m.standard_error() <= target * m.mean;
    let Gathered::<1> { list, .. } = gather(
        lamps,
        1 << 61,
        effort,
        &enough,
        watch,
        &|lamp: &LampPosition| {
            let lamp = *lamp;
            let one = move |rng: &mut PathRng, stats: &mut Stats| {
                let along = HALF_LENGTH * (2.0 * f64::from(rng.unit()) - 1.0);
                let (sin, cos) = lamp.angle_deg.to_radians().sin_cos();
                let from = match lamp.axis {
                    LampAxis::Weft => glam::DVec3::new(along, sin, cos),
                    LampAxis::Warp => glam::DVec3::new(sin, along, cos),
                };
                let distance = from.length();
                let w_in = (from / distance).as_vec3();
                // Square of the distance, and a cosine at the lamp.
                let irradiance = w_in.z.abs() * distance.powi(-3) as f32;
                let value = patch.estimate_bsdf(w_in, Vec3::Z, rng, stats);
                value * (irradiance * std::f32::consts::PI)
            };
            move |names: &PathNames, stats: &mut Stats, found: &mut dyn FnMut([Rgb; 1])| {
                for path in names.paths.clone() {
                    found([one(&mut names.rng(path), stats)]);
                }
            }
        },
    )?;
    Ok(lamps
        .iter()
        .zip(list)
        .map(|(&lamp, [moments])| SweepValue {
            lamp,
            intensity: Measured::of(&moments),
        })
        .collect())
}

/// Means of a sweep with the lamp in front and behind. They correspond to the middle of
/// photographs lit from either side.
pub fn front_and_back(sweep: &[SweepValue]) -> [[f64; 3]; 2] {
    [false, true].map(|back| {
        let side = sweep.iter().filter(|v| (v.lamp.angle_deg > 90.0) == back);
        let (count, sum) = side.fold((0.0f64, [0.0; 3]), |(n, s), v| {
            let m = v.intensity.mean;
            (n + 1.0, [s[0] + m[0], s[1] + m[1], s[2] + m[2]])
        });
        sum.map(|s| s / count.max(1.0))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lamps_beyond_90_degrees_are_behind() {
        let value = |angle_deg: f64, mean: f64| SweepValue {
            lamp: LampPosition {
                axis: LampAxis::Warp,
                angle_deg,
            },
            intensity: Measured::new([mean, 2.0 * mean, 3.0 * mean], [0.0; 3]),
        };
        let sweep = [
            value(-60.0, 1.0),
            value(60.0, 3.0),
            value(120.0, 5.0),
            value(240.0, 6.0),
            value(180.0, 10.0),
        ];
        assert_eq!(front_and_back(&sweep), [[2.0, 4.0, 6.0], [7.0, 14.0, 21.0]]);
        assert_eq!(front_and_back(&sweep[..1])[1], [0.0; 3]);
    }
}
