use super::*;
use crate::cylinder::mean_attenuations;
use crate::near::LOBES;
use crate::proofs::{draws, fails};
use crate::{FlakeFamily, FlakeMixtures};
use organza_basis::hypothesis::{SphereGrid, t_test, welch_test};
use organza_basis::{FibrePopulation, Mixture, Moments, warp};

fn mixture(axis: Vec3, spread_rad: f32) -> Mixture {
    let mut mixture = Mixture::EMPTY;
    mixture.push(FibrePopulation {
        length_density_per_mm2: 40.0,
        axis,
        spread_rad,
        radius_mm: 0.01,
        ..Default::default()
    });
    mixture
}

fn flakes(fibre: ClearFibre, end_on_ratio: f32) -> FlakeMixtures {
    let optics = FlakeOptics::new(Rgb::WHITE, end_on_ratio);
    let scattering = TransmittingFlakes::new(&[optics], vec![fibre]);
    FlakeMixtures::new(vec![optics], Arc::new(scattering))
}

fn dyed() -> ClearFibre {
    ClearFibre {
        ior: 1.55,
        absorption_radii: Rgb::new(0.0, 0.2, 1.0),
        albedo: Rgb::WHITE,
    }
}

#[test]
fn the_inverse_of_refraction_is_exact_in_double_precision() {
    for ior in [1.05f32, 1.3, 1.55, 2.5] {
        let fibre = ClearFibre { ior, ..dyed() };
        for cos in [1.0f32, 0.6, 0.1] {
            let (ior, c) = (f64::from(ior), f64::from(cos));
            let index = (ior * ior - 1.0 + c * c).sqrt() / c;
            let turn = |g: f64| 2.0 * (g - (g.sin() / index).asin());
            for k in 1..60 {
                let gamma = 0.5 * std::f64::consts::PI * f64::from(k) / 60.0;
                let (got, slope) = fibre.gamma_of_turn(cos, turn(gamma) as f32).unwrap();
                let step = 1e-5;
                let exact = 4.0 * step / (turn(gamma + step) - turn(gamma - step));
                let off = (f64::from(got) - gamma).abs();
                assert!(off < 2e-4, "{ior} {cos} {gamma}: {got}");
                let off = (f64::from(slope) / exact - 1.0).abs();
                assert!(off < 2e-3, "{ior} {cos} {gamma}");
            }
            let beyond = turn(0.5 * std::f64::consts::PI) + 1e-3;
            let found = fibre.gamma_of_turn(cos, beyond as f32);
            assert!(found.is_none(), "{ior} {cos}");
        }
    }
}

/// Drawn directions follow the density, which integrates to one; the density of mirrors
/// alone is rejected.
#[test]
fn directions_are_drawn_as_the_density_says() {
    let axis = Vec3::new(0.48, 0.36, 0.8);
    let mut rng = PathRng::from_seed(141);
    for end_on in [0.3f32, 0.7] {
        let flakes = flakes(dyed(), end_on);
        let mixture = mixture(axis, 0.2);
        for w_out in [Vec3::new(-0.8, 0.0, 0.6), Vec3::Z] {
            let cosines = (0..=16).map(|k| f64::from(k) / 8.0 - 1.0).collect();
            let grid = SphereGrid::with_edges(axis, cosines, 24).admitting(4e-3);
            let mut drawn = || {
                flakes
                    .sample(&mixture, None, w_out, &mut rng)
                    .map(|s| s.w_in)
            };
            let density = |w| f64::from(flakes.eval(&mixture, None, w_out, w).1);
            let v = grid.chi_square(draws(40_000), &mut drawn, density);
            assert!(!fails(v, 4), "seed 141, {end_on} {w_out}: {v:?}");
            let mirrors =
                FlakeFamily::SGGX_SPECULAR.of_materials(vec![FlakeOptics::new(Rgb::WHITE, end_on)]);
            let mirrors = |w| f64::from(mirrors.eval(&mixture, None, w_out, w).1);
            let twin = grid.chi_square(draws(40_000), &mut drawn, mirrors);
            assert!(twin.p_value < 1e-6, "seed 141, {end_on} {w_out}: {twin:?}");
        }
    }
}

/// Swapping the directions changes nothing, pair by pair. The phase function without the
/// extinction is the twin, which is not symmetric.
#[test]
fn every_pair_is_reciprocal() {
    let axis = Vec3::new(0.48, 0.36, 0.8);
    let (flakes, mixture) = (flakes(dyed(), 0.3), mixture(axis, 0.1));
    let mut rng = PathRng::from_seed(142);
    let mut lopsided = 0;
    for _ in 0..2000 {
        let [a, b] = [(); 2].map(|()| warp::uniform_sphere(rng.unit2()));
        let there = flakes.eval(&mixture, None, a, b).0 * flakes.sigma_t_per_mm(&mixture, a);
        let back = flakes.eval(&mixture, None, b, a).0 * flakes.sigma_t_per_mm(&mixture, b);
        let off = (there.0 - back.0).abs();
        let allowed = 2e-3 * there.0.max(back.0) + Vec3::splat(1e-4);
        let is_near = off.cmple(allowed).all();
        assert!(is_near, "seed 142: {a} {b}, {there:?} {back:?}");
        let bare = flakes.eval(&mixture, None, a, b).0.0 - flakes.eval(&mixture, None, b, a).0.0;
        lopsided += usize::from(bare.abs().max_element() > 0.05 * there.0.max_element());
    }
    assert!(lopsided > 200, "seed 142: {lopsided}");
}

/// Broadside and for smooth fibres, scattered light keeps the share that ray optics of a
/// cylinder gives by quadrature over offsets. A share 3 % higher is rejected.
#[test]
fn shares_are_those_of_a_cylinder() {
    let (flakes, mixture) = (flakes(dyed(), 0.0), mixture(Vec3::X, 0.0));
    let energies = mean_attenuations(1.55, dyed().absorption_radii, 1.0, 512);
    let total: Vec3 = (0..LOBES).map(|p| energies[p].0).sum();
    let mut rng = PathRng::from_seed(143);
    let (mut kept, mut black) = (Moments::default(), Moments::default());
    for _ in 0..draws(40_000) {
        let s = flakes.sample(&mixture, None, Vec3::Z, &mut rng).unwrap();
        kept.add(f64::from(s.weight.0.y));
        black.add(f64::from(s.weight.0.z));
    }
    for (got, exact) in [(kept, total.y), (black, total.z)] {
        let v = t_test(&got, f64::from(exact));
        assert!(!fails(v, 2), "seed 143: {got:?} {exact}");
        let twin = t_test(&got, 1.03 * f64::from(exact));
        assert!(twin.p_value < 1e-6, "seed 143: {got:?} {exact}");
    }
}

/// Light leaves where rays traced through a cylinder leave: the shares within half a right
/// angle of straight on, and within a right angle of the way back. Mirrors alone, and light
/// that is reflected inside leaving as from a mirror, are rejected.
#[test]
fn light_leaves_where_a_cylinder_sends_it() {
    let clear = ClearFibre::of_albedo(Rgb::WHITE);
    let (flakes, mixture) = (flakes(clear, 0.0), mixture(Vec3::X, 0.0));
    let mut rng = PathRng::from_seed(144);
    let ahead = |azimuth: f32| azimuth.cos() > (0.25 * PI).cos();
    let back = |azimuth: f32| azimuth.cos() < 0.0;
    let mut got = [Moments::default(); 2];
    let (mut traced, mut as_mirrors) = (got, got);
    for _ in 0..draws(40_000) {
        let s = flakes.sample(&mixture, None, Vec3::Z, &mut rng).unwrap();
        let azimuth = (-s.w_in.z).clamp(-1.0, 1.0).acos();
        count(&mut got, [ahead(azimuth), back(azimuth)]);
        let h = 2.0 * rng.unit() - 1.0;
        let crossing = Crossing::new(1.55, 1.0, h);
        // Each meeting with the surface reflects, or ends the way through or out of the fibre.
        let mut reflects = || rng.unit() < crossing.fresnel;
        let lobe = match (reflects(), reflects(), reflects()) {
            (true, ..) => 0,
            (false, false, _) => 1,
            (false, true, false) => 2,
            // Reflected more often, which leaves with the mirrored light.
            (false, true, true) => 0,
        };
        let azimuth = crossing.exit_azimuth(lobe, incidence(h));
        count(&mut traced, [ahead(azimuth), back(azimuth)]);
        let azimuth = crossing.exit_azimuth(usize::from(lobe == 1), incidence(h));
        count(&mut as_mirrors, [ahead(azimuth), back(azimuth)]);
    }
    for (got, traced) in got.iter().zip(&traced) {
        let v = welch_test(got, traced);
        assert!(!fails(v, 2), "seed 144: {got:?} {traced:?}");
    }
    let twin = welch_test(&as_mirrors[1], &traced[1]);
    assert!(twin.p_value < 1e-6, "seed 144: {as_mirrors:?} {traced:?}");
    let mirrors: Moments = (0..draws(40_000))
        .map(|_| {
            let azimuth = PI - 2.0 * (2.0 * rng.unit() - 1.0).asin();
            f64::from(u8::from(ahead(azimuth)))
        })
        .collect();
    let twin = welch_test(&mirrors, &traced[0]);
    assert!(twin.p_value < 1e-6, "seed 144: {mirrors:?} {traced:?}");
}

fn count(moments: &mut [Moments; 2], found: [bool; 2]) {
    for (m, found) in moments.iter_mut().zip(found) {
        m.add(f64::from(u8::from(found)));
    }
}
