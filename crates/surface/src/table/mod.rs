//! The mean BSDF of a cloth as a table: reflection and transmission of both faces, and the
//! share of light that passes straight through, apart.
//!
//! # The values
//! [`FarTable`] is a symmetric matrix `M` over the nodes `a` of [`Rings`], and between them
//!
//! ```text
//! f(w_o, w_i) = sum over a, b of B_a(w_o) M_ab B_b(w_i)
//! ```
//!
//! with the hats `B` of the nodes. From this form follow, without further conditions:
//!
//! - `f` is symmetric in its directions, because `M` is. Directions of both faces are in one
//!   matrix, so this includes transmission, from the front and from the back.
//! - `f` is not negative, because `M` and the hats are not.
//! - The hemispherical share of scattered light is linear between nodes. With the share that
//!   passes straight through, which is linear too, a cloth that absorbs nothing returns exactly
//!   what it receives if the nodes do.
//! - Light is drawn exactly in proportion to `f` times the cosine: a node by its share, a second
//!   node by its row of the matrix, and a direction by the second node's hat.
//!
//! A value takes one byte for each channel: the logarithm of the value without the two factors
//! of its nodes, which make the rows add up to the measured shares ([`balance`]).
//!
//! Where a pixel is narrower than the period of the cloth, a [`Texture`] multiplies the values by
//! a ratio that depends on the place. Directions are drawn as without it.

mod balance;
mod clipping;
mod file;
mod layout;
mod rings;
#[cfg(test)]
mod tests;
mod texture;

pub use balance::{Balanced, MeasuredMatrix, balance};
pub use file::{MAX_FILE_BYTES, TableFileError, is_table, read_table, sealed, write_table};
pub use layout::{MAX_TEXELS, TextureLayout};
pub use rings::{Hats, Rings};
pub use texture::{MAX_RANK, Texture, TextureParts};

use glam::Vec3;
use organza_basis::{PathRng, Rgb};
use organza_scatter::{Footprint, LobeSample, Surface};

/// Nodes between two entries of the sums that a node is drawn by.
const BLOCK: usize = 16;

/// The mean BSDF of a cloth.
#[derive(Clone, Debug, PartialEq)]
pub struct FarTable {
    rings: Rings,
    /// Share of light straight through, for the nodes of the front. Light from the opposite
    /// direction takes the same way.
    gaps: Vec<f32>,
    /// Values by their bytes, for each channel.
    decode: [[f32; 256]; 3],
    /// Factors of the nodes, for each channel.
    factors: Vec<[f32; 3]>,
    /// The matrix, rows of the lower triangle one after another.
    codes: Vec<[u8; 3]>,
    /// Sums of the mean of the channels times the weights of the nodes, after every
    /// [`BLOCK`] nodes, of each row.
    sums: Vec<f32>,
    /// Weights of the nodes.
    weights: Vec<f32>,
    /// How the places of a repeat differ from the mean.
    texture: Option<Texture>,
}

/// The parts of a table, as files hold them.
#[derive(Clone, Debug, PartialEq)]
pub struct TableParts {
    /// The nodes.
    pub rings: Rings,
    /// Share of light straight through, 0 to 1, for the nodes of the front.
    pub gaps: Vec<f32>,
    /// For each channel, natural logarithms of the values of the bytes 1 and 255. The bytes
    /// between divide it evenly; the byte 0 is zero.
    pub range: [[f32; 2]; 3],
    /// Factors of all nodes, for each channel.
    pub factors: Vec<[f32; 3]>,
    /// Bytes of the pairs of nodes `(a, b)` with `b <= a`, at `a (a + 1) / 2 + b`.
    pub codes: Vec<[u8; 3]>,
}

/// Why parts are not a table.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoTable {
    /// Lists of other lengths than the nodes ask for.
    #[error("its lists do not fit its nodes")]
    Lengths,
    /// A number that is negative, not finite or too large.
    #[error("{0} is out of range")]
    Number(&'static str),
    /// A row that gives back more light than arrives.
    #[error("its node {node} gives back {share:.4} of the light that it receives")]
    Energy {
        /// The node.
        node: usize,
        /// Scattered and direct share, largest channel.
        share: f64,
    },
}

/// More than one by so much is rounding.
const ENERGY_ALLOWANCE: f64 = 1e-3;

/// Where the value of a pair of nodes is in the list.
fn place(a: usize, b: usize) -> usize {
    let (high, low) = if a >= b { (a, b) } else { (b, a) };
    high * (high + 1) / 2 + low
}

/// Values by their bytes.
fn decoded([low, high]: [f32; 2]) -> [f32; 256] {
    std::array::from_fn(|byte| match byte {
        0 => 0.0,
        _ => (low + (high - low) * (byte - 1) as f32 / 254.0).exp(),
    })
}

impl FarTable {
    /// A table of parts.
    ///
    /// # Errors
    /// Parts that do not fit each other, numbers out of range, or a cloth that would give back
    /// more light than it receives.
    pub fn new(parts: TableParts) -> Result<FarTable, NoTable> {
        let TableParts {
            rings,
            gaps,
            range,
            factors,
            codes,
        } = parts;
        let n = rings.sphere();
        if gaps.len() != rings.hemisphere() || factors.len() != n || codes.len() != n * (n + 1) / 2
        {
            return Err(NoTable::Lengths);
        }
        if !gaps.iter().all(|g| (0.0..=1.0).contains(g)) {
            return Err(NoTable::Number("a share of light straight through"));
        }
        let limits = range
            .iter()
            .all(|[low, high]| low <= high && low.abs() < 40.0 && *high < 40.0);
        if !limits {
            return Err(NoTable::Number("the range of its bytes"));
        }
        if !factors.iter().flatten().all(|f| (0.0..=1e6).contains(f)) {
            return Err(NoTable::Number("a factor of a node"));
        }
        let weights = (0..n).map(|k| rings.weight(k) as f32).collect();
        let mut table = FarTable {
            decode: range.map(decoded),
            rings,
            gaps,
            factors,
            codes,
            sums: Vec::new(),
            weights,
            texture: None,
        };
        let blocks = n.div_ceil(BLOCK);
        let mut sums = Vec::with_capacity(n * blocks);
        for a in 0..n {
            let gap = f64::from(table.gap_of(a));
            let mut shares = [0.0f64; 3];
            for b in 0..n {
                let weight = table.rings.weight(b);
                let value = table.value(a, b);
                for (share, v) in shares.iter_mut().zip(value) {
                    *share += f64::from(v) * weight;
                }
                if b % BLOCK == BLOCK - 1 || b + 1 == n {
                    sums.push((shares.iter().sum::<f64>() / 3.0) as f32);
                }
            }
            let most = shares.iter().fold(0.0f64, |m, s| m.max(*s)) + gap;
            if !(most <= 1.0 + ENERGY_ALLOWANCE) {
                return Err(NoTable::Energy {
                    node: a,
                    share: most,
                });
            }
        }
        table.sums = sums;
        Ok(table)
    }

    /// The table with a texture.
    pub fn with_texture(self, texture: Option<Texture>) -> FarTable {
        FarTable { texture, ..self }
    }

    /// How the places of a repeat differ from the mean, if that is known.
    pub fn texture(&self) -> Option<&Texture> {
        self.texture.as_ref()
    }

    /// Its nodes.
    pub fn rings(&self) -> &Rings {
        &self.rings
    }

    /// Memory that it takes, bytes.
    pub fn memory_bytes(&self) -> usize {
        size_of::<FarTable>()
            + 3 * self.codes.len()
            + 12 * self.factors.len()
            + 4 * (self.gaps.len() + self.sums.len() + self.weights.len())
            + self.texture.as_ref().map_or(0, Texture::memory_bytes)
    }

    /// The share of light from a node that passes straight through.
    fn gap_of(&self, node: usize) -> f32 {
        let front = match node < self.rings.hemisphere() {
            true => node,
            false => self.rings.opposite(node),
        };
        self.gaps.get(front).copied().unwrap_or(0.0)
    }

    /// The value of a pair of nodes, 1/sr.
    #[inline]
    fn value(&self, a: usize, b: usize) -> [f32; 3] {
        let codes = self.codes[place(a, b)];
        let (x, y) = (self.factors[a], self.factors[b]);
        std::array::from_fn(|c| self.decode[c][usize::from(codes[c])] * (x[c] * y[c]))
    }

    /// The share of light from a direction that is scattered: mean of the channels.
    fn scattered(&self, hats: &Hats) -> f32 {
        let last = self.rings.sphere().div_ceil(BLOCK) - 1;
        let row = |node: u32| self.sums[node as usize * (last + 1) + last];
        let terms = hats.nodes.iter().zip(hats.values);
        terms.map(|(&node, v)| row(node) * v).sum()
    }

    /// The scattered share of light from a direction, for each channel.
    pub fn albedo(&self, w: Vec3) -> Rgb {
        let hats = self.rings.hats(w);
        let mut sum = [0.0f64; 3];
        for (&a, share) in hats.nodes.iter().zip(hats.values) {
            for b in 0..self.rings.sphere() {
                let value = self.value(a as usize, b);
                for (s, v) in sum.iter_mut().zip(value) {
                    *s += f64::from(v * share) * f64::from(self.weights[b]);
                }
            }
        }
        let [r, g, b] = sum.map(|s| s as f32);
        Rgb::new(r, g, b)
    }

    /// The value between two sets of hats.
    fn between(&self, mut x: Hats, mut y: Hats) -> Rgb {
        // Always in the same order, so that exchanged directions have the same bits.
        let order = x.nodes.cmp(&y.nodes).then_with(|| {
            let bits = |h: &Hats| h.values.map(f32::to_bits);
            bits(&x).cmp(&bits(&y))
        });
        if order.is_gt() {
            std::mem::swap(&mut x, &mut y);
        }
        let mut sum = [0.0f32; 3];
        for (&a, u) in x.nodes.iter().zip(x.values) {
            for (&b, v) in y.nodes.iter().zip(y.values) {
                let value = self.value(a as usize, b as usize);
                for (s, m) in sum.iter_mut().zip(value) {
                    *s += m * (u * v);
                }
            }
        }
        Rgb::new(sum[0], sum[1], sum[2])
    }

    /// Value and density for a ray that met yarn, from the value.
    fn density(&self, value: Rgb, out: &Hats, w_in: Vec3) -> f32 {
        let scattered = self.scattered(out);
        if scattered > 0.0 {
            value.mean() * w_in.z.abs() / scattered
        } else {
            0.0
        }
    }

    /// What the texture makes of a value at a place.
    fn ratio(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> Rgb {
        match &self.texture {
            Some(texture) => texture.ratio(w_out, w_in, at),
            None => Rgb::WHITE,
        }
    }

    /// A node drawn by the row of another.
    fn next_node(&self, from: usize, rng: &mut PathRng) -> usize {
        let n = self.rings.sphere();
        let blocks = n.div_ceil(BLOCK);
        let row = &self.sums[from * blocks..(from + 1) * blocks];
        let wanted = rng.unit() * row[blocks - 1];
        let block = row.partition_point(|s| *s <= wanted).min(blocks - 1);
        let mut before = if block == 0 { 0.0 } else { row[block - 1] };
        let mut last = block * BLOCK;
        for b in block * BLOCK..((block + 1) * BLOCK).min(n) {
            let [x, y, z] = self.value(from, b);
            let share = (x + y + z) * (self.weights[b] / 3.0);
            if share > 0.0 {
                last = b;
                before += share;
                if before > wanted {
                    break;
                }
            }
        }
        last
    }
}

impl Surface for FarTable {
    fn gap(&self, w: Vec3, at: Footprint) -> f32 {
        if w.z == 0.0 {
            return 0.0;
        }
        let hats = self.rings.hats(if w.z < 0.0 { -w } else { w });
        let terms = hats.nodes.iter().zip(hats.values);
        let mean = terms.map(|(&k, v)| self.gaps[k as usize] * v).sum::<f32>();
        match &self.texture {
            Some(texture) => texture.gap(w, mean.min(1.0), at),
            None => mean.min(1.0),
        }
    }

    fn eval(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> Rgb {
        if w_out.z == 0.0 || w_in.z == 0.0 {
            return Rgb::BLACK;
        }
        let mean = self.between(self.rings.hats(w_out), self.rings.hats(w_in));
        mean * self.ratio(w_out, w_in, at)
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3, at: Footprint) -> f32 {
        let value = self.eval(w_out, w_in, Footprint::FAR);
        (1.0 - self.gap(w_out, at)) * self.density(value, &self.rings.hats(w_out), w_in)
    }

    fn sample(&self, w_out: Vec3, at: Footprint, rng: &mut PathRng) -> Option<LobeSample> {
        if w_out.z == 0.0 {
            return None;
        }
        let hats = self.rings.hats(w_out);
        let scattered = self.scattered(&hats);
        let gap = self.gap(w_out, at);
        if !(scattered > 0.0) || gap >= 1.0 {
            return None;
        }
        let blocks = self.rings.sphere().div_ceil(BLOCK);
        let mut wanted = rng.unit() * scattered;
        let mut from = hats.nodes[0] as usize;
        for (&node, share) in hats.nodes.iter().zip(hats.values) {
            let part = self.sums[node as usize * blocks + blocks - 1] * share;
            if part > 0.0 {
                from = node as usize;
                wanted -= part;
                if wanted < 0.0 {
                    break;
                }
            }
        }
        let w_in = self.rings.draw(self.next_node(from, rng), rng);
        let value = self.between(hats, self.rings.hats(w_in));
        let density = self.density(value, &hats, w_in);
        (density > 0.0).then(|| LobeSample {
            w_in,
            weight: value * self.ratio(w_out, w_in, at) * (w_in.z.abs() / density / (1.0 - gap)),
            pdf: (1.0 - gap) * density,
        })
    }

    fn axis(&self, _: Footprint) -> Vec3 {
        Vec3::ZERO
    }
}
