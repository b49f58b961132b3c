//! Light that leaves a ply after more than one event, by the place of the circumference.

use organza_basis::Rgb;
use std::f32::consts::TAU;

/// Cells of the place where light leaves.
pub const PLACES: usize = 24;

/// What leaves, by the place.
#[derive(Clone, Debug, Default)]
pub struct Sent(pub [Rgb; PLACES]);

impl Sent {
    /// Whether a place is on the side away from where light came in.
    fn is_through(place: usize) -> bool {
        (TAU * (place as f32 + 0.5) / PLACES as f32).cos() > 0.0
    }

    /// The same from every place.
    #[cfg(test)]
    pub fn even(colour: Rgb) -> Sent {
        Sent([colour; PLACES])
    }

    /// From all places.
    pub fn total(&self) -> Rgb {
        self.0.iter().fold(Rgb::BLACK, |sum, &sent| sum + sent)
    }

    /// From the side away from where light came in.
    pub fn through(&self) -> Rgb {
        let places = (0..PLACES).filter(|&place| Sent::is_through(place));
        places.fold(Rgb::BLACK, |sum, place| sum + self.0[place])
    }

    /// Multiplies by factors that depend on the side: `true` is away from where light came in.
    pub fn scale(&mut self, factor: impl Fn(bool) -> Rgb) {
        for (place, sent) in self.0.iter_mut().enumerate() {
            *sent *= factor(Sent::is_through(place));
        }
    }
}
