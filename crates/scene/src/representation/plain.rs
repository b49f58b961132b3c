//! Virtual scattering, plain: an event is a point that scatters as a fibre seen
//! from a distance.

use super::{Build, Representation, Tracker, VoxelBuild, virtual_fibres};
use organza_transport::VirtualFibreEvent;
use organza_volume::FibreFootprint;

/// Virtual scattering, plain.
pub static PLAIN: Representation = Representation {
    name: "plain",
    title: "virtual scattering (plain)",
    about: "Virtual scattering off points, by the far field of fibres",
    colour: [0x8a, 0x7f, 0xd0],
    keys: &["local_visibility"],
    trackers: &[Tracker::Kernel, Tracker::Woodcock, Tracker::Regular],
    drapes: true,
    is_ready: |_, _, _| true,
    check: |fabric, path, _| fabric.fibre_models(path).map(|_| ()),
    build: Build::Voxels(VoxelBuild {
        footprint: FibreFootprint::Covered,
        finest_level: |_, _| 0,
        medium: |source| virtual_fibres::medium(source, VirtualFibreEvent::Plain),
    }),
    fitted: Some(&virtual_fibres::FITTED_FIBRES),
};
