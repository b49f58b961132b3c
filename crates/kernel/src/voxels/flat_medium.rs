//! Matter laid out for lanes: [two words](super::voxel_words) a voxel.
//!
//! # Several populations
//! Where no voxel has more than one population of fibres, the words of voxel i
//! stand at place i. Elsewhere a voxel holds the number of its populations less
//! one (2 bits) and the place of the first. Populations superpose: a tentative
//! collision picks one with equal chances and takes it with probability (number
//! x own extinction / majorant), which in sum is the extinction of all over the
//! majorant. Everything after is with that one alone, as a collision with the
//! mixture is with one of its fibres.
//!
//! # Reach
//! Every voxel knows a bound on the extinction in all voxels at most so many
//! steps away, along axes or diagonals. A flight begins at that bound and goes
//! on at the greatest one behind the border: exact, since flights have no
//! memory. In air far from yarns the bound is zero and the flight begins with a
//! jump; where density varies inside yarns it is the density nearby.

use super::blocks::Blocks;
use super::fibre_tables::{WIDE_RAD, area_squared, end_on_ratio};
use super::flake_tables::FlakeTables;
use super::population_tables::populations;
use super::scattering::Scattering;
use super::voxel_words::{VoxelWords, WORDS};
use crate::matter::NO_YARN;
use glam::Vec3;
use organza_basis::CellGrid;
use organza_film::{FirstEvent, SiteInfo};
use organza_lanes::{Floats, Ints, V3, one, vector_of};
use std::sync::Arc;

/// The index of no population.
pub const NO_POPULATION: u32 = u32::MAX;

/// Bits of the place of a voxel's first population.
pub const PLACE_BITS: u32 = 29;

/// A medium laid out for lanes.
pub struct FlatMedium {
    pub cell_grid: CellGrid,
    /// The blocks of a cloth of blocks, of which the grid is that of one. Voxels are counted
    /// through all blocks.
    pub blocks: Option<Arc<Blocks>>,
    /// The words of every population, or of a voxel without any.
    pub words: Vec<u32>,
    /// Where the populations of every voxel stand, and how many they are; empty
    /// where each has its own place.
    pub places: Vec<u32>,
    /// Which substance every population has; empty where there is one.
    pub materials: Vec<u32>,
    /// Of flakes red, green, blue of the albedo as bits of `f32` and the material, of fibres
    /// the material and three words unused.
    pub substances: Vec<u32>,
    /// Of every population; empty where no yarns are known.
    pub yarns: Vec<u32>,
    /// Of every population, the densest in its voxel, which stands for all in
    /// pictures; empty where each has its own place.
    pub densest: Vec<u32>,
    /// What shares are of, 1/mm: [`MOST`] of it is the majorant.
    pub scale_per_mm: f32,
    pub scattering: Scattering,
}

impl FlatMedium {
    /// Its micro-flakes, when they are not of the SGGX distribution alone.
    pub fn flakes(&self) -> Option<&FlakeTables> {
        match &self.scattering {
            Scattering::Flakes(flakes) => Some(flakes),
            _ => None,
        }
    }

    /// The substances of the populations at these places.
    #[inline(always)]
    pub fn substance_at<U: Ints>(&self, place: U) -> U {
        if self.materials.is_empty() {
            U::splat(0)
        } else {
            place.gather(&self.materials)
        }
    }

    /// Albedos of the micro-flakes at these places.
    #[inline(always)]
    pub fn albedo_at<F: Floats>(&self, place: F::Ints) -> V3<F> {
        if self.materials.is_empty() {
            return V3::splat(self.only_albedo());
        }
        let first = place.gather(&self.materials).shl::<2>();
        vector_of(&self.substances, first, 0)
    }

    /// Materials of the micro-flakes at these places.
    #[inline(always)]
    pub fn material_at<U: Ints>(&self, place: U) -> U {
        let first = self.substance_at(place).shl::<2>();
        (first + U::splat(3)).gather(&self.substances)
    }

    /// The materials of its fibres, in the order of their numbers.
    pub fn fibres(&self) -> impl Iterator<Item = usize> {
        self.substances
            .chunks_exact(4)
            .map(|words| words[0] as usize)
    }

    /// Share of the extinction that fibres cause which point nearly all ways.
    pub fn wide_share(&self) -> f32 {
        let limit = end_on_ratio(WIDE_RAD);
        let (mut all, mut wide) = (0.0, 0.0);
        for words in self.words.chunks_exact(WORDS) {
            let voxel = VoxelWords([words[0], words[1]].map(<one::U as Ints>::splat));
            let dense = f64::from(voxel.broadside().0);
            all += dense;
            wide += if voxel.end_on().0 > limit { dense } else { 0.0 };
        }
        if all > 0.0 { (wide / all) as f32 } else { 0.0 }
    }

    /// Mean optical depth across its box along z, of light from everywhere, and the mean
    /// relative variance of the weights of tangents in its populations of fibres.
    pub fn thickness_and_variance(&self) -> (f64, f64) {
        /// Mean over directions of what parallel fibres show.
        const MEAN_AREA: f64 = std::f64::consts::FRAC_PI_4;
        let tables = populations();
        let (mut all, mut varied) = (0.0, 0.0);
        for voxel in 0..self.voxel_count() {
            let (first, count) = self.place(voxel);
            for place in first..first + count {
                let words = self.words_at(place);
                let dense = f64::from(words.broadside().0) / count as f64;
                all += dense;
                if dense > 0.0 {
                    varied += dense * tables.variance(words.end_on_code().0);
                }
            }
        }
        let dims = self.cell_grid.dims();
        let columns = self.voxel_count() as f64 / f64::from(dims.z);
        let voxel_mm = f64::from(self.cell_grid.voxel_mm().z);
        let depth = all * MEAN_AREA * f64::from(self.scale_per_mm) * voxel_mm / columns;
        (depth, if all > 0.0 { varied / all } else { 0.0 })
    }

    /// Bytes that a medium with so many voxels takes at the least, all working
    /// space while it is built included.
    pub fn min_bytes(voxels: u64) -> u64 {
        28 * voxels
    }

    /// Number of voxels, of all blocks together.
    pub fn voxel_count(&self) -> usize {
        let blocks = self.blocks.as_ref().map_or(1, |b| b.count());
        blocks * self.cell_grid.dims().as_usizevec3().element_product()
    }

    /// The albedo of all, where there is one.
    pub fn only_albedo(&self) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|i| f32::from_bits(self.substances[i])))
    }

    /// The place of the first population of a voxel, and how many it has; one
    /// where it has none.
    pub fn place(&self, voxel: usize) -> (usize, usize) {
        self.places.get(voxel).map_or((voxel, 1), |&place| {
            let first = place & ((1 << PLACE_BITS) - 1);
            (first as usize, (place >> PLACE_BITS) as usize + 1)
        })
    }

    /// The populations of a voxel, as stored.
    pub fn populations_of(&self, voxel: usize) -> impl Iterator<Item = StoredPopulation<'_>> {
        let (first, count) = self.place(voxel);
        let stored = (first..first + count).map(move |i| self.stored(i, count as f32));
        stored.filter(|p| p.broadside_per_mm > 0.0)
    }

    /// Extinction of a voxel toward `w`, 1/mm; `None` beyond the last.
    pub fn extinction_per_mm(&self, voxel: usize, w: Vec3) -> Option<f32> {
        let voxels = self.voxel_count();
        let own = || self.populations_of(voxel).map(|p| p.extinction_per_mm(w));
        (voxel < voxels).then(|| own().sum())
    }

    /// The words at a place.
    pub fn words_at(&self, place: usize) -> VoxelWords<one::U> {
        let words = &self.words[WORDS * place..][..WORDS];
        VoxelWords([words[0], words[1]].map(<one::U as Ints>::splat))
    }

    /// A population as stored; `shared_by` is the number in its voxel.
    fn stored(&self, place: usize, shared_by: f32) -> StoredPopulation<'_> {
        let words = self.words_at(place);
        if self.words[WORDS * place] >> 16 == 0 {
            return StoredPopulation {
                scaled_axis: Vec3::ZERO,
                end_on: 1.0,
                end_on_code: 0,
                broadside_per_mm: 0.0,
                scattering: &self.scattering,
            };
        }
        let (axis, end_on) = (words.axis(), words.end_on().0);
        let length = (1.0 - end_on * end_on).max(0.0).sqrt();
        StoredPopulation {
            scaled_axis: length * Vec3::new(axis.x.0, axis.y.0, axis.z.0).normalize(),
            end_on,
            end_on_code: words.end_on_code().0,
            broadside_per_mm: words.broadside().0 * self.scale_per_mm / shared_by,
            scattering: &self.scattering,
        }
    }

    /// What a film notes of a path's first population, if it met one.
    pub fn first_event(&self, place: u32, depth_mm: f32) -> Option<FirstEvent> {
        if place == NO_POPULATION {
            return None;
        }
        let shown = self.densest.get(place as usize).map_or(place, |&i| i) as usize;
        let yarn = self.yarns.get(shown).copied();
        let axis = self.words_at(shown).axis();
        Some(FirstEvent {
            info: SiteInfo {
                axis: Vec3::new(axis.x.0, axis.y.0, axis.z.0).normalize(),
                yarn: yarn.filter(|&y| y != NO_YARN),
            },
            depth_mm: f64::from(depth_mm),
        })
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        let matter = self.words.len() + self.places.len() + self.materials.len();
        let noted = self.substances.len() + self.yarns.len() + self.densest.len();
        let areas = self.flakes().map_or(0, FlakeTables::memory_bytes);
        4 * (matter + noted) as u64 + areas
    }
}

/// A population as the lanes see it.
#[derive(Clone, Copy)]
pub struct StoredPopulation<'a> {
    /// The axis times `sqrt(1 - e^2)`.
    pub scaled_axis: Vec3,
    /// The end-on ratio e, and its code.
    pub end_on: f32,
    pub end_on_code: u32,
    /// Extinction across the axis, 1/mm.
    pub broadside_per_mm: f32,
    pub scattering: &'a Scattering,
}

impl StoredPopulation<'_> {
    /// Extinction toward `w`, 1/mm.
    pub fn extinction_per_mm(&self, w: Vec3) -> f32 {
        let across = self.scaled_axis.cross(w).length_squared();
        let e2 = self.end_on * self.end_on;
        let apart = || {
            let across = across / (1.0 - e2).max(1e-6);
            let along = (1.0 - across).max(0.0);
            [along, across, self.end_on].map(one::F::splat)
        };
        let squared = match self.scattering {
            Scattering::Mirrors | Scattering::Diffuse => e2 + across,
            Scattering::Flakes(flakes) => {
                let [along, across, end_on] = apart();
                let code = <one::U as Ints>::splat(self.end_on_code);
                flakes.area_squared(code, along, across, end_on).0
            }
            Scattering::Fibres => {
                let [along, across, end_on] = apart();
                area_squared(along, across, end_on).0
            }
        };
        self.broadside_per_mm * squared.sqrt()
    }
}
