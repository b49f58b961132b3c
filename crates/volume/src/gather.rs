//! Gathering clipped pieces of curve, brick by brick.
//!
//! Every batch of the source is gathered on its own, then folded into the
//! whole in the order of batches: sums do not depend on how many threads
//! worked or which came first.

use crate::cluster::{Apart, Lump, merge_to};
use std::collections::HashMap;

/// Most populations that a voxel remembers while it is being filled; beyond,
/// the nearest are merged. Keeps memory bounded by occupied voxels.
const MOST_LUMPS: usize = 16;
/// Left after such a merger.
const LEFT_LUMPS: usize = 8;

const NONE: u32 = u32::MAX;

/// Populations of one group and lobe in one brick.
struct Block {
    brick: u32,
    group: u64,
    lobe: u8,
    /// Next block of the brick.
    next: u32,
    occupied: u64,
}

/// The pieces of one batch. Reused from batch to batch.
pub struct Gather {
    first_block: Vec<u32>,
    blocks: Vec<Block>,
    sums: Vec<[Lump; 64]>,
    last: (u32, u64, u32),
}

/// What one batch left, sorted by brick and key.
pub struct Gathered {
    /// Brick and the end of its part of `lumps`.
    pub bricks: Vec<(u32, u32)>,
    /// Populations.
    pub lumps: Vec<Lump>,
}

impl Gather {
    /// For a grid of so many bricks.
    pub fn new(brick_count: usize) -> Gather {
        Gather {
            first_block: vec![NONE; brick_count],
            blocks: Vec::new(),
            sums: Vec::new(),
            last: (NONE, 0, NONE),
        }
    }

    fn block(&mut self, brick: u32, group: u64, lobe: u8) -> usize {
        let mut at = self.first_block[brick as usize];
        while at != NONE {
            let b = &self.blocks[at as usize];
            if b.group == group && b.lobe == lobe {
                return at as usize;
            }
            at = b.next;
        }
        let new = self.blocks.len();
        self.blocks.push(Block {
            brick,
            group,
            lobe,
            next: self.first_block[brick as usize],
            occupied: 0,
        });
        self.sums.push([Lump::default(); 64]);
        self.first_block[brick as usize] = new as u32;
        new
    }

    /// Adds a piece to its voxel: to the lobe of its yarn that it is like, or
    /// to a second one.
    pub fn add(&mut self, brick: u32, piece: &Lump) {
        let group = piece.group();
        if (brick, group) != (self.last.0, self.last.1) {
            self.last = (brick, group, self.block(brick, group, 0) as u32);
        }
        let (block, bit) = (self.last.2 as usize, piece.bit());
        if self.put(block, bit, piece, false) {
            return;
        }
        let second = self.block(brick, group, 1);
        if self.put(second, bit, piece, false) {
            return;
        }
        let nearness = |at: usize| {
            let sum = &self.sums[at][bit as usize];
            f64::from(sum.likeness(piece)) / sum.length_mm
        };
        let nearest = if nearness(second) > nearness(block) {
            second
        } else {
            block
        };
        self.put(nearest, bit, piece, true);
    }

    fn put(&mut self, block: usize, bit: u32, piece: &Lump, anyway: bool) -> bool {
        let b = &mut self.blocks[block];
        let sum = &mut self.sums[block][bit as usize];
        if b.occupied >> bit & 1 == 0 {
            b.occupied |= 1 << bit;
            *sum = *piece;
            sum.key |= u64::from(b.lobe);
        } else if anyway || sum.is_like(piece) {
            sum.add(piece);
        } else {
            return false;
        }
        true
    }

    /// Takes what was gathered and leaves this empty.
    pub fn take(&mut self) -> Gathered {
        let mut order: Vec<u32> = (0..self.blocks.len() as u32).collect();
        order.sort_unstable_by_key(|&i| self.blocks[i as usize].brick);
        let mut out = Gathered {
            bricks: Vec::new(),
            lumps: Vec::new(),
        };
        for part in
            order.chunk_by(|&a, &b| self.blocks[a as usize].brick == self.blocks[b as usize].brick)
        {
            let start = out.lumps.len();
            for &i in part {
                let mut left = self.blocks[i as usize].occupied;
                while left != 0 {
                    let bit = left.trailing_zeros();
                    left &= left - 1;
                    out.lumps.push(self.sums[i as usize][bit as usize]);
                }
            }
            out.lumps[start..].sort_unstable_by_key(|l| l.key);
            let brick = self.blocks[part[0] as usize].brick;
            out.bricks.push((brick, out.lumps.len() as u32));
            self.first_block[brick as usize] = NONE;
        }
        self.blocks.clear();
        self.sums.clear();
        self.last = (NONE, 0, NONE);
        out
    }
}

/// A share of the bricks of the whole tile, chosen by number.
#[derive(Default)]
pub struct Shard {
    /// Populations of each brick, sorted by key.
    pub bricks: HashMap<u32, Vec<Lump>>,
    /// Populations in all of them.
    pub lump_count: usize,
}

impl Shard {
    /// Folds in this shard's part of a batch.
    pub fn fold(&mut self, batch: &Gathered, shard: u32, shard_count: u32) {
        let mut start = 0;
        for &(brick, end) in &batch.bricks {
            let part = &batch.lumps[start..end as usize];
            start = end as usize;
            if brick % shard_count != shard {
                continue;
            }
            let whole = self.bricks.entry(brick).or_default();
            self.lump_count -= whole.len();
            let crowded = |v: &[Lump]| v.len() > MOST_LUMPS;
            if whole.is_empty() && !part.chunk_by(|a, b| a.bit() == b.bit()).any(crowded) {
                whole.extend_from_slice(part);
            } else {
                *whole = folded(whole, part);
            }
            self.lump_count += whole.len();
        }
    }
}

/// Joins two sorted lists of populations of one brick.
fn folded(whole: &[Lump], part: &[Lump]) -> Vec<Lump> {
    let mut out = Vec::with_capacity(whole.len() + part.len());
    let (mut i, mut j) = (0, 0);
    let mut voxel = Vec::new();
    for bit in 0..64 {
        voxel.clear();
        while i < whole.len() && whole[i].bit() == bit {
            voxel.push(whole[i]);
            i += 1;
        }
        while j < part.len() && part[j].bit() == bit {
            join(&mut voxel, &part[j]);
            if voxel.len() > MOST_LUMPS {
                merge_to(&mut voxel, LEFT_LUMPS, 0.0, Apart::Yarns);
            }
            j += 1;
        }
        voxel.sort_unstable_by_key(|l| l.key);
        out.extend_from_slice(&voxel);
    }
    out
}

/// Adds a population to the lobe of its group that it is like, or as another.
fn join(voxel: &mut Vec<Lump>, new: &Lump) {
    let nearness = |l: &Lump| f64::from(l.likeness(new)) / l.length_mm;
    let of_group = voxel.iter_mut().filter(|l| l.group() == new.group());
    let mut lobes: Vec<&mut Lump> = of_group.collect();
    lobes.sort_by(|a, b| nearness(b).total_cmp(&nearness(a)));
    let full = lobes.len() >= 2;
    match lobes.first_mut() {
        Some(nearest) if full || nearest.is_like(new) => nearest.add(new),
        Some(other) => {
            let lobe = 1 - (other.key & 1);
            let key = (new.key & !0xff) | lobe;
            voxel.push(Lump { key, ..*new });
        }
        None => voxel.push(*new),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn folding_keeps_lobes_apart_whatever_their_order() {
        let piece = |t: Vec3| Lump::new(Lump::key_of(9, 3, 1), 1.0, 0.01, t);
        let gather = |ts: &[Vec3]| {
            let mut g = Gather::new(1);
            ts.iter().for_each(|&t| g.add(0, &piece(t)));
            g.take()
        };
        let mut shard = Shard::default();
        shard.fold(&gather(&[Vec3::X, Vec3::Y, Vec3::X]), 0, 1);
        shard.fold(&gather(&[Vec3::Y, Vec3::X]), 0, 1);
        let lumps = &shard.bricks[&0];
        let lengths: Vec<f64> = lumps.iter().map(|l| l.length_mm).collect();
        assert_eq!(lengths, [3.0, 2.0]);
        assert_eq!(lumps[0].moment_mm.diagonal, Vec3::new(3.0, 0.0, 0.0));
        assert!(
            lumps
                .iter()
                .all(|l| l.bit() == 9 && l.group() == 3 << 16 | 1)
        );
    }

    #[test]
    fn crowds_of_yarns_stay_bounded() {
        let mut shard = Shard::default();
        for yarn in 0..100 {
            let mut g = Gather::new(1);
            g.add(0, &Lump::new(Lump::key_of(0, yarn, 0), 1.0, 0.01, Vec3::Z));
            shard.fold(&g.take(), 0, 1);
        }
        assert!(shard.lump_count <= MOST_LUMPS);
        let total: f64 = shard.bricks[&0].iter().map(|l| l.length_mm).sum();
        assert_eq!(total, 100.0);
    }
}
