use super::*;
use organza_basis::curve::{Segment, SegmentList};
use organza_basis::{Aabb, unwatched};
use organza_scatter::Fibre;
use organza_volume::{FibreFootprint, VoxelizeOptions, voxelize};
use std::f32::consts::PI;

const RADIUS_MM: f32 = 0.008;

fn clear() -> Fibre {
    organza_testing::dielectric_fibre(Rgb::splat(0.02), 0.1, 0.2)
}

/// Fibres along x through all the tile at places of the y-z plane.
fn along_x(size_mm: Vec3, places: impl Iterator<Item = [f32; 2]>) -> SegmentList {
    let one = |(fibre, [y, z]): (usize, [f32; 2])| {
        let ends = [0.0, size_mm.x].map(|x| Vec3::new(x, y, z));
        Segment {
            fibre: fibre as u32,
            ..Segment::straight(ends[0], ends[1], RADIUS_MM)
        }
    };
    SegmentList::new(
        Aabb::new(Vec3::ZERO, size_mm),
        true,
        places.enumerate().map(one).collect(),
    )
}

/// The fibres, and their volume in one voxel.
fn matter(source: &SegmentList) -> (ExplicitFibres, Arc<Octree>) {
    let fibres = ExplicitFibres::new(source, vec![clear()], None, &unwatched).unwrap();
    let options = VoxelizeOptions {
        voxel_mm: source.tile.bounds_mm.size().max_element(),
        levels: Some(1),
        footprint: FibreFootprint::Axis,
        max_memory_bytes: None,
    };
    let octree = voxelize(source, &options, &unwatched).unwrap();
    (fibres, Arc::new(octree))
}

fn measured(fibres: &ExplicitFibres, octree: &Arc<Octree>, seed: u64) -> MaterialPacking {
    let study = PackingStudy {
        walks: 20_000,
        seed,
    };
    let packing = measure_packing(fibres, octree, study, &unwatched)
        .unwrap()
        .unwrap();
    packing.levels[0][0]
}

/// Fibres strewn at random, a hundredth of the volume.
fn strewn(seed: u64) -> SegmentList {
    let size_mm = Vec3::splat(4.0);
    let count = 0.01 * size_mm.y * size_mm.z / (PI * RADIUS_MM * RADIUS_MM);
    let mut rng = PathRng::new(seed, 0, 0);
    let places = (0..count as u32).map(|_| [4.0 * rng.unit(), 4.0 * rng.unit()]);
    along_x(size_mm, places)
}

/// The void fraction is 0.99, and one of 796 fibres is the one that a ray leaves; both
/// take less than 0.012 off the factor.
#[test]
fn fibres_strewn_at_random_have_a_factor_of_one() {
    let (fibres, octree) = matter(&strewn(1));
    let found = measured(&fibres, &octree, 2);
    for (name, factor) in [("own yarn", found.own_yarn), ("outside", found.outside)] {
        let PackingFactor {
            mean,
            standard_error,
        } = factor.unwrap();
        let off = |factor: f32| (factor - 1.0).abs() / (4.0 * standard_error + 0.012);
        // Margin: one is four standard errors and 0.012.
        assert!(off(mean) < 1.0, "seeds 1, 2, {name}: {factor:?}");
        assert!(standard_error < 0.02, "seeds 1, 2, {name}: {factor:?}");
        // The twin: a factor that is a fifth off.
        assert!(off(1.2 * mean) > 1.0 && off(0.8 * mean) > 1.0, "{factor:?}");
    }
}

/// Where a flight starts.
#[derive(Clone, Copy, PartialEq)]
enum Start {
    /// On the surface, outward.
    Exit,
    /// Where light came in that goes straight through.
    Entry,
}

/// The factor of flights from the fibres of a hexagonal lattice that fills 0.6 of the
/// volume, from the rows in the middle, under light that is even in all directions.
fn lattice_factor(start: Start, seed: u64) -> PackingFactor {
    const FRACTION: f32 = 0.6;
    const ROWS: u32 = 120;
    let spacing_mm = RADIUS_MM * (2.0 * PI / (3.0f32.sqrt() * FRACTION)).sqrt();
    let row_mm = 0.5 * 3.0f32.sqrt() * spacing_mm;
    let width_mm = ROWS as f32 * row_mm;
    let size_mm = Vec3::new(width_mm, 100.0 * spacing_mm, width_mm);
    let place = |i: u32, row: u32| {
        let shift = if row.is_multiple_of(2) { 0.25 } else { 0.75 };
        [(i as f32 + shift) * spacing_mm, (row as f32 + 0.5) * row_mm]
    };
    let places = (0..ROWS).flat_map(|row| (0..100).map(move |i| place(i, row)));
    let (fibres, octree) = matter(&along_x(size_mm, places));
    let bare = VirtualFibreMedium::with_factors(
        octree,
        0,
        vec![clear()],
        VirtualFibreEvent::Packed,
        |_, _| vec![PackingFactors::NONE],
    )
    .unwrap();
    let one = |i: u64| {
        let mut rng = PathRng::new(seed, 0, i);
        let [y, z] = place(rng.below(100), ROWS / 2 - 4 + rng.below(8));
        let axis = Vec3::new(rng.unit() * size_mm.x, y, z);
        // The normal of the surface, and a direction by the cosine to it.
        let (sin, cos) = (2.0 * PI * rng.unit()).sin_cos();
        let normal = Vec3::new(0.0, cos, sin);
        let local = warp::cosine_hemisphere(rng.unit2());
        let w = Vec3::X * local.x + normal.cross(Vec3::X) * local.y + normal * local.z;
        let exit = axis + RADIUS_MM * normal;
        let from = match start {
            Start::Exit => exit,
            Start::Entry => {
                let chord_mm = 2.0 * RADIUS_MM * w.dot(normal) / (1.0 - w.x * w.x);
                exit - chord_mm * w
            }
        };
        let ray = Ray::new(from, w).leaving(Some(0));
        let hit = fibres.first_hit(&ray, f64::INFINITY, &mut Stats::default());
        let flight = Flight {
            ray,
            length_mm: hit.as_ref().map_or(f64::INFINITY, |h| h.0),
            weight: 1.0,
            met: hit.map(|_| (0, 0)),
        };
        tally(&bare, &[flight], RADIUS_MM, &mut rng)[0][0]
    };
    let tallies: Vec<Tally> = (0..20_000).into_par_iter().map(one).collect();
    factor(tallies.into_iter()).unwrap()
}

/// On any line through fibres that do not overlap the mean void between two is the void
/// fraction over the bare extinction, so the factor is 1/0.4; the few flights that leave
/// the lattice take less than a hundredth of it. The twin starts where light came in:
/// void and fibre together are one over the extinction, and the factor is 1.
#[test]
fn a_lattice_has_the_factor_of_its_voids() {
    let found = lattice_factor(Start::Exit, 3);
    let off = |factor: f32| (factor - 2.5).abs() / (4.0 * found.standard_error + 0.025);
    // Margin: one is four standard errors and a hundredth.
    assert!(off(found.mean) < 1.0, "seed 3: {found:?}");
    assert!(found.standard_error < 0.03, "seed 3: {found:?}");
    assert!(off(1.2 * found.mean) > 1.0 && off(0.8 * found.mean) > 1.0);
    let twin = lattice_factor(Start::Entry, 3);
    // Margin: most of the bound is four standard errors.
    let most = 4.0 * twin.standard_error + 0.01;
    assert!((twin.mean - 1.0).abs() < most, "seed 3: {twin:?}");
    assert!(off(twin.mean) > 1.0);
}

#[test]
fn factors_do_not_depend_on_the_number_of_threads() {
    let (fibres, octree) = matter(&strewn(4));
    let study = PackingStudy {
        walks: 500,
        seed: 5,
    };
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let measure = || measure_packing(&fibres, &octree, study, &unwatched).unwrap();
        pool.build().unwrap().install(measure).unwrap()
    };
    let one = with_threads(1);
    assert_eq!(one, with_threads(3));
    assert_eq!(one.walks, 500);
}

#[test]
fn no_walks_and_too_few_hits_give_no_factor() {
    let (fibres, octree) = matter(&strewn(6));
    let study = |walks| PackingStudy { walks, seed: 0 };
    let measure = |walks| measure_packing(&fibres, &octree, study(walks), &unwatched).unwrap();
    assert!(measure(0).is_none());
    let few = measure(50).unwrap();
    assert_eq!(few.levels[0][0], MaterialPacking::default());
}

#[test]
fn a_stop_leaves_no_factors() {
    let (fibres, octree) = matter(&strewn(4));
    let study = PackingStudy {
        walks: 2000,
        seed: 5,
    };
    let stopped = measure_packing(&fibres, &octree, study, &|_| ControlFlow::Break(()));
    assert_eq!(stopped, Err(Stopped));
}
