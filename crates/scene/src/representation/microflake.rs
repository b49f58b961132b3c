//! Micro-flakes: voxels whose fibres scatter as distributions of small flat
//! mirrors or diffusers.

use super::{Build, FittedOptics, Representation, Tracker, VoxelBuild, VoxelSource};
use crate::error::Result;
use crate::optics::albedo_for_colour;
use organza_basis::Rgb;
use organza_scatter::FlakeFamily;
use organza_transport::{AnyMedium, FlakeOctreeMedium};
use organza_volume::FibreFootprint;
use std::sync::Arc;

/// Micro-flakes.
pub static MICROFLAKE: Representation = Representation {
    name: "microflake",
    title: "micro-flakes",
    about: "Micro-flakes of the family that `flake` names",
    colour: [0x3b, 0x82, 0xc4],
    keys: &["flake"],
    trackers: &[Tracker::Kernel, Tracker::Woodcock, Tracker::Regular],
    drapes: true,
    is_ready: |_, _, _| true,
    check: |_, _, _| Ok(()),
    build: Build::Voxels(VoxelBuild {
        footprint: FibreFootprint::Covered,
        finest_level: |_, _| 0,
        medium,
    }),
    fitted: Some(&FittedOptics {
        roughness: "end_on_ratio",
        range: [0.01, 0.9],
        start: 0.1,
        colour: |heap| {
            let heap = Rgb::from(heap.map(|c| c as f32));
            let albedo = albedo_for_colour(heap).0.to_array();
            ("albedo", format!("{albedo:?}"))
        },
        replaced: &["gamma", "sin_power"],
    }),
};

fn medium(source: &VoxelSource<'_>) -> Result<Option<AnyMedium>> {
    let (octree, optics) = (Arc::clone(&source.octree), source.fabric.flake_optics());
    let family = source.settings.flake;
    let medium = if family == FlakeFamily::SGGX_TRANSMITTING {
        let fibres = source.fabric.clear_fibres(source.path)?;
        FlakeOctreeMedium::of_clear_fibres(octree, source.level, optics, fibres)
    } else {
        FlakeOctreeMedium::new(octree, source.level, optics, family)
    };
    Ok(medium.map(AnyMedium::FlakeOctree))
}
