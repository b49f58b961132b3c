//! The far field of a fibre as a table: lobes over the azimuth, at even steps of the cosine of the
//! mean inclination.

use crate::cone_table::node;
use crate::near::LOBES;
use crate::near::parts::{SectionRow, SectionTable};
use glam::{Vec3, Vec4};
use organza_basis::{PathRng, Rgb};
use std::f32::consts::{PI, TAU};

/// Rows of a table, even in the cosine of the mean inclination: Fresnel's reflectance is nearly
/// linear in it toward grazing.
pub(crate) const ROWS: usize = 33;
/// Lobes with azimuths of their own; the last is even.
pub(crate) const SHAPED: usize = LOBES - 1;

/// See the [module](self).
#[derive(Clone, Debug)]
pub(crate) struct LobeTable {
    rows: Vec<Row>,
    azimuths: usize,
    /// Per row and shaped lobe, over azimuths from 0 to pi: colour per radian, and
    /// density of drawing the azimuth, given the lobe.
    table: Vec<Vec4>,
    /// Per row and shaped lobe: the distribution of the absolute azimuth.
    cumulative: Vec<f32>,
    /// As long: the last azimuth at or before an even share of it, so that
    /// drawing begins where it ends.
    guide: Vec<u16>,
}

#[derive(Clone, Copy, Debug)]
struct Row {
    /// Of the last lobe, as in the table.
    rest: Vec4,
    /// Probability of each lobe.
    lobes: Vec4,
}

impl LobeTable {
    /// A table without rows, of so many azimuths from 0 to pi with both ends.
    pub fn new(azimuths: usize) -> LobeTable {
        let nodes = ROWS * SHAPED * azimuths;
        LobeTable {
            rows: Vec::with_capacity(ROWS),
            azimuths,
            table: Vec::with_capacity(nodes),
            cumulative: Vec::with_capacity(nodes),
            guide: Vec::with_capacity(nodes),
        }
    }

    /// Adds the row of the next cosine: what each lobe sends, and the shapes of all but the last
    /// over the azimuths, up to scale.
    pub fn add_row(&mut self, energies: [Rgb; LOBES], shapes: &[Vec<Vec3>; SHAPED]) {
        // Lobes are drawn by their mean over the channels.
        let grey = Vec4::from_array(energies.map(Rgb::mean));
        let total = grey.element_sum();
        self.rows.push(Row {
            rest: energies[SHAPED].0.extend(1.0) / TAU,
            lobes: if total > 0.0 { grey / total } else { Vec4::X },
        });
        for (shape, energy) in shapes.iter().zip(energies) {
            // Trapezoidal over both signs of the azimuth.
            let step = PI / (self.azimuths - 1) as f32;
            let half: Vec3 = shape.windows(2).map(|s| 0.5 * step * (s[0] + s[1])).sum();
            let scale = 0.5 * energy.0 / half.max(Vec3::splat(f32::MIN_POSITIVE));
            // A lobe without energy is never drawn; let it be even.
            let all = half.element_sum();
            let density = |s: Vec3| {
                if all > 0.0 {
                    0.5 * s.element_sum() / all
                } else {
                    0.5 / PI
                }
            };
            let start = self.cumulative.len();
            let (mut cumulative, mut before) = (0.0, None);
            for s in shape {
                let d = density(*s);
                cumulative += before.map_or(0.0, |b: f32| step * (b + d));
                before = Some(d);
                self.table.push((*s * scale).extend(d));
                self.cumulative.push(cumulative);
            }
            let row = &mut self.cumulative[start..];
            row.iter_mut().for_each(|c| *c /= cumulative);
            let mut at = 0;
            for k in 0..self.azimuths {
                let share = k as f32 / self.azimuths as f32;
                while at + 2 < self.azimuths && row[at + 1] <= share {
                    at += 1;
                }
                self.guide.push(at as u16);
            }
        }
    }

    /// The same for lanes.
    pub fn sections(&self) -> SectionTable {
        let row = |(i, row): (usize, &Row)| SectionRow {
            lobes: row.lobes.to_array(),
            rest: row.rest.truncate().to_array(),
            nodes: [0, 1, 2].map(|p| {
                let start = (i * SHAPED + p) * self.azimuths;
                let nodes = &self.table[start..start + self.azimuths];
                nodes.iter().map(|node| node.to_array()).collect()
            }),
        };
        let rows = self.rows.iter().enumerate().map(row).collect();
        SectionTable { rows }
    }

    /// Probability with which each lobe is drawn.
    pub fn far_lobes(&self, cos_theta: f32) -> [f32; LOBES] {
        let (i, u) = node(cos_theta, ROWS);
        let (row, next) = (&self.rows[i].lobes, self.rows[i + 1].lobes);
        row.lerp(next, u).to_array()
    }

    /// Colour per radian of azimuth of each lobe in the far field, in x, y, z; the
    /// density of drawing the azimuth, given the lobe, in w.
    pub fn far(&self, mean_cos: f32, azimuth_rad: f32) -> [Vec4; LOBES] {
        let (i, u) = node(mean_cos, ROWS);
        let (k, v) = node(azimuth_rad.abs() * (1.0 / PI), self.azimuths);
        let mut out = [self.rows[i].rest.lerp(self.rows[i + 1].rest, u); LOBES];
        for (p, out) in out.iter_mut().enumerate().take(SHAPED) {
            let low = (i * SHAPED + p) * self.azimuths + k;
            let high = low + SHAPED * self.azimuths;
            let a = self.table[low].lerp(self.table[low + 1], v);
            let b = self.table[high].lerp(self.table[high + 1], v);
            *out = a.lerp(b, u);
        }
        out
    }

    /// Nodes of the table from 0 to pi.
    pub fn azimuth_nodes(&self) -> usize {
        self.azimuths
    }

    /// Draws the azimuth of a lobe with the density of [`Self::far`].
    pub fn far_azimuth_sample(&self, lobe: usize, mean_cos: f32, rng: &mut PathRng) -> f32 {
        if lobe == SHAPED {
            return PI - TAU * rng.unit();
        }
        // Between two rows, one of them: their mixture is the interpolation.
        let (i, u) = node(mean_cos, ROWS);
        let row = i + usize::from(rng.unit() < u);
        let start = (row * SHAPED + lobe) * self.azimuths;
        let cumulative = &self.cumulative[start..start + self.azimuths];
        let u = rng.unit();
        let mut k = usize::from(self.guide[start + (u * self.azimuths as f32) as usize]);
        while k + 2 < self.azimuths && cumulative[k + 1] <= u {
            k += 1;
        }
        let share = (u - cumulative[k]) / (cumulative[k + 1] - cumulative[k]).max(1e-30);
        let (a, b) = (self.table[start + k].w, self.table[start + k + 1].w);
        let t = linear_quantile(a, b, share);
        let azimuth = (k as f32 + t) * PI / (self.azimuths - 1) as f32;
        let is_right = rng.bits() & 1 == 0;
        if is_right { azimuth } else { -azimuth }
    }
}

/// The cosine of a row.
pub(crate) fn row_cosine(i: usize) -> f32 {
    i as f32 / (ROWS - 1) as f32
}

/// Where a density that runs linearly from a to b over `[0, 1]` has collected
/// the given share of its integral.
fn linear_quantile(a: f32, b: f32, share: f32) -> f32 {
    let area = 0.5 * (a + b) * share.clamp(0.0, 1.0);
    // The root that neither divides by b - a nor cancels.
    let root = (a * a + 2.0 * (b - a) * area).max(0.0).sqrt();
    (2.0 * area / (a + root).max(1e-30)).min(1.0)
}
