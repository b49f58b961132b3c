//! Virtual scattering, packed: an event is at the surface of a fibre that stands
//! among others.

use super::{Build, Representation, Tracker, VoxelBuild, virtual_fibres};
use organza_transport::VirtualFibreEvent;
use organza_volume::{FibreFootprint, Octree};
use organza_weave::Material;

/// Edge of the voxels, in fibre radii, that suits packed fibres best: finer ones
/// count chance clusters twice, coarser ones blur the outline of yarns and hide light
/// that leaves it.
const VOXEL_RADII: f32 = 1.0;

/// Virtual scattering, packed.
pub static PACKED: Representation = Representation {
    name: "packed",
    title: "virtual scattering (packed)",
    about: "Virtual scattering off the surfaces of fibres among others",
    colour: [0x1f, 0x9e, 0x77],
    keys: &["local_visibility", "first_events", "while_weight"],
    trackers: &[Tracker::Woodcock],
    drapes: true,
    is_ready: |_, _, _| true,
    check: |fabric, path, _| fabric.fibre_models(path).map(|_| ()),
    build: Build::Voxels(VoxelBuild {
        footprint: FibreFootprint::Axis,
        finest_level,
        medium: |source| virtual_fibres::medium(source, VirtualFibreEvent::Packed),
    }),
    fitted: Some(&virtual_fibres::FITTED_FIBRES),
};

fn finest_level(octree: &Octree, materials: &[Material]) -> u8 {
    let radii: f32 = materials.iter().map(|m| m.fibre_radius_mm).sum();
    let wanted_mm = VOXEL_RADII * radii / materials.len().max(1) as f32;
    let off = |l: &u8| (octree.voxel_mm(*l).max_element() / wanted_mm).ln().abs();
    (0..octree.level_count())
        .min_by(|a, b| off(a).total_cmp(&off(b)))
        .unwrap_or(0)
}
