//! Every invariant of the octree, checked.

use super::{EMPTY, Level, Octree, broadside};
use crate::lattice::{bit_of, brick_at, brick_index, bricks_across, cell_of_bit};
use crate::record::{decode_group, is_valid_direction};
use glam::UVec3;

impl Octree {
    /// Panics, saying what is wrong, unless every invariant holds: tables,
    /// masks and ranges agree; no brick, cell or population is empty; cells
    /// outside the box are; every coarse cell holds exactly the length of its
    /// eight; majorants bound what lies below them.
    ///
    /// # Panics
    /// When an invariant is broken.
    pub fn assert_well_formed(&self) {
        if let Err(problem) = self.check() {
            panic!("octree is not well formed: {problem}");
        }
    }

    /// As [`Octree::assert_well_formed`], for data that came from outside.
    pub(crate) fn check(&self) -> Result<(), String> {
        if self.levels.len() != usize::from(self.lattice.levels) {
            return Err(format!(
                "{} levels stored, {} named",
                self.levels.len(),
                self.lattice.levels
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

    fn check_level(&self, level: u8, l: &Level) -> Result<(), String> {
        let dims = self.lattice.dims_at(level);
        if l.grid != bricks_across(dims)
            || l.brick_of.len() as u64 != l.grid.as_u64vec3().element_product()
        {
            return Err("the table of bricks has the wrong size".into());
        }
        let mut next = 0;
        let mut first = 0;
        for (at, &index) in l.brick_of.iter().enumerate() {
            if index == EMPTY {
                continue;
            }
            let low = brick_at(at as u32, l.grid) << 2u32;
            let Some(brick) = l.bricks.get(index as usize).filter(|_| index == next) else {
                return Err(format!(
                    "brick at {low} has number {index}, expected {next}"
                ));
            };
            next += 1;
            let [a, b, c, d] = brick.masks;
            if a == 0 || b & !a != 0 || c & !b != 0 || d & !c != 0 {
                return Err(format!("brick at {low} has masks {a:x} {b:x} {c:x} {d:x}"));
            }
            if brick.first != first {
                return Err(format!(
                    "brick at {low} begins at {}, expected {first}",
                    brick.first
                ));
            }
            first += brick.masks.iter().map(|m| m.count_ones()).sum::<u32>();
            if first as usize > l.records.len() {
                return Err(format!("brick at {low} ends beyond the populations"));
            }
            for bit in 0..64 {
                let records = &l.records[brick.records_of(bit)];
                let cell = low + cell_of_bit(bit);
                if !records.is_empty() && cell.cmpge(dims).any() {
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
        }
        if next as usize != l.bricks.len() || first as usize != l.records.len() {
            return Err("bricks or populations that no cell names".into());
        }
        Ok(())
    }
}

/// Sum of the lengths in a cell, quanta.
fn quanta(l: &Level, cell: UVec3) -> u64 {
    let at = l.brick_of[brick_index(cell >> 2u32, l.grid) as usize];
    if at == EMPTY {
        return 0;
    }
    let records = &l.records[l.bricks[at as usize].records_of(bit_of(cell))];
    records.iter().map(|r| u64::from(r.length)).sum()
}

fn check_pair(finer: &Level, coarser: &Level) -> Result<(), String> {
    let mut sums = vec![[0u64; 64]; coarser.bricks.len()];
    let mut majorants = vec![0.0f32; coarser.bricks.len()];
    for (at, &index) in finer.brick_of.iter().enumerate() {
        if index == EMPTY {
            continue;
        }
        let brick = brick_at(at as u32, finer.grid);
        let parent = brick_index(brick >> 1u32, coarser.grid) as usize;
        let parent = coarser.brick_of.get(parent).map_or(EMPTY, |&p| p);
        if parent == EMPTY {
            return Err(format!("brick {brick} has no brick above it"));
        }
        let parent = parent as usize;
        let fine = &finer.bricks[index as usize];
        majorants[parent] = majorants[parent].max(fine.majorant_per_mm);
        for bit in 0..64 {
            let cell = (brick << 2u32) + cell_of_bit(bit);
            sums[parent][bit_of(cell >> 1u32) as usize] += quanta(finer, cell);
        }
    }
    for (at, &index) in coarser.brick_of.iter().enumerate() {
        if index == EMPTY {
            continue;
        }
        let low = brick_at(at as u32, coarser.grid) << 2u32;
        for bit in 0..64 {
            let cell = low + cell_of_bit(bit);
            let (held, below) = (quanta(coarser, cell), sums[index as usize][bit as usize]);
            if held != below {
                return Err(format!(
                    "cell {cell} holds {held} quanta, its eight {below}"
                ));
            }
        }
        if coarser.bricks[index as usize].majorant_per_mm != majorants[index as usize] {
            return Err(format!(
                "brick at {low} does not carry the greatest majorant below it"
            ));
        }
    }
    Ok(())
}
