//! The voxels of a cloth of blocks, from those of its exemplar.

use glam::{UVec2, UVec3};
use organza_volume::{BlockCut, BlockLayout, Error, Octree, Parts};
use organza_weave::{Cloth, Synthesis};

/// The crossings of the exemplar, of which those must be voxelized that blocks show, unless they
/// are those of volumes.
pub fn parts(synthesis: &Synthesis) -> Parts {
    let is_woven = |place| synthesis.volume_at(place).is_none();
    let shown = synthesis.blocks.iter().map(|b| b.place);
    let shown = shown.filter(|&at| is_woven(at)).map(place);
    Parts::some(crossings(synthesis), shown)
}

/// Crossings of the exemplar along x and y.
pub fn crossings(synthesis: &Synthesis) -> UVec2 {
    let exemplar = &synthesis.exemplar;
    place([exemplar.ends(), exemplar.picks()])
}

fn place([end, pick]: [usize; 2]) -> UVec2 {
    UVec2::new(end as u32, pick as u32)
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
    let parts = crossings(synthesis);
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
        low: place(b.place) * block.truncate(),
    });
    let cuts: Vec<BlockCut> = cuts.collect();
    Octree::of_blocks(octree, &cuts, layout, &|block, yarn, material| {
        exemplar.block_material(synthesis, block as usize, yarn, material)
    })
}
