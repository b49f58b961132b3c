//! Laying matter out for lanes: from what is described, voxel by voxel, to words.

use super::blocks::{Blocks, grid_of};
use super::flat_medium::{FlatMedium, PLACE_BITS};
use super::reach::{Surroundings, surroundings, surroundings_in_blocks};
use super::scattering::Scattering;
use super::voxel_words::{MOST, WORDS, pack, with_surroundings};
use crate::matter::{MAX_DIM, Matter, NO_YARN, Population, Substance, Unsuited};
use glam::{UVec3, Vec3};
use organza_basis::CellGrid;
use rayon::prelude::*;
use std::collections::HashMap;

/// Room for what rounding does to a stored extinction: its greatest is below
/// the bound times this.
const BOUND_SLACK: f32 = 1.0 + 2e-4;

impl Substance {
    /// Flakes that lanes take side by side have no more than an albedo.
    fn words(self, scattering: &Scattering) -> [u32; 4] {
        match self {
            Substance::Flakes(albedo, material) => {
                let [r, g, b] = albedo.0.to_array().map(f32::to_bits);
                let needs_material = matches!(scattering, Scattering::Flakes(_));
                [
                    r,
                    g,
                    b,
                    if needs_material {
                        u32::from(material)
                    } else {
                        0
                    },
                ]
            }
            Substance::Fibres(material) => [u32::from(material), 0, 0, 0],
        }
    }
}

impl FlatMedium {
    /// Lays matter out.
    ///
    /// # Errors
    /// Matter that does not suit, or too much of it.
    pub fn new(matter: &impl Matter) -> Result<FlatMedium, Unsuited> {
        let (cell_grid, blocks) = grid_of(matter).ok_or(Unsuited::TooWide)?;
        let dims = cell_grid.dims();
        let populations_at = |cell: UVec3, out: &mut Vec<Population>| {
            let shown = blocks.as_ref().map_or(cell, |b| shown(b, dims, cell));
            matter.populations(shown, out)
        };
        let tables = blocks.as_ref().map_or(1, |b| b.count());
        if dims.max_element() > MAX_DIM {
            return Err(Unsuited::TooWide);
        }
        let is_gathered_again = blocks.is_some();
        let layers = (dims.z as usize * tables) as u32;
        let slices = (0..layers)
            .into_par_iter()
            .map(|z| {
                let slice = Slice::gather(dims, z, &populations_at)?;
                // Many blocks have many populations: they are gathered again to be stored.
                Ok(if is_gathered_again {
                    slice.without_populations()
                } else {
                    slice
                })
            })
            .collect::<Result<Vec<Slice>, Unsuited>>()?;
        let greatest = slices.iter().flat_map(|s| &s.bounds).fold(0.0, most);
        let scale_per_mm = f32::max(greatest, f32::MIN_POSITIVE * 1e12) * (BOUND_SLACK / MOST);
        let least = slices.iter().map(|s| s.least).fold(f32::INFINITY, f32::min);
        check_range(&cell_grid, MOST * scale_per_mm, least)?;
        let shares = slices.iter().flat_map(|s| &s.bounds);
        let shares = shares.map(|bound| bound * (BOUND_SLACK / scale_per_mm));
        let path_mm = 1.0 / (MOST * scale_per_mm);
        let around = match &blocks {
            None => surroundings(&cell_grid, shares, path_mm),
            Some(_) => surroundings_in_blocks(&cell_grid, shares, path_mm),
        };
        let has_mixtures = slices.iter().any(|s| s.counts.iter().any(|&n| n > 1));
        let mut filler = Filler {
            flat: FlatMedium {
                cell_grid,
                blocks: blocks.clone(),
                words: Vec::with_capacity(WORDS * around.len()),
                places: Vec::new(),
                materials: Vec::new(),
                substances: Vec::new(),
                yarns: Vec::new(),
                densest: Vec::new(),
                scale_per_mm,
                scattering: Scattering::of(matter.scatterers()),
            },
            substance_numbers: HashMap::new(),
            knows_yarns: slices.iter().any(|s| s.knows_yarns),
        };
        let again = |z: u32| Slice::gather(dims, z, &populations_at);
        let again = is_gathered_again.then_some(&again as &dyn Fn(u32) -> _);
        filler.fill(&slices, again, &around, has_mixtures)?;
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
}

/// The voxel of the matter that shows a voxel of the blocks on top of each other.
fn shown(blocks: &Blocks, block: UVec3, stacked: UVec3) -> UVec3 {
    let number = stacked.z / block.z;
    let crossing = blocks.shown_at[number as usize];
    let low = (crossing * block.truncate()).extend(0);
    low + stacked.with_z(stacked.z - number * block.z)
}

/// A medium on its way to be laid out.
struct Filler {
    flat: FlatMedium,
    substance_numbers: HashMap<[u32; 4], u32>,
    knows_yarns: bool,
}

impl Filler {
    /// Lays out the voxels of all slices, with their surroundings. `again` gathers the
    /// populations of a slice that has none left.
    fn fill(
        &mut self,
        slices: &[Slice],
        again: Option<&dyn Fn(u32) -> Result<Slice, Unsuited>>,
        around: &[Surroundings],
        has_mixtures: bool,
    ) -> Result<(), Unsuited> {
        let mut air = vec![u32::MAX; 1 << 16];
        let mut around = around.iter();
        for (z, slice) in (0..).zip(slices) {
            let gathered = again.map(|again| again(z)).transpose()?;
            let mut left = &gathered.as_ref().unwrap_or(slice).populations[..];
            for (&count, &around) in slice.counts.iter().zip(&mut around) {
                let (own, rest) = left.split_at(usize::from(count));
                left = rest;
                let mut first = self.places();
                match own {
                    [] if has_mixtures => {
                        // Voxels of air have little to say: they share it.
                        let code = usize::from(around.bound_code) << 8;
                        let known = &mut air[code | usize::from(around.reach_code)];
                        if *known == u32::MAX {
                            self.add_air(around);
                            *known = first;
                        }
                        first = *known;
                    }
                    [] => self.add_air(around),
                    _ => self.add(own, around)?,
                }
                if self.places() >> PLACE_BITS != 0 {
                    return Err(Unsuited::TooManyPopulations);
                }
                if has_mixtures {
                    let more = u32::from(count.saturating_sub(1));
                    self.flat.places.push(first | more << PLACE_BITS);
                    self.note_densest(own, first);
                }
            }
        }
        Ok(())
    }

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
            let key = p.substance.words(&self.flat.scattering);
            let substance = self.substance_number(key)?;
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

    fn substance_number(&mut self, key: [u32; 4]) -> Result<u32, Unsuited> {
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
        Ok(number)
    }
}

/// Whether lanes keep the extinctions of matter between these two, 1/mm.
///
/// A tentative collision is taken by a number of 24 bits, so its chance is off by up to
/// `2^-24`; behind the border of a voxel's reach, tentative collisions come at the
/// greatest extinction M. Along a way l that adds at most `M l 2^-24` to an optical
/// depth, and at most the share `2^-24 M / x` to that of matter of extinction x, which
/// no transmittance shows more than 0.37 of. Either is kept below 5e-4. (Words round to
/// `2^-28 M`, sixteen times less.)
///
/// Places are 24 bits, too: mean free paths are kept to several of their steps.
pub fn check_range(cell_grid: &CellGrid, max_per_mm: f32, min_per_mm: f32) -> Result<(), Unsuited> {
    const STEP: f32 = 1.0 / (1 << 24) as f32;
    const MAX_ERROR: f32 = 5e-4;
    let size_mm = cell_grid.bounds_mm().size();
    let repeats = cell_grid.repeats();
    let way_mm = if repeats { size_mm.z } else { size_mm.length() };
    let depth = max_per_mm * way_mm;
    let is_kept = |error: f32| error <= MAX_ERROR;
    let is_thin_kept = min_per_mm == f32::INFINITY
        || is_kept(0.37 * STEP * (max_per_mm / min_per_mm))
        || is_kept(STEP * depth);
    if !is_thin_kept {
        return Err(Unsuited::Contrast(depth));
    }
    let voxel_depth = max_per_mm * cell_grid.voxel_mm().max_element();
    let places = cell_grid.dims().max_element() as f32;
    if voxel_depth * places * 2.0 * STEP > 0.25 || voxel_depth.is_nan() {
        return Err(Unsuited::Dense(voxel_depth));
    }
    Ok(())
}

fn most(a: f32, &b: &f32) -> f32 {
    a.max(b)
}

/// One layer of voxels.
struct Slice {
    counts: Vec<u8>,
    populations: Vec<Population>,
    /// Bound of what a tentative collision in the voxel is taken with.
    bounds: Vec<f32>,
    /// The least that any population is taken with; infinite without any.
    least: f32,
    /// Whether any population knows its yarn.
    knows_yarns: bool,
}

impl Slice {
    fn without_populations(self) -> Slice {
        Slice {
            populations: Vec::new(),
            ..self
        }
    }

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
            least: f32::INFINITY,
            knows_yarns: false,
        };
        for y in 0..dims.y {
            for x in 0..dims.x {
                let before = slice.populations.len();
                populations_at(UVec3::new(x, y, z), &mut slice.populations)?;
                let own = &slice.populations[before..];
                let most = own.iter().map(|p| p.broadside_per_mm).fold(0.0, f32::max);
                let dense = own.iter().map(|p| p.broadside_per_mm * own.len() as f32);
                let dense = dense.filter(|&dense| dense > 0.0);
                slice.least = dense.fold(slice.least, f32::min);
                slice.knows_yarns |= own.iter().any(|p| p.yarn != NO_YARN);
                slice.counts.push(own.len() as u8);
                slice.bounds.push(most * own.len() as f32);
            }
        }
        Ok(slice)
    }
}
