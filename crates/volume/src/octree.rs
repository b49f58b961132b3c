//! The sparse octree of fibre mixtures and its queries.
//!
//! Every level is a regular grid of cells, twice as coarse as the level below. It is stored as
//! a dense table of bricks of 4 x 4 x 4 cells; only occupied bricks take memory. Looking up a
//! point takes three dependent loads (table, brick, population) at any level, without a descent
//! from a root. `benches/volume` times look-ups.
//!
//! # What is stored, and what rounding costs
//! A population takes 12 bytes, a brick 40, the table 4 for each brick of the
//! box. Against exact sums in the finest voxels,
//! - length, and with it extinction, is off by one length quantum at most: a
//!   2^31th of the fibre that may lie in the fullest block of 32^3 voxels, or
//!   coarsest cell if that is larger. Sums over cells are exact: every level
//!   holds the same total;
//! - the radius, and with it extinction, by 1/8190 of the range of radii in
//!   the tile, nothing where there is only one;
//! - the axis by 0.0006 rad at most;
//! - a spread up to 0.5 rad by 0.0014 to 0.003 rad.
//!
//! Tests verify all four. Coarse cells are merged from the exact tensors, not from the stored
//! populations of the cells below.

pub(crate) mod build;
mod of_blocks;
mod outline;
mod validate;

pub use of_blocks::BlockCut;
pub use outline::sub_cell_bit;

use crate::block_layout::BlockLayout;
use crate::footprint::FibreFootprint;
use crate::lattice::{Lattice, bit_of, brick_at, brick_index, cell_of_bit, octant};
use crate::packing::MeasuredPacking;
use crate::record::{
    Brick, RadiusScale, StoredPopulation, decode_axis, decode_group, decode_spread,
};
use glam::{UVec3, Vec3};
use organza_basis::{Aabb, FibrePopulation, Mixture};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Marks a brick without fibre.
pub(crate) const EMPTY: u32 = u32::MAX;

/// Yarn and material of a population.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Group {
    pub yarn: u32,
    pub material: u16,
}

/// One level of detail.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct OctreeLevel {
    /// Bricks along each axis.
    pub grid: UVec3,
    /// Index of each brick (x fastest, then y, z) or [`EMPTY`].
    pub brick_of: Vec<u32>,
    pub bricks: Vec<Brick>,
    pub records: Vec<StoredPopulation>,
    /// Density of one length quantum.
    pub density_per_quantum: f32,
}

/// Fibre mixtures in the voxels of a tile, at several levels of detail.
///
/// Level 0 is the finest; each next level has cells of twice the edge.
///
/// The octree of a cloth of [blocks](Octree::blocks) stores each of them once. Points, cells
/// and sizes are those of the whole cloth; lengths, counts of voxels and bytes are those of
/// what is stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Octree {
    /// The voxels that are stored: of the box, or of all blocks on top of each other.
    pub(crate) lattice: Lattice,
    /// Which block each crossing of the cloth shows.
    pub(crate) blocks: Option<Arc<BlockLayout>>,
    /// Finest voxels of the whole cloth.
    dims: UVec3,
    bounds_mm: Aabb,
    finest_per_mm: Vec3,
    pub(crate) levels: Vec<OctreeLevel>,
    pub(crate) groups: Vec<Group>,
    pub(crate) radii: RadiusScale,
    /// One unit of stored length; a power of two.
    pub(crate) quantum_mm: f64,
    pub(crate) material_count: u32,
    pub(crate) footprint: FibreFootprint,
    pub(crate) packing: Option<MeasuredPacking>,
}

impl Octree {
    pub(crate) fn assemble(
        lattice: Lattice,
        levels: Vec<OctreeLevel>,
        groups: Vec<Group>,
        radii: RadiusScale,
        quantum_mm: f64,
        material_count: u32,
    ) -> Octree {
        Octree {
            lattice,
            blocks: None,
            dims: lattice.dims,
            bounds_mm: lattice.bounds_mm(),
            finest_per_mm: (1.0 / lattice.voxel_mm).as_vec3(),
            levels,
            groups,
            radii,
            quantum_mm,
            material_count,
            footprint: FibreFootprint::Covered,
            packing: None,
        }
    }

    /// The same octree as the blocks of a cloth; `None` unless they are as many voxels as it
    /// has.
    pub(crate) fn with_blocks(mut self, blocks: BlockLayout) -> Option<Octree> {
        let cells = blocks.block_cells(0);
        let whole = (1 << (self.lattice.levels - 1)) - 1;
        let dims = self.lattice.dims;
        let stacked = u64::from(cells.z) * u64::from(blocks.count());
        let fits = cells.truncate() == dims.truncate()
            && stacked == u64::from(dims.z)
            && (cells & whole) == UVec3::ZERO
            && self.lattice.repeats;
        self.dims = blocks.dims();
        self.blocks = Some(Arc::new(blocks));
        self.bounds_mm = self.cloth_bounds_mm();
        fits.then_some(self)
    }

    fn cloth_bounds_mm(&self) -> Aabb {
        let cloth = Lattice {
            dims: self.dims,
            ..self.lattice
        };
        cloth.bounds_mm()
    }

    /// Which block each crossing shows, of a cloth of blocks.
    pub fn blocks(&self) -> Option<&Arc<BlockLayout>> {
        self.blocks.as_ref()
    }

    /// The stored cell that stands for a cell of the cloth.
    #[inline]
    fn stored(&self, level: u8, cell: UVec3) -> UVec3 {
        match &self.blocks {
            None => cell,
            Some(blocks) => blocks.stored(level, cell),
        }
    }

    /// The box that the voxels fill. Where the octree repeats, its x and y
    /// extents are the period.
    pub fn bounds_mm(&self) -> Aabb {
        self.bounds_mm
    }

    /// True when the box repeats without end in x and y.
    pub fn repeats(&self) -> bool {
        self.lattice.repeats
    }

    /// Which voxels hold the length of fibres that are thicker than a voxel.
    pub fn footprint(&self) -> FibreFootprint {
        self.footprint
    }

    /// Its packing factors, where they were measured.
    pub fn packing(&self) -> Option<&MeasuredPacking> {
        self.packing.as_ref()
    }

    /// The same octree with measured packing factors, or without. `None` unless they
    /// are positive and finite, one for every level and material.
    pub fn with_packing(mut self, packing: Option<MeasuredPacking>) -> Option<Octree> {
        let (levels, materials) = (self.level_count(), self.material_count());
        let fits = packing.as_ref().is_none_or(|p| p.fits(levels, materials));
        self.packing = packing;
        fits.then_some(self)
    }

    /// The same octree, `scale` times as large in every direction, including its fibres. `None`
    /// unless the scale is positive and the octree stays finite.
    pub fn scaled(mut self, scale: f64) -> Option<Octree> {
        self.lattice.min_mm *= scale;
        self.lattice.voxel_mm *= scale;
        self.quantum_mm *= scale;
        self.radii.min_mm = (f64::from(self.radii.min_mm) * scale) as f32;
        self.radii.step_mm = (f64::from(self.radii.step_mm) * scale) as f32;
        self.scale_extinctions(1.0 / scale);
        self.bounds_mm = self.cloth_bounds_mm();
        self.finest_per_mm = (1.0 / self.lattice.voxel_mm).as_vec3();
        let sound = scale > 0.0 && self.lattice.is_sound() && self.check().is_ok();
        sound.then_some(self)
    }

    /// The same octree with `factor` times as much fibre in every voxel. Measured packing
    /// factors are dropped: they belong to the density as it was. `None` unless the factor is
    /// positive and the octree stays finite.
    pub fn with_density(mut self, factor: f64) -> Option<Octree> {
        self.quantum_mm *= factor;
        self.scale_extinctions(factor);
        self.packing = None;
        let sound = factor > 0.0 && self.quantum_mm.is_finite() && self.check().is_ok();
        sound.then_some(self)
    }

    /// After the lattice or the quantum has changed.
    fn scale_extinctions(&mut self, factor: f64) {
        for (level, l) in (0u8..).zip(&mut self.levels) {
            l.density_per_quantum = self.lattice.density_of(self.quantum_mm, level);
            for brick in &mut l.bricks {
                // Rounding must not take a bound below what it bounds.
                brick.majorant_per_mm *= factor as f32 * (1.0 + 1e-5);
            }
        }
    }

    /// The material of each yarn, by yarn.
    pub fn materials_of_yarns(&self) -> BTreeMap<u32, u16> {
        self.groups.iter().map(|g| (g.yarn, g.material)).collect()
    }

    /// The same octree, repeated in x and y or not.
    pub fn with_repeats(mut self, repeats: bool) -> Octree {
        self.lattice.repeats = repeats;
        self
    }

    /// Number of levels; level 0 is the finest.
    pub fn level_count(&self) -> u8 {
        self.lattice.levels
    }

    /// Edges of a cell. `level` must be below [`Octree::level_count`], here
    /// and everywhere.
    pub fn voxel_mm(&self, level: u8) -> Vec3 {
        self.lattice.voxel_at(level).as_vec3()
    }

    /// Cells along each axis; the cells fill the box exactly.
    pub fn dims(&self, level: u8) -> UVec3 {
        self.dims >> u32::from(level)
    }

    /// Number of materials that populations may name.
    pub fn material_count(&self) -> usize {
        self.material_count as usize
    }

    /// The cell that holds a point, the point wrapped into the period where
    /// the octree repeats. `None` outside the box and for a point that is not
    /// a number. Faces of the box belong to it; a face between two cells
    /// belongs to the upper one.
    #[inline]
    pub fn cell_of(&self, level: u8, p_mm: Vec3) -> Option<UVec3> {
        let mut q = p_mm - self.bounds_mm.min;
        let size = self.bounds_mm.size();
        if self.lattice.repeats {
            q.x -= (q.x / size.x).floor() * size.x;
            q.y -= (q.y / size.y).floor() * size.y;
            if !(p_mm.z >= self.bounds_mm.min.z && p_mm.z <= self.bounds_mm.max.z && q.is_finite())
            {
                return None;
            }
        } else if !self.bounds_mm.contains(p_mm) {
            return None;
        }
        // Rounding may leave a coordinate slightly outside on either side; the cast clamps
        // negative values to zero.
        let cell = (q * self.finest_per_mm).as_uvec3();
        Some(cell.min(self.dims - 1) >> u32::from(level))
    }

    #[inline]
    fn brick(&self, level: u8, brick: UVec3) -> Option<(&OctreeLevel, &Brick)> {
        let l = &self.levels[usize::from(level)];
        let at = l.brick_of[brick_index(brick, l.grid) as usize];
        (at != EMPTY).then(|| (l, &l.bricks[at as usize]))
    }

    #[inline]
    fn records(&self, level: u8, cell: UVec3) -> (f32, &[StoredPopulation]) {
        let cell = self.stored(level, cell);
        let Some((l, brick)) = self.brick(level, cell >> 2u32) else {
            return (0.0, &[]);
        };
        (
            l.density_per_quantum,
            &l.records[brick.records_of(bit_of(cell))],
        )
    }

    #[inline]
    fn decode(&self, density_per_quantum: f32, r: &StoredPopulation) -> FibrePopulation {
        let group = self.groups[decode_group(r.population)];
        FibrePopulation {
            length_density_per_mm2: r.length as f32 * density_per_quantum,
            axis: decode_axis(r.direction),
            spread_rad: decode_spread(r.direction),
            radius_mm: self.radii.decode(r.population),
            material: group.material,
            yarn: group.yarn,
        }
    }

    /// The populations of a cell; `cell` must lie within [`Octree::dims`].
    #[inline]
    pub fn mixture(&self, level: u8, cell: UVec3) -> Mixture {
        let (density_per_quantum, records) = self.records(level, cell);
        let mut mixture = Mixture::EMPTY;
        for r in records {
            mixture.push(self.decode(density_per_quantum, r));
        }
        mixture
    }

    /// The populations at a point, empty outside.
    #[inline]
    pub fn mixture_at(&self, level: u8, p_mm: Vec3) -> Mixture {
        self.cell_of(level, p_mm)
            .map_or(Mixture::EMPTY, |cell| self.mixture(level, cell))
    }

    /// Bound of the extinction toward any direction in any of the finest
    /// voxels inside a cell: sum of `2 r rho` over their populations. Zero
    /// when the cell is empty.
    ///
    /// Unlike the mixture of the cell itself, which is an average, this bounds the finest
    /// voxels; since averages do not exceed it, it also bounds every level in between. From
    /// level 2 on it is a single look-up; levels 0 and 1 read one or eight voxels. `level` may
    /// exceed the coarsest by two, but not in a cloth of blocks.
    pub fn majorant_per_mm(&self, level: u8, cell: UVec3) -> f32 {
        if level >= 2 {
            // A brick of four cells along each edge is one cell two levels above, and blocks
            // hold whole cells of every level.
            return self
                .brick(level - 2, self.stored(level, cell))
                .map_or(0.0, |(_, b)| b.majorant_per_mm);
        }
        let low = cell << u32::from(level);
        let finest = (0..8u32.pow(level.into())).map(|i| low + octant(i));
        finest.fold(0.0, |most, cell| most.max(self.broadside_per_mm(0, cell)))
    }

    /// Sum of the broadside extinctions of a cell's own populations: equal to
    /// [`Mixture::broadside_per_mm`] of [`Octree::mixture`], but cheaper.
    #[inline]
    pub fn broadside_per_mm(&self, level: u8, cell: UVec3) -> f32 {
        let (density_per_quantum, records) = self.records(level, cell);
        broadside(records, density_per_quantum, &self.radii)
    }

    /// Finest voxels that hold fibre.
    pub fn occupied_voxels(&self) -> u64 {
        self.occupied_cells(0)
    }

    /// Cells of a level that hold fibre.
    pub fn occupied_cells(&self, level: u8) -> u64 {
        let bricks = &self.levels[usize::from(level)].bricks;
        let cells = bricks.iter().map(|b| u64::from(b.masks[0].count_ones()));
        cells.sum()
    }

    /// Calls `visit` with every occupied cell of a level, brick by brick or, in a cloth of
    /// blocks, crossing by crossing.
    pub fn for_each_occupied(&self, level: u8, mut visit: impl FnMut(UVec3)) {
        let Some(blocks) = &self.blocks else {
            return self.for_each_stored(level, visit);
        };
        let block = blocks.block_cells(level);
        for crossing in 0..blocks.index().len() as u32 {
            let across = blocks.crossings().x;
            let low = UVec3::new(crossing % across, crossing / across, 0) * block;
            for i in 0..block.element_product() {
                let cell = low + brick_at(i, block);
                if !self.records(level, cell).1.is_empty() {
                    visit(cell);
                }
            }
        }
    }

    /// The same, but of a cloth of blocks with the cells of one crossing for each block.
    pub fn for_each_stored(&self, level: u8, mut visit: impl FnMut(UVec3)) {
        let l = &self.levels[usize::from(level)];
        for (i, &at) in l.brick_of.iter().enumerate() {
            if at == EMPTY {
                continue;
            }
            let low = brick_at(i as u32, l.grid) << 2u32;
            let mut left = l.bricks[at as usize].masks[0];
            while left != 0 {
                let bit = left.trailing_zeros();
                left &= left - 1;
                let cell = low + cell_of_bit(bit);
                visit(match &self.blocks {
                    None => cell,
                    Some(blocks) => blocks.shown(level, cell),
                });
            }
        }
    }

    /// Fibre length stored at a level: the same number at every level.
    pub fn fibre_length_mm(&self, level: u8) -> f64 {
        let records = &self.levels[usize::from(level)].records;
        records.iter().map(|r| u64::from(r.length)).sum::<u64>() as f64 * self.quantum_mm
    }

    /// Bytes of memory of one level.
    pub fn level_memory_bytes(&self, level: u8) -> u64 {
        let l = &self.levels[usize::from(level)];
        (size_of_val(&l.brick_of[..]) + size_of_val(&l.bricks[..]) + size_of_val(&l.records[..]))
            as u64
    }

    /// Bytes of memory of the whole octree, with all levels and tables.
    pub fn memory_bytes(&self) -> u64 {
        let levels: u64 = (0..self.level_count())
            .map(|l| self.level_memory_bytes(l))
            .sum();
        let blocks = self.blocks.as_ref().map_or(0, |b| b.memory_bytes());
        levels + blocks + size_of_val(&self.groups[..]) as u64 + size_of::<Octree>() as u64
    }
}

fn broadside(records: &[StoredPopulation], density_per_quantum: f32, radii: &RadiusScale) -> f32 {
    records
        .iter()
        .map(|r| 2.0 * radii.decode(r.population) * (r.length as f32 * density_per_quantum))
        .sum()
}
