//! Matter: what light can meet, and how a ray finds where it is met.

pub(crate) mod any_medium;
pub(crate) mod cloth_medium;
pub(crate) mod collision;
pub(crate) mod detail;
pub(crate) mod draping;
pub(crate) mod explicit_fibres;
pub(crate) mod fibre_medium;
pub(crate) mod flake_medium;
pub(crate) mod grid_medium;
pub(crate) mod levelled_cloth;
pub(crate) mod local_visibility;
pub(crate) mod medium;
pub(crate) mod plane;
pub(crate) mod sheet;
pub(crate) mod tracking;
pub(crate) mod voxel_bounds;
pub(crate) mod voxel_fibres;

pub use any_medium::AnyMedium;
pub use cloth_medium::ClothMedium;
pub use collision::Collision;
pub use detail::{Detail, LevelSteps, Tracking};
pub use draping::Draping;
pub use explicit_fibres::{ExplicitFibres, ExplicitFibresError, FibreHit, Overlap};
pub use fibre_medium::{FibreEvent, FibreMedium, FibreSite};
pub use flake_medium::{FlakeMedium, FlakeSite};
pub use grid_medium::{Grid, GridMedium, GridMediumError, Interpolation};
pub use levelled_cloth::LevelledCloth;
pub use local_visibility::LocalVisibility;
pub use medium::Medium;
pub use plane::Plane;
pub use tracking::{
    Integrator, exact_transmittance, sample_collision, sample_collision_exactly,
    stopped_transmittance, transmittance,
};
