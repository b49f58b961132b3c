//! Builds an octree from voxels whose mixtures are already known: scans, edited volumes.
//!
//! The voxels take the place of the segments that [`crate::voxelize()`] clips; all levels are
//! built from them by the same code, so lengths are conserved and coarse cells gain the spread
//! of the axes that they cover.

use crate::block::sort_by_voxel;
use crate::cluster::GatheredPopulation;
use crate::lattice::{BLOCK, Lattice, MAX_LEVELS, VOXELS, brick_at, bricks_across, cell_in_block};
use crate::octree::build::{Assembly, Scales, build_block};
use crate::{Error, Octree};
use glam::{DVec3, UVec3};
use organza_basis::spread::mean_cos_sq;
use organza_basis::{FibrePopulation, Mixture, Stopped, Sym3, Watch};
use rayon::prelude::*;

/// The grid of the voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixtureGrid {
    /// Least corner, mm.
    pub min_mm: DVec3,
    /// Edges of a voxel, mm.
    pub voxel_mm: DVec3,
    /// Voxels along each axis.
    pub dims: UVec3,
    /// True when the volume repeats in x and y.
    pub repeats: bool,
}

/// Voxels whose mixtures are known. The same cell always gives the same mixture.
pub trait MixtureSource: Sync {
    /// The grid.
    fn grid(&self) -> MixtureGrid;

    /// Number of materials that populations may name.
    fn material_count(&self) -> usize;

    /// The mixture of a cell below `grid().dims`.
    fn mixture(&self, cell: UVec3) -> Mixture;
}

/// Bytes that an octree takes for each population of the finest level, with all coarser levels
/// and the tables of bricks of sparse cloth.
const BYTES_PER_POPULATION: u64 = 32;

/// Bytes that each thread takes for the block in its work.
const BYTES_PER_BLOCK: u64 = 8 << 20;

/// Blocks that a thread is given at a time.
const BLOCKS_AT_A_TIME: usize = 4;

/// Builds the octree of the voxels.
///
/// Without `levels` there are as many, up to six, as leave the period whole: along x and y of a
/// volume that repeats, the voxels must be a multiple of the coarsest cell. Other extents are
/// padded with empty voxels at their upper end. Populations of less than a 2^32nd of the length
/// in the fullest block are lost to rounding. The result is the same bit for bit on any number
/// of threads. `progress` is called with the share of the work done, in `[0, 1]`.
///
/// # Errors
/// A grid or levels that no octree can have, populations that are not finite, more memory than
/// `max_memory_bytes`; [`Error::Stopped`] if `progress` broke.
pub fn octree_of_mixtures(
    source: &dyn MixtureSource,
    levels: Option<u8>,
    max_memory_bytes: Option<u64>,
    progress: Watch<'_, f32>,
) -> Result<Octree, Error> {
    let grid = source.grid();
    let lattice = lattice_of(&grid, levels)?;
    let blocks = lattice.blocks_across();
    let count = blocks.element_product();
    let seen: Vec<Seen> = (0..count)
        .into_par_iter()
        .map(|block| Seen::of(source, &grid, brick_at(block, blocks)))
        .collect();
    Stopped::check(progress(0.2))?;
    let mut all = Seen::default();
    for s in &seen {
        all.populations += s.populations;
        all.is_wrong |= s.is_wrong;
        all.groups.extend(&s.groups);
        all.groups.sort_unstable();
        all.groups.dedup();
        all.radii_mm = [
            all.radii_mm[0].min(s.radii_mm[0]),
            all.radii_mm[1].max(s.radii_mm[1]),
        ];
    }
    if all.is_wrong {
        return Err(Error::Options(
            "a voxel holds a population that is not finite, or whose axis has no length".into(),
        ));
    }
    let tables: u64 = (0..lattice.levels)
        .map(|l| {
            bricks_across(lattice.dims_at(l))
                .as_u64vec3()
                .element_product()
                * 4
        })
        .sum();
    let threads = rayon::current_num_threads();
    let needed = tables
        + all.populations * BYTES_PER_POPULATION
        + (threads * BLOCKS_AT_A_TIME) as u64 * BYTES_PER_BLOCK;
    let allowed = max_memory_bytes.unwrap_or(u64::MAX);
    if needed > allowed {
        return Err(Error::Memory { needed, allowed });
    }
    let lengths = seen.iter().map(|s| s.length_mm);
    let scales = Scales::new(&lattice, lengths, all.radii_mm, all.groups)?;
    let mut assembly = Assembly::new(&lattice, &scales);
    let filled: Vec<u32> = (0..count)
        .filter(|&b| seen[b as usize].populations > 0)
        .collect();
    let mut done = 0;
    for part in filled.chunks(BLOCKS_AT_A_TIME * threads) {
        let built: Vec<_> = part
            .par_iter()
            .map(|&b| {
                let populations = gather(source, &grid, brick_at(b, blocks));
                build_block(&lattice, &scales, b, populations)
            })
            .collect();
        for b in built {
            assembly.add(b)?;
        }
        done += part.len();
        Stopped::check(progress(0.2 + 0.8 * done as f32 / filled.len() as f32))?;
    }
    assembly.finish(source.material_count())
}

/// The lattice of a grid, padded to whole cells of the coarsest level.
fn lattice_of(grid: &MixtureGrid, levels: Option<u8>) -> Result<Lattice, Error> {
    if let Some(levels) = levels.filter(|l| !(1..=MAX_LEVELS).contains(l)) {
        return Err(Error::Options(format!(
            "{levels} levels; expected 1 to {MAX_LEVELS}"
        )));
    }
    let with = |levels: u8| {
        let cell = 1u32 << (levels - 1);
        Lattice {
            min_mm: grid.min_mm,
            voxel_mm: grid.voxel_mm,
            dims: grid.dims.map(|n| n.div_ceil(cell).saturating_mul(cell)),
            levels,
            repeats: grid.repeats,
        }
    };
    let fits = |l: &Lattice| !grid.repeats || l.dims.truncate() == grid.dims.truncate();
    let useful = |l: &Lattice| (l.dims >> u32::from(l.levels - 1)).max_element() > 1;
    let lattice = match levels {
        Some(levels) => with(levels),
        None => (2..=6u8)
            .rev()
            .map(with)
            .find(|l| fits(l) && useful(l))
            .unwrap_or_else(|| with(1)),
    };
    if !fits(&lattice) {
        return Err(Error::Options(format!(
            "{} x {} voxels of a period are no multiple of {}, the coarsest of {} levels",
            grid.dims.x,
            grid.dims.y,
            1u32 << (lattice.levels - 1),
            lattice.levels
        )));
    }
    if grid.dims.min_element() == 0 || !lattice.is_sound() {
        return Err(Error::Options(format!(
            "{} voxels of {} mm at {} mm make no octree",
            grid.dims, grid.voxel_mm, grid.min_mm
        )));
    }
    Ok(lattice)
}

/// What the first look at a block finds.
#[derive(Default)]
struct Seen {
    populations: u64,
    length_mm: f64,
    radii_mm: [f32; 2],
    groups: Vec<u64>,
    is_wrong: bool,
}

impl Seen {
    fn of(source: &dyn MixtureSource, grid: &MixtureGrid, block: UVec3) -> Seen {
        let volume_mm3 = grid.voxel_mm.element_product();
        let mut seen = Seen {
            radii_mm: [f32::INFINITY, 0.0],
            ..Seen::default()
        };
        for_each_population(source, grid, block, |_, p| {
            let wrong = !(p.length_density_per_mm2.is_finite()
                && p.radius_mm.is_finite()
                && p.radius_mm > 0.0
                && p.spread_rad >= 0.0
                && (p.axis.length_squared() - 1.0).abs() < 1e-3);
            seen.is_wrong |= wrong;
            seen.populations += 1;
            seen.length_mm += f64::from(p.length_density_per_mm2) * volume_mm3;
            seen.radii_mm[0] = seen.radii_mm[0].min(p.radius_mm);
            seen.radii_mm[1] = seen.radii_mm[1].max(p.radius_mm);
            let group = group_of(p);
            if !seen.groups.contains(&group) {
                seen.groups.push(group);
            }
        });
        seen
    }
}

fn group_of(p: &FibrePopulation) -> u64 {
    u64::from(p.yarn) << 16 | u64::from(p.material)
}

/// Calls `visit` with every population of a block, and the number of its voxel there.
fn for_each_population(
    source: &dyn MixtureSource,
    grid: &MixtureGrid,
    block: UVec3,
    mut visit: impl FnMut(u32, &FibrePopulation),
) {
    let low = block * BLOCK;
    for voxel in 0..VOXELS as u32 {
        let cell = low + cell_in_block(voxel);
        if !cell.cmplt(grid.dims).all() {
            continue;
        }
        for p in source.mixture(cell).iter() {
            // Written so that a number that is none counts as a population.
            if p.length_density_per_mm2 <= 0.0 {
                continue;
            }
            visit(voxel, p);
        }
    }
}

/// The populations of a block, sorted by voxel.
fn gather(source: &dyn MixtureSource, grid: &MixtureGrid, block: UVec3) -> Vec<GatheredPopulation> {
    let volume_mm3 = grid.voxel_mm.element_product();
    let mut populations = Vec::new();
    for_each_population(source, grid, block, |voxel, p| {
        let length_mm = f64::from(p.length_density_per_mm2) * volume_mm3;
        let along = mean_cos_sq(p.spread_rad);
        let tensor = Sym3::axial(p.axis, 0.5 * (1.0 - along), along);
        populations.push(GatheredPopulation {
            key: GatheredPopulation::key_of(voxel, group_of(p)),
            ..GatheredPopulation::of_line(length_mm, p.radius_mm, tensor)
        });
    });
    sort_by_voxel(&mut populations);
    populations
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use organza_basis::unwatched;
    use std::ops::ControlFlow;

    /// Some voxels of a box of 40 x 8 x 5.
    struct Some40 {
        repeats: bool,
        axis: Vec3,
    }

    impl MixtureSource for Some40 {
        fn grid(&self) -> MixtureGrid {
            MixtureGrid {
                min_mm: DVec3::new(1.0, 2.0, 3.0),
                voxel_mm: DVec3::new(0.01, 0.01, 0.02),
                dims: UVec3::new(40, 8, 5),
                repeats: self.repeats,
            }
        }

        fn material_count(&self) -> usize {
            2
        }

        fn mixture(&self, cell: UVec3) -> Mixture {
            let mut mixture = Mixture::EMPTY;
            if cell.element_sum().is_multiple_of(3) {
                mixture.push(FibrePopulation {
                    length_density_per_mm2: 100.0 + cell.x as f32,
                    axis: self.axis,
                    spread_rad: 0.2,
                    radius_mm: 0.005,
                    material: (cell.y % 2) as u16,
                    yarn: cell.z,
                });
            }
            mixture
        }
    }

    #[test]
    fn the_octree_holds_what_the_voxels_held() {
        let source = Some40 {
            repeats: false,
            axis: Vec3::new(0.6, 0.0, 0.8),
        };
        let octree = octree_of_mixtures(&source, None, None, &unwatched).unwrap();
        octree.assert_well_formed();
        assert_eq!(octree.level_count(), 6);
        assert!(octree.dims(0).cmpge(source.grid().dims).all());
        let mut length = 0.0;
        for z in 0..5 {
            for y in 0..8 {
                for x in 0..40 {
                    let cell = UVec3::new(x, y, z);
                    let (got, want) = (octree.mixture(0, cell), source.mixture(cell));
                    assert_eq!(got.len(), want.len(), "{cell}");
                    let (Some(g), Some(w)) = (got.first(), want.first()) else {
                        continue;
                    };
                    length += f64::from(w.length_density_per_mm2) * 2e-6;
                    let share = g.length_density_per_mm2 / w.length_density_per_mm2;
                    assert!((share - 1.0).abs() < 4.0 * f32::EPSILON, "{share}");
                    // Margin: the angle that stored axes are kept within.
                    assert!(g.axis.cross(w.axis).length() < 6e-4);
                    assert!((g.spread_rad - w.spread_rad).abs() < 3e-3);
                    assert_eq!((g.material, g.yarn), (w.material, w.yarn));
                    assert!((g.radius_mm / w.radius_mm - 1.0).abs() <= 2.0 * f32::EPSILON);
                }
            }
        }
        for level in 0..6 {
            assert!((octree.fibre_length_mm(level) / length - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn a_period_stays_whole_and_nonsense_is_refused() {
        let whole = Some40 {
            repeats: true,
            axis: Vec3::X,
        };
        let octree = octree_of_mixtures(&whole, None, None, &unwatched).unwrap();
        // 40 and 8 are multiples of eight.
        assert_eq!(octree.level_count(), 4);
        assert_eq!(octree.dims(0), UVec3::new(40, 8, 8));
        let refused = |source: &Some40, levels, memory| {
            octree_of_mixtures(source, levels, memory, &unwatched).is_err()
        };
        assert!(refused(&whole, Some(5), None));
        assert!(refused(&whole, Some(9), None));
        assert!(refused(&whole, None, Some(1000)));
        let bent = Some40 {
            repeats: false,
            axis: Vec3::ZERO,
        };
        assert!(refused(&bent, None, None));
        let stop = |_| ControlFlow::Break(());
        let stopped = octree_of_mixtures(&whole, None, None, &stop);
        assert!(matches!(stopped, Err(Error::Stopped(_))));
    }
}
