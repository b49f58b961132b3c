//! What a laboratory found of a shade, by side.

use anyhow::Result;
use organza_measure::{
    KlemsBand, KlemsBasis, KlemsFileError, KlemsMatrix, Measured, SideShares, read_klems_parts,
};
use organza_work::of_file;
use std::path::Path;

/// What is known of light on one side.
#[derive(Clone, Copy, Debug, Default)]
pub struct Side {
    /// Of a beam along the normal: back, and through in all.
    pub reflected: Option<[f64; 3]>,
    pub through: Option<[f64; 3]>,
    /// Of evenly diffuse light.
    pub diffuse_reflected: Option<[f64; 3]>,
    pub diffuse_through: Option<[f64; 3]>,
}

/// What is known of a band.
#[derive(Clone, Debug)]
pub struct Target {
    pub basis: KlemsBasis,
    /// Face and back.
    pub sides: [Side; 2],
    /// Share of a beam along the normal that meets nothing.
    pub straight: Option<f64>,
}

impl Target {
    /// Reads a band of a WINDOW file; `None` if the file has nothing of it.
    ///
    /// # Errors
    /// Names the file and the place.
    pub fn read(text: &str, band: KlemsBand, path: &Path) -> Result<Option<Target>> {
        let fail = |e: &dyn std::fmt::Display| of_file(path, e);
        let parts = match read_klems_parts(text, band) {
            Err(KlemsFileError::Missing(_)) if band == KlemsBand::Solar => return Ok(None),
            other => other.map_err(|e| fail(&e))?,
        };
        let basis = parts.basis;
        let beam = |m: &Option<KlemsMatrix>| m.as_ref().map(|m| basis.hemispherical(m, 0));
        let diffuse = |m: &Option<KlemsMatrix>| m.as_ref().map(|m| basis.diffuse(m));
        let side = |k: usize| Side {
            reflected: beam(&parts.reflection[k]),
            through: beam(&parts.transmission[k]),
            diffuse_reflected: diffuse(&parts.reflection[k]),
            diffuse_through: diffuse(&parts.transmission[k]),
        };
        let straight = parts.transmission.iter().flatten();
        let straight: Vec<f64> = straight.map(|m| mean(basis.straight(m))).collect();
        let count = straight.len();
        let target = Target {
            basis,
            sides: [side(0), side(1)],
            straight: (count > 0).then(|| straight.iter().sum::<f64>() / count as f64),
        };
        let is_empty = target.equations().is_empty();
        match (is_empty, band) {
            (true, KlemsBand::Solar) => Ok(None),
            (true, _) => Err(fail(&"has no matrix of light")),
            _ => Ok(Some(target)),
        }
    }

    /// What a cloth must fulfil beside the straight light: one for each channel of a beam that
    /// comes back or passes scattered.
    pub fn equations(&self) -> Vec<Equation> {
        let mut list = Vec::new();
        let straight = self.straight.unwrap_or(0.0);
        for (side, known) in self.sides.iter().enumerate() {
            for channel in 0..3 {
                let mut add = |is_reflected, value: Option<f64>| {
                    list.extend(value.map(|value| Equation {
                        side,
                        channel,
                        is_reflected,
                        value: value.max(0.0),
                    }));
                };
                add(true, known.reflected.map(|v| v[channel]));
                add(false, known.through.map(|v| v[channel] - straight));
            }
        }
        list
    }
}

/// One value that a cloth must have.
#[derive(Clone, Copy, Debug)]
pub struct Equation {
    side: usize,
    channel: usize,
    is_reflected: bool,
    value: f64,
}

impl Equation {
    /// How far it is off, in hundredths of the value; small values matter less.
    pub fn residual(&self, seen: &Seen) -> f64 {
        (self.found(seen).mean[self.channel] - self.value) / self.unit()
    }

    /// Standard error of the residual.
    pub fn noise(&self, seen: &Seen) -> f64 {
        self.found(seen).se[self.channel] / self.unit()
    }

    fn found(&self, seen: &Seen) -> Measured {
        let shares = &seen[self.side][0];
        match self.is_reflected {
            true => shares.reflected,
            false => shares.scattered,
        }
    }

    fn unit(&self) -> f64 {
        0.01 * (self.value + LITTLE)
    }

    /// Its channel.
    pub fn channel(&self) -> usize {
        self.channel
    }
}

/// A share of light that hardly matters.
const LITTLE: f64 = 0.005;

/// What a cloth does with light: face and back, a beam and diffuse light.
pub type Seen = [[SideShares; 2]; 2];

/// The mean of the channels.
pub fn mean(colour: [f64; 3]) -> f64 {
    colour.iter().sum::<f64>() / 3.0
}

/// Share of a beam that meets nothing, of both sides, with its standard error.
pub fn straight_of(seen: &Seen) -> [f64; 2] {
    let of = |side: usize| seen[side][0].straight;
    let value = 0.5 * (of(0).mean[0] + of(1).mean[0]);
    [value, 0.5 * of(0).se[0].hypot(of(1).se[0])]
}

/// All numbers of what was seen, for a journal.
pub fn to_numbers(seen: &Seen) -> Vec<f64> {
    let parts = seen.iter().flatten();
    let parts = parts.flat_map(|s| [s.straight, s.scattered, s.through, s.reflected]);
    parts.flat_map(|m| [m.mean, m.se]).flatten().collect()
}

/// How many they are.
pub const NUMBERS: usize = 2 * 2 * 4 * 2 * 3;

/// The inverse of [`to_numbers`].
pub fn from_numbers(list: &[f64]) -> Seen {
    let three = |at: usize| std::array::from_fn(|c| list[at + c]);
    let measured = |at: usize| Measured::new(three(at), three(at + 3));
    let shares = |at: usize| SideShares {
        straight: measured(at),
        scattered: measured(at + 6),
        through: measured(at + 12),
        reflected: measured(at + 18),
    };
    [[shares(0), shares(24)], [shares(48), shares(72)]]
}
