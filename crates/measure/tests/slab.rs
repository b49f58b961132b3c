//! The slab of SGGX fibres through the goniometer: against another renderer,
//! against itself turned about, and against its own integrals.

use glam::{UVec3, Vec2, Vec3};
use organza_basis::{Aabb, Moments, PathRng, Rgb, unwatched, warp};
use organza_measure::{
    Angles, Effort, Exit, MeasureError, Pair, PatchError, PatchResponse, VolumePatch,
    measure_albedo_rows, measure_albedos, measure_openness, measure_pair_rows, measure_pairs,
    parse_pairs, write_pairs,
};
use organza_transport::{AnyMedium, Grid, GridMedium, Integrator, Interpolation, Stats};

const SIGMA_PER_MM: f32 = 20.0;
const THICKNESS_MM: f32 = 0.3;
const ALBEDO: [f32; 3] = [0.95, 0.8, 0.5];

fn grid(albedo: [f32; 3], size_mm: f32, repeats: bool) -> AnyMedium {
    let half = Vec3::new(0.5 * size_mm, 0.5 * size_mm, 0.5 * THICKNESS_MM);
    let dims = UVec3::new(3, 2, 6);
    let samples = vec![[SIGMA_PER_MM]; dims.element_product() as usize];
    let medium = GridMedium::new(
        Aabb::new(-half, half),
        repeats,
        Interpolation::Nearest,
        Grid::new(dims, samples).unwrap(),
        Grid::constant([0.04, 1.0, 1.0, 0.0, 0.0, 0.0]),
        Grid::constant(albedo),
    );
    AnyMedium::Grid(medium.unwrap())
}

fn slab(integrator: Integrator) -> VolumePatch {
    VolumePatch::of_media(vec![grid(ALBEDO, 0.4, true)], integrator).unwrap()
}

fn pair(i: (f64, f64), o: (f64, f64)) -> Pair {
    Pair::new(Angles::new(i.0, i.1), Angles::new(o.0, o.1))
}

/// A twin that takes the light for perpendicular to itself.
struct ForgottenCosine(VolumePatch);

impl PatchResponse for ForgottenCosine {
    fn estimate_bsdf(&self, w_in: Vec3, w_out: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Rgb {
        self.0.estimate_bsdf(w_in, w_out, rng, stats) * w_in.z.abs()
    }
    fn estimate_at(
        &self,
        place_mm: Vec2,
        w_in: Vec3,
        w_out: Vec3,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Rgb {
        self.0.estimate_at(place_mm, w_in, w_out, rng, stats) * w_in.z.abs()
    }
    fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, stats: &mut Stats) -> Exit {
        // And this one loses what it absorbs on the way.
        Exit {
            absorbed: Rgb::BLACK,
            ..self.0.estimate_exit(w, rng, stats)
        }
    }
}

/// Distances to the reference in combined standard errors, all pairs.
fn distances(patch: &impl PatchResponse, paths: u64, seed: u64) -> Vec<f64> {
    let table = include_str!("../../../tests/data/slab_mitsuba.csv");
    let pairs = parse_pairs(table).unwrap();
    let rows = organza_testing::csv_numbers(table);
    assert_eq!((pairs.len(), rows.len()), (16, 16));
    let results = measure_pairs(patch, &pairs, &Effort::new(paths, seed), &unwatched).unwrap();
    results
        .list
        .iter()
        .zip(&rows)
        .flat_map(|(got, row)| {
            assert_eq!(got.paths, paths);
            let b = &got.bsdf;
            [0, 1, 2].map(|c| (b.mean[c] - row[4 + c]) / b.se[c].hypot(row[7 + c]))
        })
        .collect()
}

#[test]
fn agrees_with_an_independent_renderer_and_the_twin_does_not() {
    let paths = organza_testing::sized(4_000, 400_000);
    for integrator in [Integrator::Woodcock, Integrator::Regular] {
        let all = distances(&slab(integrator), paths, 7);
        let is_near = all.iter().all(|d| d.abs() < 4.0);
        assert!(is_near, "seed 7, {integrator:?}: {all:.1?}");
    }
    let twin = distances(&ForgottenCosine(slab(Integrator::Woodcock)), paths, 7);
    let rejected = twin.iter().filter(|d| d.abs() > 4.0).count();
    assert!(rejected >= 20, "only {rejected}: {twin:.1?}");
}

#[test]
fn the_bsdf_is_reciprocal() {
    // Turning a pair about exchanges its roles: f(a, b) = f(b, a), reflected
    // and transmitted.
    let some = [
        ((20.0, 30.0), (65.0, 200.0)),
        ((70.0, 90.0), (10.0, 0.0)),
        ((50.0, 10.0), (130.0, 150.0)),
        ((160.0, 0.0), (40.0, 45.0)),
    ];
    let there: Vec<Pair> = some.iter().map(|&(a, b)| pair(a, b)).collect();
    let back: Vec<Pair> = some.iter().map(|&(a, b)| pair(b, a)).collect();
    let slab = slab(Integrator::Woodcock);
    let a = measure_pairs(&slab, &there, &Effort::new(10_000, 11), &unwatched).unwrap();
    let b = measure_pairs(&slab, &back, &Effort::new(10_000, 12), &unwatched).unwrap();
    let twin = ForgottenCosine(slab);
    let wrong = measure_pairs(&twin, &back, &Effort::new(10_000, 12), &unwatched).unwrap();
    let mut rejected = 0;
    for ((a, b), wrong) in a.list.iter().zip(&b.list).zip(&wrong.list) {
        for c in 0..3 {
            let z = |x: &organza_measure::Measured| {
                (a.bsdf.mean[c] - x.mean[c]) / a.bsdf.se[c].hypot(x.se[c])
            };
            let (pair, far) = (a.pair, z(&b.bsdf));
            assert!(far.abs() < 4.0, "seeds 11 and 12, {pair:?}: {far}");
            rejected += usize::from(z(&wrong.bsdf).abs() > 4.0);
        }
    }
    assert!(rejected >= 4, "the twin was rejected {rejected} times");
}

#[test]
fn shares_add_to_one_and_direct_light_is_beer_lamberts() {
    let slab = slab(Integrator::Woodcock);
    let incident = [
        Angles::new(0.0, 0.0),
        Angles::new(60.0, 35.0),
        Angles::new(140.0, 80.0),
    ];
    let results = measure_albedos(&slab, &incident, &Effort::new(20_000, 3), &unwatched).unwrap();
    for a in &results.list {
        for c in 0..3 {
            let (sum, se) = (a.sum.mean[c], a.sum.se[c]);
            assert!((sum - 1.0).abs() < 4.0 * se + 1e-6, "seed 3: {sum} +- {se}");
            let parts = [a.reflected, a.transmitted, a.direct, a.absorbed];
            let total: f64 = parts.iter().map(|p| p.mean[c]).sum();
            assert!((total - sum).abs() < 4.0 * f64::from(f32::EPSILON));
        }
        let w = a.incident.direction().as_dvec3();
        let area = (0.04 * w.x * w.x + w.y * w.y + w.z * w.z).sqrt();
        let depth = f64::from(SIGMA_PER_MM * THICKNESS_MM) * area / w.z.abs();
        let distance = (a.direct.mean[0] - (-depth).exp()).abs();
        // The deviation of a share is known before it is measured.
        let se = ((-depth).exp() / 20_000.0).sqrt();
        assert!(distance < 4.0 * se, "seed 3: {distance} against {se}");
    }
    let (open, se) = measure_openness(&slab, &Effort::new(20_000, 3), &unwatched).unwrap();
    assert!((open - (-6f64).exp()).abs() < 4.0 * se, "{open} +- {se}");
    let twin = ForgottenCosine(slab);
    let wrong = measure_albedos(&twin, &incident, &Effort::new(20_000, 3), &unwatched).unwrap();
    let sum = wrong.list[0].sum;
    assert!((sum.mean[2] - 1.0).abs() > 10.0 * sum.se[2]);
}

#[test]
fn the_bsdf_integrates_to_reflectance_and_transmittance() {
    // Shadow rays against escaping paths: two ways to one number. The light
    // comes from the cosine distribution, so f / density is pi f.
    let slab = slab(Integrator::Woodcock);
    let from = Angles::new(50.0, 20.0);
    let results = measure_albedos(&slab, &[from], &Effort::new(30_000, 5), &unwatched).unwrap();
    let mut sides = [[Moments::default(); 3]; 2];
    let mut stats = Stats::default();
    for path in 0..30_000 {
        let mut rng = PathRng::new(6, 0, path);
        for (side, sign) in sides.iter_mut().zip([1.0, -1.0]) {
            let w_in = warp::cosine_hemisphere(rng.unit2());
            // Away from the horizon, where 1/cos overflows.
            let w_in = w_in.with_z(sign * w_in.z.max(1e-4));
            let value = slab.estimate_bsdf(w_in, from.direction(), &mut rng, &mut stats);
            for (m, x) in side.iter_mut().zip(value.0.to_array()) {
                m.add(f64::from(x) * std::f64::consts::PI);
            }
        }
    }
    for (side, share) in sides
        .iter()
        .zip([results.list[0].reflected, results.list[0].transmitted])
    {
        for (c, m) in side.iter().enumerate() {
            let z = (m.mean - share.mean[c]) / m.standard_error().hypot(share.se[c]);
            assert!(z.abs() < 4.0, "seeds 5 and 6, channel {c}: {z}");
        }
    }
}

#[test]
fn results_depend_on_the_seed_and_not_on_the_threads() {
    let pairs = [
        pair((30.0, 0.0), (30.0, 180.0)),
        pair((0.0, 0.0), (150.0, 0.0)),
    ];
    let table = |threads, seed| {
        let slab = slab(Integrator::Woodcock);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let results = pool.build().unwrap().install(|| {
            measure_pairs(&slab, &pairs, &Effort::new(5000, seed), &unwatched).unwrap()
        });
        let mut out = Vec::new();
        write_pairs(&results.list, &mut out).unwrap();
        String::from_utf8(out).unwrap()
    };
    assert_eq!(table(1, 4), table(2, 4));
    assert_ne!(table(2, 4), table(2, 5));
    assert_eq!(parse_pairs(&table(1, 4)).unwrap(), pairs);
}

#[test]
fn rows_of_a_list_have_the_values_of_the_whole_measurement() {
    let slab = slab(Integrator::Woodcock);
    let pairs = [20.0, 40.0, 60.0].map(|theta| pair((theta, 0.0), (30.0, 180.0)));
    let incident = pairs.map(|p| p.incident);
    let effort = Effort {
        paths: 5000,
        seed: 6,
        target_error: Some(0.1),
    };
    let whole = measure_pairs(&slab, &pairs, &effort, &unwatched).unwrap();
    let albedos = measure_albedos(&slab, &incident, &effort, &unwatched).unwrap();
    for rows in [0..1, 1..3, 2..2, 0..3] {
        let part = measure_pair_rows(&slab, &pairs, rows.clone(), &effort, &unwatched).unwrap();
        assert_eq!(part.list, whole.list[rows.clone()]);
        let part =
            measure_albedo_rows(&slab, &incident, rows.clone(), &effort, &unwatched).unwrap();
        assert_eq!(part.list, albedos.list[rows]);
    }
    // The known-bad twin: the same pair as a list of its own has other random numbers.
    let alone = measure_pairs(&slab, &pairs[1..2], &effort, &unwatched).unwrap();
    assert_ne!(alone.list[0], whole.list[1]);
    let beyond = measure_pair_rows(&slab, &pairs, 2..4, &effort, &unwatched);
    let words = beyond.unwrap_err().to_string();
    assert_eq!(words, "rows 2..4 of a list of 3; expected rows within 0..3");
}

#[test]
fn a_target_error_is_met_where_paths_allow() {
    let pairs = [
        pair((30.0, 0.0), (30.0, 180.0)),
        pair((70.0, 0.0), (160.0, 0.0)),
    ];
    let effort = Effort {
        paths: 50_000,
        seed: 9,
        target_error: Some(0.05),
    };
    let results = measure_pairs(&slab(Integrator::Woodcock), &pairs, &effort, &unwatched).unwrap();
    let (easy, hard) = (&results.list[0], &results.list[1]);
    assert!((0..3).all(|c| easy.bsdf.se[c] <= 0.05 * easy.bsdf.mean[c]));
    assert!(easy.paths.is_power_of_two() && easy.paths < 50_000);
    assert_eq!(hard.paths, 50_000, "blue hardly comes through");
}

#[test]
fn an_end_of_the_box_is_no_end_of_energy() {
    // A box that ends loses light through its sides, but none altogether.
    let ends =
        VolumePatch::of_media(vec![grid([1.0; 3], 0.4, false)], Integrator::Woodcock).unwrap();
    let incident = [Angles::new(30.0, 0.0)];
    let results = measure_albedos(&ends, &incident, &Effort::new(20_000, 8), &unwatched).unwrap();
    let a = &results.list[0];
    let rest = a.reflected.mean[0] + a.transmitted.mean[0] + a.direct.mean[0];
    let off = (rest - 1.0).abs();
    assert!(off < 4.0 * f64::EPSILON, "nothing is absorbed: {rest}");
}

#[test]
fn what_makes_no_patch_is_refused() {
    let fail = |media| VolumePatch::of_media(media, Integrator::Woodcock).err();
    assert_eq!(fail(Vec::new()), Some(PatchError::Empty));
    let mixed = vec![grid(ALBEDO, 0.4, true), grid(ALBEDO, 0.4, false)];
    assert_eq!(fail(mixed), Some(PatchError::Mixed));
    let periods = vec![grid(ALBEDO, 0.4, true), grid(ALBEDO, 0.3, true)];
    assert!(matches!(fail(periods), Some(PatchError::Periods(..))));
    let one = [pair((0.0, 0.0), (30.0, 0.0))];
    let (slab, effort) = (slab(Integrator::Woodcock), Effort::new(1, 0));
    let few = measure_pairs(&slab, &one, &effort, &unwatched);
    assert_eq!(few, Err(MeasureError::TooFewPaths(1)));
}
