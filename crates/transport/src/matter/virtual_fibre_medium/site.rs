//! What a look-up in a medium of virtual fibres gives.

use glam::Vec3;
use organza_basis::FibrePopulation;
use organza_scatter::NearEvent;
use std::ops::Range;

/// What lies where a ray may collide, or did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualFibreSite {
    /// Places of the populations, from the first to before the last.
    pub(super) places: [u32; 2],
    /// Where across its width the virtual fibre is met, in `[-1, 1]`.
    pub(super) offset: f32,
    /// The yarn that the ray leaves.
    pub(super) left_yarn: Option<u32>,
    /// The fibre, of a real collision.
    pub(super) met: Option<Met>,
}

impl VirtualFibreSite {
    pub(super) fn new(places: Range<u32>, offset: f32, left_yarn: Option<u32>) -> VirtualFibreSite {
        VirtualFibreSite {
            places: [places.start, places.end],
            offset,
            left_yarn,
            met: None,
        }
    }
}

/// The fibre of a real collision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Met {
    /// Its population.
    pub population: FibrePopulation,
    /// Its unit tangent.
    pub tangent: Vec3,
    /// How, of a packed fibre.
    pub near: Option<NearEvent>,
}
