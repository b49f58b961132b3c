//! Parallel light: optical depths toward one light, tabulated, and the exact
//! ones that keep the table honest.
//!
//! Every event scores the light that the table says arrives, and with a small
//! probability what the exact transmittance adds or takes away, weighed up. The
//! sum is right on average whatever the table holds; the better the table, the
//! less there is to add.

use super::flat_medium::FlatMedium;
use crate::Lattice;
use glam::{IVec3, UVec3, Vec3};
use organza_basis::Rgb;
use rayon::prelude::*;

/// Greatest optical depth in the table: the light left, 4e-5, does not matter
/// to the difference.
pub const MOST_DEPTH: f32 = 10.0;

/// Optical depth in a cell of the table that interpolation still copes with.
const DEPTH_PER_CELL: f32 = 0.7;

/// Most cells along the edge of a voxel.
const MOST_PER_VOXEL: u32 = 3;

/// Most voxels that the way from a node to the border is followed through. What
/// nearly horizontal light meets behind them is missing from the table.
const MOST_STEPS: usize = 4096;

/// A ray along an endless slab without matter in its way has to end some time.
const MOST_EXACT_STEPS: u64 = 1 << 20;

/// One parallel light.
pub struct LightTable {
    /// Unit direction toward the light.
    pub to_light: Vec3,
    /// Irradiance across it.
    pub irradiance: Rgb,
    /// Nodes along each axis.
    pub dims: UVec3,
    /// Nodes along the edge of a voxel.
    pub per_voxel: u32,
    /// Four optical depths a word, in 255 steps up to [`MOST_DEPTH`]: of the
    /// node, of its neighbours in x, in y and in both; z fastest, then x, y: a
    /// look-up takes two that lie one above the other.
    pub depths: Vec<u32>,
    /// Extinction toward the light in every voxel, 1/mm.
    extinction_per_mm: Vec<f32>,
    lattice: Lattice,
}

/// A piece of the way to the light from the middle of a cell: through the voxel
/// so far from the first.
struct Piece {
    offset: IVec3,
    length_mm: f32,
}

impl LightTable {
    /// The table of light that travels along `direction`.
    pub fn new(medium: &FlatMedium, direction: Vec3, irradiance: Rgb) -> LightTable {
        let lattice = medium.lattice;
        let to_light = -direction;
        let extinction_per_mm: Vec<f32> = medium
            .cells
            .par_iter()
            .map(|&cell| {
                medium
                    .populations_of(cell)
                    .map(|p| p.extinction_per_mm(to_light))
                    .sum()
            })
            .collect();
        let per_voxel = nodes_per_voxel(&lattice, &extinction_per_mm);
        let mut table = LightTable {
            to_light,
            irradiance,
            dims: lattice.dims() * per_voxel,
            per_voxel,
            depths: Vec::new(),
            extinction_per_mm,
            lattice,
        };
        table.depths = table.pack(&table.node_depths());
        table
    }

    /// Bytes that tables of so many lights take at the most.
    pub fn most_bytes(lattice: &Lattice, lights: u64) -> u64 {
        let voxels = lattice.dims().as_u64vec3().element_product();
        let nodes = u64::from(MOST_PER_VOXEL).pow(3);
        // Depths once more while they are packed.
        voxels * (lights * 4 * (1 + nodes) + 4 * nodes)
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        4 * (self.depths.len() + self.extinction_per_mm.len()) as u64
    }

    /// Whether the matter repeats.
    pub fn repeats(&self) -> bool {
        self.lattice.repeats()
    }

    /// Optical depths from the nodes, the middles of the table's cells.
    ///
    /// All nodes at one place in their voxels share one way to the light; what
    /// a row of them meets in a piece of it is a row of voxels.
    fn node_depths(&self) -> Vec<f32> {
        let (n, per) = (self.dims.as_usizevec3(), self.per_voxel as usize);
        let ways: Vec<Vec<Piece>> = (0..per.pow(3))
            .map(|i| self.way([i % per, i / per % per, i / (per * per)]))
            .collect();
        let mut depths = vec![0.0f32; n.element_product()];
        depths.par_chunks_mut(n.x).enumerate().for_each_init(
            || vec![0.0f32; n.x / per],
            |sums, (at, out)| {
                let (y, z) = (at % n.y, at / n.y);
                for x in 0..per {
                    let way = &ways[(z % per * per + y % per) * per + x];
                    sums.fill(0.0);
                    self.add_way(way, y / per, z / per, sums);
                    for (out, &sum) in out[x..].iter_mut().step_by(per).zip(&*sums) {
                        *out = sum;
                    }
                }
            },
        );
        depths
    }

    /// Adds the optical depths along a way to a row of voxels.
    fn add_way(&self, way: &[Piece], y: usize, z: usize, sums: &mut [f32]) {
        let dims = self.lattice.dims().as_ivec3();
        for piece in way {
            let mut y = y as i32 + piece.offset.y;
            let z = z as i32 + piece.offset.z;
            let mut x = piece.offset.x;
            if z < 0 || z >= dims.z {
                return;
            }
            if self.lattice.repeats() {
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
                if self.lattice.repeats() {
                    add(&mut sums[ahead.len()..], around);
                }
            } else {
                add(&mut sums[-x as usize..], row);
            }
        }
    }

    /// The way from the middle of cell `phase` of a voxel to the farthest
    /// border there can be.
    fn way(&self, phase: [usize; 3]) -> Vec<Piece> {
        let start = Vec3::from_array(phase.map(|p| (p as f32 + 0.5) / self.per_voxel as f32));
        let mut walk = VoxelWalk::new(&self.lattice, start, self.to_light);
        let dims = self.lattice.dims().as_ivec3();
        let mut way = Vec::new();
        while way.len() < MOST_STEPS {
            let offset = walk.cell;
            let out = |axis: usize| offset[axis].abs() >= dims[axis];
            if out(2) || !self.lattice.repeats() && (out(0) || out(1)) {
                break;
            }
            let length_mm = walk.step();
            way.push(Piece { offset, length_mm });
        }
        way
    }

    /// Four neighbours a word.
    fn pack(&self, depths: &[f32]) -> Vec<u32> {
        let n = self.dims.as_usizevec3();
        let code = |x: usize, y: usize, z: usize| {
            let depth = depths[(z * n.y + y) * n.x + x].min(MOST_DEPTH);
            (depth * (255.0 / MOST_DEPTH) + 0.5) as u32
        };
        let next = |i: usize, n: usize| match (i + 1 < n, self.lattice.repeats()) {
            (true, _) => i + 1,
            (false, true) => 0,
            (false, false) => i,
        };
        let mut words = vec![0u32; depths.len()];
        let rows = words.par_chunks_mut(n.x * n.z).enumerate();
        rows.for_each(|(y, out)| {
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

    /// The exact transmittance from a local point to the light, and the number
    /// of voxels looked at.
    pub fn transmittance(&self, p: Vec3) -> (f32, u64) {
        transmittance(&self.lattice, p, self.to_light, |index| {
            self.extinction_per_mm[index]
        })
    }
}

/// The exact transmittance from a local point along a unit direction through
/// voxels that have an extinction, 1/mm, and the number of voxels looked at.
#[inline]
pub fn transmittance(
    lattice: &Lattice,
    p: Vec3,
    direction: Vec3,
    extinction_per_mm: impl Fn(usize) -> f32,
) -> (f32, u64) {
    let dims = lattice.dims().as_ivec3();
    let mut walk = VoxelWalk::new(lattice, p, direction);
    let (mut depth, mut steps) = (0.0f32, 0);
    loop {
        let mut c = walk.cell;
        if c.z < 0 || c.z >= dims.z {
            break;
        }
        if lattice.repeats() {
            c.x = around(c.x, dims.x);
            c.y = around(c.y, dims.y);
        } else if (c.x | c.y) < 0 || c.x >= dims.x || c.y >= dims.y {
            break;
        }
        let extinction = extinction_per_mm(((c.z * dims.y + c.y) * dims.x + c.x) as usize);
        steps += 1;
        let length_mm = walk.step();
        if extinction > 0.0 {
            depth += length_mm * extinction;
        }
        // e^-88 is the smallest f32 worth carrying on for.
        if depth > 88.0 || steps > MOST_EXACT_STEPS {
            break;
        }
    }
    ((-depth).exp(), steps)
}

fn around(c: i32, n: i32) -> i32 {
    if (0..n).contains(&c) {
        c
    } else {
        c.rem_euclid(n)
    }
}

/// Cells along the edge of a voxel so that most of the matter has at most
/// [`DEPTH_PER_CELL`] in a cell.
fn nodes_per_voxel(lattice: &Lattice, extinction_per_mm: &[f32]) -> u32 {
    let (sum, of_squares) = extinction_per_mm
        .par_chunks(1 << 16)
        .map(|c| {
            let sum = |f: fn(f64) -> f64| c.iter().map(|&x| f(f64::from(x))).sum::<f64>();
            (sum(|x| x), sum(|x| x * x))
        })
        .reduce(|| (0.0, 0.0), |a, b| (a.0 + b.0, a.1 + b.1));
    // The mean extinction where light is stopped.
    let typical = if sum > 0.0 { of_squares / sum } else { 0.0 };
    let voxel_mm = lattice.voxel_mm().element_sum() / 3.0;
    let depth = typical as f32 * voxel_mm;
    ((depth / DEPTH_PER_CELL).round() as u32).clamp(1, MOST_PER_VOXEL)
}

/// Steps from voxel to voxel along a ray.
struct VoxelWalk {
    cell: IVec3,
    step: IVec3,
    next_mm: Vec3,
    per_voxel_mm: Vec3,
    at_mm: f32,
}

impl VoxelWalk {
    fn new(lattice: &Lattice, p: Vec3, direction: Vec3) -> VoxelWalk {
        let per_mm = direction / lattice.voxel_mm();
        let cell = p.floor();
        let forth = per_mm.cmpge(Vec3::ZERO);
        let border = Vec3::select(forth, cell + 1.0, cell);
        let still = per_mm.cmpeq(Vec3::ZERO);
        let far = Vec3::INFINITY;
        VoxelWalk {
            cell: cell.as_ivec3(),
            step: IVec3::select(forth, IVec3::ONE, IVec3::NEG_ONE),
            next_mm: Vec3::select(still, far, (border - p) / per_mm),
            per_voxel_mm: Vec3::select(still, far, per_mm.abs().recip()),
            at_mm: 0.0,
        }
    }

    /// Leaves the current voxel and tells the length of the way through it.
    #[inline]
    fn step(&mut self) -> f32 {
        let n = self.next_mm;
        let axis = if n.x < n.y {
            if n.x < n.z { 0 } else { 2 }
        } else if n.y < n.z {
            1
        } else {
            2
        };
        let length = n[axis] - self.at_mm;
        self.at_mm = n[axis];
        self.cell[axis] += self.step[axis];
        self.next_mm[axis] += self.per_voxel_mm[axis];
        length.max(0.0)
    }
}
