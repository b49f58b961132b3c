use crate::cloth::cotton_octree;
use glam::{DAffine3, DMat3, DVec3, IVec3};
use organza_basis::{Budget, MergedFlakes, Mixture, PathRng};
use organza_scatter::{FlakeMaterials, FlakeOptics};
use organza_volume::vdb::{self, Cells, Codec, Data, Grid, Leaf, Value};
use organza_volume::{Error, GridSet};

/// Rough fibres, alike in all materials.
fn merge(mixture: &Mixture) -> MergedFlakes {
    static MATERIALS: std::sync::LazyLock<FlakeMaterials> = std::sync::LazyLock::new(|| {
        let optics = FlakeOptics::new(organza_basis::Rgb::new(0.9, 0.5, 0.25), 0.1);
        FlakeMaterials::new(vec![optics; 4])
    });
    MATERIALS.merged(mixture)
}

/// Reads with plenty of memory.
fn read(bytes: &[u8]) -> Result<vdb::File, Error> {
    vdb::read(bytes, &mut Budget::new(1 << 30))
}

/// Scattered leaves, some with negative coordinates, some far apart.
fn scattered<T: Value>(background: T, value: impl Fn(&mut PathRng) -> T) -> Cells<T> {
    let mut rng = PathRng::from_seed(8);
    let mut cells = Cells::new(background);
    for origin in [
        [0, 0, 0],
        [8, 0, 0],
        [-8, 16, 4096],
        [128, -4096, 8],
        [-5000 & !7, 72, 64],
    ] {
        let mut leaf = Leaf {
            origin: IVec3::from_array(origin),
            mask: [0; 8],
            values: vec![background; 512],
        };
        for i in 0..512 {
            if rng.below(3) > 0 {
                leaf.mask[i / 64] |= 1 << (i % 64);
                leaf.values[i] = value(&mut rng);
            }
        }
        cells.leaves.push(leaf);
    }
    cells
}

fn sorted(mut grids: Vec<Grid>) -> Vec<Grid> {
    fn sort<T>(c: &mut Cells<T>) {
        c.leaves.sort_by_key(|l| l.origin.to_array());
    }
    for g in &mut grids {
        match &mut g.data {
            Data::Float(c) => sort(c),
            Data::Vec3(c) => sort(c),
            Data::Int(c) => sort(c),
        }
    }
    grids
}

fn samples(half: bool) -> Vec<Grid> {
    // Multiples of 1/8 below 256 are the same in 16 bits.
    let number = |r: &mut PathRng| r.below(2048) as f32 / 8.0;
    let scale = DMat3::from_diagonal(DVec3::new(0.01, 0.02, 0.03));
    let turned = DMat3::from_axis_angle(DVec3::Z, 0.3) * scale;
    let shift = DVec3::new(-1.0, 2.0, 0.5);
    let grid = |name: &str, matrix3, data| Grid {
        name: name.into(),
        mm_from_cell: DAffine3 {
            matrix3,
            translation: shift,
        },
        extent: (name == "density").then_some((IVec3::new(-9, 0, 3), IVec3::splat(400))),
        half,
        data,
    };
    sorted(vec![
        grid("density", scale, Data::Float(scattered(0.0, number))),
        grid(
            "uniform",
            DMat3::from_diagonal(DVec3::splat(0.25)),
            Data::Float(scattered(-1.5, number)),
        ),
        grid(
            "orientation",
            turned,
            Data::Vec3(scattered([0.0; 3], |r| [number(r), number(r), -number(r)])),
        ),
        grid("yarn", scale, Data::Int(scattered(-1, |r| r.bits() as i32))),
        grid("empty", scale, Data::Float(Cells::new(0.0))),
    ])
}

#[test]
fn round_trips_are_exact() {
    for half in [false, true] {
        for codec in [Codec::Zip, Codec::Raw] {
            let grids = samples(half);
            let mut bytes = Vec::new();
            vdb::write(&grids, codec, &mut bytes).unwrap();
            let mut back = sorted(read(&bytes).unwrap().grids);
            // Integers have no half form.
            back[3].half = half;
            assert_eq!(back, grids, "{half} {codec:?}");
        }
    }
}

#[test]
fn values_that_grow_when_packed_are_written_as_they_are() {
    // Packing makes one value of four bytes longer. So a packed file has only the lengths, of
    // eight bytes each, of the values of the leaf and of the two nodes above it.
    let mut leaf = Leaf {
        origin: IVec3::ZERO,
        mask: [0; 8],
        values: vec![0.0; 512],
    };
    leaf.mask[0] = 1;
    leaf.values[0] = 0.7;
    let mut cells = Cells::new(0.0);
    cells.leaves.push(leaf);
    let mut grids = samples(false);
    grids.truncate(1);
    grids[0].data = Data::Float(cells);
    let [raw, packed] = [Codec::Raw, Codec::Zip].map(|codec| {
        let mut bytes = Vec::new();
        vdb::write(&grids, codec, &mut bytes).unwrap();
        bytes.len()
    });
    assert_eq!(packed, raw + 3 * 8);
}

#[test]
fn another_reader_finds_the_same_values() {
    let tree = cotton_octree(0.02);
    let grids = vdb::grids_from_octree(&tree, 0, false, &merge);
    let mut bytes = Vec::new();
    vdb::write(&grids, Codec::Zip, &mut bytes).unwrap();
    let mut reader = vdb_rs::VdbReader::new(std::io::Cursor::new(&bytes)).unwrap();
    for name in ["density", "spread"] {
        let grid = reader.read_grid::<f32>(name).unwrap();
        let mut count = 0;
        for (at, value, _) in grid.iter() {
            let cell = glam::UVec3::new(at.x as u32, at.y as u32, at.z as u32);
            let s = merge(&tree.mixture(0, cell));
            let want = if name == "density" {
                s.density_per_mm
            } else {
                s.spread_rad
            };
            assert_eq!(value, want, "{name} {cell}");
            count += 1;
        }
        assert_eq!(count, tree.occupied_voxels());
    }
}

#[test]
fn a_file_is_the_medium_that_was_put_in() {
    let tree = cotton_octree(0.02);
    let mut bytes = Vec::new();
    vdb::write(
        &vdb::grids_from_octree(&tree, 0, false, &merge),
        Codec::Zip,
        &mut bytes,
    )
    .unwrap();
    let file = read(&bytes).unwrap();
    let set = file.grid_set(&mut Budget::new(1 << 30)).unwrap();
    let expected = GridSet::from_octree(&tree, 0, &merge);
    assert_eq!(set.sigma_t.data, expected.sigma_t.data);
    assert_eq!(set.sggx.as_ref().unwrap().data, expected.sggx.unwrap().data);
    let albedo = &set.albedo.as_ref().unwrap().data;
    assert_eq!(*albedo, expected.albedo.unwrap().data);
    let (a, b) = (set.sigma_t.bounds_mm, expected.sigma_t.bounds_mm);
    assert!(a.min.distance(b.min) < 1e-6 && a.max.distance(b.max) < 1e-6);
    let axes = set.axes.unwrap();
    tree.for_each_occupied(0, |cell| {
        let s = merge(&tree.mixture(0, cell));
        assert_eq!(axes.cell(cell), s.axis.extend(s.spread_rad).to_array());
    });
    let small = file.grid_set(&mut Budget::new(1000)).unwrap_err();
    let small = small.to_string();
    assert!(small.contains("1000 bytes are allowed"), "{small}");
    let mut other = file.clone();
    other.grids[0].name = "densty".into();
    let refused = other.grid_set(&mut Budget::new(1 << 30));
    let error = refused.unwrap_err().to_string();
    assert!(error.contains("did you mean \"densty\""), "{error}");
}

/// 104 bytes that announce 2^32 - 1 grids, each of which ends where it begins, once
/// took 7.5 GB; a small file of many leaves takes no more than it is allowed.
#[test]
fn a_file_takes_no_more_memory_than_allowed() {
    let mut head = b" BDV\0\0\0\0".to_vec();
    [224u32, 10, 0]
        .iter()
        .for_each(|n| head.extend(n.to_le_bytes()));
    head.push(1);
    head.extend([b'0'; 36]);
    head.extend(0u32.to_le_bytes());
    head.extend(u32::MAX.to_le_bytes());
    let at = head.len() as u64;
    [0u32; 3].iter().for_each(|n| head.extend(n.to_le_bytes()));
    [at; 3].iter().for_each(|n| head.extend(n.to_le_bytes()));
    let error = read(&head).unwrap_err().to_string();
    assert!(error.contains("do not follow"), "{error}");

    let mut cells = Cells::new(0.0f32);
    for i in 0..64 {
        cells.leaves.push(Leaf {
            origin: IVec3::new(8 * i, 0, 0),
            mask: [0; 8],
            values: vec![0.0; 512],
        });
    }
    let grid = Grid {
        name: "density".into(),
        mm_from_cell: DAffine3::IDENTITY,
        extent: None,
        half: false,
        data: Data::Float(cells),
    };
    let mut bytes = Vec::new();
    vdb::write(&[grid], Codec::Zip, &mut bytes).unwrap();
    assert!(vdb::read(&bytes, &mut Budget::new(64 * 2200)).is_ok());
    let error = vdb::read(&bytes, &mut Budget::new(64 * 2000)).unwrap_err();
    assert!(matches!(error, Error::Budget(_)), "{error}");
}

#[test]
fn damaged_files_are_refused_and_never_panic() {
    let mut good = Vec::new();
    vdb::write(&samples(false), Codec::Zip, &mut good).unwrap();
    for end in (0..good.len()).step_by(good.len() / 150) {
        assert!(read(&good[..end]).is_err(), "{end}");
    }
    let mut rng = PathRng::from_seed(9);
    let mut refused = 0;
    for _ in 0..400 {
        let mut bad = good.clone();
        let at = rng.below(bad.len() as u32) as usize;
        bad[at] ^= 1 << rng.below(8);
        refused += u32::from(read(&bad).is_err());
    }
    // Many flips only change a value; those in structure are noticed.
    assert!(refused > 20, "seed 9: {refused}");
    let with = |from: &str, to: &str| {
        let (from, to) = (from.as_bytes(), to.as_bytes());
        let at = good.windows(from.len()).position(|w| w == from).unwrap();
        let mut bad = good.clone();
        bad[at..at + to.len()].copy_from_slice(to);
        read(&bad).unwrap().unread[0].clone()
    };
    let other = read(b"VOL\x03........").unwrap_err().to_string();
    assert!(other.contains("first bytes"), "{other}");
    assert_eq!(with("Tree_float_5_4_3", "Tree_bool__5_4_3").0, "density");
    let (_, said) = with("ScaleTranslateMap", "NonlinearFrustumM");
    assert!(said.contains("map"));
}

/// Written by OpenVDB 10.0.1 with its default packing: values are functions of
/// the cell, for x in -3..12, y in 0..9, z in 0..10.
#[test]
fn blosc_files_of_openvdb_are_read() {
    let bytes = include_bytes!("data/openvdb_blosc.vdb");
    let file = read(bytes).unwrap();
    assert_eq!(file.unread, []);
    let by_name = |name: &str| &file.grids.iter().find(|g| g.name == name).unwrap().data;
    for name in ["density", "orientation", "half"] {
        assert_eq!(by_name(name).active_count(), 15 * 9 * 10, "{name}");
        let b = (IVec3::new(-3, 0, 0), IVec3::new(11, 8, 9));
        assert_eq!(by_name(name).active_box(), Some(b), "{name}");
    }
    let Data::Float(density) = by_name("density") else {
        panic!()
    };
    density.for_each_active(|c, _, v| assert_eq!(v, (c.x + 16 * c.y + 256 * c.z) as f32));
    let Data::Vec3(orientation) = by_name("orientation") else {
        panic!()
    };
    orientation.for_each_active(|c, _, v| assert_eq!(v, c.as_vec3().to_array()));
    let Data::Vec3(half) = by_name("half") else {
        panic!()
    };
    half.for_each_active(|c, _, v| assert_eq!(v, [c.z as f32, c.x as f32, c.y as f32]));
    // A map that the library does not know: our own unpacking.
    let Data::Float(affine) = by_name("affine") else {
        panic!()
    };
    affine.for_each_active(|c, _, v| assert_eq!(v, (c.x + c.y) as f32));
    assert_eq!(affine.active_count(), 64);
    let mut rng = PathRng::from_seed(10);
    for _ in 0..60 {
        let mut bad = bytes.to_vec();
        let at = rng.below(bad.len() as u32) as usize;
        bad[at] ^= 1 << rng.below(8);
        // Whatever comes of it, it comes back.
        let _ = read(&bad);
    }
}
