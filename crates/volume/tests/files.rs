use crate::cloth::{cotton_octree, list, voxelized};
use glam::Vec3;
use organza_basis::Budget;
use organza_volume::{MaterialPacking, MeasuredPacking, Octree, PackingFactor, ovox};

fn files() -> Vec<ovox::SourceFile> {
    let file = |name: &str, bytes: &[u8]| ovox::SourceFile {
        name: name.into(),
        bytes: bytes.into(),
    };
    vec![
        file("fabric.toml", b"[draft]"),
        file("drafts/leer.wif", b""),
    ]
}

fn plenty() -> Budget {
    Budget::new(1 << 30)
}

#[test]
fn ovox_returns_the_very_octree() {
    let empty = list(Vec3::ZERO, Vec3::ONE, vec![]);
    let empty = voxelized(&empty, 0.1, None);
    for tree in [cotton_octree(0.02), empty] {
        let mut bytes = Vec::new();
        ovox::write(&tree, &files(), &mut bytes).unwrap();
        let back = ovox::read(&mut &bytes[..], &mut plenty()).unwrap();
        assert!(back.octree == tree && back.files == files());
        back.octree.assert_well_formed();
        println!(
            ".ovox: {} bytes for {} in memory",
            bytes.len(),
            tree.memory_bytes()
        );
    }
}

#[test]
fn damaged_ovox_files_are_refused_with_a_reason() {
    let tree = cotton_octree(0.1);
    let mut good = Vec::new();
    ovox::write(&tree, &files(), &mut good).unwrap();
    let refusal = |b: &[u8]| {
        let read = ovox::read(&mut &b[..], &mut plenty());
        read.map(|_| ()).unwrap_err().to_string()
    };
    for end in (0..good.len()).step_by(7) {
        assert!(refusal(&good[..end]).contains("cut off"), "{end}");
    }
    // Any single altered byte is noticed.
    for at in 0..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 1 << (at % 8);
        let why = refusal(&bad);
        match at {
            0..8 => assert!(why.contains("first bytes"), "{why}"),
            // Version 5 would have another header.
            8..12 if bad[8..12] != [5, 0, 0, 0] => {
                assert!(why.contains("this program reads versions 4 and 5"), "{why}");
            }
            _ => assert!(why.contains("not a readable .ovox file"), "{at}: {why}"),
        }
    }
    let mut long = good.clone();
    long.push(0);
    assert!(refusal(&long).contains("continues"));
    let small = ovox::read(&mut &good[..], &mut Budget::new(1000)).unwrap_err();
    let small = small.to_string();
    assert!(small.contains("1000 bytes are allowed"), "{small}");
}

fn factor(mean: f32) -> Option<PackingFactor> {
    let standard_error = 0.01 * mean;
    Some(PackingFactor {
        mean,
        standard_error,
    })
}

/// Different factors for every level and material, and some that are missing.
fn packing(tree: &Octree) -> MeasuredPacking {
    let of = |level: u8| {
        let one = |m: usize| MaterialPacking {
            own_yarn: factor(1.5 + f32::from(level) + 0.25 * m as f32),
            other_yarn: (m > 0).then(|| factor(1.25)).flatten(),
            outside: factor(1.125),
        };
        (0..tree.material_count()).map(one).collect()
    };
    MeasuredPacking {
        walks: 1234,
        levels: (0..tree.level_count()).map(of).collect(),
    }
}

#[test]
fn packing_factors_are_kept() {
    let tree = cotton_octree(0.1);
    let packing = packing(&tree);
    let tree = tree.with_packing(Some(packing.clone())).unwrap();
    let mut bytes = Vec::new();
    ovox::write(&tree, &files(), &mut bytes).unwrap();
    let back = ovox::read(&mut &bytes[..], &mut plenty()).unwrap();
    assert!(back.octree == tree && back.files == files());
    assert_eq!(back.octree.packing(), Some(&packing));
    let scaled = back.octree.scaled(2.0).unwrap();
    assert_eq!(scaled.packing(), Some(&packing));
}

#[test]
fn packing_factors_that_make_no_sense_are_refused() {
    let tree = cotton_octree(0.1);
    let good = packing(&tree);
    let mut fewer = good.clone();
    fewer.levels.pop();
    let mut narrow = good.clone();
    narrow.levels[0].pop();
    let with = |mean: f32| {
        let mut packing = good.clone();
        packing.levels[0][0].own_yarn = factor(mean);
        packing
    };
    for wrong in [fewer, narrow, with(-1.0), with(0.0), with(f32::NAN)] {
        let why = format!("{wrong:?}");
        assert!(tree.clone().with_packing(Some(wrong)).is_none(), "{why}");
    }
}

fn checksum(bytes: &[u8]) -> [u8; 4] {
    let mut sum = flate2::Crc::new();
    sum.update(bytes);
    sum.sum().to_le_bytes()
}

/// A file whose header and table of yarns and materials are changed, with checksums that are
/// right.
fn altered(good: &[u8], header: impl Fn(&mut [u8]), groups: impl Fn(&mut [u8])) -> Vec<u8> {
    let word = |at: usize| u32::from_le_bytes(good[at..at + 4].try_into().unwrap()) as usize;
    let end = 16 + word(12);
    let mut bytes = good[..end].to_vec();
    header(&mut bytes[16..]);
    bytes.extend(checksum(&bytes[16..]));
    let first = end + 4;
    let (stored, raw) = (word(first), word(first + 4));
    let after = first + 12 + stored;
    let mut table = lz4_flex::block::decompress(&good[first + 12..after], raw).unwrap();
    groups(&mut table);
    let packed = lz4_flex::block::compress(&table);
    bytes.extend((packed.len() as u32).to_le_bytes());
    bytes.extend((raw as u32).to_le_bytes());
    bytes.extend(checksum(&packed));
    bytes.extend(packed);
    bytes.extend(&good[after..]);
    bytes
}

/// Whatever a file says of materials, no voxel has one that there is not.
#[test]
fn materials_that_there_are_not_are_refused() {
    let tree = cotton_octree(0.1);
    let mut good = Vec::new();
    ovox::write(&tree, &files(), &mut good).unwrap();
    // The known-bad twin: checksums alone refuse nothing.
    let same = altered(&good, |_| (), |_| ());
    let same = ovox::read(&mut &same[..], &mut plenty()).unwrap();
    assert!(same.octree == tree);
    let why = |bytes: &[u8]| {
        let read = ovox::read(&mut &bytes[..], &mut plenty());
        read.map(|_| ()).unwrap_err().to_string()
    };
    let count = |n: u32| move |header: &mut [u8]| header[76..80].copy_from_slice(&n.to_le_bytes());
    let fewer = why(&altered(&good, count(1), |_| ()));
    assert!(fewer.contains("expected a number below 1"), "{fewer}");
    let many = why(&altered(&good, count(65_537), |_| ()));
    assert!(many.contains("its header is inconsistent"), "{many}");
    // Bytes of equal position in their records are adjacent: the third byte of a material is
    // behind the six before it, and makes 65536 of zero.
    let beyond = |table: &mut [u8]| {
        let groups = table.len() / 8;
        table[6 * groups] = 1;
    };
    let beyond = why(&altered(&good, |_| (), beyond));
    assert!(beyond.contains("expected a number below"), "{beyond}");
}

/// What an array keeps is what the grids of other formats hold; half of them raw.
#[test]
fn nrrd_returns_the_grids_of_a_level() {
    use organza_scatter::{FlakeMaterials, FlakeOptics};
    use organza_volume::format::{Open, Source, Volume, Voxels, nrrd};
    let tree = cotton_octree(0.05);
    let optics = FlakeOptics::new(organza_basis::Rgb::new(0.9, 0.5, 0.25), 0.1);
    let materials = FlakeMaterials::new(vec![optics; 4]);
    let merge = |mixture: &organza_basis::Mixture| materials.merged(mixture);
    let expected = organza_volume::GridSet::from_octree(&tree, 1, &merge);
    for raw in [false, true] {
        let voxels = Voxels {
            octree: &tree,
            level: 1,
            half: false,
            raw,
            files: &[],
            merge: &merge,
        };
        let mut bytes = Vec::new();
        let parts = (nrrd::FORMAT.write)(&voxels).unwrap();
        assert_eq!(parts.len(), 1);
        for part in parts {
            (part.write)(&mut bytes).unwrap();
        }
        let open: &Open<'_> = &|_, _| Ok(Some(bytes.clone()));
        let source = Source {
            name: "tile.nrrd",
            open,
        };
        let Volume::Grids(set) = (nrrd::FORMAT.read)(&source, &mut plenty()).unwrap() else {
            panic!("no grids");
        };
        assert!(set.sigma_t.data == expected.sigma_t.data);
        assert!(set.sggx.unwrap().data == expected.sggx.as_ref().unwrap().data);
        assert!(set.albedo.unwrap().data == expected.albedo.as_ref().unwrap().data);
        assert_eq!(set.axes.unwrap().channels, 4);
        let (a, b) = (set.sigma_t.bounds_mm, expected.sigma_t.bounds_mm);
        assert!(a.min.distance(b.min) < 1e-6 && a.max.distance(b.max) < 1e-6);
        let small = (nrrd::FORMAT.read)(&source, &mut Budget::new(10_000)).unwrap_err();
        let small = small.to_string();
        assert!(small.contains("10000 bytes are allowed"), "{small}");
    }
}

/// Twice as large: lengths double, what is blocked per mm halves. Three times as dense: three
/// times the length in the same box.
#[test]
fn octrees_are_scaled_with_their_fibres() {
    let tree = cotton_octree(0.05);
    let large = tree.clone().scaled(2.0).unwrap();
    large.assert_well_formed();
    assert_eq!(large.bounds_mm().max, 2.0 * tree.bounds_mm().max);
    let ratio = large.fibre_length_mm(0) / tree.fibre_length_mm(0);
    assert!((ratio - 2.0).abs() <= 8.0 * f64::EPSILON, "{ratio}");
    tree.for_each_occupied(0, |cell| {
        let (a, b) = (
            tree.broadside_per_mm(0, cell),
            large.broadside_per_mm(0, cell),
        );
        assert!((a - 2.0 * b).abs() <= 2.0 * f32::EPSILON * a, "{cell}");
    });
    let dense = tree.clone().with_density(3.0).unwrap();
    dense.assert_well_formed();
    let ratio = dense.fibre_length_mm(0) / tree.fibre_length_mm(0);
    assert!((ratio - 3.0).abs() <= 8.0 * f64::EPSILON, "{ratio}");
    assert_eq!(dense.bounds_mm(), tree.bounds_mm());
    assert!(tree.clone().with_density(-1.0).is_none());
    assert!(tree.clone().with_density(f64::INFINITY).is_none());
    assert!(tree.clone().scaled(0.0).is_none());
    assert!(tree.clone().scaled(f64::NAN).is_none());
    assert!(!tree.with_repeats(false).repeats());
}
