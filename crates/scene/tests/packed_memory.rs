//! What the kernel needs of the memory that is allowed, for packed fibres.

use crate::flat_cloth::{build, settings};
use organza_kernel::Refusal;
use organza_transport::{AnyMedium, EngineChoice, KernelRefusal, engine};

/// The voxels that stay count, too, and what laying them out takes on the way: with the same
/// limit for each, the peak was twice as high.
#[test]
fn packed_fibres_count_all_that_is_in_memory_at_once() {
    let (scene, _) = build(
        "packed",
        "[camera]\norigin_mm = [0.0, 0.0, 9.0]\ntarget_mm = [0.0, 0.0, 0.0]\n\
         up = [0.0, 1.0, 0.0]\nwidth_mm = 1.0\nresolution = [2, 2]\n\
         [[light]]\nkind = \"environment\"\nradiance = [1.0, 1.0, 1.0]\n",
    );
    let AnyMedium::VirtualFibres(packed) = &scene.media[0] else {
        panic!("no packed fibres");
    };
    let dims = scene.media[0].cell_grid().unwrap().dims();
    let voxels = dims.as_u64vec3().element_product();
    let least = packed.octree().memory_bytes() + 30 * voxels;
    let refused = |max_bytes: u64| {
        let made = engine(&scene, &settings(1), EngineChoice::Processor, max_bytes);
        made.err()
    };
    let Some(KernelRefusal::Kernel(Refusal::Memory(needed, allowed))) = refused(least) else {
        panic!("{least} bytes suffice for {voxels} voxels");
    };
    assert!(allowed == least && needed > least, "{needed} {allowed}");
    assert_eq!(refused(2 * least), None);
}
