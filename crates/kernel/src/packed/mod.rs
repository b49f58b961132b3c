//! Packed fibres: voxels that say where the axes of fibres are, and rays through them
//! that meet the surfaces of virtual fibres ([`organza_scatter::PackedEvent`]).
//!
//! A tentative collision draws where across its width a fibre would be met, looks the
//! population up at the axis that this fibre would have, and takes it in proportion to its
//! extinction, as the general walk does. The event is that of an explicit fibre
//! ([`crate::fibres`]) with the tangent of the population: light scatters in the near
//! field, and the path goes on from the surface. So the walk of waves, its lights and its
//! events are those of explicit fibres, and a path may change from the one to the other.

mod axis_code;
pub(crate) mod fibre_volume;
pub(crate) mod flight;
mod lay_out;
pub(crate) mod meeting;
mod switch;
pub(crate) mod volume_ray;

pub use fibre_volume::FibreVolume;
pub use lay_out::{ExpectedFibre, PackedVoxels};
pub(crate) use switch::PackedPart;
pub use switch::Switch;
