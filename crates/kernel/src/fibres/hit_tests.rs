//! Hits in cells against all pieces tried.

use super::body::FibreBody;
use super::cells::Unfit;
use super::exhaustive::{Compared, Exhaustive};
use super::matter::{FibreEntry, FibreMatter};
use super::strands::{Joint, Strand, Strands};
use glam::{DVec2, DVec3, UVec3, Vec3};
use organza_basis::{Aabb, CellGrid, PathRng, warp};
use organza_scatter::{Fibre, FittedFibre, FittedParameters};

const RADIUS_MM: f32 = 0.008;

/// Strands in memory.
#[derive(Default)]
struct Heap {
    joints: Vec<Joint>,
    strands: Vec<Strand>,
}

impl Heap {
    /// A chain through points with radii; interior joints of one radius are cut.
    fn chain(&mut self, points: &[(Vec3, f32)], cut_ends: bool) {
        let strand = self.strands.len() as u32;
        self.strands.push(Strand {
            yarn: strand,
            fibre: 0,
            material: 0,
        });
        let last = points.len() - 1;
        for (i, &(position, radius_mm)) in points.iter().enumerate() {
            let way = |a: usize, b: usize| (points[b].0 - points[a].0).normalize_or_zero();
            let (back, ahead) = (way(i.saturating_sub(1), i), way(i, (i + 1).min(last)));
            let tangent = (back + ahead).try_normalize().unwrap_or(Vec3::X);
            let inner = i > 0 && i < last;
            let even = inner && points[i - 1].1 == radius_mm && points[i + 1].1 == radius_mm;
            let gentle = back.dot(ahead) > 0.7;
            self.joints.push(Joint {
                position,
                radius_mm,
                tangent,
                strand,
                cut: if inner { even && gentle } else { cut_ends },
            });
        }
    }

    fn strands(&self) -> Strands<'_> {
        Strands {
            joints: &self.joints,
            strands: &self.strands,
        }
    }
}

/// Whole numbers of steps of single precision at 8 m.
const PERIOD_MM: Vec3 = Vec3::new(0.40625, 0.3125, 0.1875);

/// Twisted fibres that cross the tile, hairs that taper and leave it sideways,
/// balls, a sharp bend, and two fibres in one place.
fn heap() -> Heap {
    let mut heap = Heap::default();
    for fibre in 0..60 {
        let (r, phase) = (0.012 * (fibre as f32 / 4.0).sqrt(), 2.4 * fibre as f32);
        let points: Vec<(Vec3, f32)> = (0..=30)
            .map(|i| {
                let x = PERIOD_MM.x * i as f32 / 30.0;
                let (sin, cos) = (phase + std::f32::consts::TAU * x / PERIOD_MM.x).sin_cos();
                (Vec3::new(x, 0.15 + r * cos, 0.1 + r * sin), RADIUS_MM)
            })
            .collect();
        heap.chain(&points, true);
    }
    for hair in 0..12 {
        let k = hair as f32;
        let from = Vec3::new(0.03 * k, 0.1 + 0.01 * k, 0.1);
        let way = Vec3::new(0.11, 0.04 * k - 0.2, 0.02 * (k - 6.0) / 6.0);
        let points: Vec<(Vec3, f32)> = (0..8)
            .map(|i| {
                let bent = Vec3::new(0.0, 0.0, 0.004 * (i * i) as f32 / 8.0);
                let radius = RADIUS_MM * (1.0 - 0.1 * i as f32);
                (from + i as f32 / 4.0 * way + bent, radius)
            })
            .collect();
        heap.chain(&points, false);
    }
    let ball = Vec3::new(0.2, 0.02, 0.1);
    heap.chain(&[(ball, 0.02), (ball, 0.02)], false);
    heap.chain(
        &[(ball, 0.01), (ball + Vec3::new(0.002, 0.0, 0.0), 0.015)],
        false,
    );
    let corner = Vec3::new(0.1, 0.27, 0.05);
    let bend = [
        (corner, RADIUS_MM),
        (corner + Vec3::new(0.05, 0.0, 0.0), RADIUS_MM),
        (corner + Vec3::new(0.05, 0.0, 0.05), RADIUS_MM),
    ];
    heap.chain(&bend, false);
    heap.chain(&bend, false);
    heap
}

fn fibres() -> Vec<Fibre> {
    let parameters = FittedParameters::preset("gabardine").unwrap();
    vec![Fibre::from(FittedFibre::new(parameters).unwrap())]
}

/// The same heap, so many times as large.
fn scaled(mut heap: Heap, scale: f32) -> Heap {
    for joint in &mut heap.joints {
        joint.position *= scale;
        joint.radius_mm *= scale;
    }
    heap
}

fn matter(heap: &Heap, origin_mm: Vec3, repeats: bool) -> FibreMatter {
    matter_within(heap, (origin_mm, PERIOD_MM), repeats, u64::MAX).unwrap()
}

fn matter_within(
    heap: &Heap,
    (origin_mm, period_mm): (Vec3, Vec3),
    repeats: bool,
    max_bytes: u64,
) -> Result<FibreMatter, Unfit> {
    let mut box_mm = Aabb::new(origin_mm, origin_mm + period_mm);
    if !repeats {
        for j in &heap.joints {
            let at = origin_mm + j.position;
            box_mm = box_mm.with_point(at - j.radius_mm);
            box_mm = box_mm.with_point(at + j.radius_mm);
        }
    }
    let grid = CellGrid::new(box_mm, UVec3::ONE, repeats).unwrap();
    let body = FibreBody {
        strands: heap.strands(),
        origin_mm,
        reach: &grid,
        fibres: &fibres(),
        shell: None,
    };
    FibreMatter::new(&[body], Vec::new(), max_bytes)
}

fn direction(rng: &mut PathRng, i: u64) -> DVec3 {
    let d = warp::uniform_sphere(rng.unit2());
    let d = match i % 6 {
        0 => d + 30.0 * Vec3::X,
        1 => d + 3000.0 * Vec3::X,
        2 => d * Vec3::new(1.0, 1.0, 0.02),
        3 => [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Z][(i / 8 % 4) as usize],
        _ => d,
    };
    d.as_dvec3().normalize()
}

/// Shares of rays on which both disagree, and which graze.
fn compare(origin_mm: Vec3, repeats: bool, seed: u64, rays: u64) -> (u64, u64) {
    compare_in(&heap(), 1.0, origin_mm, repeats, seed, rays)
}

/// The same of a heap that is so many times as large as usual.
fn compare_in(
    heap: &Heap,
    scale: f32,
    origin_mm: Vec3,
    repeats: bool,
    seed: u64,
    rays: u64,
) -> (u64, u64) {
    let period_mm = scale * PERIOD_MM;
    let matter = matter_within(heap, (origin_mm, period_mm), repeats, u64::MAX).unwrap();
    let period = if repeats {
        period_mm.truncate().as_dvec2()
    } else {
        DVec2::ZERO
    };
    let size = f64::from(scale);
    let origin = origin_mm.as_dvec3();
    let places = 16;
    let (mut wrong, mut grazing) = (0, 0);
    for place in 0..places {
        let mut rng = PathRng::new(seed, 0, place);
        let u = DVec3::from_array([0; 3].map(|_| f64::from(rng.unit())));
        let middle = origin + u * period_mm.as_dvec3();
        let tried = Exhaustive::near(heap.strands(), origin, period, middle, 0.5 * size);
        for i in 0..rays / places {
            let d = direction(&mut rng, i);
            // From within, or from before all that is near.
            let back = if i % 2 == 0 { 0.0 } else { 0.3 * size };
            let from = middle - back * d;
            let own = matter.first_hit(from, d);
            let own = own.filter(|h| h.distance_mm < 0.5 * size);
            let least = if matter.bodies[0]
                .enter(from, d)
                .is_some_and(|e| e.distance_mm == 0.0)
            {
                f64::from(matter.bodies[0].start_mm)
            } else {
                0.0
            };
            let hair = 1e-4 * size * f64::from(RADIUS_MM);
            match tried.compare(own.as_ref(), (from, d), (least, 0.5 * size), hair) {
                Compared::Same => {}
                Compared::Grazing => grazing += 1,
                Compared::Wrong => {
                    wrong += 1;
                    eprintln!("seed {seed} place {place} ray {i}: {from} {d}: {own:?}");
                }
            }
        }
    }
    (wrong, grazing)
}

fn rays() -> u64 {
    organza_testing::sized(1_600, 100_000)
}

#[test]
fn cells_find_what_trying_finds() {
    for (seed, repeats) in [(1, true), (2, false)] {
        let (wrong, grazing) = compare(Vec3::ZERO, repeats, seed, rays());
        assert_eq!(wrong, 0, "seed {seed}");
        assert!(grazing < rays() / 100, "seed {seed}: {grazing}");
    }
}

/// At 10 m single precision has steps of a micrometre.
#[test]
fn fibres_far_from_the_origin_are_met() {
    let far = Vec3::new(8192.0, -4096.0, 512.0);
    let (wrong, grazing) = compare(far, true, 3, rays());
    assert_eq!(wrong, 0, "seed 3");
    assert!(grazing < rays() / 100, "seed 3: {grazing}");
}

/// Fibres of a quarter of a micrometre, 8 m from the origin.
#[test]
fn fibres_thinner_than_steps_of_single_precision_are_met() {
    let far = Vec3::new(8192.0, -4096.0, 512.0);
    let scale = 1.0 / 32.0;
    let radius_mm = scale * RADIUS_MM;
    assert!(radius_mm < far.x.next_up() - far.x, "{radius_mm}");
    let thin = scaled(heap(), scale);
    let (wrong, grazing) = compare_in(&thin, scale, far, true, 6, rays());
    assert_eq!(wrong, 0, "seed 6");
    assert!(grazing < rays() / 100, "seed 6: {grazing}");
}

/// Rays along a straight fibre, exactly and nearly, from within it, on its surface and
/// beside it, among its neighbours.
#[test]
fn rays_along_fibres_meet_what_trying_finds() {
    let mut heap = Heap::default();
    for fibre in 0..40u32 {
        let y = 0.01 + 0.03 * (fibre % 10) as f32;
        let z = 0.03 + 0.04 * (fibre / 10) as f32;
        let [a, b] = [0.0, PERIOD_MM.x].map(|x| (Vec3::new(x, y, z), RADIUS_MM));
        // One in five ends within the tile, with a round end.
        if fibre % 5 == 0 {
            let end = (a.0.with_x(0.5 * PERIOD_MM.x), RADIUS_MM);
            heap.chain(&[a, end], false);
        } else {
            heap.chain(&[a, b], true);
        }
    }
    let matter = matter(&heap, Vec3::ZERO, true);
    let period = PERIOD_MM.truncate().as_dvec2();
    let middle = 0.5 * PERIOD_MM.as_dvec3();
    let tried = Exhaustive::near(heap.strands(), DVec3::ZERO, period, middle, 1.0);
    let least = f64::from(matter.bodies[0].start_mm);
    let (mut wrong, mut close, mut met) = (0, 0, 0);
    // Few: a ray that meets nothing passes thousands of tiles.
    let count = organza_testing::sized(200, 6_250);
    for i in 0..count {
        let mut rng = PathRng::new(7, 0, i);
        let joint = &heap.joints[2 * (rng.unit() * 40.0) as usize];
        let tilt = [0.0, 1e-7, 1e-5, 1e-3][(i % 4) as usize];
        let aside = [0.5, 0.999, 1.001, 1.5][(i / 4 % 4) as usize];
        let u = warp::uniform_sphere(rng.unit2()).as_dvec3();
        let out = DVec3::new(0.0, u.y, u.z)
            .try_normalize()
            .unwrap_or(DVec3::Y);
        let x = f64::from(PERIOD_MM.x * rng.unit());
        let from = joint.position.as_dvec3().with_x(x) + aside * f64::from(RADIUS_MM) * out;
        let d = (DVec3::X + tilt * u).normalize();
        let within = |h: &FibreEntry| h.distance_mm < 0.5;
        let own = matter.first_hit(from, d).filter(within);
        met += u64::from(tried.first(from, d, (least, 0.5)).is_some());
        let hair = 1e-4 * f64::from(RADIUS_MM);
        match tried.compare(own.as_ref(), (from, d), (least, 0.5), hair) {
            Compared::Same => {}
            Compared::Grazing => close += 1,
            Compared::Wrong => {
                wrong += 1;
                eprintln!("seed 7 ray {i}: {from} {d}: {own:?}");
            }
        }
    }
    assert_eq!(wrong, 0, "seed 7");
    assert!(close < count / 20, "seed 7: {close}");
    assert!(met > count / 20, "seed 7: {met}");
}

/// A ray from inside a fibre leaves it and meets others.
#[test]
fn inside_a_fibre_nothing_is_met() {
    let heap = heap();
    let matter = matter(&heap, Vec3::ZERO, true);
    let (a, b) = (heap.joints[3].position, heap.joints[4].position);
    let inside = a.midpoint(b).as_dvec3();
    let along = (b - a).as_dvec3().normalize();
    let hit = matter.first_hit(inside, along);
    // It runs on within the fibre at least to the next bend.
    assert!(hit.is_none_or(|h| h.distance_mm > 0.02), "{hit:?}");
}

/// Where memory does not suffice for copies, cells hold lists, which give the same hits
/// bit for bit, and where it does not suffice for these, fibres are refused.
#[test]
fn lists_find_the_hits_of_copies() {
    let heap = heap();
    for (seed, repeats) in [(4, true), (5, false)] {
        let copies = matter(&heap, Vec3::ZERO, repeats);
        assert!(copies.bodies[0].cells.lists.is_none());
        let mut allowed = 1 << 16;
        let lists = loop {
            match matter_within(&heap, (Vec3::ZERO, PERIOD_MM), repeats, allowed) {
                Ok(lists) => break lists,
                // The error says how much the next step needs. A twentieth more keeps some copies.
                Err(Unfit::Memory(needed)) if needed > allowed => allowed = needed + needed / 20,
                Err(why) => panic!("{allowed}: {why:?}"),
            }
        };
        let (own, all) = (&lists.bodies[0].cells, &copies.bodies[0].cells);
        assert!(own.lists.is_some(), "copies fit into {allowed}");
        // Most cells have lists: their blocks are put together, not kept.
        let [kept, made] = [own, all].map(|cells| cells.blocks.len());
        assert!(20 * kept < made, "{kept} of {made} blocks are copies");
        assert!(own.memory_bytes() < all.memory_bytes());
        let mut met = 0;
        for i in 0..rays() {
            let mut rng = PathRng::new(seed, 0, i);
            let d = direction(&mut rng, i);
            let u = Vec3::new(rng.unit(), rng.unit(), rng.unit());
            let from = (u * PERIOD_MM).as_dvec3() - 0.3 * f64::from(rng.unit()) * d;
            let found = lists.first_hit(from, d);
            assert_eq!(found, copies.first_hit(from, d), "seed {seed}: {from} {d}");
            met += u64::from(found.is_some());
        }
        assert!(met > rays() / 4, "seed {seed}: {met} rays meet fibres");
    }
}
