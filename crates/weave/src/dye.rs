//! Which material each piece of a thread has: one, shells of a ring dye, or a blend.

use crate::Error;
use crate::blend::FibrePart;
use crate::yarn::Yarn;
use organza_basis::{PathRng, Rgb, mix64};

/// Shells of equal thickness in which the colour of a ring-dyed yarn is constant.
const SHELLS: usize = 8;
/// Half the width over which ring dye fades, as a share of the yarn's radius (estimated).
const FADE: f64 = 0.2;
/// Colour of undyed thread.
pub(crate) const UNDYED: Rgb = Rgb::new(0.8, 0.8, 0.8);

/// Gives the index of the material of a colour, and of a part of a blend of materials.
pub(crate) type IndexOf<'a> = dyn FnMut(Option<Rgb>, Option<&FibrePart>) -> Result<u16, Error> + 'a;

/// The materials of one thread.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Dye {
    fibres: Colouring,
    /// Those of neps that have colours of their own, alike in number.
    neps: Vec<u16>,
}

/// The materials of the fibres of a thread.
#[derive(Clone, Debug, PartialEq)]
enum Colouring {
    /// All fibres alike.
    Even(u16),
    /// By distance from the yarn's centre, from the core outwards.
    Ring([u16; SHELLS]),
    /// By fibre: the share of all fibres up to each part of the blend, and its material.
    Blend(Vec<(f64, u16)>),
}

impl Dye {
    /// One material for everything.
    pub fn even(material: u16) -> Dye {
        Dye {
            fibres: Colouring::Even(material),
            neps: Vec::new(),
        }
    }

    /// The dye of a thread of some colour. `index` gets the part of the blend only if the parts
    /// differ by more than colour.
    pub fn new(yarn: &Yarn, colour: Option<Rgb>, index: &mut IndexOf<'_>) -> Result<Dye, Error> {
        let fibres = Colouring::new(yarn, colour, index)?;
        let neps = yarn.neps.iter().flat_map(|n| &n.colours);
        let neps = neps.map(|colour| index(Some(*colour), None));
        Ok(Dye {
            fibres,
            neps: neps.collect::<Result<_, Error>>()?,
        })
    }

    /// The material of a nep at random; `None` for that of any fibre of the yarn.
    pub fn of_nep(&self, rng: &mut PathRng) -> Option<u16> {
        let count = self.neps.len() as u32;
        (count > 0).then(|| self.neps[rng.below(count) as usize])
    }

    /// The material that stands for the thread: its outermost, or the first of a blend.
    pub fn main(&self) -> u16 {
        match &self.fibres {
            Colouring::Even(material) => *material,
            Colouring::Ring(shells) => shells[SHELLS - 1],
            Colouring::Blend(parts) => parts[0].1,
        }
    }

    /// The dye of the fibres of a part of the blend.
    pub fn of_part(&self, part: usize) -> FibreDye {
        match &self.fibres {
            Colouring::Blend(parts) => FibreDye::Even(parts[part].1),
            Colouring::Even(material) => FibreDye::Even(*material),
            Colouring::Ring(shells) => FibreDye::Ring(*shells),
        }
    }

    /// The material of a random number from 0 to 1.
    fn drawn(&self, u: f64) -> u16 {
        match &self.fibres {
            Colouring::Blend(parts) => {
                let part = parts.iter().find(|part| u < part.0);
                part.map_or(self.main(), |part| part.1)
            }
            _ => self.main(),
        }
    }

    /// The dye of one fibre at random.
    pub fn of_fibre(&self, rng: &mut PathRng) -> FibreDye {
        match &self.fibres {
            Colouring::Even(material) => FibreDye::Even(*material),
            Colouring::Ring(shells) => FibreDye::Ring(*shells),
            Colouring::Blend(_) => FibreDye::Even(self.drawn(f64::from(rng.unit()))),
        }
    }
}

impl Colouring {
    fn new(yarn: &Yarn, colour: Option<Rgb>, index: &mut IndexOf<'_>) -> Result<Colouring, Error> {
        if let Some(ring) = yarn.ring_dye {
            let outer = colour.unwrap_or(UNDYED);
            let mut shells = [0; SHELLS];
            for (i, shell) in shells.iter_mut().enumerate() {
                let radius = (i as f64 + 0.5) / SHELLS as f64;
                let dyed = smooth_step((radius - (1.0 - ring.depth) + FADE) / (2.0 * FADE)) as f32;
                let mixed = ring.core_colour.0.lerp(outer.0, dyed);
                *shell = index(Some(Rgb(mixed)), None)?;
            }
            return Ok(Colouring::Ring(shells));
        }
        if yarn.blend.is_empty() {
            return Ok(Colouring::Even(index(colour, None)?));
        }
        let mut up_to = 0.0;
        let parts = yarn.blend.iter().map(|part| {
            up_to += part.share;
            let of_its_own = yarn.blends_materials.then_some(part);
            Ok((up_to, index(part.colour.or(colour), of_its_own)?))
        });
        Ok(Colouring::Blend(parts.collect::<Result<_, Error>>()?))
    }
}

/// The materials of one fibre.
#[derive(Clone, Copy, Debug)]
pub(crate) enum FibreDye {
    Even(u16),
    Ring([u16; SHELLS]),
}

/// The tufts of a blend that a fibre runs through, one after the other.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TuftsOfFibre {
    /// Names the tufts; all fibres that lie in them have the same name.
    pub name: u64,
    /// How many there are along the fibre, which is closed, and where the first one begins, in
    /// their lengths.
    pub count: u32,
    pub start: f64,
}

impl TuftsOfFibre {
    /// The material at a share of all windings of the fibre; `dye` is that of the thread.
    pub fn at(&self, dye: &Dye, run: f64) -> u16 {
        let place = (run * f64::from(self.count) + self.start).floor() as i64;
        let tuft = place.rem_euclid(i64::from(self.count)) as u64;
        let bits = mix64(self.name ^ mix64(tuft));
        dye.drawn(unit_of(bits))
    }
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

/// A number from 0 to 1 of random bits.
pub(crate) fn unit_of(bits: u64) -> f64 {
    (bits >> 11) as f64 * 2f64.powi(-53)
}

fn smooth_step(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}
