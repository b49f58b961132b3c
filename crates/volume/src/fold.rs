//! Joining what a block gathered at different times.

use crate::cluster::{Apart, Lump, Merger};

/// Most populations that a voxel remembers while it is being filled; beyond,
/// the nearest are merged. Keeps memory bounded by occupied voxels.
const MOST_LUMPS: usize = 16;
/// Left after such a merger.
const LEFT_LUMPS: usize = 8;

/// Joins two lists of populations of one block, both sorted by voxel; so is
/// the result.
pub fn fold(whole: Vec<Lump>, part: Vec<Lump>) -> Vec<Lump> {
    let crowded = |v: &[Lump]| v.len() > MOST_LUMPS;
    if whole.is_empty() && !part.chunk_by(|a, b| a.voxel() == b.voxel()).any(crowded) {
        return part;
    }
    let mut merger = Merger::default();
    let mut out = Vec::with_capacity(whole.len() + part.len());
    let (mut i, mut j) = (0, 0);
    let mut voxel = Vec::new();
    loop {
        let next = [whole.get(i), part.get(j)];
        let Some(at) = next.into_iter().flatten().map(Lump::voxel).min() else {
            return out;
        };
        voxel.clear();
        while i < whole.len() && whole[i].voxel() == at {
            voxel.push(whole[i]);
            i += 1;
        }
        while j < part.len() && part[j].voxel() == at {
            join(&mut voxel, &part[j]);
            if voxel.len() > MOST_LUMPS {
                merger.merge_to(&mut voxel, LEFT_LUMPS, 0.0, Apart::Yarns);
            }
            j += 1;
        }
        voxel.sort_unstable_by_key(|l| l.key);
        out.extend_from_slice(&voxel);
    }
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
            let key = (new.key & !1) | lobe;
            voxel.push(Lump { key, ..*new });
        }
        None => voxel.push(*new),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    fn lump(voxel: u32, yarn: u64, length_mm: f64, tangent: Vec3, lobe: u64) -> Lump {
        let key = Lump::key_of(voxel, yarn << 16 | 1) | lobe;
        Lump::new(key, length_mm, 0.01, tangent)
    }

    #[test]
    fn folding_keeps_lobes_apart_whatever_their_order() {
        let first = vec![lump(9, 3, 2.0, Vec3::X, 0), lump(9, 3, 1.0, Vec3::Y, 1)];
        let then = vec![lump(9, 3, 1.0, Vec3::Y, 0), lump(9, 3, 1.0, Vec3::X, 1)];
        let lumps = fold(fold(Vec::new(), first), then);
        let lengths: Vec<f64> = lumps.iter().map(|l| l.length_mm).collect();
        assert_eq!(lengths, [3.0, 2.0]);
        assert_eq!(lumps[0].moment_mm.diagonal, Vec3::new(3.0, 0.0, 0.0));
        assert!(
            lumps
                .iter()
                .all(|l| l.voxel() == 9 && l.group() == 3 << 16 | 1)
        );
    }

    #[test]
    fn crowds_of_yarns_stay_bounded() {
        let one_by_one = (0..100).fold(Vec::new(), |whole, yarn| {
            fold(whole, vec![lump(0, yarn, 1.0, Vec3::Z, 0)])
        });
        let together: Vec<Lump> = (0..100).map(|k| lump(0, k, 1.0, Vec3::Z, 0)).collect();
        for lumps in [one_by_one, fold(Vec::new(), together)] {
            assert!(lumps.len() <= MOST_LUMPS);
            let total: f64 = lumps.iter().map(|l| l.length_mm).sum();
            assert_eq!(total, 100.0);
        }
    }
}
