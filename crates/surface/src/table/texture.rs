//! The texture of a table: how the threads of a repeat differ from its mean.
//!
//! At a place `x` the cloth scatters
//!
//! ```text
//! f(x, w_o, w_i) = f(w_o, w_i) (1 + sum over k of u_k(x) v_k(w_o, w_i))
//! ```
//!
//! with the mean `f` of the [table](super::FarTable), a few images `u_k` over the texels of a
//! period and a function `v_k` of both directions for each, between the nodes of few rings. The
//! images have the mean zero, so the mean over a period is that of the table. The share of light
//! straight through is that of the table times a ratio by texel and direction.
//!
//! Wider pixels read images that are averaged over texels, down to a single one.

use super::NoTable;
use super::layout::TextureLayout;
use super::rings::{Hats, Rings};
use glam::{IVec2, UVec2, Vec2, Vec3};
use organza_basis::Rgb;
use organza_scatter::Footprint;

/// Most images of a texture.
pub const MAX_RANK: usize = 32;
/// Numbers that are summed side by side.
const LANES: usize = 8;
/// Texels to the width of a pixel, at least, that are interpolated for it.
const TEXELS_ACROSS_PIXEL: f32 = 4.0;

/// The parts of a texture, as files hold them.
#[derive(Clone, Debug, PartialEq)]
pub struct TextureParts {
    /// The nodes of the eye between which it is interpolated.
    pub eye: Rings,
    /// Those of the light.
    pub light: Rings,
    /// Where its texels are.
    pub layout: TextureLayout,
    /// Share of light straight through, in 255ths: for each texel the nodes of the front.
    pub gaps: Vec<u8>,
    /// Values of the images in 32767ths: for each texel those of all images.
    pub images: Vec<i16>,
    /// For each image and node of the eye, the value of 127 of its functions.
    pub scales: Vec<f32>,
    /// For each image, node of the eye and node of the light, the functions' values.
    pub functions: Vec<[i8; 3]>,
}

/// How the places of a repeat differ from its mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    eye: Rings,
    light: Rings,
    layout: TextureLayout,
    /// Mean share of light straight through, for the nodes of the front.
    mean_gaps: Vec<f32>,
    rank: usize,
    /// The rank, rounded up.
    stride: usize,
    /// For each node of the eye, node of the light and channel the functions of all images,
    /// with zeros to the stride.
    functions: Vec<f32>,
    /// Images of texels, of pairs of texels, and so on.
    levels: Vec<Level>,
}

/// The texture at one width of texels.
#[derive(Clone, Debug, PartialEq)]
struct Level {
    size: UVec2,
    /// For each texel the nodes of the front.
    gaps: Vec<f32>,
    /// For each texel all images.
    images: Vec<f32>,
}

impl Level {
    /// The level with texels of twice the width, along the sides that have several.
    fn halved(&self) -> Level {
        let step = UVec2::select(self.size.cmpgt(UVec2::ONE), UVec2::splat(2), UVec2::ONE);
        let size = self.size / step;
        let averaged = |list: &[f32]| {
            let each = list.len() / (self.size.x * self.size.y).max(1) as usize;
            let share = 1.0 / (step.x * step.y) as f32;
            let mut mean = vec![0.0; each * (size.x * size.y) as usize];
            for (at, values) in list.chunks_exact(each.max(1)).enumerate() {
                let (x, y) = (at as u32 % self.size.x, at as u32 / self.size.x);
                let to = ((y / step.y) * size.x + x / step.x) as usize * each;
                for (sum, v) in mean[to..to + each].iter_mut().zip(values) {
                    *sum += v * share;
                }
            }
            mean
        };
        Level {
            size,
            gaps: averaged(&self.gaps),
            images: averaged(&self.images),
        }
    }
}

/// Texels and their shares of a lookup.
type Taps = [(usize, f32); 4];

impl Texture {
    /// A texture of parts.
    ///
    /// # Errors
    /// Lists of wrong lengths and numbers out of range.
    pub fn new(parts: &TextureParts) -> Result<Texture, NoTable> {
        let TextureParts {
            eye, light, layout, ..
        } = parts;
        if !layout.is_sound() {
            return Err(NoTable::Number("the grid of its texture"));
        }
        let (n, m, texels) = (eye.sphere(), light.sphere(), layout.texels());
        let rank = parts.scales.len() / n.max(1);
        let lengths = parts.gaps.len() == texels * eye.hemisphere()
            && parts.scales.len() == rank * n
            && parts.images.len() == texels * rank
            && parts.functions.len() == rank * n * m;
        if !lengths || rank > MAX_RANK {
            return Err(NoTable::Lengths);
        }
        if !parts.scales.iter().all(|s| (0.0..=1e4).contains(s)) {
            return Err(NoTable::Number("a scale of its texture"));
        }
        let stride = rank.next_multiple_of(LANES);
        let mut functions = vec![0.0; 3 * n * m * stride];
        for (at, values) in parts.functions.chunks_exact(m.max(1)).enumerate() {
            let (k, out) = (at / n, at % n);
            let unit = parts.scales[at] / 127.0;
            for (into, channels) in values.iter().enumerate() {
                for (c, v) in channels.iter().enumerate() {
                    functions[((out * m + into) * 3 + c) * stride + k] = f32::from(*v) * unit;
                }
            }
        }
        let mut images: Vec<f32> = parts
            .images
            .iter()
            .map(|v| f32::from(*v) / 32767.0)
            .collect();
        // Rounding must not move the mean.
        for k in 0..rank {
            let own = || images.iter().skip(k).step_by(rank);
            let mean = own().map(|v| f64::from(*v)).sum::<f64>() / texels as f64;
            let own = images.iter_mut().skip(k).step_by(rank);
            own.for_each(|v| *v -= mean as f32);
        }
        let mut levels = vec![Level {
            size: layout.size,
            gaps: parts.gaps.iter().map(|g| f32::from(*g) / 255.0).collect(),
            images,
        }];
        while let Some(last) = levels.last().filter(|l| l.size != UVec2::ONE) {
            let next = last.halved();
            levels.push(next);
        }
        let mean_gaps = levels.last().map_or(Vec::new(), |l| l.gaps.clone());
        Ok(Texture {
            eye: eye.clone(),
            light: light.clone(),
            layout: *layout,
            mean_gaps,
            rank,
            stride,
            functions,
            levels,
        })
    }

    /// Where its texels are.
    pub fn layout(&self) -> &TextureLayout {
        &self.layout
    }

    /// The number of its images.
    pub fn rank(&self) -> usize {
        self.rank
    }

    /// Memory that it takes, bytes.
    pub fn memory_bytes(&self) -> usize {
        let levels = self.levels.iter();
        let lists = levels.map(|l| 4 * (l.gaps.len() + l.images.len()));
        lists.sum::<usize>() + 4 * self.functions.len() + 4 * self.mean_gaps.len()
    }

    /// The images for a pixel and the texels that it reads of them, seen from `w`; `None` where
    /// it covers a period.
    fn taps(&self, w: Vec3, at: Footprint) -> Option<(&Level, Taps)> {
        if !(at.width_mm < self.layout.period_mm.max_element()) {
            return None;
        }
        let wanted_mm = at.width_mm / TEXELS_ACROSS_PIXEL;
        let doublings = (wanted_mm / self.layout.texel_mm()).log2().floor().max(0.0);
        let level = self.levels.get(doublings as usize)?;
        let place = self.layout.texels_from_middle(at.position_mm, w) - self.layout.origin_mm;
        let size = level.size.as_vec2();
        let turns = place / self.layout.period_mm;
        let grid = (turns - turns.floor()) * size - 0.5;
        if !grid.is_finite() {
            return None;
        }
        let (low, share) = (grid.floor(), grid - grid.floor());
        let wrap = |v: IVec2| v.rem_euclid(level.size.as_ivec2()).as_uvec2();
        let tap = |step: IVec2, share: f32| {
            let cell = wrap(low.as_ivec2() + step);
            ((cell.y * level.size.x + cell.x) as usize, share)
        };
        let rest = Vec2::ONE - share;
        Some((
            level,
            [
                tap(IVec2::ZERO, rest.x * rest.y),
                tap(IVec2::X, share.x * rest.y),
                tap(IVec2::Y, rest.x * share.y),
                tap(IVec2::ONE, share.x * share.y),
            ],
        ))
    }

    /// Share of light along `w` that passes straight through, where the table has `mean`.
    pub fn gap(&self, w: Vec3, mean: f32, at: Footprint) -> f32 {
        // Light passes both ways along a line.
        let w = if w.z < 0.0 { -w } else { w };
        let Some((level, taps)) = self.taps(w, at).filter(|_| mean > 0.0) else {
            return mean;
        };
        let hats = self.eye.hats(w);
        let half = self.eye.hemisphere();
        let (mut here, mut usual) = (0.0, 0.0);
        for (&node, hat) in hats.nodes.iter().zip(hats.values) {
            let node = node as usize;
            usual += self.mean_gaps[node] * hat;
            for (texel, share) in taps {
                here += level.gaps[texel * half + node] * (share * hat);
            }
        }
        if usual > 0.0 {
            (mean * here / usual).min(1.0)
        } else {
            mean
        }
    }

    /// The value between two directions over that of the table.
    pub fn ratio(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> Rgb {
        let Some((level, taps)) = self.taps(w_out, at) else {
            return Rgb::WHITE;
        };
        let m = self.light.sphere();
        let hats = [self.eye.hats(w_out), self.light.hats(w_in)];
        let nonzero = |h: &Hats| h.nodes.into_iter().zip(h.values).filter(|p| p.1 != 0.0);
        let mut images = [0.0f32; MAX_RANK];
        for (texel, share) in taps {
            let here = &level.images[texel * self.rank..(texel + 1) * self.rank];
            images
                .iter_mut()
                .zip(here)
                .for_each(|(sum, v)| *sum += v * share);
        }
        let images = &images[..self.stride];
        let mut ratio = Vec3::ONE;
        for (out, u) in nonzero(&hats[0]) {
            for (into, v) in nonzero(&hats[1]) {
                let first = (out as usize * m + into as usize) * 3 * self.stride;
                let of = |c: usize| &self.functions[first + c * self.stride..][..self.stride];
                let sums = Vec3::new(dot(images, of(0)), dot(images, of(1)), dot(images, of(2)));
                ratio += sums * (u * v);
            }
        }
        Rgb(ratio.max(Vec3::ZERO))
    }
}

/// The sum of products of two lists whose length is a multiple of [`LANES`].
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0f32; LANES];
    for (x, y) in a.chunks_exact(LANES).zip(b.chunks_exact(LANES)) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum += x * y;
        }
    }
    sums.iter().sum()
}
