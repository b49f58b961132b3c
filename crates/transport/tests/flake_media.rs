//! Octrees of fibres as micro-flakes of every family: nothing gained, nothing
//! lost, however light is gathered, and free flight that agrees with the closed
//! form.

use crate::furnace::gather;
use glam::Vec3;
use organza_basis::curve::{Segment, SegmentList};
use organza_basis::hypothesis::{t_test, welch_test};
use organza_basis::{Aabb, Moments, PathRng, Ray, Rgb, unwatched, warp};
use organza_transport::{
    FlakeFamily, FlakeOctreeMedium, FlakeOptics, Medium, Stats, exact_transmittance, transmittance,
};
use organza_volume::{FibreFootprint, Octree, VoxelizeOptions, voxelize};

/// Two layers of fibres that cross, each strewn by a few tenths about its mean.
fn cloth() -> Octree {
    const EDGE_MM: f32 = 0.24;
    let mut rng = PathRng::from_seed(91);
    let mut segments = Vec::new();
    for i in 0..240 {
        let centre = Vec3::new(rng.unit(), rng.unit(), 0.2 + 0.6 * rng.unit()) * EDGE_MM;
        let mean = if i % 2 == 0 { Vec3::X } else { Vec3::Y };
        let way = (mean + 0.3 * warp::uniform_sphere(rng.unit2())).normalize() * 0.03;
        segments.push(Segment::straight(centre - way, centre + way, 0.008));
    }
    let bounds_mm = Aabb::new(Vec3::ZERO, Vec3::splat(EDGE_MM));
    let source = SegmentList::new(bounds_mm, true, segments);
    let options = VoxelizeOptions {
        voxel_mm: 0.02,
        levels: Some(3),
        footprint: FibreFootprint::Covered,
        max_memory_bytes: None,
    };
    voxelize(&source, &options, &unwatched).unwrap()
}

fn flakes(family: FlakeFamily, albedo: f32) -> FlakeOctreeMedium {
    flakes_at(0, family, albedo)
}

fn flakes_at(level: u8, family: FlakeFamily, albedo: f32) -> FlakeOctreeMedium {
    let optics = FlakeOptics::new(Rgb::splat(albedo), 0.2);
    FlakeOctreeMedium::new(cloth(), level, vec![optics], family).unwrap()
}

fn draws(small: u32) -> u32 {
    organza_testing::sized(small, 20 * small)
}

#[test]
fn the_furnace_is_one_for_every_family() {
    let w = -Vec3::new(1.0, 0.5, 3.0).normalize();
    let off = |level, family, albedo| {
        let medium = flakes_at(level, family, albedo);
        let mut rng = PathRng::from_seed(92);
        let gathered: Moments = (0..draws(4_000))
            .map(|_| gather(&medium, Ray::new(Vec3::splat(0.12) - w, w), &mut rng))
            .collect();
        (t_test(&gathered, 1.0).p_value, gathered)
    };
    for family in FlakeFamily::all() {
        let (p, got) = off(0, family, 1.0);
        assert!(p > 1e-4, "seed 92, {family:?}: {p} {got:?}");
        let (p, got) = off(0, family, 0.97);
        // Margin: the probability at which the twin is rejected.
        assert!(p < 1e-6, "seed 92, {family:?}: the twin passed: {got:?}");
    }
    // Coarse cells with outlines.
    for level in 1..=2 {
        let (p, got) = off(level, FlakeFamily::SGGX_SPECULAR, 1.0);
        assert!(p > 1e-4, "seed 92, level {level}: {p} {got:?}");
        let (p, got) = off(level, FlakeFamily::SGGX_SPECULAR, 0.97);
        // Margin: the probability at which the twin is rejected.
        assert!(p < 1e-6, "seed 92, level {level}: the twin passed: {got:?}");
    }
}

#[test]
fn ratio_tracking_is_the_closed_form() {
    let mut stats = Stats::default();
    for (k, family) in FlakeFamily::all().enumerate() {
        let medium = flakes(family, 1.0);
        for w in [Vec3::NEG_Z, -Vec3::new(0.5, 0.4, 1.0).normalize()] {
            let local = medium
                .cell_grid()
                .clip(&Ray::new(Vec3::splat(0.12) - w, w), f64::INFINITY)
                .unwrap();
            let exact = f64::from(exact_transmittance(&medium, &local, &mut stats));
            let mut rng = PathRng::new(93, k as u64, 0);
            let got: Moments = (0..draws(20_000))
                .map(|_| f64::from(transmittance(&medium, &local, &mut rng, &mut stats)))
                .collect();
            let v = t_test(&got, exact);
            assert!(v.p_value > 1e-4, "seed 93, {family:?} {w}: {got:?} {exact}");
        }
    }
    assert_eq!(stats.majorant_violations, 0);
}

/// At one point, sigma(a) f(a, b) is sigma(b) f(b, a), as a mean over drawn
/// flakes; the families block alike.
#[test]
fn points_are_reciprocal_and_families_block_alike() {
    let specular = flakes(FlakeFamily::SGGX_SPECULAR, 1.0);
    let (a, b) = (Vec3::new(0.48, 0.36, 0.8), Vec3::new(-0.6, 0.64, -0.48));
    for family in FlakeFamily::all() {
        let medium = flakes(family, 0.8);
        let dims = medium.cell_grid().dims().as_vec3();
        let sites: Vec<_> = (0..200)
            .map(|i| {
                let u = i as f32 / 200.0;
                let p = Vec3::new(u, (7.3 * u).fract(), 0.25 + 0.5 * (3.1 * u).fract()) * dims;
                (medium.site(p), specular.site(p))
            })
            .filter(|(s, _)| medium.sigma_t(s, a) > 0.0)
            .collect();
        assert!(sites.len() > 50);
        for (site, same) in &sites {
            let (own, sggx) = (medium.sigma_t(site, a), specular.sigma_t(same, a));
            assert!((own / sggx - 1.0).abs() < 0.03, "{family:?}: {own} {sggx}");
        }
        let mut rng = PathRng::from_seed(94);
        let mut way = |from: Vec3, to: Vec3| -> Moments {
            let draws = draws(400);
            let mut one = |s: &_| {
                let met = medium.draw_event(*s, from, &mut rng);
                f64::from(medium.sigma_t(s, from) * medium.eval(&met, from, to).0.x)
            };
            sites
                .iter()
                .flat_map(|(s, _)| (0..draws).map(|_| one(s)).collect::<Vec<_>>())
                .collect()
        };
        let (there, back) = (way(a, b), way(b, a));
        let v = welch_test(&there, &back);
        let is_even = v.p_value > 1e-3 && (there.mean / back.mean - 1.0).abs() < 0.02;
        assert!(is_even, "seed 94, {family:?}: {there:?} {back:?} {v:?}");
    }
}
