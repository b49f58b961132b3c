//! Pictures around the scene: the kernel against the walk.

use crate::{agree, cloth, film, grid, kernel, lens, samples, scene, settings};
use glam::{UVec2, Vec3};
use organza_basis::Rgb;
use organza_kernel::proofs::Fault;
use organza_transport::*;
use std::sync::Arc;

/// A dim sky with a low sun of some pixels, a lamp at the pole and one at the
/// left edge.
fn image() -> ImageEnvironment {
    let size = UVec2::new(24, 12);
    let mut pixels: Vec<Rgb> = (0..size.element_product())
        .map(|i| Rgb::new(0.3, 0.4, 0.6) * (1.0 + 0.5 * (i as f32).sin()))
        .collect();
    let mut shine = |x: usize, y: usize, radiance| pixels[y * 24 + x] = radiance;
    shine(13, 8, Rgb::new(60.0, 40.0, 20.0));
    shine(14, 8, Rgb::new(30.0, 20.0, 10.0));
    shine(13, 9, Rgb::new(20.0, 15.0, 10.0));
    shine(0, 5, Rgb::new(2.0, 9.0, 30.0));
    (0..24).for_each(|x| shine(x, 0, Rgb::splat(9.0)));
    ImageEnvironment::new(size, pixels, Vec3::new(0.2, 0.3, 1.0), Vec3::Y).unwrap()
}

pub(crate) fn picture() -> Light {
    Light::from(ImageLight {
        image: Arc::new(image()),
        search: LightSearch::Both,
    })
}

#[test]
fn pictures_light_the_kernel_as_the_walk() {
    let pinhole = Projection::Perspective { fov_rad: 0.25 };
    for (name, medium, projection) in [
        ("finite", AnyMedium::Grid(grid(false)), pinhole),
        ("endless", AnyMedium::Grid(grid(true)), lens()),
        ("mixtures", AnyMedium::SggxOctree(cloth()), pinhole),
    ] {
        let scene = scene(medium, vec![picture()], projection);
        let settings = settings(0..samples(), u32::MAX);
        let (oracle, _) = film(&scene, &settings, None);
        let good = |twin: Kernel| {
            let (film, stats) = film(&scene, &settings, Some(twin));
            assert_eq!(stats.rejected + stats.majorant_violations, 0, "{name}");
            let (spread, mean) = agree(&film, &oracle);
            (spread.p_value.min(mean.p_value), stats)
        };
        let made = || kernel(&scene, &settings, Backend::widest());
        let (p, stats) = good(made());
        assert!(p > 1e-4, "{name}, seed 9: {p}");
        assert!(stats.shadow_rays > 0);
        // Exact rays set a wrong table right.
        let (p, _) = good(made().with_fault(Fault::OpticalDepths));
        assert!(p > 1e-4, "{name}, wrong table, seed 9: {p}");
        // Known-bad twins: lamps found twice, lamps not found at all.
        for fault in [Fault::LampsTwice, Fault::NoLamps] {
            assert!(good(made().with_fault(fault)).0 < 1e-9, "{name}, seed 9");
        }
    }
}
