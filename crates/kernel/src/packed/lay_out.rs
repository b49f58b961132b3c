//! Laying packed fibres out for lanes, voxel by voxel.

use super::axis_code::encoded;
use super::fibre_volume::{BRICK, END_ON_BITS, FibreVolume, PLACE_BITS, POPULATION};
use crate::matter::{MAX_DIM, Unsuited};
use crate::voxels::fibre_tables::end_on_ratio;
use crate::voxels::layout::check_range;
use crate::voxels::reach::surroundings_within;
use crate::voxels::voxel_words::MOST;
use glam::{UVec3, Vec3};
use organza_basis::{CellGrid, FibrePopulation};
use organza_scatter::{Fibre, effective_cross_section};

/// Room for what rounding does to extinctions and bounds.
const BOUND_SLACK: f32 = 1.0 + 2e-4;

/// Voxels are looked up by signed numbers, two words each.
const MAX_VOXELS: u64 = 1 << 30;

/// Most materials: their numbers have eight bits.
const MAX_MATERIALS: usize = 256;

/// The fibre that says where the axis of a tentative collision is looked up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExpectedFibre {
    /// Unit mean axis.
    pub axis: Vec3,
    /// Radius, mm.
    pub radius_mm: f32,
}

/// Packed fibres as they are described to the kernel: constant within the voxels of a grid.
pub trait PackedVoxels: Sync {
    /// Where they are, and how they repeat: the voxels with axes in them, and beside them
    /// those that fibres reach into.
    fn cell_grid(&self) -> &CellGrid;

    /// The populations whose axes lie in a voxel. Their length per volume is that of
    /// the fibres times the greatest of the [factors](PackedVoxels::factors).
    fn populations(&self, cell: UVec3) -> &[FibrePopulation];

    /// The fibre that is expected where a ray passes a voxel.
    fn expected(&self, cell: UVec3) -> ExpectedFibre;

    /// How the fibres scatter, by material.
    fn fibres(&self) -> &[Fibre];

    /// Packing factors by material: for rays that leave a fibre of the same yarn, of another
    /// yarn, and that come from outside the cloth.
    fn factors(&self) -> Vec<[f32; 3]>;
}

impl FibreVolume {
    /// Lays packed fibres out.
    ///
    /// # Errors
    /// Fibres that do not suit, or too many of them.
    pub fn new(source: &impl PackedVoxels) -> Result<FibreVolume, Unsuited> {
        let cell_grid = *source.cell_grid();
        let dims = cell_grid.dims();
        if dims.max_element() > MAX_DIM {
            return Err(Unsuited::TooWide);
        }
        if source.fibres().len() > MAX_MATERIALS {
            return Err(Unsuited::TooManyMaterials);
        }
        let bricks = FibreVolume::bricks_of(&cell_grid);
        if (bricks * BRICK).as_u64vec3().element_product() >= MAX_VOXELS {
            return Err(Unsuited::TooManyVoxels);
        }
        let count = dims.as_usizevec3().element_product();
        let cells =
            || (0..count as u32).map(|i| UVec3::new(i, i / dims.x, i / (dims.x * dims.y)) % dims);
        let (mut greatest, mut least) = (0.0f32, f32::INFINITY);
        let (mut widest, mut thinnest) = (0.0f32, f32::INFINITY);
        let mut bounds = Vec::with_capacity(count);
        for cell in cells() {
            let here = source.populations(cell);
            let mut most = 0.0f32;
            for c in here {
                most = most.max(across_per_mm(c));
                least = least.min(across_per_mm(c));
                widest = widest.max(c.radius_mm);
                thinnest = thinnest.min(c.radius_mm);
            }
            bounds.push(most * here.len() as f32);
            greatest = greatest.max(most * here.len() as f32);
        }
        let scale_per_mm = f32::max(greatest, f32::MIN_POSITIVE * 1e12) * (BOUND_SLACK / MOST);
        let path_mm = 1.0 / (MOST * scale_per_mm);
        check_range(&cell_grid, MOST * scale_per_mm, least)?;
        let apart = (widest / cell_grid.voxel_mm().min_element() * (1.0 + 1e-5)).ceil();
        let shares = bounds.iter().map(|b| b * (BOUND_SLACK / scale_per_mm));
        let around = surroundings_within(&cell_grid, apart as u32, shares, path_mm);
        let has_one_radius = widest <= thinnest * (1.0 + 1e-4);
        let mut volume = FibreVolume {
            cell_grid,
            voxels: Vec::with_capacity(2 * count),
            radii: Vec::with_capacity(if has_one_radius { 0 } else { count }),
            radius_mm: widest,
            bricks,
            words: vec![0; POPULATION],
            shares: shares_of(&source.factors()),
            scale_per_mm,
        };
        for cell in in_bricks(volume.bricks) {
            if cell.cmpge(dims).any() {
                // A brick goes on beyond the last voxels.
                volume.voxels.extend([0; 2]);
                if !has_one_radius {
                    volume.radii.push(widest.to_bits());
                }
                continue;
            }
            let place = cell.x + dims.x * (cell.y + dims.y * cell.z);
            let around = around[place as usize];
            let expected = source.expected(cell);
            volume.voxels.push(
                u32::from(around.bound_code) << 24
                    | u32::from(around.reach_code) << 20
                    | encoded(expected.axis, 10),
            );
            if !has_one_radius {
                volume.radii.push(expected.radius_mm.to_bits());
            }
            volume.add(source.populations(cell))?;
        }
        Ok(volume)
    }

    /// Bytes that a volume of so many voxels takes at the least, with working space.
    pub fn min_bytes(cell_grid: &CellGrid) -> u64 {
        20 * cell_grid.dims().as_u64vec3().element_product()
    }

    /// Adds the populations of the next voxel.
    fn add(&mut self, populations: &[FibrePopulation]) -> Result<(), Unsuited> {
        let Some(more) = populations.len().checked_sub(1) else {
            self.voxels.push(0);
            return Ok(());
        };
        let first = (self.words.len() / POPULATION) as u32;
        if first >> PLACE_BITS != 0 || more > 7 {
            return Err(Unsuited::TooManyPopulations);
        }
        self.voxels.push(first | (more as u32) << PLACE_BITS);
        for c in populations {
            let end_on = (end_on_ratio(c.spread_rad).sqrt() * 4095.0).round() as u32;
            // To the nearest: the lower bits make room.
            let half = 1 << (END_ON_BITS - 1);
            let radius = (c.radius_mm.to_bits() + half) >> END_ON_BITS << END_ON_BITS;
            self.words.extend([
                (across_per_mm(c) / self.scale_per_mm).to_bits(),
                u32::from(c.material) << 24 | encoded(c.axis, 12),
                radius | end_on.min(4095),
                c.yarn,
            ]);
        }
        Ok(())
    }
}

/// Cells of bricks, in the order of their indices.
fn in_bricks(bricks: UVec3) -> impl Iterator<Item = UVec3> {
    let count = bricks.element_product() * BRICK.pow(3);
    (0..count).map(move |i| {
        let (brick, i) = (i / BRICK.pow(3), i % BRICK.pow(3));
        let brick = UVec3::new(brick, brick / bricks.x, brick / (bricks.x * bricks.y)) % bricks;
        brick * BRICK + UVec3::new(i, i / BRICK, i / (BRICK * BRICK)) % BRICK
    })
}

/// Extinction of a population across its axis, 1/mm.
fn across_per_mm(c: &FibrePopulation) -> f32 {
    c.broadside_per_mm() * effective_cross_section(1.0, c.spread_rad)
}

/// Factors over the greatest of their material, four words a material.
fn shares_of(factors: &[[f32; 3]]) -> Vec<u32> {
    let mut words = Vec::new();
    for of_material in factors {
        let greatest = of_material.iter().copied().fold(0.0, f32::max);
        words.extend(of_material.map(|f| (f / greatest).to_bits()));
        words.push(0);
    }
    words
}
