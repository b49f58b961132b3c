//! The voxels of an exemplar cloth, some of whose crossings are those of volumes.

use crate::woven_volume::{WovenVolume, system_of};
use glam::{DVec2, UVec2, UVec3, Vec3};
use organza_basis::{FibrePopulation, Mixture, Watch};
use organza_volume::{Error, MixtureGrid, MixtureSource, Octree, octree_of_mixtures};
use organza_weave::Synthesis;
use std::collections::BTreeMap;

/// An exemplar cloth with volumes in it.
struct ExemplarVoxels<'a> {
    /// The woven crossings.
    woven: &'a Octree,
    synthesis: &'a Synthesis,
    volumes: &'a [Option<WovenVolume>],
    /// By crossing, ends fastest: whether a block shows it.
    is_needed: Vec<bool>,
    crossings: UVec2,
    /// Voxels of a crossing along x and y.
    block: UVec2,
    /// Layers of voxels below the woven ones, and all layers.
    below: u32,
    layers: u32,
    /// Materials of the threads of the exemplar.
    materials: BTreeMap<u32, u16>,
}

/// The voxels of an exemplar cloth: `woven`, with those of volumes where volumes stand.
/// `crossings` are those of the exemplar, `allowed` are bytes; `done` learns the share that is done.
///
/// # Errors
/// As [`octree_of_mixtures`].
pub fn with_volumes(
    woven: &Octree,
    synthesis: &Synthesis,
    volumes: &[Option<WovenVolume>],
    crossings: UVec2,
    (allowed, done): (u64, Watch<'_, f32>),
) -> Result<Octree, Error> {
    let dims = woven.dims(0);
    let mut is_needed = vec![false; crossings.element_product() as usize];
    for block in &synthesis.blocks {
        is_needed[block.place[1] * crossings.x as usize + block.place[0]] = true;
    }
    // Volumes that are higher than the woven cloth get layers of their own.
    let coarsest = 1u32 << (woven.level_count() - 1);
    let (voxel_mm, bounds) = (woven.voxel_mm(0).z, woven.bounds_mm());
    let (mut low, mut high) = (bounds.min.z, bounds.max.z);
    for volume in volumes.iter().flatten() {
        let own = volume.octree.bounds_mm();
        low = low.min(own.min.z - volume.mean_height_mm);
        high = high.max(own.max.z - volume.mean_height_mm);
    }
    let layers_in = |mm: f32| ((mm / voxel_mm).max(0.0) as u32).next_multiple_of(coarsest);
    let below = layers_in(bounds.min.z - low + 0.999 * voxel_mm);
    let above = layers_in(high - bounds.max.z + 0.999 * voxel_mm);
    let voxels = ExemplarVoxels {
        woven,
        synthesis,
        volumes,
        is_needed,
        crossings,
        block: dims.truncate() / crossings,
        below,
        layers: below + dims.z + above,
        materials: woven.materials_of_yarns(),
    };
    octree_of_mixtures(&voxels, Some(woven.level_count()), Some(allowed), done)
}

impl ExemplarVoxels<'_> {
    /// The populations of a volume at a share of one of its crossings, which stands at a
    /// crossing of the exemplar. Threads have the numbers that they have in the exemplar.
    fn of_volume(
        &self,
        volume: &WovenVolume,
        (place, crossing): ([usize; 2], UVec2),
        share: DVec2,
        z_mm: f32,
    ) -> Mixture {
        let place = UVec2::new(place[0] as u32, place[1] as u32);
        let bounds = volume.octree.bounds_mm();
        let at = volume.place_mm(place, share).as_vec2() + bounds.min.truncate();
        let at = at.extend(z_mm + volume.mean_height_mm);
        let mut mixture = Mixture::EMPTY;
        for c in volume.octree.mixture_at(self.level(volume), at).iter() {
            let system = system_of(c);
            let thread = crossing[system];
            let yarn = [thread, self.crossings.x + thread][system];
            mixture.push(FibrePopulation {
                material: self.materials.get(&yarn).copied().unwrap_or(0),
                yarn,
                ..*c
            });
        }
        mixture
    }

    /// The level of a volume whose voxels are most alike in size.
    fn level(&self, volume: &WovenVolume) -> u8 {
        let edge = |v: Vec3| v.element_product().cbrt();
        let own = edge(self.woven.voxel_mm(0));
        let off = |l: &u8| (edge(volume.octree.voxel_mm(*l)) / own).ln().abs();
        (0..volume.octree.level_count())
            .min_by(|a, b| off(a).total_cmp(&off(b)))
            .unwrap_or(0)
    }
}

impl MixtureSource for ExemplarVoxels<'_> {
    fn grid(&self) -> MixtureGrid {
        let bounds = self.woven.bounds_mm();
        let (min, size) = (bounds.min.as_dvec3(), bounds.size().as_dvec3());
        let dims = self.woven.dims(0);
        let voxel_mm = size / dims.as_dvec3();
        MixtureGrid {
            min_mm: min.with_z(min.z - f64::from(self.below) * voxel_mm.z),
            voxel_mm,
            dims: dims.with_z(self.layers),
            repeats: true,
        }
    }

    fn material_count(&self) -> usize {
        self.woven.material_count()
    }

    fn mixture(&self, cell: UVec3) -> Mixture {
        let crossing = cell.truncate() / self.block;
        if !self.is_needed[(crossing.x + self.crossings.x * crossing.y) as usize] {
            return Mixture::EMPTY;
        }
        let place = [crossing.x as usize, crossing.y as usize];
        let Some((number, place)) = self.synthesis.volume_at(place) else {
            let layer = cell.z.wrapping_sub(self.below);
            return if layer < self.woven.dims(0).z {
                self.woven.mixture(0, cell.with_z(layer))
            } else {
                Mixture::EMPTY
            };
        };
        let Some(volume) = self.volumes.get(number).and_then(Option::as_ref) else {
            return Mixture::EMPTY;
        };
        let within = cell.truncate() - crossing * self.block;
        let share = (within.as_dvec2() + 0.5) / self.block.as_dvec2();
        let layer = cell.z as f32 - self.below as f32 + 0.5;
        let z_mm = self.woven.bounds_mm().min.z + layer * self.woven.voxel_mm(0).z;
        self.of_volume(volume, (place, crossing), share, z_mm)
    }
}
