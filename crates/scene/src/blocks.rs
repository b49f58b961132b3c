//! The voxels of a cloth of blocks, from those of its exemplar.

use glam::{UVec2, UVec3};
use organza_volume::{BlockCut, BlockLayout, Error, Octree};
use organza_weave::{Cloth, Synthesis};

/// Crossings of the exemplar along x and y.
pub fn parts(synthesis: &Synthesis) -> UVec2 {
    let exemplar = &synthesis.exemplar;
    UVec2::new(exemplar.ends() as u32, exemplar.picks() as u32)
}

/// The cloth of a design, cut from the octree of its exemplar.
///
/// # Errors
/// When the blocks need more than `allowed` bytes or more than an octree can address.
pub fn cut(
    octree: &Octree,
    exemplar: &Cloth,
    synthesis: &Synthesis,
    allowed: u64,
) -> Result<Octree, Error> {
    let parts = parts(synthesis);
    let dims = octree.dims(0);
    let block = UVec3::new(dims.x / parts.x, dims.y / parts.y, dims.z);
    let share = synthesis.blocks.len() as f64 / parts.as_dvec2().element_product();
    let needed =
        (octree.memory_bytes() as f64 * (1.0 + share)) as u64 + 12 * synthesis.index.len() as u64;
    if needed > allowed {
        return Err(Error::Memory { needed, allowed });
    }
    let crossings = UVec2::new(
        synthesis.design.ends() as u32,
        synthesis.design.picks() as u32,
    );
    let layout = BlockLayout::new(crossings, block, synthesis.index.clone());
    let layout = layout.map_err(Error::Options)?;
    let cuts = synthesis.blocks.iter().map(|b| BlockCut {
        low: UVec2::new(b.place[0] as u32, b.place[1] as u32) * block.truncate(),
    });
    let cuts: Vec<BlockCut> = cuts.collect();
    Octree::of_blocks(octree, &cuts, layout, &|block, yarn, material| {
        exemplar.block_material(synthesis, block as usize, yarn, material)
    })
}
