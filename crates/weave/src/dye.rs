//! Which material each piece of a thread has: one, shells of a ring dye, or a blend.

use crate::Error;
use crate::yarn::Yarn;
use organza_basis::{PathRng, Rgb};

/// Shells of equal thickness in which the colour of a ring-dyed yarn is constant.
const SHELLS: usize = 8;
/// Half the width over which ring dye fades, as a share of the yarn's radius (estimated).
const FADE: f64 = 0.2;
/// Colour of undyed thread.
const UNDYED: Rgb = Rgb::new(0.8, 0.8, 0.8);

/// The materials of one thread.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Dye {
    /// All fibres alike.
    Even(u16),
    /// By distance from the yarn's centre, from the core outwards.
    Ring([u16; SHELLS]),
    /// By fibre: the share of all fibres up to each material, and the material.
    Blend(Vec<(f64, u16)>),
}

impl Dye {
    /// The dye of a thread of some colour. `index` gives the material of a colour.
    pub fn new(
        yarn: &Yarn,
        colour: Option<Rgb>,
        index: &mut dyn FnMut(Option<Rgb>) -> Result<u16, Error>,
    ) -> Result<Dye, Error> {
        if let Some(ring) = yarn.ring_dye {
            let outer = colour.unwrap_or(UNDYED);
            let mut shells = [0; SHELLS];
            for (i, shell) in shells.iter_mut().enumerate() {
                let radius = (i as f64 + 0.5) / SHELLS as f64;
                let dyed = smooth_step((radius - (1.0 - ring.depth) + FADE) / (2.0 * FADE)) as f32;
                let mixed = ring.core_colour.0.lerp(outer.0, dyed);
                *shell = index(Some(Rgb(mixed)))?;
            }
            return Ok(Dye::Ring(shells));
        }
        if yarn.blend.is_empty() {
            return Ok(Dye::Even(index(colour)?));
        }
        let sum: f64 = yarn.blend.iter().map(|part| part.share).sum();
        let mut up_to = 0.0;
        let parts = yarn.blend.iter().map(|part| {
            up_to += part.share / sum;
            Ok((up_to, index(part.colour.or(colour))?))
        });
        Ok(Dye::Blend(parts.collect::<Result<_, Error>>()?))
    }

    /// The material that stands for the thread: its outermost, or the first of a blend.
    pub fn main(&self) -> u16 {
        match self {
            Dye::Even(material) => *material,
            Dye::Ring(shells) => shells[SHELLS - 1],
            Dye::Blend(parts) => parts[0].1,
        }
    }

    /// The dye of one fibre.
    pub fn of_fibre(&self, rng: &mut PathRng) -> FibreDye {
        match self {
            Dye::Even(material) => FibreDye::Even(*material),
            Dye::Ring(shells) => FibreDye::Ring(*shells),
            Dye::Blend(parts) => {
                let u = f64::from(rng.unit());
                let part = parts.iter().find(|part| u < part.0);
                FibreDye::Even(part.map_or(self.main(), |part| part.1))
            }
        }
    }
}

/// The materials of one fibre.
#[derive(Clone, Copy, Debug)]
pub(crate) enum FibreDye {
    Even(u16),
    Ring([u16; SHELLS]),
}

impl FibreDye {
    /// The material at a distance from the yarn's centre, as a share of its radius.
    pub fn at(&self, radius_share: impl FnOnce() -> f64) -> u16 {
        match self {
            FibreDye::Even(material) => *material,
            FibreDye::Ring(shells) => {
                let shell = (radius_share() * SHELLS as f64) as usize;
                shells[shell.min(SHELLS - 1)]
            }
        }
    }
}

fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}
