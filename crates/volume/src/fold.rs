//! Joins populations that one block gathered at different times.

use crate::cluster::{GatheredPopulation, KeepApart, Merger};

/// Maximum number of populations that a voxel holds while it is filled; beyond this number the
/// nearest are merged, so that the number of occupied voxels bounds the memory.
const MAX_GATHERED: usize = 16;
/// Their number after such a merger.
const MERGED_POPULATIONS: usize = 8;

/// Joins two lists of populations of one block. Both lists and the result are sorted by voxel.
pub fn fold(
    whole: Vec<GatheredPopulation>,
    part: Vec<GatheredPopulation>,
) -> Vec<GatheredPopulation> {
    let crowded = |v: &[GatheredPopulation]| v.len() > MAX_GATHERED;
    if whole.is_empty() && !part.chunk_by(|a, b| a.voxel() == b.voxel()).any(crowded) {
        return part;
    }
    let mut merger = Merger::default();
    let mut out = Vec::with_capacity(whole.len() + part.len());
    let (mut i, mut j) = (0, 0);
    let mut voxel = Vec::new();
    loop {
        let next = [whole.get(i), part.get(j)];
        let voxels = next.into_iter().flatten().map(GatheredPopulation::voxel);
        let Some(at) = voxels.min() else {
            return out;
        };
        voxel.clear();
        while i < whole.len() && whole[i].voxel() == at {
            voxel.push(whole[i]);
            i += 1;
        }
        while j < part.len() && part[j].voxel() == at {
            join(&mut voxel, &part[j]);
            if voxel.len() > MAX_GATHERED {
                merger.merge_to(&mut voxel, MERGED_POPULATIONS, 0.0, KeepApart::Yarns);
            }
            j += 1;
        }
        voxel.sort_unstable_by_key(|l| l.key);
        out.extend_from_slice(&voxel);
    }
}

/// Adds a population to the lobe of its group with a similar direction, or as another lobe.
fn join(voxel: &mut Vec<GatheredPopulation>, new: &GatheredPopulation) {
    let nearness = |l: &GatheredPopulation| f64::from(l.likeness(new)) / l.length_mm;
    let of_group = voxel.iter_mut().filter(|l| l.group() == new.group());
    let mut lobes: Vec<&mut GatheredPopulation> = of_group.collect();
    lobes.sort_by(|a, b| nearness(b).total_cmp(&nearness(a)));
    let full = lobes.len() >= 2;
    match lobes.first_mut() {
        Some(nearest) if full || nearest.is_like(new) => nearest.add(new),
        Some(other) => {
            let lobe = 1 - (other.key & 1);
            let key = (new.key & !1) | lobe;
            voxel.push(GatheredPopulation { key, ..*new });
        }
        None => voxel.push(*new),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn population(
        voxel: u32,
        yarn: u64,
        length_mm: f64,
        tangent: Vec3,
        lobe: u64,
    ) -> GatheredPopulation {
        let key = GatheredPopulation::key_of(voxel, yarn << 16 | 1) | lobe;
        GatheredPopulation::new(key, length_mm, 0.01, tangent)
    }

    #[test]
    fn folding_keeps_lobes_apart_whatever_their_order() {
        let first = vec![
            population(9, 3, 2.0, Vec3::X, 0),
            population(9, 3, 1.0, Vec3::Y, 1),
        ];
        let then = vec![
            population(9, 3, 1.0, Vec3::Y, 0),
            population(9, 3, 1.0, Vec3::X, 1),
        ];
        let populations = fold(fold(Vec::new(), first), then);
        let lengths: Vec<f64> = populations.iter().map(|l| l.length_mm).collect();
        assert_eq!(lengths, [3.0, 2.0]);
        assert_eq!(populations[0].moment_mm.diagonal, Vec3::new(3.0, 0.0, 0.0));
        let mut all = populations.iter();
        assert!(all.all(|l| l.voxel() == 9 && l.group() == 3 << 16 | 1));
    }

    #[test]
    fn a_second_direction_takes_the_free_lobe() {
        for lobe in [0, 1] {
            let populations = fold(
                vec![population(9, 3, 2.0, Vec3::X, lobe)],
                vec![population(9, 3, 1.0, Vec3::Y, lobe)],
            );
            let lobes = populations.iter().map(|l| (l.key & 1, l.length_mm));
            let found: Vec<(u64, f64)> = lobes.collect();
            let mut expected = [(lobe, 2.0), (1 - lobe, 1.0)];
            expected.sort_unstable_by_key(|l| l.0);
            assert_eq!(found, expected);
            assert!(populations.iter().all(|l| l.group() == 3 << 16 | 1));
        }
    }

    #[test]
    fn crowds_of_yarns_stay_bounded() {
        let one_by_one = (0..100).fold(Vec::new(), |whole, yarn| {
            fold(whole, vec![population(0, yarn, 1.0, Vec3::Z, 0)])
        });
        let together: Vec<GatheredPopulation> = (0..100)
            .map(|k| population(0, k, 1.0, Vec3::Z, 0))
            .collect();
        for populations in [one_by_one, fold(Vec::new(), together)] {
            assert!(populations.len() <= MAX_GATHERED);
            let total: f64 = populations.iter().map(|l| l.length_mm).sum();
            assert_eq!(total, 100.0);
        }
    }
}
