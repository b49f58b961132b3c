//! The near field of fibres: light met at a known offset, of one path or of many at once.
//!
//! - [`frame`], [`crossing`]: directions about a fibre; ray optics of a round one.
//! - [`parts`], [`optics`], [`section_lobes`]: the numbers of a fibre; tables of them.
//! - [`event`]: what light does.

pub mod crossing;
pub mod event;
pub mod frame;
pub mod optics;
pub mod parts;
mod section_lobes;

pub use event::Event;
pub use frame::Frame;
pub use optics::Optics;

/// Lobes kept apart: R, TT, TRT and the sum of the rest.
pub const LOBES: usize = 4;
