//! What is known of every voxel of a scan, and how it becomes an octree.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, UVec3, Vec3};
use organza_basis::spread::{MAX_SPREAD_RAD, mean_cos_sq, spread_from_mean_sin_sq};
use organza_basis::{FibrePopulation, Mixture, Watch};
use organza_volume::{Error, MixtureGrid, MixtureSource, Octree, octree_of_mixtures};
use std::f32::consts::PI;
use std::sync::LazyLock;

/// Voxels along an edge of a brick.
pub const BRICK: u32 = 8;

/// Voxels of a brick.
pub(crate) const BRICK_VOXELS: usize = (BRICK * BRICK * BRICK) as usize;

const FILL_STEPS: f32 = 65535.0;
const AXIS_STEPS: f32 = 32767.0;
const SHARE_STEPS: f32 = 255.0;

/// One voxel of a scan.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ScannedVoxel {
    /// Share of the voxel's volume that is fibre, in `[0, 1]`; zero for an empty voxel.
    pub fill: f32,
    /// Unit axis of the fibre, without a sign; z where the voxel is empty.
    pub axis: Vec3,
    /// Mean squared sine of the angle between the fibre's tangents and the axis, in
    /// `[0, 1/2]`.
    pub mean_sin_sq: f32,
    /// How far the grey values determine the axis, in `[0, 1]`: 0 where any direction fits,
    /// 1 for a straight fibre without noise.
    pub confidence: f32,
    /// Index into [`ScannedField::yarns`].
    pub yarn: u16,
}

/// A voxel in 12 bytes: the axis within 0.00005 rad, the fill within 1e-5, the root of the mean
/// squared sine in 255 steps up to the root of one half, the confidence in 255 steps.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub(crate) struct StoredVoxel {
    axis: [i16; 3],
    fill: u16,
    sine: u8,
    confidence: u8,
    yarn: u16,
}

impl StoredVoxel {
    pub fn new(v: &ScannedVoxel) -> StoredVoxel {
        let share = |x: f32| (x.clamp(0.0, 1.0) * SHARE_STEPS + 0.5) as u8;
        let axis = (v.axis * AXIS_STEPS).round();
        StoredVoxel {
            axis: [axis.x as i16, axis.y as i16, axis.z as i16],
            fill: (v.fill.clamp(0.0, 1.0) * FILL_STEPS + 0.5) as u16,
            sine: share((2.0 * v.mean_sin_sq.clamp(0.0, 0.5)).sqrt()),
            confidence: share(v.confidence),
            yarn: v.yarn,
        }
    }

    /// True where the fill is rounded to nothing.
    pub fn is_empty(&self) -> bool {
        self.fill == 0
    }

    pub fn voxel(&self) -> ScannedVoxel {
        let axis = Vec3::from(self.axis.map(f32::from));
        let sine = f32::from(self.sine) / SHARE_STEPS;
        ScannedVoxel {
            fill: f32::from(self.fill) / FILL_STEPS,
            axis: axis.normalize_or(Vec3::Z),
            mean_sin_sq: 0.5 * sine * sine,
            confidence: f32::from(self.confidence) / SHARE_STEPS,
            yarn: self.yarn,
        }
    }
}

/// Spread for each stored root mean squared sine, rad.
static SPREAD_OF_SINE: LazyLock<[f32; 256]> = LazyLock::new(|| {
    // The widest spread has less than one half, which only uniform angles reach.
    let most = 1.0 - mean_cos_sq(MAX_SPREAD_RAD);
    std::array::from_fn(|code| {
        let sine = code as f32 / SHARE_STEPS;
        spread_from_mean_sin_sq((0.5 * sine * sine).min(most))
    })
});

/// The voxels of 8 x 8 x 8, x fastest, then y, z.
pub(crate) type StoredBrick = [StoredVoxel; BRICK_VOXELS];

/// A yarn, or all fibres of one kind.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ScannedYarn {
    /// Its name: `fibre` until yarns are separated.
    pub name: String,
    /// Index of its material; yarns that look alike share one.
    pub material: u16,
}

/// Density, orientation, spread and confidence of every voxel with fibre.
///
/// Frame: voxel `(i, j, k)` fills the box from `min_mm + (i, j, k) * voxel_mm` on; x runs along
/// the rows of the slices, y from row to row, z from slice to slice. Axes are in this frame.
/// Only bricks of 8 x 8 x 8 voxels with fibre take memory: 6 KiB each, and 8 bytes for every
/// brick of the box.
#[derive(Clone, Debug)]
pub struct ScannedField {
    /// Least corner of the first voxel, mm.
    pub min_mm: DVec3,
    /// Edges of a voxel, mm.
    pub voxel_mm: DVec3,
    /// True when the field repeats in x and y.
    pub repeats: bool,
    /// Radius of the fibres, mm.
    pub fibre_radius_mm: f32,
    /// Multiplies the density of fibre when the octree is made; 1 as scanned.
    pub density_scale: f32,
    /// What the voxels' `yarn` refers to; never empty.
    pub yarns: Vec<ScannedYarn>,
    dims: UVec3,
    bricks: Vec<Option<Box<StoredBrick>>>,
}

impl ScannedField {
    /// A field of so many voxels, all of them empty, with one yarn `fibre` of material 0.
    pub fn empty(dims: UVec3, voxel_mm: DVec3, fibre_radius_mm: f32) -> ScannedField {
        let bricks = bricks_of(dims).element_product() as usize;
        ScannedField {
            min_mm: DVec3::ZERO,
            voxel_mm,
            repeats: false,
            fibre_radius_mm,
            density_scale: 1.0,
            yarns: vec![ScannedYarn {
                name: "fibre".into(),
                material: 0,
            }],
            dims,
            bricks: vec![None; bricks],
        }
    }

    /// Voxels along each axis.
    pub fn dims(&self) -> UVec3 {
        self.dims
    }

    /// The voxel of a cell below [`ScannedField::dims`].
    pub fn voxel(&self, cell: UVec3) -> ScannedVoxel {
        self.stored(cell)
            .map_or_else(|| StoredVoxel::default().voxel(), StoredVoxel::voxel)
    }

    fn stored(&self, cell: UVec3) -> Option<&StoredVoxel> {
        let brick = self.bricks[self.brick_number(cell)].as_ref()?;
        Some(&brick[place_in_brick(cell)])
    }

    fn brick_number(&self, cell: UVec3) -> usize {
        let (b, n) = (cell / BRICK, bricks_of(self.dims));
        (b.x + n.x * (b.y + n.y * b.z)) as usize
    }

    /// Changes the voxel of a cell below [`ScannedField::dims`].
    pub fn set(&mut self, cell: UVec3, voxel: &ScannedVoxel) {
        let number = self.brick_number(cell);
        let brick = &mut self.bricks[number];
        if brick.is_none() && voxel.fill <= 0.0 {
            return;
        }
        let brick = brick.get_or_insert_with(|| Box::new([StoredVoxel::default(); BRICK_VOXELS]));
        brick[place_in_brick(cell)] = StoredVoxel::new(voxel);
    }

    /// Puts a brick in its place, if there is such.
    pub(crate) fn put_brick(&mut self, number: u32, brick: Box<StoredBrick>) {
        if let Some(place) = self.bricks.get_mut(number as usize) {
            *place = Some(brick);
        }
    }

    /// Calls `visit` with every voxel that holds fibre, brick by brick.
    pub fn for_each_filled(&self, mut visit: impl FnMut(UVec3, ScannedVoxel)) {
        let n = bricks_of(self.dims);
        for (number, brick) in self.bricks.iter().enumerate() {
            let Some(brick) = brick else { continue };
            let number = number as u32;
            let low = UVec3::new(number % n.x, number / n.x % n.y, number / n.x / n.y) * BRICK;
            for (place, v) in brick.iter().enumerate().filter(|(_, v)| v.fill > 0) {
                let p = place as u32;
                visit(low + UVec3::new(p & 7, p >> 3 & 7, p >> 6), v.voxel());
            }
        }
    }

    /// Number of materials that the yarns name.
    pub fn material_count(&self) -> usize {
        let most = self.yarns.iter().map(|y| usize::from(y.material)).max();
        most.map_or(1, |m| m + 1)
    }

    /// Bytes that the bricks and their table take.
    pub fn memory_bytes(&self) -> u64 {
        let filled = self.bricks.iter().flatten().count() as u64;
        self.bricks.len() as u64 * 8 + filled * size_of::<StoredBrick>() as u64
    }

    /// Length of fibre per volume in a completely filled voxel, mm per mm^3.
    fn full_length_density(&self) -> f32 {
        self.density_scale / (PI * self.fibre_radius_mm * self.fibre_radius_mm)
    }

    /// The octree of the field; `levels`, `max_memory_bytes` and errors as in
    /// [`octree_of_mixtures`].
    ///
    /// # Errors
    /// Those of [`octree_of_mixtures`].
    pub fn octree(
        &self,
        levels: Option<u8>,
        max_memory_bytes: Option<u64>,
        progress: Watch<'_, f32>,
    ) -> Result<Octree, Error> {
        octree_of_mixtures(self, levels, max_memory_bytes, progress)
    }
}

impl MixtureSource for ScannedField {
    fn grid(&self) -> MixtureGrid {
        MixtureGrid {
            min_mm: self.min_mm,
            voxel_mm: self.voxel_mm,
            dims: self.dims,
            repeats: self.repeats,
        }
    }

    fn material_count(&self) -> usize {
        ScannedField::material_count(self)
    }

    fn mixture(&self, cell: UVec3) -> Mixture {
        let mut mixture = Mixture::EMPTY;
        let Some(stored) = self.stored(cell).filter(|v| v.fill > 0) else {
            return mixture;
        };
        let v = stored.voxel();
        mixture.push(FibrePopulation {
            length_density_per_mm2: v.fill * self.full_length_density(),
            axis: v.axis,
            spread_rad: SPREAD_OF_SINE[usize::from(stored.sine)],
            radius_mm: self.fibre_radius_mm,
            material: self
                .yarns
                .get(usize::from(v.yarn))
                .map_or(0, |y| y.material),
            yarn: u32::from(v.yarn),
        });
        mixture
    }
}

/// Bricks along each axis.
pub(crate) fn bricks_of(dims: UVec3) -> UVec3 {
    dims.map(|n| n.div_ceil(BRICK))
}

fn place_in_brick(cell: UVec3) -> usize {
    let c = cell & (BRICK - 1);
    (c.x + BRICK * (c.y + BRICK * c.z)) as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::{PathRng, unwatched, warp};

    #[test]
    fn voxels_are_kept_within_the_stated_steps() {
        let mut rng = PathRng::from_seed(11);
        for _ in 0..20_000 {
            let v = ScannedVoxel {
                fill: rng.unit(),
                axis: warp::uniform_sphere(rng.unit2()),
                mean_sin_sq: 0.5 * rng.unit(),
                confidence: rng.unit(),
                yarn: rng.below(65536) as u16,
            };
            let back = StoredVoxel::new(&v).voxel();
            assert!((back.fill - v.fill).abs() < 1e-5, "seed 11");
            assert!(back.axis.cross(v.axis).length() < 5e-5, "seed 11");
            let (a, b) = (back.mean_sin_sq.sqrt(), v.mean_sin_sq.sqrt());
            assert!((a - b).abs() < 1.5e-3, "seed 11: {a} {b}");
            assert!((back.confidence - v.confidence).abs() < 2e-3, "seed 11");
            assert_eq!(back.yarn, v.yarn);
        }
    }

    #[test]
    fn a_field_becomes_an_octree_with_its_length_axes_and_materials() {
        let dims = UVec3::new(19, 10, 9);
        let mut field = ScannedField::empty(dims, DVec3::splat(0.002), 0.005);
        field.yarns.push(ScannedYarn {
            name: "weft".into(),
            material: 1,
        });
        let cells = [UVec3::ZERO, UVec3::new(18, 9, 8), UVec3::new(7, 8, 3)];
        for (i, cell) in cells.iter().enumerate() {
            let v = ScannedVoxel {
                fill: 0.25 * (i + 1) as f32,
                axis: [Vec3::X, Vec3::Y, Vec3::Z][i],
                mean_sin_sq: 0.01,
                confidence: 1.0,
                yarn: (i % 2) as u16,
            };
            field.set(*cell, &v);
        }
        let mut seen = Vec::new();
        field.for_each_filled(|cell, _| seen.push(cell));
        assert_eq!(seen.len(), 3);
        assert!(cells.iter().all(|c| seen.contains(c)));
        let stop = |_| std::ops::ControlFlow::Break(());
        let stopped = field.octree(Some(2), None, &stop);
        assert!(matches!(stopped, Err(Error::Stopped(_))));
        let octree = field.octree(Some(2), None, &unwatched).unwrap();
        octree.assert_well_formed();
        assert_eq!(octree.material_count(), 2);
        let length = 1.5 * 0.002f64.powi(3) / (std::f64::consts::PI * 0.005 * 0.005);
        assert!((octree.fibre_length_mm(1) / length - 1.0).abs() < 1e-4);
        let there = octree.mixture(0, cells[1]);
        assert!(there[0].axis.y.abs() > 0.9999 && there[0].material == 1);
        assert!((there[0].spread_rad - 0.1).abs() < 3e-3);
    }
}
