//! Ways to find the populations of a voxel, each rival of the octree in a type of its own.

use super::tree_for_look_ups;
use criterion::{Criterion, Throughput};
use glam::UVec3;
use organza_basis::PathRng;
use organza_volume::Octree;
use std::collections::HashMap;

/// A rival layout: finds the populations of a finest voxel.
trait Layout {
    fn records(&self, cell: UVec3) -> &[[f32; 3]];
    fn bytes(&self) -> usize;
}

fn bit(cell: UVec3) -> u32 {
    let c = cell & 3;
    c.x + 4 * c.y + 16 * c.z
}

/// Occupied cells with their populations (extinction and two words along).
fn contents(tree: &Octree) -> Vec<(UVec3, Vec<[f32; 3]>)> {
    let mut all = Vec::new();
    tree.for_each_occupied(0, |cell| {
        let m = tree.mixture(0, cell);
        let records = m
            .as_slice()
            .iter()
            .map(|c| [c.broadside_per_mm(), c.spread_rad, c.axis.x]);
        all.push((cell, records.collect()));
    });
    all
}

/// One index for each voxel of the box.
struct EveryVoxel {
    dims: UVec3,
    first: Vec<u32>,
    records: Vec<[f32; 3]>,
}

impl EveryVoxel {
    fn new(dims: UVec3, all: &[(UVec3, Vec<[f32; 3]>)]) -> EveryVoxel {
        let index = |c: UVec3| (c.x + dims.x * (c.y + dims.y * c.z)) as usize;
        let mut first = vec![0u32; dims.element_product() as usize + 1];
        all.iter()
            .for_each(|(c, r)| first[index(*c) + 1] = r.len() as u32);
        for i in 1..first.len() {
            first[i] += first[i - 1];
        }
        let mut records = vec![[0.0; 3]; first[first.len() - 1] as usize];
        for (c, r) in all {
            let at = first[index(*c)] as usize;
            records[at..at + r.len()].copy_from_slice(r);
        }
        EveryVoxel {
            dims,
            first,
            records,
        }
    }
}

impl Layout for EveryVoxel {
    fn records(&self, c: UVec3) -> &[[f32; 3]] {
        let i = (c.x + self.dims.x * (c.y + self.dims.y * c.z)) as usize;
        &self.records[self.first[i] as usize..self.first[i + 1] as usize]
    }

    fn bytes(&self) -> usize {
        4 * self.first.len() + 12 * self.records.len()
    }
}

/// Bricks of 4^3 with masks, found by hash.
struct Hashed {
    bricks: HashMap<UVec3, ([u64; 4], u32)>,
    records: Vec<[f32; 3]>,
}

impl Hashed {
    fn new(all: &[(UVec3, Vec<[f32; 3]>)]) -> Hashed {
        let mut sorted: Vec<_> = all.iter().collect();
        sorted.sort_by_key(|(c, _)| ((*c >> 2u32).to_array(), bit(*c)));
        let mut made = Hashed {
            bricks: HashMap::new(),
            records: Vec::new(),
        };
        for (c, r) in sorted {
            let first = made.records.len() as u32;
            let brick = made.bricks.entry(*c >> 2u32).or_insert(([0; 4], first));
            brick.0[..r.len()]
                .iter_mut()
                .for_each(|m| *m |= 1 << bit(*c));
            made.records.extend(r);
        }
        made
    }
}

fn range(masks: &[u64; 4], first: u32, bit: u32) -> std::ops::Range<usize> {
    let below = (1u64 << bit) - 1;
    let before: u32 = masks.iter().map(|m| (m & below).count_ones()).sum();
    let count: u32 = masks.iter().map(|m| (m >> bit) as u32 & 1).sum();
    let start = (first + before) as usize;
    start..start + count as usize
}

impl Layout for Hashed {
    fn records(&self, c: UVec3) -> &[[f32; 3]] {
        match self.bricks.get(&(c >> 2u32)) {
            Some((masks, first)) => &self.records[range(masks, *first, bit(c))],
            None => &[],
        }
    }

    fn bytes(&self) -> usize {
        // Key, value and control byte, seven eighths full at best.
        self.bricks.capacity() * (12 + 40 + 1) + 12 * self.records.len()
    }
}

/// The textbook's octree: eight children by mask and rank, from the root down.
struct FromRoot {
    levels: u32,
    /// Mask of children that exist and index of the first.
    nodes: Vec<(u8, u32)>,
    leaves: Vec<(u32, u32)>,
    records: Vec<[f32; 3]>,
}

impl FromRoot {
    fn new(dims: UVec3, all: &[(UVec3, Vec<[f32; 3]>)]) -> FromRoot {
        let levels = dims.max_element().next_power_of_two().trailing_zeros();
        let morton = |c: UVec3| {
            (0..levels).fold(0u64, |m, k| {
                let b = (c >> k) & 1;
                m | u64::from(b.x | b.y << 1 | b.z << 2) << (3 * k)
            })
        };
        let mut sorted: Vec<_> = all.iter().map(|(c, r)| (morton(*c), r)).collect();
        sorted.sort_by_key(|s| s.0);
        let mut made = FromRoot {
            levels,
            nodes: Vec::new(),
            leaves: Vec::new(),
            records: Vec::new(),
        };
        for level in (1..=levels).rev() {
            let keys: Vec<u64> = sorted.iter().map(|s| s.0 >> (3 * (level - 1))).collect();
            let start = made.nodes.len() as u32;
            let mut parents: Vec<Vec<u64>> = Vec::new();
            let mut distinct = keys;
            distinct.dedup();
            for part in distinct.chunk_by(|a, b| a >> 3 == b >> 3) {
                parents.push(part.to_vec());
            }
            let mut child = if level > 1 {
                start + parents.len() as u32
            } else {
                0
            };
            for p in parents {
                let mask = p.iter().fold(0u8, |m, k| m | 1 << (k & 7));
                made.nodes.push((mask, child));
                child += p.len() as u32;
            }
        }
        for (_, r) in sorted {
            made.leaves
                .push((made.records.len() as u32, r.len() as u32));
            made.records.extend(r);
        }
        made
    }
}

impl Layout for FromRoot {
    fn records(&self, c: UVec3) -> &[[f32; 3]] {
        let mut at = 0u32;
        for level in (0..self.levels).rev() {
            let b = (c >> level) & 1;
            let k = b.x | b.y << 1 | b.z << 2;
            let (mask, first) = self.nodes[at as usize];
            if mask >> k & 1 == 0 {
                return &[];
            }
            at = first + (mask & ((1u16 << k) - 1) as u8).count_ones();
        }
        let (first, count) = self.leaves[at as usize];
        &self.records[first as usize..(first + count) as usize]
    }

    fn bytes(&self) -> usize {
        8 * self.nodes.len() + 8 * self.leaves.len() + 12 * self.records.len()
    }
}

/// Bricks of 8^3: one mask of eight words, one start for each word.
struct LargeBricks {
    grid: UVec3,
    table: Vec<u32>,
    bricks: Vec<([u64; 8], [u32; 8])>,
    /// First population and how many, since masks tell only whether there is one.
    voxels: Vec<u32>,
    records: Vec<[f32; 3]>,
}

impl LargeBricks {
    fn new(dims: UVec3, all: &[(UVec3, Vec<[f32; 3]>)]) -> LargeBricks {
        let grid: UVec3 = (dims + 7) >> 3u32;
        let place = |c: UVec3| {
            let b = c >> 3u32;
            let r = c & 7;
            (b.x + grid.x * (b.y + grid.y * b.z), r.z, r.x + 8 * r.y)
        };
        let mut sorted: Vec<_> = all.iter().map(|(c, r)| (place(*c), r)).collect();
        sorted.sort_by_key(|s| s.0);
        let mut made = LargeBricks {
            grid,
            table: vec![u32::MAX; grid.element_product() as usize],
            bricks: Vec::new(),
            voxels: Vec::new(),
            records: Vec::new(),
        };
        for ((brick, word, bit), r) in sorted {
            let at = &mut made.table[brick as usize];
            if *at == u32::MAX {
                *at = made.bricks.len() as u32;
                made.bricks.push(([0; 8], [0; 8]));
            }
            let (masks, starts) = &mut made.bricks[*at as usize];
            if masks[word as usize] == 0 {
                starts[word as usize] = made.voxels.len() as u32;
            }
            masks[word as usize] |= 1 << bit;
            made.voxels
                .push((made.records.len() as u32) << 3 | r.len() as u32);
            made.records.extend(r);
        }
        made
    }
}

impl Layout for LargeBricks {
    fn records(&self, c: UVec3) -> &[[f32; 3]] {
        let (b, r): (UVec3, UVec3) = (c >> 3u32, c & 7);
        let at = self.table[(b.x + self.grid.x * (b.y + self.grid.y * b.z)) as usize];
        if at == u32::MAX {
            return &[];
        }
        let (masks, starts) = &self.bricks[at as usize];
        let (mask, bit) = (masks[r.z as usize], r.x + 8 * r.y);
        if mask >> bit & 1 == 0 {
            return &[];
        }
        let voxel = starts[r.z as usize] + (mask & ((1u64 << bit) - 1)).count_ones();
        let packed = self.voxels[voxel as usize];
        let first = (packed >> 3) as usize;
        &self.records[first..first + (packed & 7) as usize]
    }

    fn bytes(&self) -> usize {
        4 * self.table.len()
            + 96 * self.bricks.len()
            + 4 * self.voxels.len()
            + 12 * self.records.len()
    }
}

pub fn layouts(c: &mut Criterion) {
    let tree = tree_for_look_ups();
    let all = contents(&tree);
    let dims = tree.dims(0);
    let occupied = tree.occupied_voxels() as f64;
    let mut rng = PathRng::from_seed(2);
    let points: Vec<UVec3> = (0..1 << 16)
        .map(|_| UVec3::new(rng.below(dims.x), rng.below(dims.y), rng.below(dims.z)))
        .collect();
    let truth = |p: &UVec3| tree.broadside_per_mm(0, *p);
    let mut group = c.benchmark_group("layout");
    group.throughput(Throughput::Elements(points.len() as u64));
    println!(
        "octree, level 0: {:.1} bytes per occupied voxel",
        tree.level_memory_bytes(0) as f64 / occupied
    );
    group.bench_function("octree: table of 4^3 bricks", |b| {
        b.iter(|| points.iter().map(truth).sum::<f32>());
    });
    group.bench_function("octree: whole mixture decoded", |b| {
        b.iter(|| {
            points
                .iter()
                .map(|p| tree.mixture(0, *p).broadside_per_mm())
                .sum::<f32>()
        });
    });
    group.bench_function("octree: majorant of a 4^3 region", |b| {
        b.iter(|| {
            points
                .iter()
                .map(|p| tree.majorant_per_mm(2, *p >> 2u32))
                .sum::<f32>()
        });
    });
    let rivals: [(&str, Box<dyn Layout>); 4] = [
        (
            "table of 8^3 bricks",
            Box::new(LargeBricks::new(dims, &all)),
        ),
        ("hash of 4^3 bricks", Box::new(Hashed::new(&all))),
        ("walk from the root", Box::new(FromRoot::new(dims, &all))),
        (
            "index for every voxel",
            Box::new(EveryVoxel::new(dims, &all)),
        ),
    ];
    for (name, rival) in &rivals {
        let get = |p: &UVec3| rival.records(*p).iter().map(|r| r[0]).sum::<f32>();
        for p in &points {
            assert!((get(p) - truth(p)).abs() <= 1e-4 * truth(p), "{name} {p}");
        }
        println!(
            "{name}: {:.1} bytes per occupied voxel",
            rival.bytes() as f64 / occupied
        );
        group.bench_function(*name, |b| b.iter(|| points.iter().map(get).sum::<f32>()));
    }
    group.finish();
}
