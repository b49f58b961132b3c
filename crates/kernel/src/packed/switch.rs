//! When a path changes from explicit fibres to packed ones.

use super::fibre_volume::FibreVolume;

/// The events that happen among explicit fibres; those after them are with packed ones. A
/// path changes where it leaves a fibre, and never back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switch {
    /// So many events at least are with explicit fibres.
    pub first_events: u32,
    /// Events are with explicit fibres as long as the mean of the channels of the path's
    /// throughput is at least this; infinity leaves it to the number of events.
    pub while_weight: f32,
}

impl Switch {
    /// Packed fibres from the camera on.
    pub const AT_ONCE: Switch = Switch {
        first_events: 0,
        while_weight: f32::INFINITY,
    };

    /// Whether a path of so many events that carries so much goes on among packed fibres.
    #[inline]
    pub fn is_over(&self, events: u32, mean_throughput: f32) -> bool {
        events >= self.first_events && mean_throughput < self.while_weight
    }
}

/// Packed fibres, and when paths change to them.
pub struct PackedPart {
    pub volume: FibreVolume,
    pub switch: Switch,
    /// A fault: paths go on from where they came in.
    pub starts_at_entry: bool,
}
