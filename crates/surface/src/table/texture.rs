//! The texture of a table: how the threads of a repeat differ from its mean.
//!
//! At a place `x` the cloth scatters
//!
//! ```text
//! f(x, w_o, w_i) = f(w_o, w_i) max(0, 1 + sum over k of u_k(x) v_k(w_o, w_i)) / c(w_o, w_i)
//! ```
//!
//! with the mean `f` of the [table](super::FarTable), a few images `u_k` over the texels of a
//! period and a function `v_k` of both directions for each, between the nodes of few rings. The
//! images have the mean zero; few of them can have a sum below -1 where little light goes, and `c`
//! is the mean over the period without those places ([`Clipping`]). So the mean over a period is
//! that of the table. The share of light straight through is that of the table times a ratio by
//! texel and direction.
//!
//! Wider pixels read images that are averaged over texels, down to a single one.

use super::NoTable;
use super::clipping::{Clipping, PAIRS};
use super::layout::TextureLayout;
use super::rings::{Hats, Rings};
use glam::{IVec2, UVec2, Vec2, Vec3};
use organza_basis::{PathRng, Rgb, warp};
use organza_scatter::Footprint;

/// Most images of a texture.
pub const MAX_RANK: usize = 32;
/// Numbers that are summed side by side.
const LANES: usize = 8;
/// Texels to the width of a pixel, at least, that are interpolated for it.
const TEXELS_ACROSS_PIXEL: f32 = 4.0;

/// Pixels of this share of the period and wider see less and less of the texture, and none at a
/// period: so it does not begin at an edge. Their mean over a pixel is nearly the same everywhere.
const FADES_FROM: f32 = 0.75;

/// Seed of the pairs of directions at which clipping is measured.
const CLIPPING_SEED: u64 = 1;

/// What clipping adds, a share of the mean, that is too little to have a shape.
const SHAPE_FLOOR: f32 = 0.01;

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
    /// For each node of the eye, node of the light and channel what clipping adds to the mean,
    /// over what it adds to ratios of that deviation at other pairs.
    shapes: Vec<f32>,
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
    /// The variances of the images between texels.
    variances: Vec<f32>,
    /// The means of ratios of light from the side of the eye, and from the other.
    clipping: [Clipping; 2],
}

/// Texels and their shares of a lookup.
type Taps = [(usize, f32); 4];

impl Level {
    /// A level of texels, not clipped.
    fn new(size: UVec2, gaps: Vec<f32>, images: Vec<f32>) -> Level {
        Level {
            size,
            gaps,
            images,
            variances: Vec::new(),
            clipping: [Clipping::new(&[]), Clipping::new(&[])],
        }
    }

    /// Texels at a place in turns of the period.
    fn taps(&self, turns: Vec2) -> Option<Taps> {
        let grid = (turns - turns.floor()) * self.size.as_vec2() - 0.5;
        if !grid.is_finite() {
            return None;
        }
        let (low, share) = (grid.floor(), grid - grid.floor());
        let wrap = |v: IVec2| v.rem_euclid(self.size.as_ivec2()).as_uvec2();
        let tap = |step: IVec2, share: f32| {
            let cell = wrap(low.as_ivec2() + step);
            ((cell.y * self.size.x + cell.x) as usize, share)
        };
        let rest = Vec2::ONE - share;
        Some([
            tap(IVec2::ZERO, rest.x * rest.y),
            tap(IVec2::X, share.x * rest.y),
            tap(IVec2::Y, rest.x * share.y),
            tap(IVec2::ONE, share.x * share.y),
        ])
    }

    /// The values of `rank` images.
    fn values(&self, rank: usize, taps: Taps) -> Values {
        let mut values = [0.0f32; MAX_RANK];
        for (texel, share) in taps {
            let here = &self.images[texel * rank..(texel + 1) * rank];
            let pairs = values.iter_mut().zip(here);
            pairs.for_each(|(sum, v)| *sum += v * share);
        }
        values
    }

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
        Level::new(size, averaged(&self.gaps), averaged(&self.images))
    }
}

/// A value for each image, with zeros for those that are none.
type Values = [f32; MAX_RANK];

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
        let images = parts.images.iter().map(|v| f32::from(*v) / 32767.0);
        let mut images: Vec<f32> = images.collect();
        // Rounding must not move the mean.
        for k in 0..rank {
            let own = || images.iter().skip(k).step_by(rank);
            let mean = own().map(|v| f64::from(*v)).sum::<f64>() / texels as f64;
            let own = images.iter_mut().skip(k).step_by(rank);
            own.for_each(|v| *v -= mean as f32);
        }
        let gaps = parts.gaps.iter().map(|g| f32::from(*g) / 255.0).collect();
        let mut levels = vec![Level::new(layout.size, gaps, images)];
        while let Some(last) = levels.last().filter(|l| l.size != UVec2::ONE) {
            let next = last.halved();
            levels.push(next);
        }
        let mean_gaps = levels.last().map_or(Vec::new(), |l| l.gaps.clone());
        let mut texture = Texture {
            eye: eye.clone(),
            light: light.clone(),
            layout: *layout,
            mean_gaps,
            rank,
            stride,
            functions,
            shapes: vec![1.0; 3 * n * m],
            levels,
        };
        for at in 0..texture.levels.len() {
            texture.measure_clipping(at);
        }
        texture.measure_shapes();
        Ok(texture)
    }

    /// The values of all images at the places at which clipping is measured.
    fn places(&self, level: &Level) -> Vec<Values> {
        let taps = Clipping::places().filter_map(|turns| level.taps(turns));
        taps.map(|taps| level.values(self.rank, taps)).collect()
    }

    /// Measures what clipping adds to the mean of a level.
    fn measure_clipping(&mut self, at: usize) {
        let places = self.places(&self.levels[at]);
        let share = 1.0 / places.len().max(1) as f32;
        let square = |k: usize| places.iter().map(|v| v[k] * v[k]).sum::<f32>() * share;
        let variances: Vec<f32> = (0..self.stride).map(square).collect();
        let mut measured = [Vec::new(), Vec::new()];
        let mut rng = PathRng::from_seed(CLIPPING_SEED);
        for pair in 0..2 * PAIRS {
            let mut direction = || warp::uniform_sphere(rng.unit2());
            let (w_out, mut w_in) = (direction(), direction());
            let side = pair % 2;
            let z = if side == 0 { w_out.z } else { -w_out.z };
            w_in.z = w_in.z.abs().copysign(z);
            for function in self.functions(w_out, w_in).0 {
                let spread = deviation(&function, &variances);
                measured[side].push((spread, clipped_mean(&places, &function)));
            }
        }
        let level = &mut self.levels[at];
        level.clipping = measured.map(|m| Clipping::new(&m));
        level.variances = variances;
    }

    /// Measures at the nodes how what clipping adds differs from pairs of the same deviation.
    fn measure_shapes(&mut self) {
        let Some(level) = self.levels.first() else {
            return;
        };
        let places = self.places(level);
        let m = self.light.sphere();
        let shape = |(at, function): (usize, &[f32])| {
            let mut values = [0.0; MAX_RANK];
            values[..self.stride].copy_from_slice(function);
            let (out, into) = (at / (3 * m), at / 3 % m);
            let is_through = (out < self.eye.hemisphere()) != (into < self.light.hemisphere());
            let clipping = &level.clipping[usize::from(is_through)];
            let usual = clipping.mean(deviation(&values, &level.variances)) - 1.0;
            // Where little is added, it does not matter by what.
            let own = clipped_mean(&places, &values) - 1.0 + SHAPE_FLOOR;
            own / (usual + SHAPE_FLOOR)
        };
        let functions = self.functions.chunks_exact(self.stride.max(1));
        let shapes: Vec<f32> = functions.enumerate().map(shape).collect();
        if !shapes.is_empty() {
            self.shapes = shapes;
        }
    }

    /// The same that does not divide by what clipping adds: a known bad one.
    #[cfg(test)]
    pub(super) fn undivided(mut self) -> Texture {
        self.shapes.fill(0.0);
        self
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
        let lists = levels.map(|l| 4 * (l.gaps.len() + l.images.len()) + size_of_val(&l.clipping));
        lists.sum::<usize>() + 4 * (self.functions.len() + self.shapes.len() + self.mean_gaps.len())
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
        Some((level, level.taps(place / self.layout.period_mm)?))
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

    /// The functions of all images between two directions, for each channel, and the shapes of
    /// what clipping adds.
    fn functions(&self, w_out: Vec3, w_in: Vec3) -> ([Values; 3], [f32; 3]) {
        let m = self.light.sphere();
        let hats = [self.eye.hats(w_out), self.light.hats(w_in)];
        let nonzero = |h: &Hats| h.nodes.into_iter().zip(h.values).filter(|p| p.1 != 0.0);
        let (mut functions, mut shapes) = ([[0.0f32; MAX_RANK]; 3], [0.0f32; 3]);
        for (out, u) in nonzero(&hats[0]) {
            for (into, v) in nonzero(&hats[1]) {
                let first = (out as usize * m + into as usize) * 3;
                for (c, sums) in functions.iter_mut().enumerate() {
                    let here = &self.functions[(first + c) * self.stride..][..self.stride];
                    let pairs = sums.iter_mut().zip(here);
                    pairs.for_each(|(sum, f)| *sum += f * (u * v));
                    shapes[c] += self.shapes[first + c] * (u * v);
                }
            }
        }
        (functions, shapes)
    }

    /// The value between two directions over that of the table.
    pub fn ratio(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> Rgb {
        let Some((level, taps)) = self.taps(w_out, at) else {
            return Rgb::WHITE;
        };
        let values = level.values(self.rank, taps);
        let clipping = &level.clipping[usize::from(w_out.z * w_in.z < 0.0)];
        let (functions, shapes) = self.functions(w_out, w_in);
        let periods = at.width_mm / self.layout.period_mm.max_element();
        let seen = ((1.0 - periods) / (1.0 - FADES_FROM)).clamp(0.0, 1.0);
        let ratio = |c: usize| {
            let spread = seen * deviation(&functions[c], &level.variances);
            let added = clipping.mean(spread) - 1.0;
            let sum = seen * dot(&values, &functions[c]);
            (1.0 + sum).max(0.0) / (1.0 + added * shapes[c])
        };
        Rgb::new(ratio(0), ratio(1), ratio(2))
    }
}

/// The mean over places of what is not negative of a ratio.
fn clipped_mean(places: &[Values], function: &Values) -> f32 {
    let ratios = places
        .iter()
        .map(|values| (1.0 + dot(values, function)).max(0.0));
    ratios.sum::<f32>() / places.len().max(1) as f32
}

/// The standard deviation over places of images of these variances times their functions.
fn deviation(function: &Values, variances: &[f32]) -> f32 {
    let terms = function.iter().zip(variances);
    let squares = terms.map(|(f, variance)| f * f * variance);
    squares.sum::<f32>().sqrt()
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
