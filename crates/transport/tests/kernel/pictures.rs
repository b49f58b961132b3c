//! Pictures around the scene: the kernel against the walk.

use crate::kernel::{
    PINHOLE, cloth, film, flat_scene, grid, least_p, lens, scene, settings, walked, walker,
};
use organza_kernel::proofs::Fault;
use organza_testing::{environment_with_lamps, sized};
use organza_transport::*;
use std::sync::Arc;

pub(crate) fn picture() -> Light {
    Light::from(ImageLight {
        image: Arc::new(environment_with_lamps()),
        search: LightSearch::Both,
    })
}

#[test]
fn pictures_light_the_kernel_as_the_walk() {
    for (name, medium, projection) in [
        ("finite", AnyMedium::Grid(grid(false)), PINHOLE),
        ("endless", AnyMedium::Grid(grid(true)), lens()),
        ("mixtures", AnyMedium::FlakeOctree(cloth()), PINHOLE),
    ] {
        let scene = scene(medium, vec![picture()], projection);
        let settings = settings(0..sized(1024, 65_536), u32::MAX);
        let (oracle, _) = walked(&scene, &settings);
        let good = |flat: FlatScene| {
            let engine = walker(flat, Backend::widest());
            let (film, stats) = film(&scene, &settings, engine);
            assert_eq!(stats.rejected + stats.majorant_violations, 0, "{name}");
            (least_p(&film, &oracle), stats)
        };
        let made = || flat_scene(&scene, &settings);
        let (p, stats) = good(made());
        assert!(p > 1e-4, "{name}, seed 9: {p}");
        assert!(stats.shadow_rays > 0);
        // Exact rays set a wrong table right.
        let (p, _) = good(made().with_fault(Fault::OpticalDepths));
        assert!(p > 1e-4, "{name}, wrong table, seed 9: {p}");
        // Known-bad twins: lamps found twice, lamps not found at all.
        for fault in [Fault::LampsTwice, Fault::NoLamps] {
            // Margin: the probability at which the twin is rejected.
            assert!(good(made().with_fault(fault)).0 < 1e-9, "{name}, seed 9");
        }
    }
}
