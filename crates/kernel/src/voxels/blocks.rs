//! Matter of blocks: the periods of the grid that paths walk in are crossings, and an index
//! gives the block that each crossing shows.

use crate::matter::{Matter, MatterBlocks};
use glam::{IVec2, UVec2, UVec3, Vec2, Vec3};
use organza_basis::{Aabb, CellGrid};
use organza_lanes::{Floats, Ints};
use std::sync::Arc;

/// Which block each crossing shows.
#[derive(Clone, Debug)]
pub struct Blocks {
    /// Crossings along x and y.
    pub crossings: UVec2,
    /// Voxels of a block.
    pub voxels: u32,
    /// The block of each crossing, x fastest.
    pub index: Arc<[u32]>,
    /// A crossing that shows each block.
    pub shown_at: Arc<[UVec2]>,
}

/// The grid that paths walk in: that of the matter, or of one block of it, and the blocks.
pub fn grid_of(matter: &impl Matter) -> Option<(CellGrid, Option<Arc<Blocks>>)> {
    let whole = *matter.cell_grid();
    let Some(blocks) = matter.blocks() else {
        return Some((whole, None));
    };
    let grid = one_block(&whole, &blocks)?;
    let blocks = Blocks {
        crossings: blocks.crossings,
        voxels: blocks.voxels.element_product(),
        index: blocks.index,
        shown_at: blocks.shown_at,
    };
    Some((grid, Some(Arc::new(blocks))))
}

/// A grid whose period is the first crossing, cut as the whole is.
fn one_block(whole: &CellGrid, blocks: &MatterBlocks) -> Option<CellGrid> {
    let bounds = whole.bounds_mm();
    let size = blocks.voxels.as_vec3() * whole.voxel_mm();
    let max = Vec3::new(bounds.min.x + size.x, bounds.min.y + size.y, bounds.max.z);
    let grid = CellGrid::new(Aabb::new(bounds.min, max), blocks.voxels, true)?;
    if whole.is_endless() {
        return Some(grid);
    }
    let reach = whole.reach_mm();
    grid.cut_to(reach.min.truncate(), reach.max.truncate())
}

impl Blocks {
    /// Number of blocks.
    pub fn count(&self) -> usize {
        self.shown_at.len()
    }

    /// The block of a crossing; crossings are counted on through the repeats of the cloth.
    pub fn number(&self, crossing: IVec2) -> usize {
        let n = self.crossings.as_ivec2();
        let within = IVec2::new(crossing.x.rem_euclid(n.x), crossing.y.rem_euclid(n.y));
        self.index[(within.x + n.x * within.y) as usize] as usize
    }

    /// The crossing whose first voxel lies so many voxels beyond the first one's.
    pub fn crossing(beyond: Vec2, block: UVec3) -> IVec2 {
        (beyond / block.truncate().as_vec2()).round().as_ivec2()
    }

    /// The same as [`Blocks::number`] of [`Blocks::crossing`], in every lane.
    #[inline(always)]
    pub fn numbers<F: Floats>(&self, beyond: [F; 2], block: UVec3) -> F::Ints {
        let within = |beyond: F, size: u32, count: u32| {
            let half = F::splat(0.5);
            let crossing = (beyond * F::splat(1.0 / size as f32) + half).floor();
            let count = F::splat(count as f32);
            let turns = ((crossing + half) * (F::splat(1.0) / count)).floor();
            (crossing - turns * count).max(F::splat(0.0)).to_ints()
        };
        let x = within(beyond[0], block.x, self.crossings.x);
        let y = within(beyond[1], block.y, self.crossings.y);
        (x + F::Ints::splat(self.crossings.x) * y).gather(&self.index)
    }
}
