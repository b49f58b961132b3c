use crate::cloth::PlainWeave;
use glam::{DAffine3, DMat3, DVec3, IVec3};
use organza_basis::PathRng;
use organza_volume::vdb::{self, Cells, Codec, Data, Grid, Leaf, Value};
use organza_volume::{Octree, VoxelizeOptions, export, voxelize};

fn cotton() -> Octree {
    let options = VoxelizeOptions {
        voxel_mm: 0.02,
        ..VoxelizeOptions::default()
    };
    voxelize(&PlainWeave::cotton(2), &options, &|_| {}).unwrap()
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
            let mut back = sorted(vdb::read(&bytes).unwrap().grids);
            // Integers have no half form.
            back[3].half = half;
            assert_eq!(back, grids, "{half} {codec:?}");
        }
    }
}

#[test]
fn another_reader_finds_the_same_values() {
    let tree = cotton();
    let grids = vdb::grids_from_octree(&tree, 0, false);
    let mut bytes = Vec::new();
    vdb::write(&grids, Codec::Zip, &mut bytes).unwrap();
    let mut reader = vdb_rs::VdbReader::new(std::io::Cursor::new(&bytes)).unwrap();
    for name in ["density", "spread"] {
        let grid = reader.read_grid::<f32>(name).unwrap();
        let mut count = 0;
        for (at, value, _) in grid.iter() {
            let cell = glam::UVec3::new(at.x as u32, at.y as u32, at.z as u32);
            let s = export::Summary::of(&tree.mixture(0, cell));
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
    let tree = cotton();
    let mut bytes = Vec::new();
    vdb::write(
        &vdb::grids_from_octree(&tree, 0, false),
        Codec::Zip,
        &mut bytes,
    )
    .unwrap();
    let file = vdb::read(&bytes).unwrap();
    let medium = file.medium(1 << 30).unwrap();
    let expected = export::vol_triple(&tree, 0, &|_| organza_basis::Rgb::WHITE);
    assert_eq!(medium.sigma_t.data, expected.sigma_t.data);
    assert_eq!(medium.sggx.as_ref().unwrap().data, expected.sggx.data);
    let (a, b) = (medium.sigma_t.bounds_mm, expected.sigma_t.bounds_mm);
    assert!(a.min.distance(b.min) < 1e-6 && a.max.distance(b.max) < 1e-6);

    // Orientation and spread alone give the same where there is one population.
    let mut without = file.clone();
    without.grids.retain(|g| !g.name.starts_with("sggx"));
    let medium = without.medium(1 << 30).unwrap().sggx.unwrap();
    tree.for_each_occupied(0, |cell| {
        if tree.mixture(0, cell).as_slice().len() == 1 {
            for (x, y) in medium.cell(cell).iter().zip(expected.sggx.cell(cell)) {
                assert!((x - y).abs() < 1e-6, "{cell}");
            }
        }
    });
    assert!(
        file.medium(1000)
            .unwrap_err()
            .to_string()
            .contains("1000 are allowed")
    );
    without.grids[0].name = "densty".into();
    let error = without.medium(1 << 30).unwrap_err().to_string();
    assert!(error.contains("did you mean \"densty\""), "{error}");
}

#[test]
fn damaged_files_are_refused_and_never_panic() {
    let mut good = Vec::new();
    vdb::write(&samples(false), Codec::Zip, &mut good).unwrap();
    for end in (0..good.len()).step_by(good.len() / 150) {
        assert!(vdb::read(&good[..end]).is_err(), "{end}");
    }
    let mut rng = PathRng::from_seed(9);
    let mut refused = 0;
    for _ in 0..400 {
        let mut bad = good.clone();
        let at = rng.below(bad.len() as u32) as usize;
        bad[at] ^= 1 << rng.below(8);
        refused += u32::from(vdb::read(&bad).is_err());
    }
    // Many flips only change a value; those in structure are noticed.
    assert!(refused > 20, "seed 9: {refused}");
    let with = |from: &str, to: &str| {
        let (from, to) = (from.as_bytes(), to.as_bytes());
        let at = good.windows(from.len()).position(|w| w == from).unwrap();
        let mut bad = good.clone();
        bad[at..at + to.len()].copy_from_slice(to);
        vdb::read(&bad).unwrap().unread[0].clone()
    };
    let other = vdb::read(b"VOL\x03........").unwrap_err().to_string();
    assert!(other.contains("does not begin"), "{other}");
    assert_eq!(with("Tree_float_5_4_3", "Tree_bool__5_4_3").0, "density");
    assert!(
        with("ScaleTranslateMap", "NonlinearFrustumM")
            .1
            .contains("map")
    );
}

/// Written by OpenVDB 10.0.1 with its default packing: values are functions of
/// the cell, for x in -3..12, y in 0..9, z in 0..10.
#[test]
fn blosc_files_of_openvdb_are_read() {
    let bytes = include_bytes!("../data/openvdb_blosc.vdb");
    let file = vdb::read(bytes).unwrap();
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
        let _ = vdb::read(&bad);
    }
}
