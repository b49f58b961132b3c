//! Cloths of blocks: the kernel looks the block of a crossing up, the general walk asks the
//! octree.

use super::*;
use crate::kernel::virtual_fibres::silk_and_cotton;
use organza_basis::unwatched;
use organza_testing::{sized, twisted_weave};
use organza_volume::voxelize::VoxelizePlan;
use organza_volume::{BlockCut, BlockLayout, FibreFootprint, Octree, Parts, VoxelizeOptions};

/// Crossings of the exemplar each way.
const PARTS: u32 = 3;
/// Crossings of the cloth, no multiple of the exemplar's.
const CROSSINGS: UVec2 = UVec2::new(5, 4);

/// A cloth of nine blocks; `turned` shows them in another order.
fn octree(turned: bool) -> Octree {
    let options = VoxelizeOptions {
        voxel_mm: 0.017,
        levels: Some(2),
        footprint: FibreFootprint::Axis,
        max_memory_bytes: None,
    };
    let weave = twisted_weave();
    let plan = VoxelizePlan::of_parts(&weave, Parts::all(UVec2::splat(PARTS)), &options).unwrap();
    let exemplar = plan.run(&unwatched).unwrap();
    let dims = exemplar.dims(0);
    let block = UVec3::new(dims.x / PARTS, dims.y / PARTS, dims.z);
    let places = (0..PARTS * PARTS).map(|i| UVec2::new(i % PARTS, i / PARTS));
    let cuts: Vec<BlockCut> = places
        .map(|at| BlockCut {
            low: at * block.truncate(),
        })
        .collect();
    let step = if turned { 4 } else { 7 };
    let numbers = (0..CROSSINGS.element_product()).map(|i| i * step % (PARTS * PARTS));
    let layout = BlockLayout::new(CROSSINGS, block, numbers.collect()).unwrap();
    // Every other block has its colours exchanged, so that the order shows.
    let exchanged = |block: u32, _: u32, material: u16| material ^ (block % 2) as u16;
    Octree::of_blocks(&exemplar, &cuts, layout, &exchanged).unwrap()
}

fn flakes(turned: bool) -> AnyMedium {
    flakes_at(0, turned)
}

fn flakes_at(level: u8, turned: bool) -> AnyMedium {
    let optics =
        [[0.9, 0.7, 0.5], [0.5, 0.8, 0.95]].map(|albedo| FlakeOptics::new(Rgb::from(albedo), 0.1));
    let family = FlakeFamily::SGGX_SPECULAR;
    let medium = FlakeOctreeMedium::new(octree(turned), level, optics.to_vec(), family);
    AnyMedium::FlakeOctree(medium.unwrap())
}

fn cut(mut medium: AnyMedium) -> AnyMedium {
    let (low, high) = (Vec2::new(-0.13, 0.05), Vec2::new(0.61, 0.36));
    medium.cut_to(low, high).unwrap();
    medium
}

fn scenes() -> Vec<(&'static str, Scene)> {
    let wide = wide(0.7);
    vec![
        ("endless", scene(flakes(false), parallel(), wide)),
        ("sky", scene(flakes(false), sky(), lens())),
        ("level 1", scene(flakes_at(1, false), parallel(), wide)),
        ("cut", scene(cut(flakes(false)), parallel(), wide)),
    ]
}

#[test]
fn the_kernel_agrees_with_the_general_walk_on_blocks() {
    let settings = settings(0..sized(1024, 65_536), 200);
    let turned = scene(flakes(true), parallel(), wide(0.7));
    let (other, _) = walked(&turned, &settings);
    for (name, scene) in scenes() {
        let (a, stats) = by_kernel(&scene, &settings);
        let (b, of_walk) = walked(&scene, &settings);
        assert_eq!(stats.rejected + stats.majorant_violations, 0, "{name}");
        assert_eq!(of_walk.majorant_violations, 0, "{name}");
        assert_agree(name, &a, &b);
        if name == "endless" {
            // The same blocks in another order are another cloth.
            let (spread, _) = agree(&a, &other);
            assert!(spread.p_value < 1e-9, "seed 9: {spread:?}");
        }
    }
}

#[test]
fn back_ends_walk_blocks_alike() {
    for (name, scene) in scenes() {
        assert_back_ends_alike(name, &scene);
    }
}

/// Plain virtual fibres in blocks, both ways; packed ones reach from block to block.
#[test]
fn plain_fibres_live_in_blocks() {
    let fibres = silk_and_cotton;
    let medium = |event| VirtualFibreMedium::new(octree(false), 0, fibres(), event);
    assert!(medium(VirtualFibreEvent::Packed).is_none());
    let plain = AnyMedium::VirtualFibres(medium(VirtualFibreEvent::Plain).unwrap());
    let scene = scene(plain, parallel(), wide(0.7));
    let settings = settings(0..samples(), 40);
    let (a, stats) = by_kernel(&scene, &settings);
    let (b, _) = walked(&scene, &settings);
    assert_eq!(stats.rejected + stats.majorant_violations, 0);
    assert_agree("fibres in blocks", &a, &b);
}
