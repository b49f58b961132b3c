use crate::cloth::{PlainWeave, cells, length_mm, list, voxelized};
use glam::{UVec3, Vec3};
use organza_basis::{Segment, SegmentSource, unwatched};
use organza_volume::{FibreFootprint, Octree, VoxelizeOptions, VoxelizePlan, voxelize};

#[test]
fn one_fibre_is_found_with_its_place_length_axis_and_no_spread() {
    // Along a diagonal of the xy plane at z = 0.55, radius 3 um.
    let (a, b) = (Vec3::new(0.05, 0.15, 0.55), Vec3::new(0.85, 0.95, 0.55));
    let fibre = Segment {
        yarn: 7,
        material: 2,
        ..Segment::straight(a, b, 0.003)
    };
    let tree = voxelized(&list(Vec3::ZERO, Vec3::ONE, vec![fibre]), 0.1, Some(1));
    assert_eq!(tree.occupied_voxels(), 17);
    let axis = (b - a).normalize();
    let mut length = 0.0;
    tree.for_each_occupied(0, |cell| {
        let m = tree.mixture(0, cell);
        let [c] = m.as_slice() else { panic!("{cell}") };
        assert!(c.axis.cross(axis).length() < 2.0 * f32::EPSILON, "{cell}");
        assert_eq!((c.spread_rad, c.yarn, c.material), (0.0, 7, 2));
        assert!((c.radius_mm - 0.003).abs() <= 0.003 * f32::EPSILON);
        // The clip in that cell, from its ends on the cell's faces.
        let low = cell.as_vec3() * 0.1;
        let t0 = (low - a) / (b - a);
        let t1 = (low + 0.1 - a) / (b - a);
        let want = (t1.x.min(t1.y).min(1.0) - t0.x.max(t0.y).max(0.0)) * a.distance(b);
        let got = c.length_density_per_mm2 * 1e-3;
        assert!((got - want).abs() < 2e-6, "{cell}: {got} {want}");
        length += got;
    });
    assert!((length - a.distance(b)).abs() <= 4.0 * f32::EPSILON);
}

#[test]
fn two_crossed_fibres_of_one_yarn_are_two_populations() {
    for angle_deg in [40.0f32, 60.0, 90.0] {
        let angle_rad = angle_deg.to_radians();
        let d = Vec3::new(angle_rad.cos(), angle_rad.sin(), 0.0);
        let c = Vec3::splat(0.5);
        let fibres = vec![
            Segment::straight(c - 0.4 * Vec3::X, c + 0.4 * Vec3::X, 0.01),
            Segment::straight(c - 0.3 * d, c + 0.3 * d, 0.01),
        ];
        let tree = voxelized(&list(Vec3::ZERO, Vec3::ONE, fibres), 1.0, Some(1));
        let m = tree.mixture(0, UVec3::ZERO);
        let [x, y] = m.as_slice() else {
            panic!("{angle_deg}: {m:?}")
        };
        assert!(x.axis.cross(Vec3::X).length() <= 2.0 * f32::EPSILON);
        // Margin: the angle that stored axes are kept within.
        assert!(y.axis.cross(d).length() < 6e-4);
        assert!((x.length_density_per_mm2 - 0.8).abs() < 2.0 * f32::EPSILON);
        assert!((y.length_density_per_mm2 - 0.6).abs() <= 2.0 * f32::EPSILON);
        assert_eq!((x.spread_rad, y.spread_rad), (0.0, 0.0));
    }
}

#[test]
fn every_level_holds_the_length_put_in() {
    let cloth = PlainWeave::cotton(2);
    let tree = voxelized(&cloth, 0.01, None);
    assert_eq!(tree.level_count(), 5);
    let put_in = length_mm(&cloth);
    let found = tree.fibre_length_mm(0);
    assert!((found / put_in - 1.0).abs() < 1e-6, "{found} of {put_in}");
    for level in 0..tree.level_count() {
        assert_eq!(tree.fibre_length_mm(level), found, "level {level}");
        let volume = f64::from(tree.voxel_mm(level).element_product());
        let mut sum = 0.0;
        tree.for_each_occupied(level, |cell| {
            let m = tree.mixture(level, cell);
            sum += m
                .as_slice()
                .iter()
                .map(|c| f64::from(c.length_density_per_mm2))
                .sum::<f64>()
                * volume;
        });
        assert!((sum / put_in - 1.0).abs() < 1e-5, "level {level}");
    }
}

#[test]
fn warp_and_weft_stay_apart_where_they_meet() {
    let cloth = PlainWeave::cotton(2);
    let tree = voxelized(&cloth, 0.05, None);
    let mut met = 0;
    tree.for_each_occupied(0, |cell| {
        let m = tree.mixture(0, cell);
        let warp = m.as_slice().iter().any(|c| c.material == 1);
        let weft = m.as_slice().iter().any(|c| c.material == 0);
        met += u32::from(warp && weft);
        for c in m.as_slice() {
            assert_eq!(u32::from(c.material), c.yarn / 2);
        }
    });
    assert!(met > 100, "{met}");
}

#[test]
fn what_leaves_sideways_comes_back_on_the_other_side() {
    let mut source = list(
        Vec3::new(-1.0, 2.0, 0.0),
        Vec3::new(1.0, 3.0, 1.0),
        vec![Segment::straight(
            Vec3::new(-0.5, 2.5, 0.5),
            Vec3::new(3.7, 2.5, 0.5),
            0.001,
        )],
    );
    source.tile.repeats = true;
    let tree = voxelized(&source, 0.1, Some(1));
    assert_eq!(tree.occupied_voxels(), 20);
    assert!((tree.fibre_length_mm(0) - 4.2).abs() < 2.0 * f64::from(f32::EPSILON));
    // Twice through x in (-0.5, 1), three times through (-1, -0.5) + ... up to 3.7 = -0.3 + 4.
    for (x, times) in [
        (-0.95, 2.0),
        (-0.55, 2.0),
        (-0.45, 3.0),
        (-0.35, 3.0),
        (-0.25, 2.0),
        (0.95, 2.0),
    ] {
        for shift in [-6.0, 0.0, 2.0] {
            let m = tree.mixture_at(0, Vec3::new(x + shift, 2.55 + 3.0, 0.55));
            let got = m.as_slice()[0].length_density_per_mm2 / 100.0;
            assert!((got - times).abs() < 8.0 * f32::EPSILON, "{x}: {got}");
        }
    }
}

#[test]
fn thick_fibres_fill_the_voxels_they_cover() {
    // Radius 2.5 voxels: phi = pi r^2 rho must be near 1 inside and 0 outside.
    let (a, b) = (Vec3::new(0.5, 0.5, 0.1), Vec3::new(0.5, 0.5, 0.9));
    let source = list(Vec3::ZERO, Vec3::ONE, vec![Segment::straight(a, b, 0.25)]);
    let tree = voxelized(&source, 0.1, Some(1));
    assert!((tree.fibre_length_mm(0) - 0.8).abs() < 2.0 * f64::from(f32::EPSILON));
    for (p, want) in [
        ((0.45, 0.55), 1.0),
        ((0.35, 0.55), 1.0),
        ((0.15, 0.15), 0.0),
        ((0.85, 0.15), 0.0),
    ] {
        let m = tree.mixture_at(0, Vec3::new(p.0, p.1, 0.5));
        let phi: f32 = m
            .as_slice()
            .iter()
            .map(|c| std::f32::consts::PI * 0.0625 * c.length_density_per_mm2)
            .sum();
        assert!((phi - want).abs() < 0.15, "{p:?}: {phi}");
    }
    let axis_only = VoxelizeOptions {
        voxel_mm: 0.1,
        footprint: FibreFootprint::Axis,
        ..VoxelizeOptions::default()
    };
    let tree = voxelize(&source, &axis_only, &unwatched).unwrap();
    assert_eq!(tree.occupied_voxels(), 8);
}

#[test]
fn majorants_bound_every_finest_voxel_below() {
    let tree = voxelized(&PlainWeave::cotton(2), 0.02, Some(4));
    let mut tight = 0.0f32;
    for level in 0..tree.level_count() + 2 {
        let dims = (tree.dims(0) + ((1 << level) - 1)) >> u32::from(level);
        let mut most = vec![0.0f32; dims.element_product() as usize];
        tree.for_each_occupied(0, |cell| {
            let c = cell >> u32::from(level);
            let at = &mut most[(c.x + dims.x * (c.y + dims.y * c.z)) as usize];
            *at = at.max(tree.mixture(0, cell).broadside_per_mm());
        });
        for (c, &m) in cells(dims).zip(&most) {
            let bound = tree.majorant_per_mm(level, c);
            let is_tight = bound >= m * (1.0 - 1e-6) && bound <= m * (1.0 + 1e-5);
            assert!(is_tight, "{level} {c}: {bound} {m}");
            tight = tight.max(m);
        }
    }
    assert!(tight > 0.0);
}

#[test]
fn threads_do_not_change_a_bit() {
    let cloth = PlainWeave::cotton(4);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let pool = pool.build().unwrap();
        pool.install(|| voxelized(&cloth, 0.02, None))
    };
    assert!(on(1) == on(2) && on(1) == on(3));
}

#[test]
fn points_on_faces_have_a_cell_and_outside_have_none() {
    let s = Segment::straight(Vec3::splat(0.1), Vec3::splat(0.9), 0.001);
    let mut source = list(Vec3::ZERO, Vec3::ONE, vec![s]);
    let tree = voxelized(&source, 0.1, Some(1));
    assert_eq!(tree.cell_of(0, Vec3::ZERO), Some(UVec3::ZERO));
    assert_eq!(tree.cell_of(0, Vec3::ONE), Some(UVec3::splat(9)));
    for p in [
        Vec3::new(-1e-6, 0.5, 0.5),
        Vec3::splat(1.1),
        Vec3::splat(f32::NAN),
        Vec3::INFINITY,
    ] {
        assert_eq!(tree.cell_of(0, p), None);
    }
    source.tile.repeats = true;
    let tree = voxelized(&source, 0.1, Some(1));
    assert_eq!(tree.cell_of(0, Vec3::new(1.0, -1e-9, 0.5)).unwrap().x, 0);
    for x in [-1e-9f32, 1.0 - 1e-7, 123.45, -9999.999, 1e7] {
        let c = tree.cell_of(0, Vec3::new(x, x, 1.0)).unwrap();
        assert!(c.cmplt(UVec3::splat(10)).all());
    }
    assert_eq!(tree.cell_of(0, Vec3::new(0.5, 0.5, 1.001)), None);
    assert_eq!(tree.cell_of(0, Vec3::new(f32::NAN, 0.5, 0.5)), None);
}

#[test]
fn hard_sources_are_survived_or_refused() {
    let unit = |segments| list(Vec3::ZERO, Vec3::ONE, segments);
    assert_eq!(voxelized(&unit(vec![]), 0.1, None).occupied_voxels(), 0);
    let point = Segment::straight(Vec3::splat(0.5), Vec3::splat(0.5), 0.01);
    let none = voxelized(&unit(vec![point]), 0.1, None);
    assert_eq!(none.occupied_voxels(), 0);
    let crowd: Vec<Segment> = (0..10_000)
        .map(|i| {
            let x = 0.5 + 1e-5 * i as f32 / 10_000.0;
            Segment {
                yarn: i,
                ..Segment::straight(Vec3::new(x, 0.5, 0.01), Vec3::new(x, 0.5, 0.99), 0.001)
            }
        })
        .collect();
    let tree = voxelized(&unit(crowd), 0.5, None);
    assert!((tree.fibre_length_mm(0) / 9800.0 - 1.0).abs() < 2.0 * f64::from(f32::EPSILON));
    let far: Vec3 = Vec3::splat(1e4);
    let s = Segment::straight(far + Vec3::splat(0.1), far + Vec3::splat(0.9), 0.001);
    let tree = voxelized(&list(far, far + 1.0, vec![s]), 0.05, None);
    let share = tree.fibre_length_mm(0) / length_mm(&list(far, far + 1.0, vec![s]));
    assert!((share - 1.0).abs() < 1e-5);
    let options = VoxelizeOptions {
        voxel_mm: 0.1,
        ..VoxelizeOptions::default()
    };
    let good = Segment::straight(Vec3::splat(0.2), Vec3::splat(0.3), 0.01);
    let [mut endless, mut outside, mut inverted] = [good; 3];
    (endless.end_mm, endless.yarn) = (Vec3::NAN, 5);
    outside.end_mm = Vec3::splat(2.0);
    inverted.end_radius_mm = -1.0;
    for (segment, reason) in [
        (endless, "yarn 5"),
        (outside, "outside the tile"),
        (inverted, "radii"),
    ] {
        let refused = voxelize(&unit(vec![segment]), &options, &unwatched);
        let said = refused.unwrap_err().to_string();
        assert!(said.contains(reason), "{said}");
    }
    let small = VoxelizeOptions {
        max_memory_bytes: Some(1000),
        voxel_mm: 0.01,
        ..VoxelizeOptions::default()
    };
    let error = voxelize(&unit(vec![good]), &small, &unwatched)
        .unwrap_err()
        .to_string();
    assert!(error.contains("1000 are allowed"), "{error}");
    let need = VoxelizePlan::new(&PlainWeave::cotton(2), &options)
        .unwrap()
        .memory_bytes();
    let just_short = VoxelizeOptions {
        max_memory_bytes: Some(need / 2),
        ..options
    };
    assert!(voxelize(&PlainWeave::cotton(2), &just_short, &unwatched).is_err());
}

/// A batch that is larger than what is allowed is refused while it is read, not when all
/// of it is in memory.
#[test]
fn a_batch_beyond_the_memory_allowed_is_not_kept() {
    struct Endless;
    impl SegmentSource for Endless {
        fn tile(&self) -> organza_basis::curve::Tile {
            list(Vec3::ZERO, Vec3::ONE, Vec::new()).tile()
        }
        fn batch_count(&self) -> usize {
            1
        }
        fn for_each_in_batch(&self, _: usize, emit: &mut dyn FnMut(&Segment)) {
            let across = Segment::straight(Vec3::new(0.1, 0.5, 0.5), Vec3::splat(0.5), 0.001);
            for _ in 0..400_000 {
                emit(&across);
            }
        }
        fn material_count(&self) -> usize {
            1
        }
    }
    let options = VoxelizeOptions {
        max_memory_bytes: Some(1 << 20),
        voxel_mm: 0.1,
        ..VoxelizeOptions::default()
    };
    match voxelize(&Endless, &options, &unwatched) {
        Err(organza_volume::Error::Memory { needed, .. }) => {
            assert!(needed < (1 << 20) + 1000, "{needed}");
        }
        other => panic!("{:?}", other.map(|_| ())),
    }
}

/// Every voxel crossed by the fibres of one yarn, or of two at right angles.
fn full_grid(voxels: u32, yarns: u32) -> Octree {
    let side = 0.01 * voxels as f32;
    let mut fibres = Vec::new();
    for i in 0..voxels * voxels {
        let (u, v) = ((i % voxels) as f32 + 0.5, (i / voxels) as f32 + 0.5);
        for yarn in 0..yarns {
            let at = |along: f32| {
                let p = 0.01 * Vec3::new(along * voxels as f32, u, v);
                let turned = Vec3::new(p.y, p.x, p.z);
                if yarn == 0 { p } else { turned }
            };
            fibres.push(Segment {
                yarn,
                ..Segment::straight(at(0.0), at(1.0), 0.003)
            });
        }
    }
    voxelized(&list(Vec3::ZERO, Vec3::splat(side), fibres), 0.01, None)
}

#[test]
fn memory_per_voxel_stays_below_the_promise() {
    let per_voxel = |t: &Octree| t.memory_bytes() as f64 / t.occupied_voxels() as f64;
    let (one, two) = (full_grid(32, 1), full_grid(32, 2));
    assert_eq!(two.mixture(0, UVec3::splat(7)).as_slice().len(), 2);
    let cloth = voxelized(&PlainWeave::cotton(4), 0.01, None);
    println!(
        "bytes per occupied voxel: one yarn {:.1}, two {:.1}, cloth {:.1}",
        per_voxel(&one),
        per_voxel(&two),
        per_voxel(&cloth)
    );
    assert!(per_voxel(&one) <= 24.0 && per_voxel(&cloth) <= 24.0);
    assert!(per_voxel(&two) <= 48.0);
}
