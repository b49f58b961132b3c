//! Virtual goniometer over a patch of cloth.
//!
//! A [`PatchResponse`] answers two questions about a patch, whatever stands
//! behind it: what it sends from one direction into another, and where the
//! light from one direction ends up. [`VolumePatch`] traces paths through
//! media, [`SurfacePatch`] evaluates a reflectance model. [`measure_pairs`] and
//! [`measure_albedos`] turn the answers into means with standard errors.
//!
//! # Conventions
//! Directions are unit vectors that point away from the cloth, in the fabric
//! frame: x weft, y warp, z out of the face. A pair whose directions lie on
//! one side is reflection, on two sides transmission; the light may come from
//! behind. The BSDF is `L_o / (E_perp |cos theta_i|)`, 1/sr, and leaves out
//! what goes straight through, which is no function of direction but a share:
//! [`Energy::direct`].
//!
//! # Determinism
//! The random numbers of a path are named by seed, pair and index. Paths are
//! added in order, in chunks of fixed size.

mod goniometer;
mod layout;
mod pairs;
mod patch;
mod surface_patch;
mod table;
mod volume_patch;

pub use goniometer::{
    Albedo, Effort, MeasureError, Measured, PairValue, Told, measure_albedos, measure_openness,
    measure_pairs,
};
pub use layout::{irawan_incident, irawan_layout};
pub use pairs::{
    Angles, Pair, PairsError, PairsErrorKind, distinct_incident, parse_incident, parse_pairs,
};
pub use patch::{Energy, PatchResponse};
pub use surface_patch::SurfacePatch;
pub use table::{write_albedos, write_pairs};
pub use volume_patch::{PatchError, VolumePatch};
