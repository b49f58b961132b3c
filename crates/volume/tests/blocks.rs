use crate::cloth::{PlainWeave, cells};
use glam::{UVec2, UVec3, Vec3};
use organza_basis::{Budget, unwatched};
use organza_volume::voxelize::VoxelizePlan;
use organza_volume::{BlockCut, BlockLayout, Octree, Parts, VoxelizeOptions, ovox};

const ENDS: u32 = 4;

fn exemplar() -> Octree {
    of_parts(Parts::all(UVec2::splat(ENDS)))
}

fn of_parts(parts: Parts) -> Octree {
    let weave = PlainWeave::cotton(ENDS);
    let options = VoxelizeOptions {
        voxel_mm: 0.024,
        ..VoxelizeOptions::default()
    };
    let plan = VoxelizePlan::of_parts(&weave, parts, &options).unwrap();
    plan.run(&unwatched).unwrap()
}

fn block_voxels(exemplar: &Octree) -> UVec3 {
    let dims = exemplar.dims(0);
    assert_eq!(dims % UVec3::new(ENDS, ENDS, 1), UVec3::ZERO);
    UVec3::new(dims.x / ENDS, dims.y / ENDS, dims.z)
}

/// A cloth whose crossings show the places of the exemplar that `source` gives.
fn of_blocks(exemplar: &Octree, crossings: UVec2, source: impl Fn(UVec2) -> UVec2) -> Octree {
    let block = block_voxels(exemplar);
    let (mut cuts, mut index) = (Vec::new(), Vec::new());
    for y in 0..crossings.y {
        for x in 0..crossings.x {
            let cut = BlockCut {
                low: source(UVec2::new(x, y)) * block.truncate(),
            };
            let known = cuts.iter().position(|c| *c == cut);
            index.push(known.unwrap_or(cuts.len()) as u32);
            if known.is_none() {
                cuts.push(cut);
            }
        }
    }
    let layout = BlockLayout::new(crossings, block, index).unwrap();
    Octree::of_blocks(exemplar, &cuts, layout, &|_, _, material| material).unwrap()
}

/// Calls `visit` with every cell of a level.
fn for_each_cell(tree: &Octree, level: u8, visit: impl FnMut(UVec3)) {
    cells(tree.dims(level)).for_each(visit);
}

#[test]
fn every_crossing_in_its_own_place_is_the_exemplar() {
    let exemplar = exemplar();
    let cloth = of_blocks(&exemplar, UVec2::splat(ENDS), |at| at);
    cloth.assert_well_formed();
    assert_eq!(cloth.bounds_mm(), exemplar.bounds_mm());
    assert!(exemplar.level_count() > 1);
    for level in 0..exemplar.level_count() {
        assert_eq!(cloth.dims(level), exemplar.dims(level));
        let expected = exemplar.fibre_length_mm(level);
        assert_eq!(cloth.fibre_length_mm(level), expected);
        for_each_cell(&exemplar, level, |cell| {
            assert_eq!(cloth.mixture(level, cell), exemplar.mixture(level, cell));
            let (own, other) = (&cloth, &exemplar);
            let bounds = [own, other].map(|t| t.majorant_per_mm(level, cell));
            assert!((bounds[0] / bounds[1] - 1.0).abs() < 1e-5 || bounds == [0.0; 2]);
        });
    }
    let p = Vec3::new(-0.3, 2.1, 0.02);
    assert_eq!(cloth.mixture_at(0, p), exemplar.mixture_at(0, p));
}

#[test]
fn crossings_show_their_blocks() {
    let exemplar = exemplar();
    let crossings = UVec2::new(9, 5);
    let source = |at: UVec2| (at * UVec2::new(3, 1) + UVec2::new(at.y, at.x)) % ENDS;
    let cloth = of_blocks(&exemplar, crossings, source);
    cloth.assert_well_formed();
    let blocks = cloth.blocks().unwrap();
    assert_eq!(blocks.crossings(), crossings);
    let mut visited = 0;
    for level in 0..cloth.level_count() {
        let block = blocks.block_cells(level).truncate();
        for_each_cell(&cloth, level, |cell| {
            let crossing = cell.truncate() / block;
            let within = cell.truncate() - crossing * block;
            let there = (source(crossing) * block + within).extend(cell.z);
            assert_eq!(cloth.mixture(level, cell), exemplar.mixture(level, there));
        });
        cloth.for_each_stored(level, |cell| {
            assert!(!cloth.mixture(level, cell).is_empty());
            visited += u64::from(level == 0);
        });
        let mut occupied = 0u64;
        for_each_cell(&cloth, level, |cell| {
            occupied += u64::from(!cloth.mixture(level, cell).is_empty());
        });
        cloth.for_each_occupied(level, |cell| {
            assert!(!cloth.mixture(level, cell).is_empty());
            occupied -= 1;
        });
        assert_eq!(occupied, 0);
    }
    assert_eq!(visited, cloth.occupied_voxels());

    let mut bytes = Vec::new();
    ovox::write(&cloth, &[], &mut bytes).unwrap();
    let read = |bytes: &[u8]| ovox::read(&mut &bytes[..], &mut Budget::new(1 << 30));
    assert!(read(&bytes).unwrap().octree == cloth);
    for end in (0..bytes.len()).step_by(997) {
        let part = read(&bytes[..end]);
        assert!(part.is_err(), "{end} of {} bytes", bytes.len());
    }
    let little = ovox::read(&mut &bytes[..], &mut Budget::new(1000));
    assert!(little.is_err());
}

#[test]
fn memory_is_that_of_the_blocks_and_the_index() {
    let exemplar = exemplar();
    let small = of_blocks(&exemplar, UVec2::splat(4), |at| at % 2);
    let large = of_blocks(&exemplar, UVec2::splat(1000), |at| at % 2);
    let more = large.memory_bytes() - small.memory_bytes();
    assert_eq!(more, 4 * (1_000_000 - 16));
    assert_eq!(large.dims(0).x, 250 * exemplar.dims(0).x);
}

#[test]
fn blocks_that_do_not_fit_are_refused() {
    let exemplar = exemplar();
    let block = block_voxels(&exemplar);
    let one = |block, low| {
        let layout = BlockLayout::new(UVec2::ONE, block, vec![0]).unwrap();
        Octree::of_blocks(&exemplar, &[BlockCut { low }], layout, &|_, _, m| m)
    };
    assert!(one(block, UVec2::ZERO).is_ok());
    assert!(one(block, UVec2::new(1, 0)).is_err());
    assert!(one(block, exemplar.dims(0).truncate()).is_err());
    assert!(one(block - UVec3::Z, UVec2::ZERO).is_err());
    assert!(one(block + UVec3::X, UVec2::ZERO).is_err());
}

#[test]
fn needed_parts_are_those_of_the_whole() {
    let whole = exemplar();
    let needed = UVec2::new(2, 1);
    let some = of_parts(Parts::some(UVec2::splat(ENDS), [needed].into_iter()));
    let block = block_voxels(&whole);
    let (mut inside, mut outside) = (0.0, 0.0);
    for level in 0..whole.level_count() {
        for_each_cell(&whole, level, |cell| {
            let [all, part] = [&whole, &some].map(|tree| tree.broadside_per_mm(level, cell));
            let at = (cell.truncate() << u32::from(level)) / block.truncate();
            if at == needed {
                // A step of stored lengths is 5.6e-5 per mm here; errors of rounding are passed on.
                assert!((all - part).abs() <= 8.0 * 5.6e-5, "{cell}: {all}, {part}");
                inside += all;
            } else {
                assert!(part <= all * 1.0001);
                outside += part;
            }
        });
    }
    // Pieces that reach into the part are kept whole.
    assert!(inside > 0.0 && outside < 5.0 * inside, "{inside} {outside}");
}
