//! How much of the volume fibres fill where they are.

use organza_basis::FibrePopulation;
use organza_scatter::packing_fraction;
use organza_volume::Octree;

/// Edge in fibre radii of the cells over which packing is averaged: smaller ones
/// count chance clusters, larger ones the void beside the yarn.
const PACKING_CELL_RADII: f32 = 4.0;

/// The greatest radius of a level's fibres.
pub fn greatest_radius_mm(octree: &Octree, level: u8) -> f32 {
    let mut most = 0.0f32;
    octree.for_each_occupied(level, |cell| {
        for c in octree.mixture(level, cell).as_slice() {
            most = most.max(c.radius_mm);
        }
    });
    most
}

/// Packing where each material is: the mean over its length of the volume that
/// fibres of any material fill in the cell around.
pub fn packing_by_material(octree: &Octree, radius_mm: f32, materials: usize) -> Vec<f32> {
    let off = |l: &u8| {
        let edge_mm = octree.voxel_mm(*l).element_product().cbrt();
        (edge_mm / (PACKING_CELL_RADII * radius_mm)).ln().abs()
    };
    let level = (0..octree.level_count()).min_by(|a, b| off(a).total_cmp(&off(b)));
    let level = level.unwrap_or(0);
    let mut sums = vec![(0.0f64, 0.0f64); materials];
    octree.for_each_occupied(level, |cell| {
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
