//! Parallel light: optical depths toward one light, tabulated, and the exact
//! ones that keep the table honest.
//!
//! Every event scores the light that the table says arrives, and with a small
//! probability what the exact transmittance adds or takes away, weighed up. The
//! sum is right on average whatever the table holds; the better the table, the
//! less there is to add.

use super::blocks::Blocks;
use super::flat_medium::FlatMedium;
use super::placed_light::PlacedLight;
use super::shadow_ray::ShadowRay;
use super::voxel_walk::VoxelWalk;
use glam::{IVec2, IVec3, UVec3, Vec3};
use organza_basis::{CellGrid, Rgb};
use organza_lanes::math::V3;
use organza_lanes::{Floats, Ints};
use rayon::prelude::*;
use std::sync::Arc;

/// Greatest optical depth in the table: the light left, 4e-5, does not matter
/// to the difference.
pub const MAX_DEPTH: f32 = 10.0;

/// What is added to what a table lets through when a ray is chosen: where it is
/// wrong about darkness, rays must not be too rare.
const RESIDUAL_FLOOR: f32 = 0.005;

/// The same where tables are guesses: for lights with a place, and for cut matter.
pub const RESIDUAL_FLOOR_OF_GUESSES: f32 = 0.05;

/// Optical depth in a cell of the table that interpolation still copes with.
const DEPTH_PER_CELL: f32 = 0.7;

/// Most cells along the edge of a voxel.
const MAX_PER_VOXEL: u32 = 3;

/// Most voxels that the way from a node to the border is followed through. What
/// nearly horizontal light meets behind them is missing from the table.
const MAX_STEPS: usize = 4096;

/// Where the nodes of a table are: in the middles of cells that divide voxels.
#[derive(Clone, Copy, Debug)]
pub struct Nodes {
    /// Along each axis.
    pub dims: UVec3,
    /// Along the edge of a voxel.
    pub per_voxel: u32,
    /// Whether the last node of a row stands beside the first.
    pub repeats: bool,
    /// Tables that follow each other, one for each block of a cloth of blocks.
    pub tables: u32,
}

/// The eight nodes around a place, in every lane.
pub struct Corners<F: Floats> {
    /// The word of the lower four; that of the upper follows.
    word: F::Ints,
    /// How far the place is from the first.
    x: F,
    y: F,
    z: F,
}

impl Nodes {
    /// The nodes for lights toward which voxels have these extinctions, 1/mm. Tables of many
    /// blocks have one in each voxel: they are guesses near the borders of blocks anyway.
    pub fn new<'a>(
        cell_grid: &CellGrid,
        tables: usize,
        lights: impl Iterator<Item = &'a [f32]>,
    ) -> Nodes {
        let per_voxel = lights
            .map(|extinctions| nodes_per_voxel(cell_grid, extinctions))
            .max()
            .filter(|_| tables == 1)
            .unwrap_or(1);
        Nodes {
            dims: cell_grid.dims() * per_voxel,
            per_voxel,
            repeats: cell_grid.repeats(),
            tables: tables as u32,
        }
    }

    /// Words of the tables of one light.
    pub fn words(&self) -> u64 {
        u64::from(self.tables) * self.dims.as_u64vec3().element_product()
    }

    #[inline(always)]
    pub fn around<F: Floats>(&self, at: V3<F>, table: Option<F::Ints>) -> Corners<F> {
        let word = F::Ints::splat;
        let (per_voxel, size) = (self.per_voxel as f32, self.dims.as_vec3());
        let (x, fx) = node_before(at.x, per_voxel, size.x, self.repeats);
        let (y, fy) = node_before(at.y, per_voxel, size.y, self.repeats);
        let (z, fz) = node_before(at.z, per_voxel, size.z, false);
        let own = (x + word(self.dims.x) * y) * word(self.dims.z) + z;
        Corners {
            word: match table {
                None => own,
                Some(table) => table * word(self.dims.element_product()) + own,
            },
            x: fx,
            y: fy,
            z: fz,
        }
    }
}

/// The last node before a place, along one axis, and how far behind it the
/// place is. Before the first node: the last one of the period before, or
/// itself.
#[inline(always)]
fn node_before<F: Floats>(at: F, per_voxel: f32, size: f32, wraps: bool) -> (F::Ints, F) {
    let zero = F::splat(0.0);
    let at = at.mul_add(F::splat(per_voxel), F::splat(-0.5));
    let last = F::splat(size - 1.0);
    if wraps {
        let low = at.floor();
        let index = last.or_where_not(low.below(zero), low);
        return (index.to_ints(), at - low);
    }
    // Nothing is known beyond the last node.
    let at = at.max(zero).min(last);
    let low = at.floor();
    (low.to_ints(), at - low)
}

/// Optical depth toward a light, linear between eight nodes; `depths` holds the
/// words of all lights side by side.
#[inline(always)]
pub fn depth<F: Floats>(depths: &[u32], lights: usize, light: usize, corners: &Corners<F>) -> F {
    let low = corners.word * F::Ints::splat(lights as u32) + F::Ints::splat(light as u32);
    let high = low + F::Ints::splat(lights as u32);
    let low = between_four(low.gather(depths), corners.x, corners.y);
    let high = between_four(high.gather(depths), corners.x, corners.y);
    (high - low).mul_add(corners.z, low) * F::splat(MAX_DEPTH / 255.0)
}

/// The words of all lights side by side: those of a node are one look-up.
pub fn side_by_side(lights: &mut [OpticalDepthTable]) -> Vec<u32> {
    let tables = lights.iter_mut().map(|light| &mut light.depths);
    let tables: Vec<Vec<u32>> = tables.map(std::mem::take).collect();
    let mut words = vec![0; tables.iter().map(Vec::len).sum()];
    let nodes = words.par_chunks_exact_mut(tables.len().max(1)).enumerate();
    nodes.for_each(|(node, out)| {
        for (out, table) in out.iter_mut().zip(&tables) {
            *out = table[node];
        }
    });
    words
}

/// Between the four depths of a word.
#[inline(always)]
fn between_four<F: Floats>(four: F::Ints, fx: F, fy: F) -> F {
    let byte = F::Ints::splat(0xff);
    let (a, b) = (
        (four & byte).to_floats(),
        (four.shr::<8>() & byte).to_floats(),
    );
    let (c, d) = (
        (four.shr::<16>() & byte).to_floats(),
        four.shr::<24>().to_floats(),
    );
    let (low, high) = ((b - a).mul_add(fx, a), (d - c).mul_add(fx, c));
    (high - low).mul_add(fy, low)
}

/// One parallel light.
pub struct OpticalDepthTable {
    /// Unit direction toward the light.
    pub to_light: Vec3,
    /// Irradiance across it of parallel light.
    pub irradiance: Rgb,
    /// What light comes from, when it is not parallel.
    pub placed: Option<PlacedLight>,
    /// Exact rays are traced as if the table let so much more through.
    pub residual_floor: f32,
    pub nodes: Nodes,
    /// Four optical depths a word, in 255 steps up to [`MAX_DEPTH`]: of the
    /// node, of its neighbours in x, in y and in both; z fastest, then x, y: a
    /// look-up takes two that lie one above the other. Empty once the words
    /// of all lights are [side by side](side_by_side).
    pub depths: Vec<u32>,
    /// Extinction toward the light in every voxel, 1/mm.
    pub extinction_per_mm: Vec<f32>,
    cell_grid: CellGrid,
    blocks: Option<Arc<Blocks>>,
}

/// A piece of the way to the light from the middle of a cell: through the voxel
/// so far from the first.
struct Piece {
    offset: IVec3,
    length_mm: f32,
}

impl OpticalDepthTable {
    /// The table of light that travels along `direction`, toward which voxels have
    /// these [extinctions].
    pub fn new(
        (cell_grid, blocks): (CellGrid, Option<Arc<Blocks>>),
        nodes: Nodes,
        direction: Vec3,
        irradiance: Rgb,
        extinction_per_mm: Vec<f32>,
    ) -> OpticalDepthTable {
        let mut table = OpticalDepthTable {
            to_light: -direction,
            irradiance,
            placed: None,
            residual_floor: RESIDUAL_FLOOR,
            nodes,
            depths: Vec::new(),
            extinction_per_mm,
            cell_grid,
            blocks,
        };
        table.depths = table.pack(&table.node_codes());
        table
    }

    /// Bytes that tables of so many lights take at the most.
    pub fn max_bytes(voxels: u64, lights: u64) -> u64 {
        let nodes = u64::from(MAX_PER_VOXEL).pow(3);
        // Depths once more while they are packed and put side by side.
        voxels * (lights * 4 * (1 + 2 * nodes) + 4 * nodes)
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        4 * (self.depths.len() + self.extinction_per_mm.len()) as u64
    }

    /// Optical depths from the nodes, the middles of the table's cells, in 255
    /// steps up to [`MAX_DEPTH`].
    ///
    /// All nodes at one place in their voxels share one way to the light; what
    /// a row of them meets in a piece of it is a row of voxels.
    fn node_codes(&self) -> Vec<u8> {
        let (n, per) = (
            self.nodes.dims.as_usizevec3(),
            self.nodes.per_voxel as usize,
        );
        let ways: Vec<Vec<Piece>> = (0..per.pow(3))
            .map(|i| self.way([i % per, i / per % per, i / (per * per)]))
            .collect();
        let mut codes = vec![0u8; n.element_product() * self.nodes.tables as usize];
        codes.par_chunks_mut(n.x).enumerate().for_each_init(
            || vec![0.0f32; n.x / per],
            |sums, (at, out)| {
                let (y, z, block) = (at % n.y, at / n.y % n.z, at / n.y / n.z);
                for x in 0..per {
                    let way = &ways[(z % per * per + y % per) * per + x];
                    sums.fill(0.0);
                    match &self.blocks {
                        None => self.add_way(way, y / per, z / per, sums),
                        Some(blocks) => {
                            self.add_way_through(blocks, block, way, [y / per, z / per], sums);
                        }
                    }
                    for (out, &sum) in out[x..].iter_mut().step_by(per).zip(&*sums) {
                        *out = (sum.min(MAX_DEPTH) * (255.0 / MAX_DEPTH) + 0.5) as u8;
                    }
                }
            },
        );
        codes
    }

    /// Adds the optical depths along a way to a row of voxels.
    fn add_way(&self, way: &[Piece], y: usize, z: usize, sums: &mut [f32]) {
        let dims = self.cell_grid.dims().as_ivec3();
        for piece in way {
            let mut y = y as i32 + piece.offset.y;
            let z = z as i32 + piece.offset.z;
            let mut x = piece.offset.x;
            if z < 0 || z >= dims.z {
                return;
            }
            if self.cell_grid.repeats() {
                x = x.rem_euclid(dims.x);
                y = y.rem_euclid(dims.y);
            } else if y < 0 || y >= dims.y || x.abs() >= dims.x {
                return;
            }
            let row = &self.extinction_per_mm[((z * dims.y + y) * dims.x) as usize..];
            let row = &row[..dims.x as usize];
            let add = |sums: &mut [f32], row: &[f32]| {
                for (sum, extinction) in sums.iter_mut().zip(row) {
                    *sum += piece.length_mm * extinction;
                }
            };
            if x >= 0 {
                let (around, ahead) = row.split_at(x as usize);
                add(sums, ahead);
                if self.cell_grid.repeats() {
                    add(&mut sums[ahead.len()..], around);
                }
            } else {
                add(&mut sums[-x as usize..], row);
            }
        }
    }

    /// The same in a block, and on through its neighbours at one of the crossings that show
    /// it: at others the neighbours differ, and the table is a guess.
    fn add_way_through(
        &self,
        blocks: &Blocks,
        block: usize,
        way: &[Piece],
        [y, z]: [usize; 2],
        sums: &mut [f32],
    ) {
        let dims = self.cell_grid.dims().as_ivec3();
        let crossing = blocks.shown_at[block].as_ivec2();
        for piece in way {
            let z = z as i32 + piece.offset.z;
            if z < 0 || z >= dims.z {
                return;
            }
            let y = y as i32 + piece.offset.y;
            let (up, y) = (y.div_euclid(dims.y), y.rem_euclid(dims.y));
            let (right, x) = (
                piece.offset.x.div_euclid(dims.x),
                piece.offset.x.rem_euclid(dims.x) as usize,
            );
            let row = |right: i32| {
                let number = blocks.number(crossing + IVec2::new(right, up));
                let first = number * blocks.voxels as usize + ((z * dims.y + y) * dims.x) as usize;
                &self.extinction_per_mm[first..first + dims.x as usize]
            };
            let (own, next) = sums.split_at_mut(dims.x as usize - x);
            let add = |sums: &mut [f32], row: &[f32]| {
                for (sum, extinction) in sums.iter_mut().zip(row) {
                    *sum += piece.length_mm * extinction;
                }
            };
            add(own, &row(right)[x..]);
            if !next.is_empty() {
                add(next, row(right + 1));
            }
        }
    }

    /// The way from the middle of cell `phase` of a voxel to the farthest
    /// border there can be.
    fn way(&self, phase: [usize; 3]) -> Vec<Piece> {
        let start = Vec3::from_array(phase.map(|p| (p as f32 + 0.5) / self.nodes.per_voxel as f32));
        let mut walk = VoxelWalk::new(&self.cell_grid, start, self.to_light);
        let dims = self.cell_grid.dims().as_ivec3();
        let mut way = Vec::new();
        while way.len() < MAX_STEPS {
            let offset = walk.cell;
            let out = |axis: usize| offset[axis].abs() >= dims[axis];
            if out(2) || !self.cell_grid.repeats() && (out(0) || out(1)) {
                break;
            }
            let length_mm = walk.step();
            way.push(Piece { offset, length_mm });
        }
        way
    }

    /// Four neighbours a word.
    fn pack(&self, codes: &[u8]) -> Vec<u32> {
        let n = self.nodes.dims.as_usizevec3();
        let next = |i: usize, n: usize| match (i + 1 < n, self.cell_grid.repeats()) {
            (true, _) => i + 1,
            (false, true) => 0,
            (false, false) => i,
        };
        let mut words = vec![0u32; codes.len()];
        let rows = words.par_chunks_mut(n.x * n.z).enumerate();
        rows.for_each(|(at, out)| {
            let (y, table) = (at % n.y, at / n.y);
            let codes = &codes[table * n.element_product()..];
            let code = |x: usize, y: usize, z: usize| u32::from(codes[(z * n.y + y) * n.x + x]);
            let beyond = next(y, n.y);
            for (x, column) in out.chunks_exact_mut(n.z).enumerate() {
                let beside = next(x, n.x);
                for (z, word) in column.iter_mut().enumerate() {
                    *word = code(x, y, z)
                        | code(beside, y, z) << 8
                        | code(x, beyond, z) << 16
                        | code(beside, beyond, z) << 24;
                }
            }
        });
        words
    }

    /// The transmittance along a ray, and the number of voxels looked at.
    pub fn transmittance(&self, medium: &FlatMedium, ray: &ShadowRay<'_>) -> (f32, u64) {
        if ray.toward != self.to_light {
            return ray.transmittance(|voxel| medium.extinction_per_mm(voxel, ray.toward));
        }
        ray.transmittance(|voxel| self.extinction_per_mm.get(voxel).copied())
    }
}

/// Extinction toward a direction in every voxel, 1/mm.
pub fn extinctions(medium: &FlatMedium, w: Vec3) -> Vec<f32> {
    (0..medium.voxel_count())
        .into_par_iter()
        .map(|voxel| medium.extinction_per_mm(voxel, w).unwrap_or_default())
        .collect()
}

/// Cells along the edge of a voxel so that most of the matter has at most
/// [`DEPTH_PER_CELL`] in a cell.
fn nodes_per_voxel(cell_grid: &CellGrid, extinction_per_mm: &[f32]) -> u32 {
    let (sum, of_squares) = extinction_per_mm
        .par_chunks(1 << 16)
        .map(|c| {
            let sum = |f: fn(f64) -> f64| c.iter().map(|&x| f(f64::from(x))).sum::<f64>();
            (sum(|x| x), sum(|x| x * x))
        })
        .reduce(|| (0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    // The mean extinction where light is stopped.
    let typical = if sum > 0.0 { of_squares / sum } else { 0.0 };
    let voxel_mm = cell_grid.voxel_mm().element_sum() / 3.0;
    let depth = typical as f32 * voxel_mm;
    ((depth / DEPTH_PER_CELL).round() as u32).clamp(1, MAX_PER_VOXEL)
}
