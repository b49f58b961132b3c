//! Environment pictures and their parts.

use super::environment::{Parts, Sky};
use super::flat_medium::FlatMedium;
use super::matter_tests::bundles;
use super::optical_depth_table::Nodes;
use glam::{UVec2, Vec3};
use organza_basis::{Moments, PathRng, Rgb, warp};
use organza_lanes::math::{LaneRng, V3, pixel_key};
use organza_lanes::{Ints, Mask, one};
use organza_light::ImageEnvironment;
use organza_testing::environment_with_lamps;

fn sky() -> (ImageEnvironment, Sky) {
    let image = environment_with_lamps();
    let medium = FlatMedium::new(&bundles(false)).unwrap();
    let parts = Parts::of(&image);
    let nodes = Nodes::new(&medium.cell_grid, 1, std::iter::empty());
    let sky = Sky::new(&medium, nodes, &image, &parts);
    (image, sky)
}

fn seen(sky: &Sky, w: Vec3, whole: bool) -> Rgb {
    let c = sky.radiance_toward(V3::<one::F>::splat(w), Mask::from_bits(u32::from(whole)));
    Rgb::new(c.x.0, c.y.0, c.z.0)
}

#[test]
fn lanes_see_the_picture() {
    let (image, sky) = sky();
    let mut rng = PathRng::from_seed(21);
    for i in 0..20_000 {
        let mut w = warp::uniform_sphere(rng.unit2());
        if i < 6 {
            w = [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z][i];
        }
        let (a, b) = (seen(&sky, w, true), image.radiance_toward(w));
        let apart = (a.0 - b.0).abs().max_element();
        assert!(apart < 2e-4 * (1.0 + b.max_component()), "{w}: {a:?} {b:?}");
    }
}

/// Lamps are found, the sky is smooth, and what is drawn from the lamps sums up
/// to what the sky lacks, moment by moment.
#[test]
fn lamps_are_what_the_sky_lacks() {
    let (image, sky) = sky();
    assert_eq!(sky.lamps.len(), 3);
    let parts = Parts::of(&image);
    let most = |p: &[Rgb]| p.iter().map(|c| c.luminance()).fold(0.0, f32::max);
    assert!(most(&parts.sky) < 3.0 && most(image.pixels()) > 40.0);
    let moments = |w: Vec3| [1.0, w.x, w.y, w.z, w.x * w.y, w.z * w.z];
    let n = 400_000;
    let mut rng = PathRng::from_seed(22);
    let (mut lacking, mut drawn) = ([Moments::default(); 6], [Moments::default(); 6]);
    // Only the green, at random points of the sphere.
    for _ in 0..n {
        let w = warp::uniform_sphere(rng.unit2());
        let light = seen(&sky, w, true).0.y - seen(&sky, w, false).0.y;
        for (sum, m) in lacking.iter_mut().zip(moments(w)) {
            sum.add(f64::from(m * light * 4.0 * std::f32::consts::PI));
        }
    }
    let (a, b) = pixel_key(5, 5);
    for sample in 0..n {
        let word = |x: u32| <one::U as Ints>::splat(x);
        let mut rng = LaneRng::new((word(a), word(b)), word(sample));
        let mut light = [0.0f32; 6];
        for lamp in &sky.lamps {
            let [p, q, _] = rng.units(true);
            let [r, s, _] = rng.units(true);
            let found = sky.sample(lamp, [p, q, r, s]);
            let w = Vec3::new(found.to_light.x.0, found.to_light.y.0, found.to_light.z.0);
            assert!((w.length() - 1.0).abs() < 4.0 * f32::EPSILON);
            let value = moments(w).map(|m| m * found.irradiance.y.0);
            light = std::array::from_fn(|i| light[i] + value[i]);
        }
        for (sum, x) in drawn.iter_mut().zip(light) {
            sum.add(f64::from(x));
        }
    }
    for (i, (a, b)) in lacking.iter().zip(drawn).enumerate() {
        let error = a.standard_error().hypot(b.standard_error());
        let apart = a.mean - b.mean;
        assert!(apart.abs() < 4.0 * error, "moment {i}: {apart} of {error}");
        assert!(error < 0.05, "{error}");
    }
}

/// Whatever the picture, the split ends, and a uniform one has no lamps.
#[test]
fn odd_pictures_are_taken_apart() {
    let parts = |pixels: &[f32]| {
        let size = UVec2::new(pixels.len() as u32 / 2, 2);
        let pixels = pixels.iter().map(|&p| Rgb::splat(p)).collect();
        Parts::of(&ImageEnvironment::new(size, pixels, Vec3::Z, Vec3::X).unwrap())
    };
    assert!(parts(&[0.0; 8]).lamps.is_empty());
    assert!(parts(&[2.5; 8]).lamps.is_empty());
    let one = parts(&[0.0, 0.0, 1e30, 0.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(one.lamps.iter().map(Vec::len).sum::<usize>(), 1);
    assert!(one.sky.iter().all(|p| p.is_valid()));
}

/// The bytes that are counted rise with the places of a lamp's texels, a power of two.
#[test]
fn memory_rises_with_the_texels_of_lamps() {
    let of = |texels: usize| {
        let mut parts = Parts::of(&environment_with_lamps());
        assert!(parts.lamps[0].len() > 2);
        parts.lamps[0].truncate(texels);
        parts.bytes(1000)
    };
    let (one, two, four) = (of(1), of(2), of(3));
    assert!(two > one);
    assert_eq!(four - two, 2 * (two - one));
}
