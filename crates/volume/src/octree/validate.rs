//! Checks of every invariant of the octree.

use super::{EMPTY, Group, Octree, OctreeLevel, broadside};
use crate::lattice::{bit_of, brick_at, brick_index, bricks_across, cell_of_bit, octant};
use crate::record::{Brick, decode_group, is_valid_direction};
use glam::UVec3;
use rayon::prelude::*;

impl Octree {
    /// Panics with the reason unless every invariant holds: tables, masks and ranges agree; no
    /// brick, cell or population is empty; cells outside the box are empty; every coarse cell
    /// holds exactly the length of its eight finer cells; majorants bound the extinctions below
    /// them.
    ///
    /// # Panics
    /// When an invariant is broken.
    pub fn assert_well_formed(&self) {
        if let Err(problem) = self.check() {
            panic!("octree is not well formed: {problem}");
        }
    }

    /// As [`Octree::assert_well_formed`], for data from files.
    pub(crate) fn check(&self) -> Result<(), String> {
        if self.levels.len() != usize::from(self.lattice.levels) {
            return Err(format!(
                "{} levels stored, {} named",
                self.levels.len(),
                self.lattice.levels
            ));
        }
        let materials = self.material_count;
        let beyond = |g: &&Group| u32::from(g.material) >= materials;
        if let Some(group) = self.groups.iter().find(beyond) {
            return Err(format!(
                "yarn {} has the material {}; expected a number below {materials}",
                group.yarn, group.material
            ));
        }
        for (level, l) in self.levels.iter().enumerate() {
            self.check_level(level as u8, l)
                .map_err(|problem| format!("level {level}: {problem}"))?;
        }
        for (level, pair) in self.levels.windows(2).enumerate() {
            check_pair(&pair[0], &pair[1])
                .map_err(|problem| format!("levels {level} and {}: {problem}", level + 1))?;
        }
        Ok(())
    }

    fn check_level(&self, level: u8, l: &OctreeLevel) -> Result<(), String> {
        let dims = self.lattice.dims_at(level);
        if l.grid != bricks_across(dims)
            || l.brick_of.len() as u64 != l.grid.as_u64vec3().element_product()
        {
            return Err("the table of bricks has the wrong size".into());
        }
        let mut place_of = vec![EMPTY; l.bricks.len()];
        for (at, &index) in l.brick_of.iter().enumerate() {
            if index == EMPTY {
                continue;
            }
            match place_of.get_mut(index as usize) {
                Some(place) if *place == EMPTY => *place = at as u32,
                _ => {
                    let low = brick_at(at as u32, l.grid) << 2u32;
                    return Err(format!("brick at {low} has number {index}"));
                }
            }
        }
        if place_of.contains(&EMPTY) {
            return Err("a brick without a place".into());
        }
        let mut first = 0u64;
        for (&at, brick) in place_of.iter().zip(&l.bricks) {
            if u64::from(brick.first) != first {
                let low = brick_at(at, l.grid) << 2u32;
                return Err(format!(
                    "brick at {low} begins at {}, expected {first}",
                    brick.first
                ));
            }
            first += u64::from(brick.masks.iter().map(|m| m.count_ones()).sum::<u32>());
        }
        if first != l.records.len() as u64 {
            return Err("populations without a cell".into());
        }
        let problem = place_of
            .par_iter()
            .zip(&l.bricks)
            .find_map_first(|(&at, brick)| self.check_brick(l, dims, at, brick).err());
        problem.map_or(Ok(()), Err)
    }

    /// Checks a brick whose range of populations is valid.
    fn check_brick(
        &self,
        l: &OctreeLevel,
        dims: UVec3,
        at: u32,
        brick: &Brick,
    ) -> Result<(), String> {
        let low = brick_at(at, l.grid) << 2u32;
        let [a, b, c, d] = brick.masks;
        if a == 0 || b & !a != 0 || c & !b != 0 || d & !c != 0 {
            return Err(format!("brick at {low} has masks {a:x} {b:x} {c:x} {d:x}"));
        }
        let mut left = a;
        while left != 0 {
            let bit = left.trailing_zeros();
            left &= left - 1;
            let records = &l.records[brick.records_of(bit)];
            let cell = low + cell_of_bit(bit);
            if cell.cmpge(dims).any() {
                return Err(format!("cell {cell} lies outside {dims}"));
            }
            for r in records {
                if r.length == 0
                    || decode_group(r.population) >= self.groups.len()
                    || !is_valid_direction(r.direction)
                {
                    return Err(format!("cell {cell} has the population {r:?}"));
                }
            }
            let own = broadside(records, l.density_per_quantum, &self.radii);
            let bounded = own <= brick.majorant_per_mm * (1.0 + 1e-5);
            if !(bounded && brick.majorant_per_mm.is_finite()) {
                return Err(format!(
                    "cell {cell} exceeds its majorant: {own} > {}",
                    brick.majorant_per_mm
                ));
            }
        }
        Ok(())
    }
}

/// Lengths in the cells of a brick, quanta.
fn quanta(l: &OctreeLevel, brick: &Brick) -> [u64; 64] {
    let mut sums = [0u64; 64];
    let mut left = brick.masks[0];
    while left != 0 {
        let bit = left.trailing_zeros();
        left &= left - 1;
        let records = &l.records[brick.records_of(bit)];
        sums[bit as usize] = records.iter().map(|r| u64::from(r.length)).sum();
    }
    sums
}

fn check_pair(finer: &OctreeLevel, coarser: &OctreeLevel) -> Result<(), String> {
    let checked: Vec<Result<usize, String>> = coarser
        .brick_of
        .par_iter()
        .enumerate()
        .filter(|(_, index)| **index != EMPTY)
        .map(|(at, &index)| check_parent(finer, coarser, at as u32, index))
        .collect();
    let mut children = 0;
    for number in checked {
        children += number?;
    }
    if children != finer.bricks.len() {
        return Err("a brick has no brick above it".into());
    }
    Ok(())
}

/// Checks a brick against the eight below it; returns how many there are.
fn check_parent(
    finer: &OctreeLevel,
    coarser: &OctreeLevel,
    at: u32,
    index: u32,
) -> Result<usize, String> {
    let place = brick_at(at, coarser.grid);
    let brick = &coarser.bricks[index as usize];
    let mut sums = [0u64; 64];
    let mut majorant = 0.0f32;
    let mut children = 0;
    for i in 0..8 {
        let child = (place << 1u32) + octant(i);
        if child.cmpge(finer.grid).any() {
            continue;
        }
        let below = finer.brick_of[brick_index(child, finer.grid) as usize];
        if below == EMPTY {
            continue;
        }
        children += 1;
        let below = &finer.bricks[below as usize];
        majorant = majorant.max(below.majorant_per_mm);
        for (bit, held) in quanta(finer, below).into_iter().enumerate() {
            let cell = (octant(i) << 1u32) + (cell_of_bit(bit as u32) >> 1u32);
            sums[bit_of(cell) as usize] += held;
        }
    }
    for (bit, held) in quanta(coarser, brick).into_iter().enumerate() {
        let below = sums[bit];
        if held != below {
            let cell = (place << 2u32) + cell_of_bit(bit as u32);
            return Err(format!(
                "cell {cell} holds {held} quanta, its eight {below}"
            ));
        }
    }
    if brick.majorant_per_mm != majorant {
        return Err(format!(
            "brick at {} does not carry the greatest majorant below it",
            place << 2u32
        ));
    }
    Ok(children)
}
