//! Light that is neither gained nor lost, whatever the matter: the kernel and the walk
//! against closed forms.

use crate::kernel::{film, flat_scene, settings, walked, walker};
use crate::scenes::{octree, orthographic, white_sky};
use glam::{DVec3, UVec3, Vec3};
use organza_basis::curve::{Segment, SegmentList};
use organza_basis::{Aabb, PathRng, Rgb, Sym3};
use organza_kernel::proofs::Fault;
use organza_kernel::{Refusal, Unsuited};
use organza_testing::{dielectric_fibre, sized};
use organza_transport::*;

/// Two cells of 1 mm side by side of an albedo, the first thin and the second dense,
/// seen through the first.
fn beside_dense(thin: f32, dense: f32, albedo: f32, interpolation: Interpolation) -> Scene {
    let grid = GridMedium::new(
        Aabb::new(Vec3::ZERO, Vec3::new(2.0, 1.0, 1.0)),
        false,
        interpolation,
        Grid::new(UVec3::new(2, 1, 1), vec![[thin], [dense]]).unwrap(),
        Grid::constant(Sym3::IDENTITY.to_array()),
        Grid::constant([albedo; 3]),
    );
    Scene {
        media: vec![AnyMedium::Grid(grid.unwrap())],
        lights: vec![white_sky(Hemisphere::All)],
        camera: orthographic(DVec3::new(0.5, 0.5, 5.0), DVec3::new(0.5, 0.5, 0.0), 0.9, 8),
    }
}

/// The mean of a film against a closed form, to a thousandth and four standard errors.
fn is_near((mean, error): (f64, f64), exact: f64) -> bool {
    (mean - exact).abs() < 1e-3 + 4.0 * error
}

/// Thin matter keeps its transmittance beside matter up to 1e9 times as dense: in the
/// kernel where it takes the matter, and in the walk, which ends. The twin is 5 % thinner, at full
/// size 2 %.
#[test]
fn thin_matter_beside_dense_matter_keeps_its_transmittance() {
    let exact = (-1.0f64).exp();
    let (samples, thinner) = sized((1024, 0.95), (4096, 0.98));
    let settings = settings(0..samples, u32::MAX);
    let mut refused = 0;
    for dense in [1e1, 1e2, 1e3, 3e3, 1e4, 1e5, 1e6, 1e8, 1e9] {
        let scene = beside_dense(1.0, dense, 0.0, Interpolation::Nearest);
        let (walked, stats) = walked(&scene, &settings);
        assert_eq!(stats.rejected + stats.majorant_violations, 0);
        let mean = walked.mean()[0];
        assert!(is_near(mean, exact), "seed 9, {dense}, walk: {mean:?}");
        let looked_up = stats.tentative as f64 / stats.paths as f64;
        assert!(looked_up < 3000.0, "{dense}: {looked_up} look-ups a path");
        match flatten(&scene, &settings, u64::MAX) {
            Ok(flat) => {
                let kernel = walker(flat, Backend::widest());
                let (made, _) = film(&scene, &settings, kernel);
                let mean = made.mean()[0];
                assert!(is_near(mean, exact), "seed 9, {dense}, kernel: {mean:?}");
            }
            Err(KernelRefusal::Kernel(Refusal::Medium(
                Unsuited::Contrast(_) | Unsuited::Dense(_),
            ))) => refused += 1,
            Err(why) => panic!("{dense}: {why}"),
        }
    }
    assert!((3..=5).contains(&refused), "{refused} refused");
    let twin = beside_dense(thinner, 1e2, 0.0, Interpolation::Nearest);
    let (twin, _) = walked(&twin, &settings);
    assert!(!is_near(twin.mean()[0], exact), "seed 9: {:?}", twin.mean());
}

/// Walks end in the densest matter that grids take, interpolated or lossless too.
#[test]
fn walks_end_in_the_densest_matter() {
    for interpolation in [Interpolation::Nearest, Interpolation::Trilinear] {
        for (dense, albedo) in [(1e9, 0.0), (1e9, 0.5), (1e7, 1.0), (1e9, 1.0)] {
            let scene = beside_dense(1.0, dense, albedo, interpolation);
            for integrator in [Integrator::Woodcock, Integrator::Regular] {
                if integrator == Integrator::Regular && interpolation == Interpolation::Trilinear {
                    continue;
                }
                let settings = RenderSettings {
                    integrator,
                    ..settings(0..sized(1, 16), u32::MAX)
                };
                let (film, stats) = walked(&scene, &settings);
                assert_eq!(stats.rejected, 0, "{dense} {albedo}");
                let mean = film.mean()[0].0;
                let possible = 0.0..=1.0 + 1e-5;
                assert!(possible.contains(&mean), "{dense} {albedo}: {mean}");
            }
        }
    }
}

/// An endless slab of white fibres that run along x but for random bends, with that blur
/// and an optical depth of 0.04 for each of them.
pub(crate) fn white_slab(longitudinal_deg: f32, fibres: u32, bend_mm: f32) -> Scene {
    let blurs_rad = [longitudinal_deg, 10.0].map(f32::to_radians);
    let fibre = dielectric_fibre(Rgb::BLACK, blurs_rad[0], blurs_rad[1]);
    let mut rng = PathRng::from_seed(31);
    let segments = (0..fibres).map(|_| {
        let (y, z) = (0.2 * rng.unit(), 0.03 + 0.06 * rng.unit());
        let bend = 2.0 * rng.unit() - 1.0;
        let from = Vec3::new(0.0, y, z);
        let to = Vec3::new(0.2, y + bend_mm * bend, z + 0.3 * bend_mm * bend);
        Segment::straight(from, to, 0.004)
    });
    let bounds_mm = Aabb::new(Vec3::ZERO, Vec3::new(0.2, 0.2, 0.12));
    let segments = SegmentList::new(bounds_mm, true, segments.collect());
    let octree = octree(&segments, 0.02, 2);
    let medium = VirtualFibreMedium::new(octree, 0, vec![fibre], VirtualFibreEvent::Plain).unwrap();
    Scene {
        media: vec![AnyMedium::VirtualFibres(medium)],
        lights: vec![white_sky(Hemisphere::All)],
        camera: orthographic(
            DVec3::new(0.02, 0.01, 5.0),
            DVec3::new(0.05, 0.05, 0.0),
            0.1,
            8,
        ),
    }
}

/// White fibres are invisible in even light after tens of events, whatever their blur
/// makes of the words of their tables. The twin rounds a factor of every event as
/// colours are rounded.
#[test]
fn white_fibres_keep_all_light_through_tens_of_events() {
    let settings = settings(0..4096, u32::MAX);
    let mut rejected = 0;
    let slabs = [
        (6.0, 250, 0.01),
        (7.0, 250, 0.05),
        (8.0, 120, 0.02),
        (10.0, 250, 0.02),
    ];
    for (longitudinal_deg, fibres, bend_mm) in slabs.into_iter().step_by(sized(2, 1)) {
        let name = format!("seed 9, {longitudinal_deg} degrees, {fibres} fibres");
        let scene = white_slab(longitudinal_deg, fibres, bend_mm);
        let by_kernel = |flat| film(&scene, &settings, walker(flat, Backend::widest()));
        let made = || flat_scene(&scene, &settings);
        let (own, stats) = by_kernel(made());
        assert!(stats.collisions > 5 * stats.paths, "{name}");
        let mean = own.mean()[1];
        assert!(is_near(mean, 1.0), "{name}: {mean:?}");
        assert!(mean.1 < 1e-3, "{name}: {mean:?}");
        let (twin, _) = by_kernel(made().with_fault(Fault::RoundedScale));
        rejected += u32::from(!is_near(twin.mean()[1], 1.0));
    }
    assert!(rejected >= 2, "{rejected} twins rejected");
}
