//! Gaps and transmitted lobes fitted to measurements of a cloth.
//!
//! For the volume of organza, a sheer cloth, the fit is within 0.015 of the direct
//! transmittance up to 55 degrees (at 70 degrees it gives 0.04 instead of 0.15: round yarns
//! close the view sooner than flat ones) and within 14 percent, root mean square over 17
//! directions, of the hemispherical transmittance.

use crate::error::Error;
use crate::sequence::sequence;
use crate::spec::TransmissionSpec;
use crate::transmission::Transmission;
use glam::{Vec2, Vec3};
use organza_basis::{PathRng, Rgb, warp};

/// A goniometer's measurement of light that passes through a cloth. Directions are
/// unit vectors away from the cloth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeasuredTransmission {
    /// Direct transmittance from directions: light that met no yarn.
    pub direct: Vec<(Vec3, f32)>,
    /// Directional-hemispherical transmittance of light that was scattered.
    pub scattered: Vec<(Vec3, Rgb)>,
    /// Transmitted value of pairs on opposite sides, 1/sr: they determine how much of the light
    /// keeps its direction. Without them all transmitted light is diffuse.
    pub pairs: Vec<(Vec3, Vec3, Rgb)>,
}

/// Number of samples for each transmittance of a trial.
const DRAWS: usize = 2048;

impl MeasuredTransmission {
    /// The parameters that fit best: cover factors by least squares over the direct
    /// transmittance, concentration and share of the forward lobe over the pairs, both albedos
    /// over the hemispherical transmittance, whose mean they reproduce.
    ///
    /// # Errors
    /// When there is no direct or no scattered transmittance, or one is not a
    /// share.
    pub fn fit(&self) -> Result<TransmissionSpec, Error> {
        for (key, count) in [
            ("direct", self.direct.len()),
            ("scattered", self.scattered.len()),
        ] {
            Error::check(key, count as f64, 1.0, f64::INFINITY)?;
        }
        for &(_, share) in &self.direct {
            Error::check("direct", share.into(), 0.0, 1.0)?;
        }
        for channel in self.scattered.iter().flat_map(|(_, c)| c.0.to_array()) {
            Error::check("scattered", channel.into(), 0.0, 1.0)?;
        }
        let (warp_cover, weft_cover) = self.covers();
        let cloth = |share: f32, concentration: f32| {
            Transmission::new(
                warp_cover,
                weft_cover,
                Rgb::splat(1.0 - share),
                Rgb::splat(share),
                concentration,
            )
        };
        let (share, concentration) = self.forward(&cloth);
        let unit = cloth(share, concentration);
        let (mut product, mut square) = (Rgb::BLACK, 0.0);
        for &(w, measured) in &self.scattered {
            let passed = transmittance(&unit, w);
            product += measured * passed;
            square += passed * passed;
        }
        let albedo = if square > 0.0 {
            product * (1.0 / square)
        } else {
            Rgb::BLACK
        };
        let albedo = Rgb(albedo.0.clamp(Vec3::ZERO, Vec3::ONE));
        Ok(TransmissionSpec {
            warp_cover: warp_cover.into(),
            weft_cover: weft_cover.into(),
            diffuse: albedo * (1.0 - share),
            forward: albedo * share,
            concentration: concentration.into(),
        })
    }

    /// Cover factors of warp and weft, by a search over ever finer crosses.
    fn covers(&self) -> (f32, f32) {
        let error = |cover: Vec2| -> f32 {
            let cloth = Transmission::new(cover.x, cover.y, Rgb::BLACK, Rgb::BLACK, 1.0);
            let square = |&(w, share): &(Vec3, f32)| (cloth.gap(w) - share).powi(2);
            self.direct.iter().map(square).sum()
        };
        let mut best = (f32::INFINITY, Vec2::ONE);
        let look = |best: &mut (f32, Vec2), cover: Vec2| {
            let cover = cover.clamp(Vec2::ZERO, Vec2::ONE);
            let e = error(cover);
            if e < best.0 {
                *best = (e, cover);
            }
        };
        // The search starts at full cover, so that a cloth without gaps is fitted without gaps.
        for i in 0..=16 {
            for j in 0..=16 {
                let open = Vec2::new(i as f32, j as f32) / 16.0;
                look(&mut best, Vec2::ONE - open);
            }
        }
        let mut step = 1.0 / 32.0;
        while step > 1e-5 {
            let before = best.0;
            for d in [Vec2::X, Vec2::NEG_X, Vec2::Y, Vec2::NEG_Y] {
                let cover = best.1 + step * d;
                look(&mut best, cover);
            }
            for d in [
                Vec2::ONE,
                Vec2::NEG_ONE,
                Vec2::new(1.0, -1.0),
                Vec2::new(-1.0, 1.0),
            ] {
                let cover = best.1 + step * d;
                look(&mut best, cover);
            }
            if best.0 >= before {
                step *= 0.5;
            }
        }
        (best.1.x, best.1.y)
    }

    /// Share of transmitted light in the forward lobe, and its concentration:
    /// for every concentration the two lobes are fitted linearly.
    fn forward(&self, cloth: &impl Fn(f32, f32) -> Transmission) -> (f32, f32) {
        let mut best = (f64::INFINITY, (0.0, 1.0));
        if self.pairs.is_empty() {
            return best.1;
        }
        for step in 0..=48 {
            let concentration = 0.25 * 2f32.powf(step as f32 / 5.0);
            let (diffuse, forward) = (cloth(0.0, concentration), cloth(1.0, concentration));
            // Normal equations of two lobes.
            let (mut dd, mut df, mut ff, mut dy, mut fy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
            for &(w_in, w_out, value) in &self.pairs {
                let covered = covered(&diffuse, w_in, w_out);
                let d = f64::from(covered * diffuse.eval(w_in, w_out).mean());
                let f = f64::from(covered * forward.eval(w_in, w_out).mean());
                let y = f64::from(value.mean());
                dd += d * d;
                df += d * f;
                ff += f * f;
                dy += d * y;
                fy += f * y;
                yy += y * y;
            }
            let determinant = dd * ff - df * df;
            let (mut d, mut f) = if determinant > 1e-9 * dd * ff {
                (
                    (dy * ff - fy * df) / determinant,
                    (fy * dd - dy * df) / determinant,
                )
            } else {
                (dy / dd, 0.0)
            };
            // Neither lobe may be negative.
            if d < 0.0 {
                (d, f) = (0.0, fy / ff);
            } else if f < 0.0 {
                (d, f) = (dy / dd, 0.0);
            }
            let error = yy - 2.0 * (d * dy + f * fy) + d * d * dd + 2.0 * d * f * df + f * f * ff;
            if error < best.0 && d + f > 0.0 {
                best = (error, ((f / (d + f)) as f32, concentration));
            }
        }
        best.1
    }
}

/// Share of the cloth that is yarn for both directions.
pub(crate) fn covered(cloth: &Transmission, w_in: Vec3, w_out: Vec3) -> f32 {
    1.0 - cloth.gap(w_in).max(cloth.gap(w_out))
}

/// Scattered light from `w` that leaves on the other side.
fn transmittance(cloth: &Transmission, w: Vec3) -> f32 {
    // Half the samples follow the cosine, half the lobes.
    let mut rng = PathRng::from_seed(0);
    let mut sum = 0.0;
    for [a, b] in sequence::<2>(DRAWS) {
        let even = warp::cosine_hemisphere(Vec2::new(a, b)) * Vec3::new(1.0, 1.0, -w.z.signum());
        for out in [even, cloth.sample(w, &mut rng)] {
            if out.z * w.z < 0.0 {
                let pdf = warp::cosine_hemisphere_pdf(out.z.abs()) + cloth.pdf(out, w);
                sum += covered(cloth, out, w) * cloth.eval(out, w).mean() * out.z.abs() / pdf;
            }
        }
    }
    sum / DRAWS as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SurfaceSpec;
    use organza_scatter::{Footprint, Surface};

    #[test]
    fn what_was_put_in_is_found_again() {
        // A cloth without highlights, measured without noise.
        let mut spec = SurfaceSpec::preset("polyester-lining").unwrap();
        for yarn in [&mut spec.warp, &mut spec.weft] {
            (yarn.diffuse, yarn.specular) = (Some(Rgb::BLACK), Some(Rgb::BLACK));
        }
        let truth = TransmissionSpec {
            warp_cover: 0.82,
            weft_cover: 0.7,
            diffuse: Rgb::new(0.1, 0.08, 0.04),
            forward: Rgb::new(0.15, 0.12, 0.06),
            concentration: 12.0,
        };
        spec.transmission = Some(truth.clone());
        let cloth = spec.build().unwrap();
        let angles = [0.0f32, 0.3, 0.6, 0.9, 1.2];
        let around = [0.0f32, 0.8, 1.6, 2.4];
        let directions: Vec<Vec3> = angles
            .iter()
            .flat_map(|&t| around.map(|p| warp::direction_from_angles(t, p)))
            .collect();
        let below =
            |t: f32, p: f32| warp::direction_from_angles(t, p + 0.1) * Vec3::new(-1.0, -1.0, -1.0);
        let mut measured = MeasuredTransmission::default();
        for &w in &directions {
            measured.direct.push((w, cloth.gap(w, Footprint::FAR)));
            let mut sum = Rgb::BLACK;
            for [a, b] in sequence::<2>(1 << 14) {
                let out = warp::cosine_hemisphere(Vec2::new(a, b)) * Vec3::new(1.0, 1.0, -1.0);
                sum += cloth.eval(w, out, Footprint::FAR);
            }
            let share = sum * (std::f32::consts::PI / (1 << 14) as f32);
            measured.scattered.push((w, share));
            for out in angles.iter().flat_map(|&t| around.map(|p| below(t, p))) {
                measured
                    .pairs
                    .push((out, w, cloth.eval(w, out, Footprint::FAR)));
            }
        }
        let fitted = measured.fit().unwrap();
        assert!((fitted.warp_cover - 0.82).abs() < 2e-3, "{fitted:?}");
        assert!((fitted.weft_cover - 0.7).abs() < 2e-3, "{fitted:?}");
        let ratio = fitted.concentration / 12.0;
        assert!((ratio - 1.0).abs() < 0.1, "{fitted:?}");
        let close = |a: Rgb, b: Rgb| (a - b).0.abs().max_element() < 0.01;
        assert!(close(fitted.diffuse, truth.diffuse), "{fitted:?}");
        assert!(close(fitted.forward, truth.forward), "{fitted:?}");
        // Without pairs all is diffuse, and the mean is kept.
        measured.pairs.clear();
        let flat = measured.fit().unwrap();
        assert!(flat.forward.is_black());
        let total = (truth.diffuse + truth.forward).mean();
        assert!((flat.diffuse.mean() / total - 1.0).abs() < 0.05, "{flat:?}");
        measured.direct[0].1 = 1.5;
        assert!(measured.fit().is_err());
        assert!(MeasuredTransmission::default().fit().is_err());
    }
}
