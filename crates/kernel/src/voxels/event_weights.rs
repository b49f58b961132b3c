//! The distribution of event weights, and whether paths have a finite variance.
//!
//! Lanes draw inclinations by the blur and tangents by a simple density, and weigh what
//! is drawn. Weights multiply along a path. In lossless matter of optical thickness t,
//! paths of n events are as frequent as `exp(-k n)` with `k = pi^2 / (3 (t + 1.42)^2)`,
//! the slowest mode of diffusion through a slab; light that is not scattered forward
//! stays longest, so k is no less for fibres. The mean of a path's squared weight grows
//! as `((1 + v) a^2)^n` for events of relative variance v and albedo a. Where
//! `(1 + v) a^2 exp(-k)` comes near one, light hides in paths too rare to be seen.

use organza_scatter::longitudinal::{Blur, Inclinations};
use organza_scatter::{FAR_LOBES, FAR_ROWS, FarParts};
use std::f32::consts::FRAC_PI_2;

/// Weights of the events of a fibre, over all inclinations as they are seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EventWeights {
    /// Their variance over their squared mean.
    pub variance: f64,
    /// Their mean, in the channel where it is greatest.
    pub albedo: f64,
}

/// The lobes of a fibre at one mean inclination.
pub struct LobeRow {
    /// What they send on, per channel.
    pub energies: [[f64; 3]; FAR_LOBES],
    /// With which chances they are drawn.
    pub chances: [f64; FAR_LOBES],
}

/// Whether the squares of path weights have a mean that is at most twice what weights
/// without variance give, in matter of that optical thickness.
pub fn are_even(weights: EventWeights, optical_thickness: f64) -> bool {
    let decay = std::f64::consts::PI.powi(2) / (3.0 * (optical_thickness + 1.42).powi(2));
    let kept = weights.albedo.min(1.0).powi(2) * (-decay).exp();
    (1.0 + weights.variance) * kept <= 0.5 * (1.0 + kept)
}

impl EventWeights {
    /// By the midpoint rule over both inclinations.
    pub fn new(parts: &FarParts<'_>, rows: &[LobeRow]) -> EventWeights {
        const OUTGOING: usize = 48;
        let blurs = parts.blurs_rad().map(Blur::new);
        let narrowest = parts.blurs_rad().into_iter().fold(1.0, f32::min);
        let incoming = (2.0 * FRAC_PI_2 / narrowest * 2.0)
            .ceil()
            .clamp(90.0, 800.0) as usize;
        let step = 2.0 * FRAC_PI_2 / incoming as f32;
        let (mut seen, mut variance, mut albedo) = (0.0, 0.0, [0.0f64; 3]);
        for i in 0..OUTGOING {
            let theta = (i as f32 + 0.5) / OUTGOING as f32 * FRAC_PI_2;
            let (sin_out, cos_out) = theta.sin_cos();
            let out = parts.scale(cos_out);
            let blur = 0.5 * blurs[0].deviation_rad;
            let drawing = blur.mul_add(blur, cos_out * cos_out).min(1.0).sqrt();
            let chances = at_row(rows, drawing, |row| row.chances);
            let (mut first, mut second) = ([0.0f64; 3], 0.0);
            for j in 0..incoming {
                let (sin_in, cos_in) = ((j as f32 + 0.5) * step - FRAC_PI_2).sin_cos();
                let pair = Inclinations::new([sin_in, cos_in], [sin_out, cos_out]);
                let scales = out * parts.scale(cos_in) * (cos_in * cos_in);
                let scales = scales.to_array().map(f64::from);
                for p in 0..FAR_LOBES {
                    let density = f64::from(pair.density(&blurs[p]) * step);
                    if density < 1e-9 || chances[p] <= 0.0 {
                        continue;
                    }
                    let energies = at_row(rows, pair.mean_cos, |row| row.energies[p]);
                    let sent: [f64; 3] = std::array::from_fn(|c| scales[c] * energies[c]);
                    for (sum, sent) in first.iter_mut().zip(sent) {
                        *sum += density * sent;
                    }
                    let grey = sent.iter().sum::<f64>() / 3.0;
                    second += density * grey * grey / chances[p];
                }
            }
            let share = f64::from(cos_out * cos_out);
            let grey = first.iter().sum::<f64>() / 3.0;
            if grey > 0.0 {
                seen += share;
                variance += share * (second / (grey * grey) - 1.0);
                for (sum, first) in albedo.iter_mut().zip(first) {
                    *sum += share * first;
                }
            }
        }
        let per = 1.0 / f64::max(seen, 1e-30);
        EventWeights {
            variance: variance * per,
            albedo: albedo.into_iter().fold(0.0, f64::max) * per,
        }
    }
}

/// Between the rows around a cosine.
fn at_row(rows: &[LobeRow], cos: f32, of: impl Fn(&LobeRow) -> [f64; 3]) -> [f64; 3] {
    let place = cos.clamp(0.0, 1.0) * (FAR_ROWS - 1) as f32;
    let low = (place as usize).min(FAR_ROWS - 2);
    let t = f64::from(place - low as f32);
    let (a, b) = (of(&rows[low]), of(&rows[low + 1]));
    std::array::from_fn(|c| a[c] + t * (b[c] - a[c]))
}
