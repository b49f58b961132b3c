//! Virtual fibres in an octree, rendered, against closed forms and against walks
//! through a homogeneous slab that know of no octree, majorant or film.

use crate::scenes::{direction, octree, orthographic, rendered, sun, white_sky};
use glam::{DVec3, Vec3};
use organza_basis::curve::{Segment, SegmentList};
use organza_basis::hypothesis::SphereGrid;
use organza_basis::{Aabb, FibrePopulation, Mixture, Moments, PathRng, Ray, Rgb};
use organza_scatter::{
    Fibre, FibreFrame, FittedFibre, FittedParameters, Lobe, PackedEvent, meet_fibre,
    sigma_t_per_mm, void_multiplier,
};
use organza_testing::{dielectric_fibre, fitted_fibre, sized};
use organza_transport::{
    AnyMedium, Film, Hemisphere, Integrator, Light, Medium, Scene, Stats, VirtualFibreEvent,
    VirtualFibreMedium, exact_transmittance, transmittance,
};
use std::f32::consts::PI;

const RADIUS_MM: f32 = 0.008;
/// Fibres are as far apart, one a voxel.
const VOXEL_MM: f32 = 0.024;
const THICKNESS_MM: f32 = 0.12;

fn density_per_mm2() -> f32 {
    1.0 / (VOXEL_MM * VOXEL_MM)
}

fn packing() -> f32 {
    PI * RADIUS_MM * RADIUS_MM * density_per_mm2()
}

/// A slab of parallel fibres along x, homogeneous in voxels.
fn slab(fibre: Fibre, event: VirtualFibreEvent) -> VirtualFibreMedium {
    let (across, down) = (4, 5);
    let width = across as f32 * VOXEL_MM;
    let mut segments = Vec::new();
    for j in 0..across {
        for k in 0..down {
            let [y, z] = [j, k].map(|i| (i as f32 + 0.5) * VOXEL_MM);
            let ends = [0.0, width].map(|x| Vec3::new(x, y, z));
            segments.push(Segment::straight(ends[0], ends[1], RADIUS_MM));
        }
    }
    let bounds_mm = Aabb::new(Vec3::ZERO, Vec3::new(width, width, THICKNESS_MM));
    let octree = octree(&SegmentList::new(bounds_mm, true, segments), VOXEL_MM, 1);
    VirtualFibreMedium::new(octree, 0, vec![fibre], event).unwrap()
}

/// How much denser fibres appear to the rays of an event than they are.
fn multiplier(event: VirtualFibreEvent) -> f32 {
    match event {
        VirtualFibreEvent::Plain => 1.0,
        VirtualFibreEvent::Packed => void_multiplier(packing()),
    }
}

fn dielectric(absorption_radii: f32) -> Fibre {
    dielectric_fibre(Rgb::splat(absorption_radii), 0.12, 0.25)
}

fn fitted() -> Fibre {
    fitted_fibre("gabardine")
}

fn picture(
    medium: VirtualFibreMedium,
    light: Light,
    view: Vec3,
    spp: u64,
    seed: u64,
) -> (Film, Stats) {
    let middle = DVec3::new(0.05, 0.05, f64::from(0.5 * THICKNESS_MM));
    let scene = Scene {
        media: vec![AnyMedium::VirtualFibres(medium)],
        lights: vec![light],
        camera: orthographic(middle + 3.0 * view.as_dvec3(), middle, 0.1, 24),
    };
    rendered(&scene, Integrator::Woodcock, spp, u32::MAX, seed)
}

fn full(small: u64) -> u64 {
    sized(small, 30 * small)
}

/// exp(-m 2 r rho sin(angle) length): every offset moves the whole slab along
/// the ray and changes nothing of its depth. The twin forgets the void.
#[test]
fn transmittance_of_parallel_fibres() {
    for event in [VirtualFibreEvent::Plain, VirtualFibreEvent::Packed] {
        let m = multiplier(event);
        let medium = slab(dielectric(0.0), event);
        let mut twin_rejected = false;
        let mut stats = Stats::default();
        for (k, (theta, phi)) in [(0.0, 0.0), (40.0, 90.0), (65.0, 10.0), (80.0, 0.0)]
            .into_iter()
            .enumerate()
        {
            let w = -direction(theta, phi);
            let ray = Ray::new(Vec3::new(0.03, 0.02, 0.06) - w, w);
            let local = medium.cell_grid().clip(&ray, f64::INFINITY).unwrap();
            let mut rng = PathRng::new(31, k as u64, 0);
            let got: Moments = (0..20_000)
                .map(|_| f64::from(transmittance(&medium, &local, &mut rng, &mut stats)))
                .collect();
            let sine = w.cross(Vec3::X).length();
            let depth = 2.0 * RADIUS_MM * density_per_mm2() * sine * THICKNESS_MM / w.z.abs();
            let off =
                |m: f32| (got.mean - f64::from((-m * depth).exp())).abs() / got.standard_error();
            assert!(
                off(m) < 4.0,
                "seed 31, {event:?}, {theta} {phi}: {} +- {}",
                got.mean,
                got.standard_error()
            );
            twin_rejected |= off(m * (1.0 - packing())) > 10.0;
            if event == VirtualFibreEvent::Plain {
                let exact = exact_transmittance(&medium, &local, &mut stats);
                assert!((exact / (-depth).exp() - 1.0).abs() < 16.0 * f32::EPSILON);
            }
        }
        assert_eq!(stats.majorant_violations, 0);
        assert!(twin_rejected || event == VirtualFibreEvent::Plain);
    }
}

/// Light from everywhere on fibres that absorb nothing looks like no fibres, but
/// for what the tables of a lobe are off, summed over the events of a path. The
/// twin absorbs a little.
#[test]
fn white_furnace() {
    let light = white_sky(Hemisphere::All);
    let view = direction(30.0, 70.0);
    for event in [VirtualFibreEvent::Plain, VirtualFibreEvent::Packed] {
        let off = |absorption: f32| {
            let medium = slab(dielectric(absorption), event);
            let (film, stats) = picture(medium, light.clone(), view, full(24), 41);
            let (mean, se) = film.mean()[0];
            let events = stats.collisions as f64 / stats.paths as f64;
            println!(
                "{event:?}, absorption {absorption}: {mean:.5} +- {se:.5}, {events:.1} events"
            );
            (mean - 1.0).abs() / (4.0 * se + 5e-4 * events)
        };
        // Margin: one is four standard errors, and 5e-4 an event for the tables of the lobes.
        assert!(off(0.0) < 1.0, "seed 41, {event:?}");
        assert!(off(0.02) > 1.0, "seed 41, {event:?}: the twin passed");
    }
}

/// Of black fibres in a furnace nothing shows but what lies behind them and their
/// gloss, no more than one event of it: the lobe's integral by quadrature. The
/// twin's fibres are not black.
#[test]
fn black_fibres_show_no_more_than_their_gloss() {
    let light = white_sky(Hemisphere::All);
    let fibre = |colour_r: f32| {
        let parameters = FittedParameters {
            colour_r: Rgb::splat(colour_r),
            colour_tt: Rgb::BLACK,
            longitudinal_r_rad: 0.1,
            ..FittedParameters::preset("silk").unwrap()
        };
        Fibre::from(FittedFibre::new(parameters).unwrap())
    };
    let black = fibre(0.0);
    for event in [VirtualFibreEvent::Plain, VirtualFibreEvent::Packed] {
        for theta_deg in [50.0, 65.0, 80.0] {
            let view = direction(theta_deg, 0.0);
            let lobe = black.far_field(Vec3::X);
            let gloss =
                SphereGrid::new(Vec3::X, 60, 24).integrate(|w| f64::from(lobe.eval(view, w).0.x));
            assert!(gloss > 1e-4 && gloss < 0.6, "{theta_deg}: {gloss}");
            let m = multiplier(event);
            // Seen along the fibres' plane the sine cancels the way's length.
            let depth = m * 2.0 * RADIUS_MM * density_per_mm2() * THICKNESS_MM;
            let through = f64::from((-depth).exp());
            let show = |fibre: &Fibre| {
                let medium = slab(fibre.clone(), event);
                picture(medium, light.clone(), view, full(8), 43).0.mean()[0]
            };
            let above = |(mean, se): (f64, f64)| (mean - through - (1.0 - through) * gloss) / se;
            let got = show(&black);
            assert!(above(got) < 4.0, "seed 43, {event:?}, {theta_deg}: {got:?}");
            assert!(got.0 > through - 4.0 * got.1, "seed 43: {got:?} {through}");
            let twin = above(show(&fibre(0.9)));
            assert!(twin > 5.0, "seed 43, {event:?}, {theta_deg}: twin {twin}");
        }
    }
}

/// A walk through the slab that uses nothing of the medium but the scattering
/// models: light from `light` (unit irradiance across it) scattered to `view`.
struct Walk<'a> {
    event: VirtualFibreEvent,
    fibre: &'a Fibre,
    mixture: Mixture,
}

impl Walk<'_> {
    fn new(event: VirtualFibreEvent, fibre: &Fibre) -> Walk<'_> {
        let m = multiplier(event);
        let mut mixture = Mixture::EMPTY;
        mixture.push(FibrePopulation {
            length_density_per_mm2: m * density_per_mm2(),
            axis: Vec3::X,
            radius_mm: RADIUS_MM,
            ..Default::default()
        });
        Walk {
            event,
            fibre,
            mixture,
        }
    }

    /// The next event of a walk that continues from height `z` against `w_out`.
    fn fly(&self, mut z: f32, w_out: Vec3, rng: &mut PathRng) -> Option<PackedEvent> {
        let sigma = sigma_t_per_mm(&self.mixture, w_out);
        loop {
            z -= w_out.z * rng.exponential() / sigma;
            if !(-RADIUS_MM..=THICKNESS_MM + RADIUS_MM).contains(&z) {
                return None;
            }
            let tangent = meet_fibre(&self.mixture, w_out, rng)?.tangent;
            let at = Vec3::new(0.0, 0.0, z);
            let event = PackedEvent::draw(at, w_out, tangent, RADIUS_MM, rng);
            let counts = match self.event {
                VirtualFibreEvent::Plain => z,
                VirtualFibreEvent::Packed => event.axis_mm().z,
            };
            if (0.0..=THICKNESS_MM).contains(&counts) {
                return Some(event);
            }
        }
    }

    fn path(&self, light: Vec3, view: Vec3, rng: &mut PathRng) -> f32 {
        let mut z = if view.z > 0.0 {
            THICKNESS_MM + RADIUS_MM
        } else {
            -RADIUS_MM
        };
        let (mut w_out, mut throughput, mut sum) = (view, 1.0f32, 0.0);
        while let Some(event) = self.fly(z, w_out, rng) {
            let (value, from, next);
            match self.event {
                VirtualFibreEvent::Plain => {
                    let far = self.fibre.far_field(event.frame.tangent);
                    value = far.eval(w_out, light).0.x;
                    from = event.point_mm.z;
                    next = far.sample(w_out, rng);
                    z = from;
                }
                VirtualFibreEvent::Packed => {
                    let frame = FibreFrame::new(event.frame.tangent, w_out);
                    let near = self.fibre.near_field(frame, event.offset);
                    value = near.eval(w_out, light).0.x;
                    from = event.exit_mm(&near, light, rng).z;
                    next = near.sample(w_out, rng);
                    z = next.map_or(z, |s| event.exit_mm(&near, s.w_in, rng).z);
                }
            }
            if self.fly(from, -light, rng).is_none() {
                sum += throughput * value;
            }
            let Some(s) = next else { break };
            throughput *= s.weight.0.x;
            if throughput < 0.1 {
                if rng.unit() < 0.5 {
                    break;
                }
                throughput *= 2.0;
            }
            w_out = -s.w_in;
        }
        sum
    }
}

/// The rendered slab is the walked one, with either event and fibre, in
/// reflection and transmission. The twin is the other event.
#[test]
fn renders_are_the_slab_walk() {
    let spp = sized(20, 1200);
    let paths = spp * 24 * 24;
    let (mut stream, mut twin) = (0, 0.0f64);
    for (name, fibre) in [("dielectric", dielectric(0.05)), ("fitted", fitted())] {
        for (light, view) in [
            (direction(25.0, 60.0), direction(40.0, 250.0)),
            (direction(150.0, 100.0), direction(20.0, 80.0)),
        ] {
            let walks = [VirtualFibreEvent::Plain, VirtualFibreEvent::Packed].map(|event| {
                stream += 1;
                let walk = Walk::new(event, &fibre);
                let one = |i| {
                    let mut rng = PathRng::new(51, stream, i);
                    f64::from(walk.path(light, view, &mut rng))
                };
                (0..paths).map(one).collect::<Moments>()
            });
            for (k, event) in [VirtualFibreEvent::Plain, VirtualFibreEvent::Packed]
                .into_iter()
                .enumerate()
            {
                let sun = sun(-light, 1.0);
                let (film, _) = picture(slab(fibre.clone(), event), sun, view, spp, 52);
                let (mean, se) = film.mean()[0];
                let z = |w: &Moments| (mean - w.mean) / se.hypot(w.standard_error());
                let (own, other) = (z(&walks[k]), z(&walks[1 - k]));
                println!(
                    "{name}, {event:?}: rendered {mean:.5} +- {se:.5}, walked {:.5}, {own:.1} errors; twin {other:.1}",
                    walks[k].mean
                );
                // Margin: four standard errors.
                assert!(own.abs() < 4.0, "seeds 51, 52: {name}, {event:?}: {own}");
                twin = twin.max(other.abs());
            }
        }
    }
    assert!(twin > 8.0, "seeds 51, 52: the twin passed, {twin}");
}

/// Same seed, same bits on any number of threads; another seed, others.
#[test]
fn threads_change_nothing() {
    let light = sun(-direction(30.0, 20.0), 1.0);
    let on = |threads: usize, seed: u64| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        pool.build().unwrap().install(|| {
            let medium = slab(dielectric(0.1), VirtualFibreEvent::Packed);
            let (film, stats) = picture(medium, light.clone(), direction(10.0, 0.0), 2, seed);
            (
                film.mean().map(|(m, se)| (m.to_bits(), se.to_bits())),
                stats,
            )
        })
    };
    let one = on(1, 61);
    assert!(one.1.shadow_rays > 0);
    assert_eq!(one, on(3, 61));
    assert_ne!(one.0, on(3, 62).0);
}

#[test]
fn levels_and_materials_that_do_not_exist_are_refused() {
    let octree = slab(fitted(), VirtualFibreEvent::Plain).octree().clone();
    let event = VirtualFibreEvent::Packed;
    assert!(VirtualFibreMedium::new(octree.clone(), 1, vec![fitted()], event).is_none());
    assert!(VirtualFibreMedium::new(octree.clone(), 0, Vec::new(), event).is_none());
    let medium = VirtualFibreMedium::new(octree, 0, vec![fitted()], event).unwrap();
    let factors = medium.packing_factors()[0];
    assert!((factors.own_yarn / void_multiplier(packing()) - 1.0).abs() < 4.0 * f32::EPSILON);
    assert!(factors.own_yarn == factors.outside && factors.own_yarn == factors.other_yarn);
    assert!(!factors.is_measured);
}

/// Rays beside the axes but within a radius of them meet fibres; rays further
/// out do not.
#[test]
fn a_lone_fibre_is_met_at_its_surface() {
    let middle = Vec3::new(0.05, 0.05, 0.1);
    let bounds_mm = Aabb::new(Vec3::ZERO, Vec3::new(0.1, 0.1, 0.2));
    let list = SegmentList::new(
        bounds_mm,
        false,
        vec![Segment::straight(
            middle - 0.04 * Vec3::X,
            middle + 0.04 * Vec3::X,
            RADIUS_MM,
        )],
    );
    let octree = octree(&list, 0.002, 1);
    let medium =
        VirtualFibreMedium::new(octree, 0, vec![fitted()], VirtualFibreEvent::Packed).unwrap();
    let mut stats = Stats::default();
    let mut depth_at = |y: f32| {
        let ray = Ray::new(middle + Vec3::new(0.0, y, 1.0), Vec3::NEG_Z);
        let local = medium.cell_grid().clip(&ray, f64::INFINITY).unwrap();
        let mut rng = PathRng::from_seed(71);
        let mean: Moments = (0..4000)
            .map(|_| f64::from(transmittance(&medium, &local, &mut rng, &mut stats)))
            .collect();
        mean.mean
    };
    let inside = depth_at(0.6 * RADIUS_MM);
    assert!(inside < 0.95, "seed 71: {inside}");
    assert_eq!(depth_at(1.4 * RADIUS_MM), 1.0);
    assert_eq!(stats.majorant_violations, 0);
}
