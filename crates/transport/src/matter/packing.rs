//! Packing factors: how much more fibres block that cannot overlap than fibres strewn
//! at random.

use organza_basis::FibrePopulation;
use organza_scatter::{packing_fraction, void_multiplier};
use organza_volume::Octree;

/// Factors on the extinction of one material's fibres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PackingFactors {
    /// For rays that leave a fibre of the same yarn.
    pub own_yarn: f32,
    /// For rays that leave a fibre of another yarn.
    pub other_yarn: f32,
    /// For rays that come from outside the cloth.
    pub outside: f32,
    /// Whether all were measured; else at least one was derived from the void fraction.
    pub is_measured: bool,
}

impl PackingFactors {
    /// As for fibres strewn at random.
    pub const NONE: PackingFactors = PackingFactors {
        own_yarn: 1.0,
        other_yarn: 1.0,
        outside: 1.0,
        is_measured: false,
    };

    /// Those of a level's materials: measured ones where the octree has them, else one
    /// over the void fraction for all.
    pub fn of_octree(octree: &Octree, level: u8) -> Vec<PackingFactors> {
        let radius_mm = greatest_radius_mm(octree, level);
        let derived = packing_by_material(octree, radius_mm, octree.material_count());
        let measured = octree
            .packing()
            .and_then(|p| p.levels.get(usize::from(level)));
        let derived = derived.into_iter().map(void_multiplier).enumerate();
        derived
            .map(|(material, derived)| {
                let found = measured.and_then(|m| m.get(material)).copied();
                let found = found.unwrap_or_default();
                PackingFactors {
                    own_yarn: found.own_yarn.map_or(derived, |f| f.mean),
                    other_yarn: found.other_yarn.map_or(derived, |f| f.mean),
                    outside: found.outside.map_or(derived, |f| f.mean),
                    is_measured: found.factors().iter().all(Option::is_some),
                }
            })
            .collect()
    }

    /// The factor on fibres of a yarn for a ray that leaves `left_yarn`.
    pub fn of(&self, yarn: u32, left_yarn: Option<u32>) -> f32 {
        match left_yarn {
            Some(left) if left == yarn => self.own_yarn,
            Some(_) => self.other_yarn,
            None => self.outside,
        }
    }

    /// The largest factor: a bound for every ray.
    pub fn largest(&self) -> f32 {
        self.own_yarn.max(self.other_yarn).max(self.outside)
    }
}

/// Edge in fibre radii of the cells over which packing is averaged: smaller ones
/// count chance clusters, larger ones the void beside the yarn.
const PACKING_CELL_RADII: f32 = 4.0;

/// The greatest radius of a level's fibres.
pub fn greatest_radius_mm(octree: &Octree, level: u8) -> f32 {
    let mut most = 0.0f32;
    octree.for_each_stored(level, |cell| {
        for c in octree.mixture(level, cell).as_slice() {
            most = most.max(c.radius_mm);
        }
    });
    most
}

/// Packing where each material is: the mean over its length of the volume that
/// fibres of any material fill in the cell around.
fn packing_by_material(octree: &Octree, radius_mm: f32, materials: usize) -> Vec<f32> {
    let off = |l: &u8| {
        let edge_mm = octree.voxel_mm(*l).element_product().cbrt();
        (edge_mm / (PACKING_CELL_RADII * radius_mm)).ln().abs()
    };
    let level = (0..octree.level_count()).min_by(|a, b| off(a).total_cmp(&off(b)));
    let level = level.unwrap_or(0);
    let mut sums = vec![(0.0f64, 0.0f64); materials];
    octree.for_each_stored(level, |cell| {
        let mixture = octree.mixture(level, cell);
        let populations = mixture.as_slice();
        let fraction =
            |c: &FibrePopulation| packing_fraction(c.length_density_per_mm2, c.radius_mm);
        let packing: f32 = populations.iter().map(fraction).sum();
        for c in populations {
            if let Some(sum) = sums.get_mut(usize::from(c.material)) {
                let length = f64::from(c.length_density_per_mm2);
                sum.0 += length * f64::from(packing);
                sum.1 += length;
            }
        }
    });
    let mean = |(sum, weight): (f64, f64)| if weight > 0.0 { sum / weight } else { 0.0 };
    sums.into_iter().map(|s| mean(s) as f32).collect()
}
