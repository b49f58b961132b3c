//! A photograph folded onto one repeat of its weave.

use crate::{Photograph, Repeat, Shading, ThreadGrid, Vignetting};
use glam::DVec2;

/// Strips of a photograph, across and along, that are left out in turn to see by how much they
/// differ.
const STRIPS: usize = 8;
/// Threads of a strip, at least.
const MIN_THREADS: f64 = 2.0;
/// Pixels that a texel needs; rounding leaves less where all were taken out.
const MIN_COUNT: f64 = 1e-3;

/// Colours of places on a cloth, gathered on one repeat of its weave.
#[derive(Clone, Debug)]
pub struct Folding {
    repeat: Repeat,
    texels: [usize; 2],
    /// Sums of colours and counts, for each texel of each crossing that differs.
    sums: Vec<[f64; 4]>,
}

impl Folding {
    /// An empty one with `texels` along x and y for each thread's spacing.
    pub fn new(repeat: Repeat, texels: [usize; 2]) -> Folding {
        Folding {
            repeat,
            texels,
            sums: vec![[0.0; 4]; repeat.count() * texels[0] * texels[1]],
        }
    }

    /// Adds the colour of a place in thread coordinates, whose whole numbers are crossings. It is
    /// shared by the four nearest texels, so that means change evenly where places move.
    pub fn add(&mut self, thread: DVec2, colour: [f64; 3]) {
        let [r, g, b] = colour;
        self.add_sum(thread, [r, g, b, 1.0]);
    }

    /// The same for the sum of several colours and their count.
    fn add_sum(&mut self, thread: DVec2, added: [f64; 4]) {
        let size = DVec2::new(self.texels[0] as f64, self.texels[1] as f64);
        let at = (thread + 0.5) * size - 0.5;
        let low = at.floor();
        let share = at - low;
        let low = low.as_i64vec2();
        for (dy, v) in [(0, 1.0 - share.y), (1, share.y)] {
            for (dx, u) in [(0, 1.0 - share.x), (1, share.x)] {
                let sum = &mut self.sums[texel(self.repeat, self.texels, low.x + dx, low.y + dy)];
                (0..4).for_each(|k| sum[k] += u * v * added[k]);
            }
        }
    }

    /// This empty one with the pixels of a photograph that count.
    fn of(
        &self,
        photograph: &Photograph,
        grid: &ThreadGrid,
        counts: impl Fn(usize, usize) -> bool,
    ) -> Folding {
        let mut folding = self.clone();
        let [w, h] = photograph.size();
        for y in 0..h {
            for x in (0..w).filter(|x| counts(*x, y)) {
                let thread = grid.thread(DVec2::new(x as f64, y as f64));
                folding.add(thread, photograph.pixel(x, y));
            }
        }
        folding
    }

    /// The same colours on texels of another size, moved right and up by so many threads.
    pub fn moved(&self, texels: [usize; 2], shift: DVec2) -> Folding {
        let mut moved = Folding::new(self.repeat, texels);
        let [n, m] = self.texels;
        let size = DVec2::new(n as f64, m as f64);
        for (i, sum) in self.sums.iter().enumerate().filter(|(_, s)| s[3] > 0.0) {
            let (class, j) = (i / (n * m), i / n % m);
            let crossing = DVec2::new(
                (class % self.repeat.ends) as f64,
                (class / self.repeat.ends) as f64,
            );
            let within = (DVec2::new((i % n) as f64, j as f64) + 0.5) / size - 0.5;
            moved.add_sum(crossing + within + shift, *sum);
        }
        moved
    }

    /// Width and height of a whole repeat, texels.
    pub fn size(&self) -> [usize; 2] {
        let [n, m] = self.texels;
        [self.repeat.ends * n, self.repeat.all_picks() * m]
    }

    /// Mean colours of the whole repeat, rows from the bottom. Texels without a place have the
    /// colour that `missing` gives for them.
    pub fn mean(&self, missing: impl Fn(usize) -> [f64; 3]) -> Vec<[f64; 3]> {
        let [w, h] = self.size();
        let value = |t: usize| {
            let (x, y) = ((t % w) as i64, (t / w) as i64);
            let [r, g, b, count] = self.sums[texel(self.repeat, self.texels, x, y)];
            if count > MIN_COUNT {
                [r / count, g / count, b / count]
            } else {
                missing(t)
            }
        };
        (0..w * h).map(value).collect()
    }

    /// The same without the places of a part.
    pub fn without(&self, part: &Folding) -> Folding {
        let sums = self.sums.iter().zip(&part.sums);
        Folding {
            repeat: self.repeat,
            texels: self.texels,
            sums: sums
                .map(|(a, b)| std::array::from_fn(|k| a[k] - b[k]))
                .collect(),
        }
    }
}

/// The sum of a texel, counted from crossing (0, 0) without end.
fn texel(repeat: Repeat, [n, m]: [usize; 2], x: i64, y: i64) -> usize {
    let (n, m) = (n as i64, m as i64);
    let class = repeat.class(x.div_euclid(n), y.div_euclid(m)) as i64;
    ((class * m + y.rem_euclid(m)) * n + x.rem_euclid(n)) as usize
}

/// One repeat of the weave as the mean over all repeats of a photograph.
#[derive(Clone, Debug)]
pub struct Fold {
    /// How crossings repeat.
    pub repeat: Repeat,
    /// Texels of one thread's spacing along x and y.
    pub texels: [usize; 2],
    /// Width and height of a texel in the photograph, pixels.
    pub texel_px: [f64; 2],
    /// Mean linear colours of the whole repeat, `ends * texels[0]` by `all_picks * texels[1]`
    /// texels; rows from the bottom.
    pub mean: Vec<[f64; 3]>,
    /// Variance of the photograph's pixels about their mean, summed over the channels.
    pub variance: f64,
    /// Mean colour of the pixels.
    pub mean_colour: [f64; 3],
    /// The vignetting that was taken out.
    pub vignetting: Vignetting,
    /// The same as `mean` with one upright strip of the photograph left out, then with one level
    /// strip left out.
    pub without_strip: [Vec<Vec<[f64; 3]>>; 2],
}

impl Fold {
    /// Folds a photograph as it is without shading and vignetting, which is found where it is not
    /// known, for each of the parts anew. A texel is a square share of a crossing, at least 1.5 pixels wide.
    pub fn new(
        photograph: &Photograph,
        grid: &ThreadGrid,
        repeat: Repeat,
        (shading, known): (&Shading, Option<Vignetting>),
    ) -> Fold {
        let texels = grid.spacing_px().map(|s| ((s / 1.5) as usize).clamp(4, 6));
        let size = photograph.size();
        let strips: [usize; 2] = std::array::from_fn(|k| {
            let threads = size[k] as f64 / grid.spacing_px()[k];
            ((threads / MIN_THREADS) as usize).clamp(2, STRIPS)
        });
        let shaded = shading.removed(photograph);
        let vignetting = known.unwrap_or_else(|| Vignetting::find(&shaded, |_, _| true));
        let flat = vignetting.removed(&shaded);
        let empty = Folding::new(repeat, texels);
        let mut whole = empty.clone();
        let mut parts = strips.map(|n| vec![empty.clone(); n]);
        let (mut total, mut squares) = ([0.0; 3], 0.0);
        for y in 0..size[1] {
            for x in 0..size[0] {
                let thread = grid.thread(DVec2::new(x as f64, y as f64));
                let c = flat.pixel(x, y);
                whole.add(thread, c);
                parts[0][x * strips[0] / size[0]].add(thread, c);
                parts[1][y * strips[1] / size[1]].add(thread, c);
                for k in 0..3 {
                    total[k] += c[k];
                    squares += c[k] * c[k];
                }
            }
        }
        let pixels = (size[0] * size[1]) as f64;
        let mean_colour = total.map(|t| t / pixels);
        let variance = squares / pixels - mean_colour.iter().map(|m| m * m).sum::<f64>();
        let mean = whole.mean(|_| mean_colour);
        let without_strip = std::array::from_fn(|axis| {
            let without = |strip: usize| {
                let rest = whole.without(&parts[axis][strip]);
                let counts = |x: usize, y: usize| [x, y][axis] * strips[axis] / size[axis] != strip;
                match known {
                    Some(_) => rest,
                    None => {
                        let flat = Vignetting::find(&shaded, counts).removed(&shaded);
                        empty.of(&flat, grid, counts)
                    }
                }
            };
            (0..strips[axis])
                .map(|strip| without(strip).mean(|t| mean[t]))
                .collect()
        });
        Fold {
            repeat,
            texels,
            texel_px: std::array::from_fn(|k| grid.spacing_px()[k] / texels[k] as f64),
            mean,
            variance: variance.max(1e-12),
            mean_colour,
            vignetting,
            without_strip,
        }
    }

    /// Width and height, texels.
    pub fn size(&self) -> [usize; 2] {
        let [n, m] = self.texels;
        [self.repeat.ends * n, self.repeat.all_picks() * m]
    }

    /// The standard deviations along x and y, in texels, of a blur that is the same in all directions;
    /// a texel in the mean is as wide as the side of a square of its area.
    pub fn blur(&self, texels: f64) -> [f64; 2] {
        let [w, h] = self.texel_px;
        [texels * (h / w).sqrt(), texels * (w / h).sqrt()]
    }

    /// Variances of the texels of `mean`, by the jackknife over upright and level strips: threads
    /// differ from each other, and their own thickness hardly changes along them, so strips along
    /// either system count.
    pub fn variances(&self) -> Vec<[f64; 3]> {
        let mut all = vec![[0.0; 3]; self.mean.len()];
        for list in &self.without_strip {
            for (t, variance) in all.iter_mut().enumerate() {
                for (c, v) in variance.iter_mut().enumerate() {
                    *v += jackknife(list.iter().map(|strip| strip[t][c]));
                }
            }
        }
        all
    }

    /// The same of the mean colour.
    pub fn mean_variances(&self) -> [f64; 3] {
        let mean = |texels: &Vec<[f64; 3]>, c: usize| {
            texels.iter().map(|t| t[c]).sum::<f64>() / texels.len().max(1) as f64
        };
        [0, 1, 2].map(|c| {
            let lists = self.without_strip.iter().filter(|list| !list.is_empty());
            lists
                .map(|list| jackknife(list.iter().map(|t| mean(t, c))))
                .sum()
        })
    }
}

/// The variance of an estimate from those that leave out one of as many parts.
pub fn jackknife(without: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = without.clone().count() as f64;
    let mean = without.clone().sum::<f64>() / n;
    without.map(|v| (v - mean).powi(2)).sum::<f64>() * (n - 1.0) / n
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fine texels that are moved are the places that were moved: but for the half of a fine texel
    /// over which each is spread.
    #[test]
    fn moved_texels_are_those_of_moved_places() {
        let repeat = Repeat {
            ends: 2,
            shift: 1,
            picks: 1,
        };
        let steps = DVec2::new(5f64.sqrt() - 1.0, 2f64.sqrt() - 1.0);
        let place = |i: usize| i as f64 * steps;
        let colour = |at: DVec2| {
            let wave = |x: f64| (std::f64::consts::PI * x).cos();
            [2.0 + wave(at.x + at.y), 2.0 + wave(at.x - at.y), 1.0]
        };
        let shift = DVec2::new(0.37, -0.21);
        let mut fine = Folding::new(repeat, [24, 24]);
        let mut direct = Folding::new(repeat, [6, 6]);
        for i in 0..100_000 {
            fine.add(place(i), colour(place(i)));
            direct.add(place(i) + shift, colour(place(i)));
        }
        let none = |_| [0.0; 3];
        let moved = fine.moved([6, 6], shift).mean(none);
        let unmoved = fine.moved([6, 6], DVec2::ZERO).mean(none);
        let error = |list: &[[f64; 3]]| {
            let direct = direct.mean(none);
            let all = list.iter().flatten().zip(direct.iter().flatten());
            all.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        // Each place is spread over fine texels by a tent of variance 1 / (6 * 24^2) in either
        // direction, of which a wave of two threads loses 0.0029; as much again for the sample.
        assert!(error(&moved) < 0.006, "{}", error(&moved));
        assert!(error(&unmoved) > 0.3, "{}", error(&unmoved));
    }
}
