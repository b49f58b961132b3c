//! What helps to tell fibres from noise.

use organza_film::Film;

/// Pictures of what is seen, in the places that the library has for the albedo and the normal
/// of surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct Guides {
    /// From 0 to 1.
    pub albedo: Vec<[f32; 3]>,
    /// From -1 to 1.
    pub normal: Vec<[f32; 3]>,
}

impl Guides {
    /// The guides of a render: its mean number n of scattering events, as n / (1 + n), stands
    /// for the albedo, and the main direction of the fibres met first, times the share of
    /// samples that met any, for the normal.
    pub fn of_film(film: &Film) -> Guides {
        let pixels = film.pixels().iter();
        let (albedo, normal) = pixels
            .map(|p| {
                let events = p.mean_bounces() as f32;
                let met = 1.0 - p.straight_through();
                let direction = p.tangent() * met;
                ([events / (1.0 + events); 3], direction.to_array())
            })
            .unzip();
        Guides { albedo, normal }
    }
}
