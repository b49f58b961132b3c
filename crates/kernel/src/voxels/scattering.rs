//! What scatters in a medium in voxels, and so which walk lanes take.

use super::flake_tables::FlakeTables;
use crate::matter::Scatterers;
use organza_scatter::LaneEvent;

/// What scatters in a medium.
pub enum Scattering {
    /// Mirrors of the SGGX distribution.
    Mirrors,
    /// Diffuse flakes of the same.
    Diffuse,
    /// Micro-flakes of another family.
    Flakes(FlakeTables),
    /// Virtual fibres.
    Fibres,
}

impl Scattering {
    /// What is described, with the tables that lanes need.
    pub fn of(scatterers: Scatterers<'_>) -> Scattering {
        match scatterers {
            Scatterers::Flakes(flakes) => match flakes.lane_event() {
                LaneEvent::SggxMirrors => Scattering::Mirrors,
                LaneEvent::SggxDiffuse => Scattering::Diffuse,
                LaneEvent::OneByOne => Scattering::Flakes(FlakeTables::new(flakes)),
            },
            Scatterers::Fibres(_) => Scattering::Fibres,
        }
    }
}
