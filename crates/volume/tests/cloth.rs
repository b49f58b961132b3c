use glam::{UVec3, Vec2, Vec3};
use organza_basis::curve::SegmentList;
use organza_basis::{Aabb, PathRng, Segment, SegmentSource, Tile, unwatched};
use organza_volume::{Error, Octree, VoxelizeOptions, voxelize};
use std::f32::consts::TAU;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};

/// A plain weave of round yarns of twisted fibres, one yarn a batch: what the
/// voxelizer meets in practice, without a cloth generator.
pub struct PlainWeave {
    /// Yarns each way in the tile; even.
    pub ends: u32,
    /// Distance of neighbouring yarns.
    pub spacing_mm: f32,
    pub fibres_per_yarn: u32,
    pub fibre_radius_mm: f32,
    /// Segments of each fibre between two crossings.
    pub steps: u32,
}

impl PlainWeave {
    /// About a fine cotton cloth: 0.3 mm yarns of 100 fibres.
    pub fn cotton(ends: u32) -> PlainWeave {
        PlainWeave {
            ends,
            spacing_mm: 0.4,
            fibres_per_yarn: 100,
            fibre_radius_mm: 0.007,
            steps: 16,
        }
    }

    fn yarn_radius_mm(&self) -> f32 {
        0.35 * self.spacing_mm
    }
}

impl SegmentSource for PlainWeave {
    fn tile(&self) -> Tile {
        let side = self.spacing_mm * self.ends as f32;
        let height = 2.0 * self.yarn_radius_mm() + 2.0 * self.fibre_radius_mm;
        Tile {
            bounds_mm: Aabb::new(Vec3::new(0.0, 0.0, -height), Vec3::new(side, side, height)),
            repeats: true,
        }
    }

    fn batch_count(&self) -> usize {
        2 * self.ends as usize
    }

    fn for_each_in_batch(&self, batch: usize, emit: &mut dyn FnMut(&Segment)) {
        let yarn = batch as u32;
        let warp = yarn >= self.ends;
        let k = yarn % self.ends;
        let across = (k as f32 + 0.5) * self.spacing_mm;
        let is_over = k.is_multiple_of(2) == warp;
        let sign = if is_over { 1.0 } else { -1.0 };
        let n = self.ends * self.steps;
        let mut rng = PathRng::new(1, u64::from(yarn), 0);
        for fibre in 0..self.fibres_per_yarn {
            let u: Vec2 = rng.unit2();
            let out = self.yarn_radius_mm() * u.x.sqrt();
            let point = |i: u32| {
                let t = i as f32 / self.steps as f32;
                // One turn of twist per crossing: about 30 degrees outside.
                let angle = TAU * (u.y + 0.5 * t);
                let (side, up) = (out * angle.cos(), out * angle.sin());
                let height = sign * self.yarn_radius_mm() * (0.5 * TAU * (t - 0.5)).cos();
                let (along, side, z) = (t * self.spacing_mm, across + side, height + up);
                if warp {
                    Vec3::new(side, along, z)
                } else {
                    Vec3::new(along, side, z)
                }
            };
            for i in 0..n {
                let mut s = Segment::straight(point(i), point(i + 1), self.fibre_radius_mm);
                (s.yarn, s.fibre, s.material) = (yarn, fibre, u16::from(warp));
                emit(&s);
            }
        }
    }

    fn material_count(&self) -> usize {
        2
    }
}

/// Segments in a box that does not repeat.
pub fn list(min: Vec3, max: Vec3, segments: Vec<Segment>) -> SegmentList {
    SegmentList::new(Aabb::new(min, max), false, segments)
}

/// Length of all segments, summed in double precision.
pub fn length_mm(source: &dyn SegmentSource) -> f64 {
    let mut sum = 0.0;
    for batch in 0..source.batch_count() {
        source.for_each_in_batch(batch, &mut |s| {
            sum += s.start_mm.as_dvec3().distance(s.end_mm.as_dvec3());
        });
    }
    sum
}

pub fn voxelized(source: &dyn SegmentSource, voxel_mm: f32, levels: Option<u8>) -> Octree {
    let options = VoxelizeOptions {
        voxel_mm,
        levels,
        ..VoxelizeOptions::default()
    };
    voxelize(source, &options, &unwatched).unwrap()
}

/// The cotton cloth of two ends.
pub fn cotton_octree(voxel_mm: f32) -> Octree {
    voxelized(&PlainWeave::cotton(2), voxel_mm, None)
}

/// All cells of a grid.
pub fn cells(dims: UVec3) -> impl Iterator<Item = UVec3> {
    (0..dims.element_product())
        .map(move |i| UVec3::new(i % dims.x, i / dims.x % dims.y, i / (dims.x * dims.y)))
}

#[test]
fn a_stop_ends_voxelization_early() {
    let options = VoxelizeOptions {
        voxel_mm: 0.02,
        ..VoxelizeOptions::default()
    };
    let run = |most: u64| {
        let calls = AtomicU64::new(0);
        let watch = |_| match calls.fetch_add(1, Ordering::Relaxed) + 1 >= most {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let result = voxelize(&PlainWeave::cotton(4), &options, &watch);
        (result.map(drop), calls.load(Ordering::Relaxed))
    };
    let (whole, all) = run(u64::MAX);
    whole.unwrap();
    for most in [1, all / 2, all] {
        let (stopped, calls) = run(most);
        assert!(matches!(stopped, Err(Error::Stopped(_))), "{most} of {all}");
        assert_eq!(calls, most);
    }
}
