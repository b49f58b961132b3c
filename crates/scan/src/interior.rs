//! Grey values inside a section that stay the same along the fibre: gaps between fibres that were
//! taken for one.
//!
//! Inside a single fibre grey values vary by noise, which differs from place to place along it. The
//! gaps inside a bundle continue along it, even where noise hides each of them. The covariance of
//! two means further apart along the fibre than noise reaches is therefore zero inside
//! a fibre, at any noise, and that of the gaps inside a bundle.

use glam::Vec3;

/// Radius of the part of a section that is looked at, in radii: beyond it blur lowers grey values.
const INNER: f32 = 0.75;
/// Fewest points of it; six figures of them are taken away.
const LEAST_POINTS: usize = 12;
/// Most points along its radius.
const MOST_ACROSS: f32 = 10.0;
/// Values along the fibre whose mean is taken on either side of the plane, and the distance
/// of the nearest from it, in voxels.
const ALONG: usize = 4;
const AWAY: f32 = 2.0;

/// Twists of a bundle: the tangent of the angle between its axis and the fibres at its outline.
/// Between two of them the pattern of six fibres around one loses an eighth of its covariance
/// at most.
pub(crate) const TWISTS: [f32; 7] = [-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6];

/// Functions of the place in a disk that blur, neighbours and a shifted middle give a single fibre.
fn smooth_functions([u, v]: [f32; 2]) -> [f32; 6] {
    [1.0, u, v, u * v, u * u - v * v, u * u + v * v]
}

/// The covariance of grey values `away` before and behind a plane across a fibre, less what a
/// polynomial of degree two across the section explains, for each of [`TWISTS`]; `None` for sections
/// of too few voxels or at the border. `radius` is in voxels, as is the argument of `grey`: two
/// coordinates across the fibre, one along it. The noise of values `away` voxels apart must be
/// independent.
pub(crate) fn covariance(
    radius: f32,
    away: f32,
    grey: impl Fn(Vec3) -> Option<f32>,
) -> Option<[f32; TWISTS.len()]> {
    let inner = INNER * radius;
    let spacing = (inner / MOST_ACROSS).max(1.0);
    let half = (inner / spacing) as i32;
    let mut points = Vec::new();
    for j in -half..=half {
        for i in -half..=half {
            let at = [i as f32 * spacing, j as f32 * spacing];
            if at[0].hypot(at[1]) <= inner {
                points.push(at);
            }
        }
    }
    if points.len() < LEAST_POINTS {
        return None;
    }
    let nearest = (0.5 * away).max(AWAY);
    let turn_per_twist = (nearest + 0.5 * (ALONG - 1) as f32) / radius;
    let side = |sign: f32, twist: f32| -> Option<Vec<f32>> {
        let (sin, cos) = (sign * twist * turn_per_twist).sin_cos();
        let mean = |p: &[f32; 2]| {
            let (u, v) = (cos * p[0] - sin * p[1], sin * p[0] + cos * p[1]);
            let mut sum = 0.0;
            for k in 0..ALONG {
                sum += grey(Vec3::new(u, v, sign * (nearest + k as f32)))?;
            }
            Some(sum / ALONG as f32)
        };
        let values: Vec<f32> = points.iter().map(mean).collect::<Option<_>>()?;
        Some(without_smooth(&points, values))
    };
    let mut found = [0.0; TWISTS.len()];
    for (covariance, twist) in found.iter_mut().zip(TWISTS) {
        let (before, behind) = (side(-1.0, twist)?, side(1.0, twist)?);
        let sum: f32 = before.iter().zip(&behind).map(|(a, b)| a * b).sum();
        *covariance = sum / (points.len() - 6) as f32;
    }
    Some(found)
}

/// Values less their projection on the smooth functions. Over points that are symmetric in both
/// axes and their exchange, all but the first and the last are orthogonal to each other.
fn without_smooth(points: &[[f32; 2]], mut values: Vec<f32>) -> Vec<f32> {
    let n = points.len() as f32;
    let mean_square = points.iter().map(|p| smooth_functions(*p)[5]).sum::<f32>() / n;
    for k in 0..6 {
        let function = |p: &[f32; 2]| match k {
            5 => smooth_functions(*p)[5] - mean_square,
            _ => smooth_functions(*p)[k],
        };
        let (mut product, mut square) = (0.0, 0.0);
        for (p, v) in points.iter().zip(&values) {
            let f = function(p);
            product += f * v;
            square += f * f;
        }
        let factor = if square > 0.0 { product / square } else { 0.0 };
        for (p, v) in points.iter().zip(&mut values) {
            *v -= factor * function(p);
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;
    use std::cell::RefCell;

    /// Waves of amplitude 0.1 along the section have the variance 0.005, which noise ten times
    /// as strong hides in a single value; the polynomial takes nothing of waves so short. The
    /// twin without waves has none.
    #[test]
    fn what_continues_along_is_told_from_noise() {
        let mean = |wave: f32, seed: u64| {
            let rng = RefCell::new(PathRng::from_seed(seed));
            let grey = |p: Vec3| {
                let smooth = 2.0 + 0.3 * p.x - 0.02 * p.y * p.y;
                let noise = 0.3 * rng.borrow_mut().normal2().x;
                Some(smooth + wave * (1.8 * p.x).sin() + noise)
            };
            let all = (0..100).filter_map(|_| covariance(9.0, 4.0, grey));
            all.map(|c| c[3]).sum::<f32>() / 100.0
        };
        // The product of two means of noise deviates by 0.3^2 / 4; 100 sections of about 140 points.
        let most = 4.0 * 0.3 * 0.3 / 4.0 / (100.0f32 * 140.0).sqrt();
        for seed in 1..=3 {
            let (bundle, fibre) = (mean(0.1, seed), mean(0.0, seed));
            assert!(
                (bundle - 0.005).abs() < 0.0005 + most,
                "seed {seed}: {bundle}"
            );
            assert!(fibre.abs() < most, "seed {seed}: {fibre}");
        }
    }
}
