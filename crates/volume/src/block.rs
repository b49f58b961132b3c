//! Filling the voxels of one block from the pieces of curve that reach it.
//!
//! The sums of a block fit into the cache, so that a piece costs little wherever it lies. The
//! groups of one yarn and material are summed and cleared one after another.

use crate::clip::for_each_clip;
use crate::cluster::GatheredPopulation;
use crate::footprint::FibreFootprint;
use crate::lattice::{BLOCK, Lattice, VOXELS, voxel_in_block};
use crate::route::RoutePiece;
use glam::{DVec3, IVec3, UVec3, Vec3};
use organza_basis::{Frame, Sym3};
use std::f32::consts::TAU;
use std::f64::consts::PI;

/// Maximum number of lines that represent one thick segment; with them the lines are half
/// a voxel apart up to a radius of 64 voxels.
const MAX_LINES: f64 = 65_536.0;

/// Sums in the voxels of a block: of the first population of a group in each voxel, and of a
/// second population of another direction.
pub struct BlockSums {
    lobes: [Vec<GatheredPopulation>; 2],
    occupied: [Vec<u64>; 2],
    lines: Vec<Line>,
    /// The present positions of the lines.
    cells: Vec<[i32; 3]>,
}

/// One of the lines that represent a thick fibre of radius one.
#[derive(Clone, Copy)]
struct Line {
    /// Place in the cross-section.
    x: f32,
    y: f32,
    /// The place between two faces at which it is sampled.
    phase: f32,
}

impl BlockSums {
    pub fn new() -> BlockSums {
        let sums = || vec![GatheredPopulation::default(); VOXELS];
        let masks = || vec![0u64; VOXELS / 64];
        BlockSums {
            lobes: [sums(), sums()],
            occupied: [masks(), masks()],
            lines: Vec::new(),
            cells: Vec::new(),
        }
    }

    /// Bytes of one voxel.
    pub const BYTES: u64 = 2 * (VOXELS * size_of::<GatheredPopulation>() + VOXELS / 8) as u64;

    /// The populations that `pieces`, each with its group, leave in a block,
    /// sorted by key.
    pub fn fill(
        &mut self,
        lattice: &Lattice,
        footprint: FibreFootprint,
        block: UVec3,
        pieces: &mut [(u64, &RoutePiece)],
    ) -> Vec<GatheredPopulation> {
        if !pieces.is_sorted_by_key(|p| p.0) {
            pieces.sort_by_key(|p| p.0);
        }
        let min = block * BLOCK;
        let dims = lattice.dims.as_ivec3();
        let mut target = Target {
            lattice,
            footprint,
            min: min.as_dvec3(),
            size: (lattice.dims - min).min(UVec3::splat(BLOCK)),
            // A box that does not repeat has nothing outside.
            low: IVec3::MIN,
            high: IVec3::MAX,
        };
        for axis in if lattice.repeats { 2..3 } else { 0..3 } {
            target.low[axis] = -(min[axis] as i32);
            target.high[axis] = dims[axis] - 1 - min[axis] as i32;
        }
        let mut populations = Vec::new();
        let mut groups = 0;
        for part in pieces.chunk_by(|a, b| a.0 == b.0) {
            for (_, p) in part {
                self.add(&target, p);
            }
            self.take(part[0].0, &mut populations);
            groups += 1;
        }
        if groups > 1 {
            sort_by_voxel(&mut populations);
        }
        populations
    }

    fn add(&mut self, to: &Target, p: &RoutePiece) {
        let along_mm = (p.end - p.start) * to.lattice.voxel_mm;
        let length_mm = along_mm.length();
        if length_mm == 0.0 {
            return;
        }
        let tangent = (along_mm / length_mm).as_vec3();
        let radius = p.start_radius_mm.max(p.end_radius_mm);
        if to.footprint.is_line(radius, to.lattice) {
            self.add_line(to, p, length_mm, Sym3::outer(tangent));
        } else {
            self.add_thick(to, p, length_mm, tangent.normalize());
        }
    }

    fn add_line(&mut self, to: &Target, p: &RoutePiece, length_mm: f64, tensor: Sym3) {
        let r0 = f64::from(p.start_radius_mm);
        let dr = 0.5 * (f64::from(p.end_radius_mm) - r0);
        for_each_clip(p.start - to.min, p.end - to.min, |cell, t0, t1| {
            if t1 > t0
                && let Some(voxel) = to.voxel(cell)
            {
                let radius = r0 + (t0 + t1) * dr;
                let piece =
                    GatheredPopulation::of_line(length_mm * (t1 - t0), radius as f32, tensor);
                put(&mut self.lobes, &mut self.occupied, voxel, &piece);
            }
        });
    }

    /// Lines spread over the cross-section, half a voxel apart or less, share the length.
    /// Between two faces across the fibre each line is sampled once, at a place of its own.
    fn add_thick(&mut self, to: &Target, p: &RoutePiece, length_mm: f64, tangent: Vec3) {
        let radius = f64::from(p.start_radius_mm.max(p.end_radius_mm));
        let narrowest = to.lattice.voxel_mm.min_element();
        let lines = 4.0 * PI * (radius / narrowest).powi(2);
        self.spread_lines(lines.ceil().min(MAX_LINES) as usize);
        let per_mm = (1.0 / to.lattice.voxel_mm).as_vec3();
        let frame = Frame::from_normal(tangent);
        let (s, t) = (frame.s * per_mm, frame.t * per_mm);
        // Counted from the first cell of the piece, so that neighbouring blocks round alike.
        let base = p.start.floor();
        let a = (p.start - base).as_vec3();
        let base = (base - to.min).as_ivec3();
        let d = (p.end - p.start).as_vec3();
        let axis = d.abs().max_position();
        // Slid along the fibre onto the face.
        let slope = d / d[axis];
        let (s, t) = (s - s[axis] * slope, t - t[axis] * slope);
        let tensor = Sym3::outer(tangent);
        let share = length_mm / self.lines.len() as f64;
        let (r0, dr) = (p.start_radius_mm, p.end_radius_mm - p.start_radius_mm);
        let (first, end) = (a[axis], a[axis] + d[axis]);
        let step = if d[axis] > 0.0 { 1 } else { -1 };
        let mut layer = floor(first);
        let mut t0 = 0.0f32;
        for left in (0..=(floor(end) - layer).abs()).rev() {
            let face = (layer + i32::from(step > 0)) as f32;
            let t1 = if left == 0 {
                1.0
            } else {
                ((face - first) / d[axis]).clamp(t0, 1.0)
            };
            let dt = t1 - t0;
            if dt > 0.0 && to.layer_is_inside(axis, base[axis] + layer) {
                let radius = r0 + (t0 + 0.5 * dt) * dr;
                let (from, along) = (a + t0 * d, dt * d);
                let (s, t) = (radius * s, radius * t);
                for (cell, line) in self.cells.iter_mut().zip(&self.lines) {
                    let at = |k: usize| {
                        floor(from[k] + line.phase * along[k] + line.x * s[k] + line.y * t[k])
                    };
                    *cell = [at(0), at(1), at(2)];
                }
                let piece = GatheredPopulation::of_line(share * f64::from(dt), radius, tensor);
                for cell in &self.cells {
                    let mut cell = IVec3::from(*cell);
                    cell[axis] = layer;
                    if let Some(voxel) = to.voxel(base + cell) {
                        put(&mut self.lobes, &mut self.occupied, voxel, &piece);
                    }
                }
            }
            t0 = t1;
            layer += step;
        }
    }

    /// Spreads lines evenly over the unit disk: a sunflower.
    fn spread_lines(&mut self, count: usize) {
        if self.lines.len() == count {
            return;
        }
        let golden = 0.5 * (3.0 - 5f32.sqrt());
        self.lines = (0..count)
            .map(|k| {
                let out = ((k as f32 + 0.5) / count as f32).sqrt();
                let (sin, cos) = (TAU * (k as f32 * golden).fract()).sin_cos();
                Line {
                    x: out * cos,
                    y: out * sin,
                    phase: ((k as f32 + 0.5) * 0.754_877_7).fract(),
                }
            })
            .collect();
        self.cells = vec![[0; 3]; count];
    }

    /// Moves the sums of one group to the end of `populations` and clears them.
    fn take(&mut self, group: u64, populations: &mut Vec<GatheredPopulation>) {
        for word in 0..VOXELS / 64 {
            let mut left = std::mem::take(&mut self.occupied[0][word]);
            let second = std::mem::take(&mut self.occupied[1][word]);
            while left != 0 {
                let bit = left.trailing_zeros();
                left &= left - 1;
                let voxel = 64 * word + bit as usize;
                let named = |population: GatheredPopulation, lobe: u64| GatheredPopulation {
                    key: GatheredPopulation::key_of(voxel as u32, group) | lobe,
                    ..population
                };
                populations.push(named(self.lobes[0][voxel], 0));
                if second >> bit & 1 == 1 {
                    populations.push(named(self.lobes[1][voxel], 1));
                }
            }
        }
    }
}

/// Adds a piece to its voxel: to the lobe of its yarn with a similar direction, or to a second
/// lobe.
#[inline]
fn put(
    lobes: &mut [Vec<GatheredPopulation>; 2],
    occupied: &mut [Vec<u64>; 2],
    voxel: usize,
    piece: &GatheredPopulation,
) {
    let (word, bit) = (voxel >> 6, 1u64 << (voxel & 63));
    let first = &mut lobes[0][voxel];
    if occupied[0][word] & bit == 0 {
        occupied[0][word] |= bit;
        *first = *piece;
    } else if first.is_like(piece) {
        first.add(piece);
    } else {
        put_aside(lobes, occupied, voxel, piece);
    }
}

/// Adds a piece whose direction differs from that of the first population of its voxel.
#[cold]
fn put_aside(
    lobes: &mut [Vec<GatheredPopulation>; 2],
    occupied: &mut [Vec<u64>; 2],
    voxel: usize,
    piece: &GatheredPopulation,
) {
    let (word, bit) = (voxel >> 6, 1u64 << (voxel & 63));
    if occupied[1][word] & bit == 0 {
        occupied[1][word] |= bit;
        lobes[1][voxel] = *piece;
        return;
    }
    if lobes[1][voxel].is_like(piece) {
        lobes[1][voxel].add(piece);
        return;
    }
    let nearness = |population: &GatheredPopulation| {
        f64::from(population.likeness(piece)) / population.length_mm
    };
    let second = nearness(&lobes[1][voxel]) > nearness(&lobes[0][voxel]);
    lobes[usize::from(second)][voxel].add(piece);
}

/// The floor of a number of voxels, without a function call on processors whose instruction set
/// may lack rounding.
#[inline]
fn floor(x: f32) -> i32 {
    let towards_zero = x as i32;
    towards_zero - i32::from(x < towards_zero as f32)
}

/// A block in the tile.
struct Target<'a> {
    lattice: &'a Lattice,
    footprint: FibreFootprint,
    /// Its least corner, voxels.
    min: DVec3,
    /// Its voxels that lie in the tile.
    size: UVec3,
    /// Cells beyond these, counted from `min`, count as these.
    low: IVec3,
    high: IVec3,
}

impl Target<'_> {
    /// Number of a cell counted from the least corner, if the cell belongs to the block.
    #[inline]
    fn voxel(&self, cell: IVec3) -> Option<usize> {
        let c = cell.clamp(self.low, self.high).as_uvec3();
        // Negative numbers have become large ones.
        (c.x < self.size.x && c.y < self.size.y && c.z < self.size.z)
            .then(|| voxel_in_block(c) as usize)
    }

    fn layer_is_inside(&self, axis: usize, layer: i32) -> bool {
        let l = layer.clamp(self.low[axis], self.high[axis]);
        (l as u32) < self.size[axis]
    }
}

/// Sorts by voxel; the order within a voxel is kept.
pub fn sort_by_voxel(populations: &mut Vec<GatheredPopulation>) {
    let voxels = populations.iter().map(GatheredPopulation::voxel);
    let most = voxels.max().unwrap_or(0);
    let mut next = vec![0u32; most as usize + 2];
    for l in populations.iter() {
        next[l.voxel() as usize + 1] += 1;
    }
    for i in 1..next.len() {
        next[i] += next[i - 1];
    }
    let mut sorted = vec![GatheredPopulation::default(); populations.len()];
    for l in populations.iter() {
        let at = &mut next[l.voxel() as usize];
        sorted[*at as usize] = *l;
        *at += 1;
    }
    *populations = sorted;
}
