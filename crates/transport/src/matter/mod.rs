//! Matter: what light can meet, and how a ray finds where it is met.

pub(crate) mod any_medium;
pub(crate) mod collision;
pub(crate) mod draping;
pub(crate) mod explicit_fibre_site;
pub(crate) mod explicit_fibres;
pub(crate) mod flake_octree_medium;
pub(crate) mod grid;
pub(crate) mod grid_medium;
pub(crate) mod hybrid_fibres;
pub(crate) mod level_choice;
pub(crate) mod levelled_cloth;
pub(crate) mod local_visibility;
pub(crate) mod majorants;
pub(crate) mod measured_packing;
pub(crate) mod medium;
pub(crate) mod octree_medium;
pub(crate) mod packing;
pub(crate) mod plane;
pub(crate) mod plies;
pub(crate) mod ray_target;
pub(crate) mod sheet;
pub(crate) mod site;
pub(crate) mod tracking;
pub(crate) mod virtual_fibre_medium;
pub(crate) mod voxel_fibres;

pub use any_medium::AnyMedium;
pub use collision::Collision;
pub use draping::Draping;
pub use explicit_fibres::{ExplicitFibres, ExplicitFibresError, FibreHit};
pub use flake_octree_medium::{FlakeOctreeMedium, FlakeSite};
pub use grid::{Grid, GridMediumError, Interpolation, MAX_EXTINCTION_PER_MM};
pub use grid_medium::GridMedium;
pub use hybrid_fibres::HybridFibres;
pub use level_choice::{Detail, LevelSteps, Progress, Tracking};
pub use levelled_cloth::LevelledCloth;
pub use local_visibility::LocalVisibility;
pub use majorants::BlockMajorants;
pub use measured_packing::{PackingStudy, measure_packing};
pub use medium::Medium;
pub use octree_medium::{OctreeLevel, OctreeMedium, Scatterer};
pub use packing::PackingFactors;
pub use plies::{Plies, PliesError};
pub use tracking::{
    Integrator, exact_transmittance, sample_collision, sample_collision_exactly,
    stopped_transmittance, transmittance,
};
pub use virtual_fibre_medium::{
    VirtualFibreEvent, VirtualFibreMedium, VirtualFibreSite, VirtualFibres,
};
