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

use super::fibre_tables::{WIDE_RAD, area_squared, end_on_ratio};
use super::reach::{Surroundings, surroundings};
use super::voxel_words::{MOST, VoxelWords, WORDS, pack, with_surroundings};
use crate::cpu::lanes::{Floats, Ints, one};
use crate::{Matter, NO_YARN, Population, Substance, Unsuited};
use glam::{UVec3, Vec3};
use organza_basis::CellGrid;
use organza_film::{FirstEvent, SiteInfo};
use rayon::prelude::*;
use std::collections::HashMap;

impl Substance {
    fn words(self) -> [u32; 3] {
        match self {
            Substance::Flakes(albedo) => albedo.0.to_array().map(f32::to_bits),
            Substance::Fibres(material) => [u32::from(material), 0, 0],
        }
    }
}

/// The index of no population.
pub const NO_POPULATION: u32 = u32::MAX;

/// Bits of the place of a voxel's first population.
pub const PLACE_BITS: u32 = 29;

/// Most voxels along an axis: `f32` coordinates then keep voxels apart by the
/// margin that the walk needs.
pub const MAX_DIM: u32 = 4096;

/// Room for what rounding does to a stored extinction: its greatest is below
/// the bound times this.
const BOUND_SLACK: f32 = 1.0 + 2e-4;

/// A medium laid out for lanes.
pub struct FlatMedium {
    pub cell_grid: CellGrid,
    /// The words of every population, or of a voxel without any.
    pub words: Vec<u32>,
    /// Where the populations of every voxel stand, and how many they are; empty
    /// where each has its own place.
    pub places: Vec<u32>,
    /// Which substance every population has; empty where there is one.
    pub materials: Vec<u32>,
    /// Of flakes red, green, blue of the albedo as bits of `f32`, of fibres the
    /// material; one word of four unused.
    pub substances: Vec<u32>,
    /// Of every population; empty where no yarns are known.
    yarns: Vec<u32>,
    /// Of every population, the densest in its voxel, which stands for all in
    /// pictures; empty where each has its own place.
    densest: Vec<u32>,
    /// What shares are of, 1/mm: [`MOST`] of it is the majorant.
    pub scale_per_mm: f32,
    /// Virtual fibres, not micro-flakes.
    pub is_of_fibres: bool,
}

impl FlatMedium {
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

    /// Bytes that a medium with so many voxels takes at the least, all working
    /// space while it is built included.
    pub fn least_bytes(cell_grid: &CellGrid) -> u64 {
        28 * cell_grid.dims().as_u64vec3().element_product()
    }

    /// Lays matter out.
    ///
    /// # Errors
    /// Matter that does not suit, or too much of it.
    pub fn new(matter: &impl Matter) -> Result<FlatMedium, Unsuited> {
        let cell_grid = *matter.cell_grid();
        let populations_at = |cell: UVec3, out: &mut Vec<Population>| matter.populations(cell, out);
        let dims = cell_grid.dims();
        if dims.max_element() > MAX_DIM {
            return Err(Unsuited::TooWide);
        }
        let slices = (0..dims.z)
            .into_par_iter()
            .map(|z| Slice::gather(dims, z, &populations_at))
            .collect::<Result<Vec<Slice>, Unsuited>>()?;
        let greatest = slices.iter().flat_map(|s| &s.bounds).fold(0.0, most);
        let scale_per_mm = f32::max(greatest, f32::MIN_POSITIVE * 1e12) * (BOUND_SLACK / MOST);
        let shares = slices.iter().flat_map(|s| &s.bounds);
        let shares = shares.map(|bound| bound * (BOUND_SLACK / scale_per_mm));
        let around = surroundings(&cell_grid, shares, 1.0 / (MOST * scale_per_mm));
        let has_mixtures = slices.iter().any(|s| s.counts.iter().any(|&n| n > 1));
        let mut filler = Filler {
            flat: FlatMedium {
                cell_grid,
                words: Vec::with_capacity(WORDS * around.len()),
                places: Vec::new(),
                materials: Vec::new(),
                substances: Vec::new(),
                yarns: Vec::new(),
                densest: Vec::new(),
                scale_per_mm,
                is_of_fibres: false,
            },
            substance_numbers: HashMap::new(),
            knows_yarns: slices
                .iter()
                .any(|s| s.populations.iter().any(|p| p.yarn != NO_YARN)),
        };
        let mut air = vec![u32::MAX; 1 << 16];
        let mut around = around.iter();
        for slice in &slices {
            let mut left = &slice.populations[..];
            for (&count, around) in slice.counts.iter().zip(&mut around) {
                let (own, rest) = left.split_at(usize::from(count));
                left = rest;
                let mut first = filler.places();
                match own {
                    [] if has_mixtures => {
                        // Voxels of air have little to say: they share it.
                        let Surroundings {
                            bound_code,
                            reach_code,
                        } = *around;
                        let known =
                            &mut air[usize::from(bound_code) << 8 | usize::from(reach_code)];
                        if *known == u32::MAX {
                            filler.add_air(*around);
                            *known = first;
                        }
                        first = *known;
                    }
                    [] => filler.add_air(*around),
                    _ => filler.add(own, *around)?,
                }
                if filler.places() >> PLACE_BITS != 0 {
                    return Err(Unsuited::TooManyPopulations);
                }
                if has_mixtures {
                    let more = u32::from(count.saturating_sub(1));
                    filler.flat.places.push(first | more << PLACE_BITS);
                    filler.note_densest(own, first);
                }
            }
        }
        Ok(filler.flat.finished())
    }

    fn finished(mut self) -> FlatMedium {
        if self.substances.is_empty() {
            self.substances.resize(4, 0);
        }
        if self.substances.len() == 4 {
            self.materials = Vec::new();
        }
        self
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
    pub fn populations_of(&self, voxel: usize) -> impl Iterator<Item = Stored> {
        let (first, count) = self.place(voxel);
        let stored = (first..first + count).map(move |i| self.stored(i, count as f32));
        stored.filter(|p| p.broadside_per_mm > 0.0)
    }

    /// Extinction of a voxel toward `w`, 1/mm; `None` beyond the last.
    pub fn extinction_per_mm(&self, voxel: usize, w: Vec3) -> Option<f32> {
        let voxels = self.cell_grid.dims().as_usizevec3().element_product();
        let own = || self.populations_of(voxel).map(|p| p.extinction_per_mm(w));
        (voxel < voxels).then(|| own().sum())
    }

    /// The words at a place.
    pub fn words_at(&self, place: usize) -> VoxelWords<one::U> {
        let words = &self.words[WORDS * place..][..WORDS];
        VoxelWords([words[0], words[1]].map(<one::U as Ints>::splat))
    }

    /// A population as stored; `shared_by` is the number in its voxel.
    fn stored(&self, place: usize, shared_by: f32) -> Stored {
        let words = self.words_at(place);
        if self.words[WORDS * place] >> 16 == 0 {
            return Stored {
                scaled_axis: Vec3::ZERO,
                end_on: 1.0,
                broadside_per_mm: 0.0,
                is_of_fibres: self.is_of_fibres,
            };
        }
        let (axis, end_on) = (words.axis(), words.end_on().0);
        let length = (1.0 - end_on * end_on).max(0.0).sqrt();
        Stored {
            scaled_axis: length * Vec3::new(axis.x.0, axis.y.0, axis.z.0).normalize(),
            end_on,
            broadside_per_mm: words.broadside().0 * self.scale_per_mm / shared_by,
            is_of_fibres: self.is_of_fibres,
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
        4 * (matter + noted) as u64
    }
}

/// A medium on its way to be laid out.
struct Filler {
    flat: FlatMedium,
    substance_numbers: HashMap<[u32; 3], u32>,
    knows_yarns: bool,
}

impl Filler {
    /// Places filled so far.
    fn places(&self) -> u32 {
        (self.flat.words.len() / WORDS) as u32
    }

    fn add_air(&mut self, around: Surroundings) {
        self.add_words([0, 0], around, 0, NO_YARN);
    }

    fn add(&mut self, own: &[Population], around: Surroundings) -> Result<(), Unsuited> {
        let share = own.len() as f32 / self.flat.scale_per_mm;
        for p in own {
            let axis = p.flake.scaled_axis().normalize_or(Vec3::Z);
            let words = pack(p.broadside_per_mm * share, axis, p.flake.end_on());
            let substance = self.substance_number(p.substance.words())?;
            self.add_words(words, around, substance, p.yarn);
        }
        Ok(())
    }

    fn add_words(&mut self, words: [u32; WORDS], around: Surroundings, substance: u32, yarn: u32) {
        let (bound, reach) = (around.bound_code, around.reach_code);
        let words = with_surroundings(words, u32::from(bound), u32::from(reach));
        self.flat.words.extend(words);
        self.flat.materials.push(substance);
        if self.knows_yarns {
            self.flat.yarns.push(yarn);
        }
    }

    fn note_densest(&mut self, own: &[Population], first: u32) {
        let dense = |&(_, p): &(u32, &Population)| p.broadside_per_mm;
        let densest = (first..)
            .zip(own)
            .max_by(|a, b| dense(a).total_cmp(&dense(b)));
        let densest = densest.map_or(first, |(place, _)| place);
        self.flat
            .densest
            .resize(self.flat.words.len() / WORDS, densest);
    }

    fn substance_number(&mut self, key: [u32; 3]) -> Result<u32, Unsuited> {
        if self.flat.substances.first_chunk() == Some(&key) {
            return Ok(0);
        }
        if let Some(&number) = self.substance_numbers.get(&key) {
            return Ok(number);
        }
        let number = self.substance_numbers.len() as u32;
        if number > 0xffff {
            return Err(Unsuited::TooManyAlbedos);
        }
        self.substance_numbers.insert(key, number);
        self.flat.substances.extend(key);
        self.flat.substances.push(0);
        Ok(number)
    }
}

fn most(a: f32, &b: &f32) -> f32 {
    a.max(b)
}

/// A population as the lanes see it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stored {
    /// The axis times `sqrt(1 - e^2)`.
    pub scaled_axis: Vec3,
    /// The end-on ratio e.
    pub end_on: f32,
    /// Extinction across the axis, 1/mm.
    pub broadside_per_mm: f32,
    /// Virtual fibres, not micro-flakes.
    pub is_of_fibres: bool,
}

impl Stored {
    /// Extinction toward `w`, 1/mm.
    pub fn extinction_per_mm(&self, w: Vec3) -> f32 {
        let across = self.scaled_axis.cross(w).length_squared();
        let e2 = self.end_on * self.end_on;
        if self.is_of_fibres {
            let across = across / (1.0 - e2).max(1e-6);
            let along = (1.0 - across).max(0.0);
            let [along, across, end_on] = [along, across, self.end_on].map(one::F::splat);
            return self.broadside_per_mm * area_squared(along, across, end_on).0.sqrt();
        }
        self.broadside_per_mm * (e2 + across).sqrt()
    }
}

/// One layer of voxels.
struct Slice {
    counts: Vec<u8>,
    populations: Vec<Population>,
    /// Bound of what a tentative collision in the voxel is taken with.
    bounds: Vec<f32>,
}

impl Slice {
    fn gather(
        dims: UVec3,
        z: u32,
        populations_at: &impl Fn(UVec3, &mut Vec<Population>) -> Result<(), Unsuited>,
    ) -> Result<Slice, Unsuited> {
        let area = dims.x as usize * dims.y as usize;
        let mut slice = Slice {
            counts: Vec::with_capacity(area),
            populations: Vec::new(),
            bounds: Vec::with_capacity(area),
        };
        for y in 0..dims.y {
            for x in 0..dims.x {
                let before = slice.populations.len();
                populations_at(UVec3::new(x, y, z), &mut slice.populations)?;
                let own = &slice.populations[before..];
                let most = own.iter().map(|p| p.broadside_per_mm).fold(0.0, f32::max);
                slice.counts.push(own.len() as u8);
                slice.bounds.push(most * own.len() as f32);
            }
        }
        Ok(slice)
    }
}
