//! Matter laid out for lanes: one word a voxel, four words a population.
//!
//! # Words
//! A voxel without fibre holds its [reach](Reach) with the top bit set; another
//! the number of its populations less one (2 bits) and the index of the first.
//! A population holds
//! - `0`: its axis times `sqrt(1 - e^2)`, x and y in 16 bits each,
//! - `1`: its z, and the square root of the end-on ratio e,
//! - `2`: its broadside extinction in 1/mm, times the number of populations in
//!   the voxel, as `f32`,
//! - `3`: the voxel's reach, and which albedo it has (16 bits).
//!
//! Sixteen bits keep the axis within 3e-5 rad and e within 0.1 %.
//!
//! # Several populations
//! Populations superpose: a tentative collision picks one with equal chances
//! and takes it with probability (number x own extinction / majorant), which in
//! sum is the extinction of all over the majorant. Everything after is with
//! that one alone, as a collision with the mixture is with one of its fibres.
//!
//! # Reach
//! Every voxel knows a bound on the extinction in all voxels at most so many
//! steps away, along axes or diagonals. A flight at that bound that would leave
//! them stops at their border and looks again: exact, since flights have no
//! memory. In air far from yarns the bound is zero and the flight a jump; where
//! density varies inside yarns it is the density nearby. Of the reaches tried,
//! the one that promises the fewest look-ups per length is kept.

use crate::{ClothMedium, FirstEvent, GridMedium, Lattice, SiteInfo};
use glam::{UVec3, Vec3};
use organza_basis::Rgb;
use organza_scatter::AxialFlake;
use rayon::prelude::*;
use std::collections::HashMap;

/// One population of fibres in a voxel, as micro-flakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Population {
    /// Extinction across the axis, 1/mm.
    pub broadside_per_mm: f32,
    /// Flakes along the axis.
    pub flake: AxialFlake,
    /// Albedo.
    pub albedo: Rgb,
    /// Yarn, where known.
    pub yarn: u32,
}

/// No yarn.
pub const NO_YARN: u32 = u32::MAX;

/// The index of no population.
pub const NO_POPULATION: u32 = u32::MAX;

/// Top bit of a voxel without fibre.
pub const EMPTY: u32 = 1 << 31;
/// Bits of the index of a voxel's first population.
pub const INDEX_BITS: u32 = 29;
/// Words of a population.
pub const WORDS: usize = 4;

/// Stored 16-bit value of an axis component that is zero.
pub const AXIS_ZERO: f32 = 32_767.0;
/// Greatest stored root of an end-on ratio.
pub const END_ON_ONE: f32 = 65_535.0;

/// Most voxels along an axis: `f32` coordinates then keep voxels apart by the
/// margin that the walk needs.
const MAX_DIM: u32 = 4096;

/// A bound and how many voxels around it holds: 12 and 4 bits.
///
/// The bound is a small floating-point number of 7 bits after the point,
/// rounded up, from `2^-31` (which stands for zero) to the greatest extinction.
/// Code c stands for a reach of the voxel itself and `r - 1` around it, with r
/// = 1, then 2, 3, 4, 6, 8, 12, ...: also a floating-point number, of one bit.
pub struct Reach;

impl Reach {
    /// Bits of the least bound.
    pub const BOUND_BASE: u32 = (127 - 31) << 23;
    /// Bits of the reach that code zero stands for.
    pub const STEPS_BASE: u32 = 127 << 23;
    /// The greatest bound, before scaling.
    const MOST: f32 = 2.0 - 1.0 / 128.0;
    /// Codes tried, nearest first; one and two are the same but for 1.5.
    const CODES: [u32; 14] = [0, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14];

    fn steps(code: u32) -> usize {
        f32::from_bits(Self::STEPS_BASE + (code << 22)) as usize
    }

    fn pack(bound: f32, code: u32) -> u32 {
        let above = bound.to_bits().saturating_sub(Self::BOUND_BASE);
        // Rounding may put the greatest a hair above its code.
        above.div_ceil(1 << 16).min(4095) | code << 12
    }
}

/// Why matter cannot be laid out for lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Unsuited {
    /// Interpolated samples, or grids of different resolutions.
    #[error("a grid is not constant within voxels")]
    Interpolated,
    /// Flakes that are not those of a fibre.
    #[error("a grid has flakes that are not symmetric about their thinnest direction")]
    NotAxial,
    /// More voxels along an axis than [`MAX_DIM`].
    #[error("a medium has more than {MAX_DIM} voxels along an axis")]
    TooWide,
    /// More albedos than there are numbers for.
    #[error("a medium has more than 65536 different albedos")]
    TooManyAlbedos,
    /// More populations than can be addressed.
    #[error("a medium has more than 2^29 populations of fibres")]
    TooManyPopulations,
}

/// A medium laid out for lanes.
pub struct FlatMedium {
    pub lattice: Lattice,
    pub cells: Vec<u32>,
    pub populations: Vec<u32>,
    /// Of every population; empty where no yarns are known.
    yarns: Vec<u32>,
    /// Of every population, the densest in its voxel, which stands for all in
    /// pictures; empty where no voxel has several.
    densest: Vec<u32>,
    /// Red, green, blue as bits of `f32`, and one word unused.
    pub albedos: Vec<u32>,
    /// What bounds are multiplied with, 1/mm.
    pub bound_scale: f32,
}

impl FlatMedium {
    /// From a grid.
    ///
    /// # Errors
    /// A grid that is not of axial flakes in constant voxels, or too large.
    pub fn from_grid(medium: &GridMedium) -> Result<FlatMedium, Unsuited> {
        if !crate::Medium::is_piecewise_constant(medium) {
            return Err(Unsuited::Interpolated);
        }
        let lattice = *crate::Medium::lattice(medium);
        Self::new(lattice, |cell, out| {
            match medium.axial_population(cell) {
                None => return Err(Unsuited::NotAxial),
                Some(p) if p.broadside_per_mm > 0.0 => out.push(p),
                Some(_) => {}
            }
            Ok(())
        })
    }

    /// From a level of an octree of cloth.
    ///
    /// # Errors
    /// A medium that is too large.
    pub fn from_cloth(medium: &ClothMedium) -> Result<FlatMedium, Unsuited> {
        let lattice = *crate::Medium::lattice(medium);
        Self::new(lattice, |cell, out| {
            medium.axial_populations(cell, out);
            Ok(())
        })
    }

    /// Bytes that a medium with so many voxels takes at the least, all working
    /// space while it is built included.
    pub fn least_bytes(lattice: &Lattice) -> u64 {
        20 * lattice.dims().as_u64vec3().element_product()
    }

    fn new(
        lattice: Lattice,
        populations_at: impl Fn(UVec3, &mut Vec<Population>) -> Result<(), Unsuited> + Sync,
    ) -> Result<FlatMedium, Unsuited> {
        let dims = lattice.dims();
        if dims.max_element() > MAX_DIM {
            return Err(Unsuited::TooWide);
        }
        let slices = (0..dims.z)
            .into_par_iter()
            .map(|z| Slice::gather(dims, z, &populations_at))
            .collect::<Result<Vec<Slice>, Unsuited>>()?;
        let count: usize = slices.iter().map(|s| s.populations.len()).sum();
        if count >= 1 << INDEX_BITS {
            return Err(Unsuited::TooManyPopulations);
        }
        let bounds: Vec<f32> = slices
            .iter()
            .flat_map(|s| s.bounds.iter().copied())
            .collect();
        let greatest = bounds.iter().copied().fold(0.0f32, f32::max);
        let bound_scale = greatest.max(f32::MIN_POSITIVE * 1e12) * BOUND_SLACK / Reach::MOST;
        let reaches = reaches(&lattice, bounds, bound_scale);
        let mut flat = FlatMedium {
            lattice,
            cells: Vec::with_capacity(reaches.len()),
            populations: Vec::with_capacity(WORDS * count.max(1)),
            yarns: Vec::new(),
            densest: Vec::new(),
            albedos: Vec::new(),
            bound_scale,
        };
        let knows_yarns = slices
            .iter()
            .any(|s| s.populations.iter().any(|p| p.yarn != NO_YARN));
        let has_mixtures = slices.iter().any(|s| s.counts.iter().any(|&n| n > 1));
        let mut albedos = HashMap::new();
        // Grids of procedural yarns say the same again and again.
        let share = !knows_yarns && !has_mixtures;
        let mut recent = vec![0usize; RECENT];
        let mut reach = reaches.into_iter();
        for slice in &slices {
            let mut left = &slice.populations[..];
            for &count in &slice.counts {
                let reach = u32::from(reach.next().unwrap_or_default());
                let (own, rest) = left.split_at(usize::from(count));
                left = rest;
                if own.is_empty() {
                    flat.cells.push(EMPTY | reach);
                    continue;
                }
                let mut first = (flat.populations.len() / WORDS) as u32;
                if let ([p], true) = (own, share) {
                    let albedo = flat.albedo_number(&mut albedos, p.albedo)?;
                    let words = pack(p, 1.0, reach | albedo << 16);
                    let known = &mut recent[slot(&words)];
                    let stored = flat.populations.get(*known..*known + WORDS);
                    if stored == Some(&words[..]) {
                        first = (*known / WORDS) as u32;
                    } else {
                        *known = flat.populations.len();
                        flat.populations.extend(words);
                    }
                    flat.cells.push(first);
                    continue;
                }
                flat.cells.push(first | u32::from(count - 1) << INDEX_BITS);
                if has_mixtures {
                    let dense = |&(_, p): &(u32, &Population)| p.broadside_per_mm;
                    let densest = (first..)
                        .zip(own)
                        .max_by(|a, b| dense(a).total_cmp(&dense(b)));
                    let densest = densest.map_or(first, |(index, _)| index);
                    flat.densest.extend(own.iter().map(|_| densest));
                }
                for p in own {
                    let albedo = flat.albedo_number(&mut albedos, p.albedo)?;
                    flat.populations
                        .extend(pack(p, f32::from(count), reach | albedo << 16));
                    if knows_yarns {
                        flat.yarns.push(p.yarn);
                    }
                }
            }
        }
        if flat.populations.is_empty() {
            // Gathers need something to point at.
            flat.populations.resize(WORDS, 0);
            flat.albedos.resize(4, 0);
        }
        Ok(flat)
    }

    fn albedo_number(
        &mut self,
        known: &mut HashMap<[u32; 3], u32>,
        albedo: Rgb,
    ) -> Result<u32, Unsuited> {
        let key = albedo.0.to_array().map(f32::to_bits);
        if self.albedos.first_chunk() == Some(&key) {
            return Ok(0);
        }
        if let Some(&number) = known.get(&key) {
            return Ok(number);
        }
        let number = known.len() as u32;
        if number > 0xffff {
            return Err(Unsuited::TooManyAlbedos);
        }
        known.insert(key, number);
        self.albedos.extend(key);
        self.albedos.push(0);
        Ok(number)
    }

    /// The populations of a voxel, as stored.
    pub fn populations_of(&self, cell: u32) -> impl Iterator<Item = Stored> {
        let (first, count) = if cell & EMPTY != 0 {
            (0, 0)
        } else {
            let index = cell & ((1 << INDEX_BITS) - 1);
            (index as usize, (cell >> INDEX_BITS) as usize + 1)
        };
        (first..first + count).map(move |i| self.stored(i, count as f32))
    }

    /// A population as stored; `shared_by` is the number in its voxel.
    pub fn stored(&self, index: usize, shared_by: f32) -> Stored {
        let words = &self.populations[WORDS * index..];
        let axis = |code: u32| code as f32 * (1.0 / AXIS_ZERO) - 1.0;
        let root = (words[1] >> 16) as f32 * (1.0 / END_ON_ONE);
        Stored {
            scaled_axis: Vec3::new(
                axis(words[0] & 0xffff),
                axis(words[0] >> 16),
                axis(words[1] & 0xffff),
            ),
            end_on: root * root,
            broadside_per_mm: f32::from_bits(words[2]) / shared_by,
        }
    }

    /// What a film notes of a path's first population, if it met one.
    pub fn first_event(&self, index: u32, depth_mm: f32) -> Option<FirstEvent> {
        if index == NO_POPULATION {
            return None;
        }
        let shown = self.densest.get(index as usize).map_or(index, |&i| i) as usize;
        let yarn = self.yarns.get(shown).copied();
        let axis = self.stored(shown, 1.0).scaled_axis;
        Some(FirstEvent {
            info: SiteInfo {
                axis: axis.normalize_or_zero(),
                yarn: yarn.filter(|&y| y != NO_YARN),
            },
            depth_mm: f64::from(depth_mm),
        })
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        let words = self.cells.len() + self.populations.len() + self.albedos.len();
        4 * (words + self.yarns.len() + self.densest.len()) as u64
    }
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
}

impl Stored {
    /// Extinction toward `w`, 1/mm.
    pub fn extinction_per_mm(&self, w: Vec3) -> f32 {
        let across = self.scaled_axis.cross(w).length_squared();
        self.broadside_per_mm * (self.end_on * self.end_on + across).sqrt()
    }
}

fn pack(p: &Population, shared_by: f32, last: u32) -> [u32; WORDS] {
    let axis = |t: f32| (t * AXIS_ZERO + AXIS_ZERO).round().clamp(0.0, 65_534.0) as u32;
    let t = p.flake.scaled_axis();
    let root = (p.flake.end_on().sqrt() * END_ON_ONE).round() as u32;
    [
        axis(t.x) | axis(t.y) << 16,
        axis(t.z) | root << 16,
        (p.broadside_per_mm * shared_by).to_bits(),
        last,
    ]
}

/// Populations that are remembered while a medium is laid out.
const RECENT: usize = 1 << 14;

/// Where a population is remembered.
fn slot(words: &[u32; WORDS]) -> usize {
    let mixed = words.iter().fold(0u32, |h, &w| {
        (h.rotate_left(5) ^ w).wrapping_mul(0x9e37_79b9)
    });
    mixed as usize >> 18
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

/// Room for what 16 bits do to the axis: the greatest stored area is below it.
const BOUND_SLACK: f32 = 1.0 + 2e-4;

/// The reach of every voxel, packed.
///
/// A flight takes a look-up per mean free path at the bound, and one per
/// border; the way to the border is half a voxel less than the reach on
/// average.
fn reaches(lattice: &Lattice, bounds: Vec<f32>, scale: f32) -> Vec<u16> {
    let dims = lattice.dims();
    let voxel_mm = lattice.voxel_mm().element_sum() / 3.0;
    let mut within = bounds;
    let mut best = vec![(f32::INFINITY, 0u16); within.len()];
    let mut steps_before = 1;
    for code in Reach::CODES {
        let steps = Reach::steps(code);
        if steps > dims.max_element() as usize {
            break;
        }
        spread_maximum(lattice, &mut within, steps - steps_before);
        steps_before = steps;
        let borders = 1.0 / ((steps as f32 - 0.5) * voxel_mm);
        best.par_iter_mut().zip(&within).for_each(|(best, &bound)| {
            let cost = bound + borders;
            if cost < best.0 {
                *best = (
                    cost,
                    Reach::pack(bound * (BOUND_SLACK / scale), code) as u16,
                );
            }
        });
    }
    best.into_iter().map(|(_, packed)| packed).collect()
}

/// Replaces every value by the greatest of those `by` steps away and its own,
/// along each axis in turn: from the greatest within n steps, those within
/// `n + by`, if `by` is at most n (or one).
fn spread_maximum(lattice: &Lattice, values: &mut Vec<f32>, by: usize) {
    if by == 0 {
        return;
    }
    let dims = lattice.dims();
    let n = [dims.x as usize, dims.y as usize, dims.z as usize];
    for axis in 0..3 {
        let wraps = lattice.repeats() && axis < 2;
        // Index of the neighbour `by` steps away, or the place itself.
        let shifted = |i: usize, forth: bool| match (wraps, forth) {
            (true, true) => (i + by) % n[axis],
            (true, false) => (i + n[axis] - by % n[axis]) % n[axis],
            (false, true) => (i + by).min(n[axis] - 1),
            (false, false) => i.saturating_sub(by),
        };
        let old = &values[..];
        let row = |y: usize, z: usize| &old[(z * n[1] + y) * n[0]..][..n[0]];
        let mut new = vec![0.0f32; old.len()];
        new.par_chunks_mut(n[0]).enumerate().for_each(|(at, out)| {
            let (y, z) = (at % n[1], at / n[1]);
            let own = row(y, z);
            if axis == 0 {
                for (x, out) in out.iter_mut().enumerate() {
                    let sides = own[shifted(x, true)].max(own[shifted(x, false)]);
                    *out = own[x].max(sides);
                }
                return;
            }
            let side = |forth| match axis {
                1 => row(shifted(y, forth), z),
                _ => row(y, shifted(z, forth)),
            };
            let sides = side(true).iter().zip(side(false));
            for (out, (&own, (&a, &b))) in out.iter_mut().zip(own.iter().zip(sides)) {
                *out = own.max(a.max(b));
            }
        });
        *values = new;
    }
}
