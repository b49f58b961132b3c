//! How well a computed picture of a repeat explains a folded photograph.

use crate::Fold;
use std::f64::consts::TAU;

/// Widths of the blur that are tried, texels.
const BLURS: [f64; 3] = [0.8, 1.1, 1.6];
/// Blur of the photograph, texels: fibres that few repeats do not average out are no weave.
const SMOOTH: f64 = 0.7;

/// The best explanation of a folded photograph by two computed pictures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Likeness {
    /// Share of the variance of the photograph's pixels that the pictures explain.
    pub of_photograph: f64,
    /// The same of the folded photograph, smoothed.
    pub of_fold: f64,
    /// How far the computed picture is moved right and up, texels.
    pub shift: [f64; 2],
    /// Standard deviation of its blur, texels; [`Fold::blur`] is that along x and y.
    pub blur: f64,
    /// Weights of the two pictures for each channel: first colours of warp and weft.
    pub weights: [[f64; 2]; 3],
}

/// A picture blurred along x and y, by these standard deviations in texels, on a repeat without borders.
/// Rows from the bottom.
pub fn blurred(picture: &[[f64; 3]], [w, h]: [usize; 2], blur: [f64; 2]) -> Vec<[f64; 3]> {
    let (across, up) = (kernel(w, blur[0]), kernel(h, blur[1]));
    let mut rows = vec![[0.0; 3]; w * h];
    for (k, &weight) in across.iter().enumerate().filter(|(_, w)| w.abs() > 1e-9) {
        for y in 0..h {
            for x in 0..w {
                let from = picture[y * w + (x + w - k) % w];
                let to = &mut rows[y * w + x];
                (0..3).for_each(|c| to[c] += weight * from[c]);
            }
        }
    }
    let mut moved = vec![[0.0; 3]; w * h];
    for (k, &weight) in up.iter().enumerate().filter(|(_, w)| w.abs() > 1e-9) {
        for y in 0..h {
            for x in 0..w {
                let from = rows[(y + h - k) % h * w + x];
                let to = &mut moved[y * w + x];
                (0..3).for_each(|c| to[c] += weight * from[c]);
            }
        }
    }
    moved
}

/// The discrete kernel of Gaussian shape on `n` texels without borders: its variance is exactly the
/// square of `blur`, however narrow it is [Lindeberg1990].
fn kernel(n: usize, blur: f64) -> Vec<f64> {
    let wave = |f: usize, k: usize| (TAU * (f * k) as f64 / n as f64).cos();
    let weight = |k: usize| {
        let waves = (0..n).map(|f| (blur * blur * (wave(f, 1) - 1.0)).exp() * wave(f, k));
        waves.sum::<f64>() / n as f64
    };
    (0..n).map(weight).collect()
}

/// The weights, not negative, with which two pictures explain a third, and how much of its sum of
/// squares that is, from the products of the pictures with each other and with the third.
pub fn explain([aa, ab, bb]: [f64; 3], [fa, fb]: [f64; 2]) -> ([f64; 2], f64) {
    let alone = |f: f64, v: f64| if v > 0.0 && f > 0.0 { f / v } else { 0.0 };
    let det = aa * bb - ab * ab;
    if det > 1e-9 * aa * bb {
        let (a, b) = ((fa * bb - fb * ab) / det, (fb * aa - fa * ab) / det);
        if a >= 0.0 && b >= 0.0 {
            return ([a, b], a * fa + b * fb);
        }
    }
    let (a, b) = (alone(fa, aa), alone(fb, bb));
    if a * fa >= b * fb {
        ([a, 0.0], a * fa)
    } else {
        ([0.0, b], b * fb)
    }
}

impl Likeness {
    /// The best likeness over all places where the repeat may begin. The first channel of
    /// `picture` shows the cloth with white warp and black weft, the second the other way; rows
    /// from the bottom, of the size of the fold.
    pub fn best(fold: &Fold, picture: &[[f64; 3]]) -> Likeness {
        let [w, h] = fold.size();
        let texels = (w * h) as f64;
        let centred = |k: usize, list: &[[f64; 3]]| -> Vec<f64> {
            let mean = list.iter().map(|c| c[k]).sum::<f64>() / texels;
            list.iter().map(|c| c[k] - mean).collect()
        };
        let smooth = blurred(&fold.mean, [w, h], [SMOOTH; 2]);
        let photograph: [Vec<f64>; 3] = std::array::from_fn(|c| centred(c, &smooth));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let folded: f64 = photograph.iter().map(|f| dot(f, f)).sum::<f64>() / texels;
        let mut best = Likeness {
            of_photograph: -1.0,
            of_fold: -1.0,
            shift: [0.0; 2],
            blur: BLURS[0],
            weights: [[0.0; 2]; 3],
        };
        for blur in BLURS {
            let soft = blurred(picture, [w, h], fold.blur(blur));
            let bases = [0, 1].map(|k| centred(k, &soft));
            let products = [
                dot(&bases[0], &bases[0]),
                dot(&bases[0], &bases[1]),
                dot(&bases[1], &bases[1]),
            ];
            for dy in 0..fold.repeat.picks * fold.texels[1] {
                for dx in 0..w {
                    let with = |f: &[f64], b: &[f64]| {
                        let mut sum = 0.0;
                        for y in 0..h {
                            let from = (y + h - dy) % h * w;
                            let (f, b) = (&f[y * w..(y + 1) * w], &b[from..from + w]);
                            sum += dot(&f[dx..], &b[..w - dx]) + dot(&f[..dx], &b[w - dx..]);
                        }
                        sum
                    };
                    let found: [_; 3] = std::array::from_fn(|c| {
                        let f = &photograph[c];
                        explain(products, [with(f, &bases[0]), with(f, &bases[1])])
                    });
                    let explained = found.iter().map(|f| f.1).sum::<f64>() / texels;
                    if explained / fold.variance > best.of_photograph {
                        best = Likeness {
                            of_photograph: explained / fold.variance,
                            of_fold: explained / folded.max(1e-12),
                            shift: [dx as f64, dy as f64],
                            blur,
                            weights: found.map(|f| f.0),
                        };
                    }
                }
            }
        }
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Kernels have the variance that they should have, and two of them in turn are the one of the
    /// summed variances; samples of a Gaussian of half a texel have not.
    #[test]
    fn kernels_have_their_variance() {
        let variance = |kernel: &[f64]| {
            let n = kernel.len();
            let distance = |k: usize| k.min(n - k) as f64;
            let squares = kernel
                .iter()
                .enumerate()
                .map(|(k, w)| w * distance(k).powi(2));
            squares.sum::<f64>() / kernel.iter().sum::<f64>()
        };
        for blur in [0.2, 0.5, 1.3] {
            let found = variance(&kernel(36, blur));
            assert!(
                (found / (blur * blur) - 1.0).abs() < 1e-9,
                "{blur}: {found}"
            );
        }
        let dot = [1.0; 3];
        let mut picture = vec![[0.0; 3]; 24 * 18];
        picture[100] = dot;
        let twice = blurred(
            &blurred(&picture, [24, 18], [0.6, 0.3]),
            [24, 18],
            [0.8, 0.4],
        );
        let once = blurred(&picture, [24, 18], [1.0, 0.5]);
        let error = twice.iter().flatten().zip(once.iter().flatten());
        let error = error.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 1e-7, "{error}");
        let sampled: Vec<f64> = (0..36usize)
            .map(|k| (-0.5 * (k.min(36 - k) as f64 / 0.5).powi(2)).exp())
            .collect();
        assert!((variance(&sampled) / 0.25 - 1.0).abs() > 0.1);
    }
}
