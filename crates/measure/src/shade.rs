//! What a shade before a window is sold by: how much of a beam along the normal, and of light from
//! everywhere, goes through and comes back, by [EnBlinds2008]'s geometries.

use crate::goniometer::gather;
use crate::klems_file::XYZ_FROM_RGB;
use crate::{Effort, Exit, MeasureError, Measured, PatchResponse, PathNames, PathRun};
use glam::{DVec3, Vec3};
use organza_basis::{Moments, PathRng, Rgb, Watch};
use organza_transport::Stats;
use serde::Serialize;

/// A value and its standard error.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Share {
    /// Share of the light that arrives.
    pub value: f64,
    /// Standard error.
    pub se: f64,
}

/// Figures of one band, of light that arrives on one side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ShadeFigures {
    /// Of a beam along the normal, what passes without meeting anything: normal-normal
    /// transmittance, the openness of the cloth.
    pub normal_normal: Share,
    /// What passes scattered: normal-diffuse transmittance.
    pub normal_diffuse: Share,
    /// Both together: normal-hemispherical transmittance.
    pub normal_hemispherical: Share,
    /// Normal-hemispherical reflectance.
    pub normal_reflectance: Share,
    /// Transmittance of evenly diffuse light: diffuse-hemispherical.
    pub diffuse_hemispherical: Share,
    /// Reflectance of evenly diffuse light.
    pub diffuse_reflectance: Share,
}

impl ShadeFigures {
    /// The figures with their names in tables.
    pub fn named(&self) -> [(&'static str, Share); 6] {
        [
            ("normal_normal", self.normal_normal),
            ("normal_diffuse", self.normal_diffuse),
            ("normal_hemispherical", self.normal_hemispherical),
            ("normal_reflectance", self.normal_reflectance),
            ("diffuse_hemispherical", self.diffuse_hemispherical),
            ("diffuse_reflectance", self.diffuse_reflectance),
        ]
    }
}

/// Where the light of a beam, or diffuse light, on one side goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SideShares {
    /// Through, meeting nothing.
    pub straight: Measured,
    /// Through, scattered.
    pub scattered: Measured,
    /// Both together.
    pub through: Measured,
    /// Back.
    pub reflected: Measured,
}

/// Streams of random numbers that belong to shades.
const SHADE_STREAMS: u64 = 1 << 59;

/// Measures where light goes that arrives on the face, then on the back: of a beam along the
/// normal and, second, of evenly diffuse light. The beam's directions fill a cone evenly, up to a
/// square of the sine of `beam_sin_squared`; `seen` is what counts of a colour.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_sides(
    patch: &impl PatchResponse,
    beam_sin_squared: f32,
    effort: &Effort,
    seen: &(dyn Fn(Rgb) -> Rgb + Sync),
    watch: Watch<'_>,
) -> Result<([[SideShares; 2]; 2], Stats), MeasureError> {
    if effort.paths < 2 {
        return Err(MeasureError::TooFewPaths(effort.paths));
    }
    let items = [
        (1.0, beam_sin_squared),
        (1.0, 1.0),
        (-1.0, beam_sin_squared),
        (-1.0, 1.0),
    ];
    let enough = |m: &Moments, target: f64| m.standard_error() <= target;
    let found = gather::<_, 4, _>(
        &items,
        SHADE_STREAMS,
        effort,
        &enough,
        watch,
        &|&(side, sin_squared): &(f32, f32)| {
            let draw = move |rng: &mut PathRng| {
                let u = rng.unit2();
                let squared = sin_squared * u.x;
                let (y, x) = (std::f32::consts::TAU * u.y).sin_cos();
                let sin = squared.sqrt();
                Vec3::new(sin * x, sin * y, side * (1.0 - squared).max(1e-12).sqrt())
            };
            move |names: &PathNames, stats: &mut Stats, found: &mut dyn FnMut([Rgb; 4])| {
                let found = &mut |exit: Exit| {
                    let e = exit.energy(Vec3::new(0.0, 0.0, side));
                    let through = e.direct + e.transmitted;
                    found([e.direct, e.transmitted, through, e.reflected].map(seen));
                };
                patch.each_exit(&draw, PathRun::new(names, stats, found));
            }
        },
    )?;
    let shares = |item: usize| {
        let [straight, scattered, through, reflected] =
            found.list[item].each_ref().map(Measured::of);
        SideShares {
            straight,
            scattered,
            through,
            reflected,
        }
    };
    let sides = [[shares(0), shares(1)], [shares(2), shares(3)]];
    Ok((sides, found.stats))
}

/// Measures a shade in the band in which the patch is seen, light on the face first. Of three
/// channels the luminance counts.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_shade(
    patch: &impl PatchResponse,
    effort: &Effort,
    watch: Watch<'_>,
) -> Result<([ShadeFigures; 2], Stats), MeasureError> {
    let (sides, stats) = measure_sides(patch, 0.0, effort, &luminance, watch)?;
    let share = |m: Measured| Share {
        value: m.mean[0],
        se: m.se[0],
    };
    let figures = sides.map(|[beam, diffuse]| ShadeFigures {
        normal_normal: share(beam.straight),
        normal_diffuse: share(beam.scattered),
        normal_hemispherical: share(beam.through),
        normal_reflectance: share(beam.reflected),
        diffuse_hemispherical: share(diffuse.through),
        diffuse_reflectance: share(diffuse.reflected),
    });
    Ok((figures, stats))
}

/// The luminance of a colour, in all channels.
fn luminance(value: Rgb) -> Rgb {
    let weights: DVec3 = XYZ_FROM_RGB.row(1);
    Rgb::splat(weights.as_vec3().dot(value.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SolarPatch;
    use organza_basis::unwatched;

    /// Cloth of which a share is holes; the rest reflects or transmits, half by half, a colour.
    struct Cloth {
        open: f32,
        colour: Rgb,
    }

    impl PatchResponse for Cloth {
        fn estimate_bsdf(&self, _: Vec3, _: Vec3, _: &mut PathRng, _: &mut Stats) -> Rgb {
            self.colour
        }
        fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, _: &mut Stats) -> Exit {
            let u = rng.unit();
            let is_straight = u < self.open;
            let comes_back = rng.unit() < 0.5;
            let (to, value) = match (is_straight, comes_back) {
                (true, _) => (-w, Rgb::WHITE),
                (_, true) => (w, self.colour),
                (_, false) => (-w, self.colour),
            };
            Exit {
                escape: Some((to, value)),
                is_straight,
                absorbed: Rgb::WHITE - value,
            }
        }
    }

    const EFFORT: Effort = Effort::new(1 << 16, 3);

    fn near(found: Share, expected: f64) {
        let off = (found.value - expected).abs();
        assert!(off < 5.0 * found.se + 1e-6, "{found:?} {expected} (seed 3)");
    }

    #[test]
    fn light_is_divided_as_the_cloth_divides_it() {
        let cloth = Cloth {
            open: 0.2,
            colour: Rgb::new(0.9, 0.5, 0.1),
        };
        let y = f64::from(luminance(cloth.colour).0.x);
        let (sides, _) = measure_shade(&cloth, &EFFORT, &unwatched).unwrap();
        for figures in sides {
            near(figures.normal_normal, 0.2);
            near(figures.normal_diffuse, 0.4 * y);
            near(figures.normal_hemispherical, 0.2 + 0.4 * y);
            near(figures.normal_reflectance, 0.4 * y);
            near(figures.diffuse_hemispherical, 0.2 + 0.4 * y);
            // The twin: one channel is not the luminance.
            assert!((figures.normal_reflectance.value - 0.4 * 0.9).abs() > 0.02);
        }
    }

    /// The sum of two bands, by paths and by single estimates, against the sum of their values.
    #[test]
    fn the_sun_sees_both_bands() {
        let of = |colour| Cloth { open: 0.2, colour };
        let patch = SolarPatch {
            visible: of(Rgb::new(0.3, 0.2, 0.1)),
            nir: of(Rgb::splat(0.8)),
            nir_share: 0.41,
        };
        let expected = 0.59 * 0.2 + 0.41 * 0.8;
        let (sides, _) = measure_shade(&patch, &EFFORT, &unwatched).unwrap();
        near(sides[1].normal_reflectance, 0.4 * expected);
        near(sides[0].normal_hemispherical, 0.2 + 0.4 * expected);
        for paths in [1, 2, 64] {
            let mut moments = Moments::default();
            for part in 0..(1 << 16) / paths {
                let names = PathNames::new(3, 0, part * paths..(part + 1) * paths);
                let run = PathRun {
                    names: &names,
                    stats: &mut Stats::default(),
                    found: &mut |v: Rgb| moments.add(f64::from(v.0.x)),
                };
                patch.each_bsdf((Vec3::Z, Vec3::Z), run);
            }
            let (value, se) = (moments.mean, moments.standard_error());
            let off = (value - expected).abs();
            assert!(off < 5.0 * se + 1e-6, "{paths}: {value} +- {se} (seed 3)");
            // The twin: both bands alike.
            assert!((value - 0.5).abs() > 10.0 * se);
        }
    }
}
