//! Where the blocks of a cloth of two levels lie.

use crate::division::Divisor;
use glam::{UVec2, UVec3};
use std::sync::Arc;

/// Most crossings along one axis of a cloth of blocks.
pub const MAX_CROSSINGS: u32 = 1 << 14;
/// Most voxels along one axis of the whole cloth.
const MAX_VOXELS: u64 = 1 << 31;

/// A cloth of crossings, each of which shows one of a few blocks of voxels.
///
/// The octree of such a cloth holds every block once, stacked along z in the order of their
/// numbers. Looking up a voxel of the cloth costs one look-up in `index` more than in an octree
/// without blocks.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockLayout {
    /// Crossings along x and y.
    crossings: UVec2,
    /// Finest voxels of a block.
    block: UVec3,
    /// The same along x and y, to divide by.
    per_block: [Divisor; 2],
    /// The block of each crossing, x fastest.
    index: Arc<[u32]>,
    /// A crossing that shows each block.
    shown_at: Arc<[UVec2]>,
}

impl BlockLayout {
    /// The layout of blocks of `block` finest voxels by crossing, x fastest.
    ///
    /// # Errors
    /// When the index has another length, a block number is left out, or a size is zero or too
    /// large.
    pub fn new(crossings: UVec2, block: UVec3, index: Vec<u32>) -> Result<BlockLayout, String> {
        let largest = crossings.max_element();
        if crossings.min_element() == 0 || largest > MAX_CROSSINGS || block.min_element() == 0 {
            return Err(format!(
                "{crossings} crossings of {block} voxels; expected 1 to {MAX_CROSSINGS} along \
                 each axis"
            ));
        }
        let voxels = crossings.as_u64vec2() * block.truncate().as_u64vec2();
        if voxels.max_element() > MAX_VOXELS || u64::from(block.z) > MAX_VOXELS {
            return Err(format!(
                "{crossings} crossings of {block} voxels; expected at most {MAX_VOXELS} voxels \
                 along each axis"
            ));
        }
        let count = u64::from(crossings.x) * u64::from(crossings.y);
        if index.len() as u64 != count {
            return Err(format!(
                "{} block numbers for {count} crossings",
                index.len()
            ));
        }
        let blocks = index.iter().max().map_or(0, |&most| most as usize + 1);
        if blocks > index.len() {
            return Err("a block that no crossing shows".into());
        }
        let nowhere = UVec2::MAX;
        let mut shown_at = vec![nowhere; blocks];
        for (i, &number) in (0u32..).zip(&index) {
            let place = &mut shown_at[number as usize];
            if *place == nowhere {
                *place = UVec2::new(i % crossings.x, i / crossings.x);
            }
        }
        if shown_at.contains(&nowhere) {
            return Err("a block that no crossing shows".into());
        }
        Ok(BlockLayout {
            crossings,
            block,
            per_block: [Divisor::new(block.x), Divisor::new(block.y)],
            index: index.into(),
            shown_at: shown_at.into(),
        })
    }

    /// Crossings along x and y.
    pub fn crossings(&self) -> UVec2 {
        self.crossings
    }

    /// Number of blocks.
    pub fn count(&self) -> u32 {
        self.shown_at.len() as u32
    }

    /// Cells of a block at a level.
    pub fn block_cells(&self, level: u8) -> UVec3 {
        self.block >> u32::from(level)
    }

    /// The block of every crossing, x fastest.
    pub fn index(&self) -> &Arc<[u32]> {
        &self.index
    }

    /// A crossing that shows each block.
    pub fn all_shown_at(&self) -> &Arc<[UVec2]> {
        &self.shown_at
    }

    /// A crossing that shows a block.
    pub fn shown_at(&self, block: u32) -> UVec2 {
        self.shown_at[block as usize]
    }

    /// Bytes of memory.
    pub fn memory_bytes(&self) -> u64 {
        (size_of_val(&self.index[..]) + size_of_val(&self.shown_at[..])) as u64
    }

    /// Finest voxels of the whole cloth along each axis.
    pub(crate) fn dims(&self) -> UVec3 {
        self.crossings.extend(1) * self.block
    }

    /// Cells of all blocks on top of each other at a level, along each axis.
    pub fn stack_dims(&self, level: u8) -> UVec3 {
        self.block_cells(level) * UVec3::new(1, 1, self.count())
    }

    /// The cell of the stack of blocks that a cell of the cloth shows.
    #[inline]
    pub fn stored(&self, level: u8, cell: UVec3) -> UVec3 {
        let block = self.block >> u32::from(level);
        // Blocks are whole cells of every level.
        let finest = cell.truncate() << u32::from(level);
        let [x, y] = self.per_block;
        let crossing = UVec2::new(x.quotient(finest.x), y.quotient(finest.y));
        let number = self.index[(crossing.x + self.crossings.x * crossing.y) as usize];
        UVec3::new(
            cell.x - crossing.x * block.x,
            cell.y - crossing.y * block.y,
            cell.z + number * block.z,
        )
    }

    /// A cell of the cloth that shows a cell of the stack of blocks.
    pub fn shown(&self, level: u8, stored: UVec3) -> UVec3 {
        let block = self.block >> u32::from(level);
        let number = stored.z / block.z;
        let low = self.shown_at(number) * block.truncate();
        let z = stored.z - number * block.z;
        UVec3::new(stored.x + low.x, stored.y + low.y, z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_found_in_their_blocks() {
        let index = vec![0, 1, 1, 2, 0, 2];
        let layout = BlockLayout::new(UVec2::new(3, 2), UVec3::new(4, 8, 2), index.clone());
        let layout = layout.unwrap();
        assert_eq!(layout.count(), 3);
        assert_eq!(layout.dims(), UVec3::new(12, 16, 2));
        for level in [0, 1] {
            let block = layout.block_cells(level);
            for (i, &number) in (0..).zip(&index) {
                let crossing = UVec2::new(i % 3, i / 3);
                let within = UVec3::new(1, 2, 0);
                let cell = (crossing * block.truncate()).extend(0) + within;
                let stored = layout.stored(level, cell);
                assert_eq!(stored, within + UVec3::Z * number * block.z);
                assert_eq!(layout.stored(level, layout.shown(level, stored)), stored);
            }
        }
    }

    #[test]
    fn layouts_with_gaps_are_refused() {
        let new = |index: Vec<u32>| BlockLayout::new(UVec2::new(2, 1), UVec3::ONE, index);
        assert!(new(vec![0, 1]).is_ok());
        for wrong in [vec![0], vec![0, 2], vec![1, 1], vec![0, u32::MAX]] {
            assert!(new(wrong.clone()).is_err(), "{wrong:?}");
        }
        assert!(BlockLayout::new(UVec2::ZERO, UVec3::ONE, Vec::new()).is_err());
        let large = UVec3::new(1 << 31, 1, 1);
        assert!(BlockLayout::new(UVec2::new(2, 1), large, vec![0, 0]).is_err());
    }
}
