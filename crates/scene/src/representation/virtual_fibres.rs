//! What the two kinds of virtual scattering share: voxels whose fibres scatter as
//! fibres.

use super::{FittedOptics, VoxelSource};
use crate::error::{InputError, Result};
use organza_transport::{
    AnyMedium, HybridFibres, LocalVisibility, VirtualFibreEvent, VirtualFibreMedium,
};
use std::sync::Arc;

/// The optics of fibres that a fit changes.
pub(super) static FITTED_FIBRES: FittedOptics = FittedOptics {
    roughness: "longitudinal_deg",
    range: [1.0, 30.0],
    start: 6.0,
    colour: |heap| ("colour", format!("{heap:?}")),
    replaced: &["absorption_per_mm", "fitted", "model"],
};

/// Voxels as a medium of virtual fibres.
pub(super) fn medium(
    source: &VoxelSource<'_>,
    event: VirtualFibreEvent,
) -> Result<Option<AnyMedium>> {
    let VoxelSource {
        fabric,
        path,
        octree,
        level,
        ..
    } = source;
    let fibres = fabric.fibre_models(path)?;
    let Some(medium) = VirtualFibreMedium::new(Arc::clone(octree), *level, fibres, event) else {
        return Ok(None);
    };
    let own_switch = source.settings.packed_from.switch();
    if let Some(switch) = own_switch.filter(|_| event == VirtualFibreEvent::Packed) {
        let explicit = fabric.explicit_fibres(path, source.max_memory_bytes, source.loader)?;
        let hybrid = HybridFibres::new(explicit, medium, switch);
        let hybrid = hybrid.ok_or_else(|| {
            InputError::of_file(
                path,
                "first_events and while_weight need the cloth in its own size",
            )
        })?;
        return Ok(Some(AnyMedium::HybridFibres(Box::new(hybrid))));
    }
    if !source.settings.local_visibility {
        return Ok(Some(AnyMedium::VirtualFibres(medium)));
    }
    let (corner_mm, voxel_mm) = (octree.bounds_mm().min, octree.voxel_mm(*level));
    let fibres = fabric.explicit_fibres(path, source.max_memory_bytes, source.loader)?;
    let (materials, seed) = (octree.material_count(), fabric.file.seed);
    let local = LocalVisibility::count(&fibres, materials, corner_mm, voxel_mm, seed)
        .map_err(|e| InputError::of_file(path, e))?;
    Ok(Some(AnyMedium::VirtualFibres(
        medium.with_local_visibility(local),
    )))
}
