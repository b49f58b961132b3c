//! The fibres of a voxel: what the octree provides and the scattering models use.

use crate::{Rgb, Sym3};
use glam::Vec3;

/// One population of fibres at a point: how much fibre there is, its direction, and how far
/// single fibres deviate from that.
///
/// The tangents of the population lie at a polar angle from `axis` that is
/// half-normal with deviation `spread_rad`, cut at 90 degrees, with uniform
/// azimuth [Schroeder2011]. An axis has no sign.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FibrePopulation {
    /// Fibre length per volume, mm per mm^3.
    pub length_density_per_mm2: f32,
    /// Unit mean axis.
    pub axis: Vec3,
    /// Deviation of the polar angle, radians; zero for parallel fibres.
    pub spread_rad: f32,
    /// Radius of the fibres.
    pub radius_mm: f32,
    /// Index into the cloth's table of materials.
    pub material: u16,
    /// Which yarn of the tile holds most of this population.
    pub yarn: u32,
}

impl FibrePopulation {
    /// Extinction of light that meets parallel fibres broadside, `2 r rho`:
    /// an upper bound of the extinction toward any direction, for any spread.
    pub fn broadside_per_mm(&self) -> f32 {
        2.0 * self.radius_mm * self.length_density_per_mm2
    }
}

/// The maximum number of populations in one voxel.
pub const MAX_POPULATIONS: usize = 4;

/// The populations at a point, at most [`MAX_POPULATIONS`], without allocation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Mixture {
    len: u8,
    populations: [FibrePopulation; MAX_POPULATIONS],
}

impl std::ops::Deref for Mixture {
    type Target = [FibrePopulation];

    fn deref(&self) -> &[FibrePopulation] {
        self.as_slice()
    }
}

impl Mixture {
    /// Nothing there.
    pub const EMPTY: Mixture = Mixture {
        len: 0,
        populations: [FibrePopulation {
            length_density_per_mm2: 0.0,
            axis: Vec3::Z,
            spread_rad: 0.0,
            radius_mm: 0.0,
            material: 0,
            yarn: 0,
        }; MAX_POPULATIONS],
    };

    /// Adds a population; `false` (and no change) when there is no room.
    pub fn push(&mut self, c: FibrePopulation) -> bool {
        let i = usize::from(self.len);
        if i == MAX_POPULATIONS {
            return false;
        }
        self.populations[i] = c;
        self.len += 1;
        true
    }

    /// The populations.
    pub fn as_slice(&self) -> &[FibrePopulation] {
        &self.populations[..usize::from(self.len)]
    }

    /// True when there is no fibre.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Sum of the broadside extinctions: a bound for every direction.
    pub fn broadside_per_mm(&self) -> f32 {
        self.as_slice()
            .iter()
            .map(FibrePopulation::broadside_per_mm)
            .sum()
    }
}

/// A mixture seen as one population of SGGX micro-flakes `[Heitz2015]`: what is
/// left of it for programs and files that know no more. Made by the scattering
/// model, in one place, so that files and pictures agree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MergedFlakes {
    /// Extinction at unit projected area, 1/mm; zero where there is no fibre.
    pub density_per_mm: f32,
    /// SGGX matrix at unit density, greatest eigenvalue at most one: the mean of
    /// the populations' matrices by extinction. The unit matrix without fibre.
    pub sggx: Sym3,
    /// Single-scattering albedo: the mean by extinction.
    pub albedo: Rgb,
    /// Unit mean axis of the population that blocks most; z without fibre.
    pub axis: Vec3,
    /// Spread of the same, radians.
    pub spread_rad: f32,
    /// Yarn of the same.
    pub yarn: u32,
    /// How many populations there are.
    pub populations: usize,
}

impl MergedFlakes {
    /// Nothing there.
    pub const EMPTY: MergedFlakes = MergedFlakes {
        density_per_mm: 0.0,
        sggx: Sym3::IDENTITY,
        albedo: Rgb::BLACK,
        axis: Vec3::Z,
        spread_rad: 0.0,
        yarn: 0,
        populations: 0,
    };
}
