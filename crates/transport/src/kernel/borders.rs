//! Where matter ends sideways.

use crate::Lattice;
use glam::{Vec2, Vec3};

/// The rectangle in x and y that the matter fills, in voxels from the corner of
/// the first period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Borders {
    pub low: Vec2,
    pub high: Vec2,
}

impl Borders {
    /// Those of a lattice; `None` where it is endless.
    pub fn of(lattice: &Lattice) -> Option<Borders> {
        if lattice.is_endless() {
            return None;
        }
        if !lattice.repeats() {
            let high = lattice.dims().as_vec3().truncate();
            return Some(Borders {
                low: Vec2::ZERO,
                high,
            });
        }
        let (reach, min) = (lattice.reach_mm(), lattice.bounds_mm().min);
        let voxels = |p: Vec3| ((p - min) / lattice.voxel_mm()).truncate();
        Some(Borders {
            low: voxels(reach.min),
            high: voxels(reach.max),
        })
    }

    /// How far it is from a place in voxels to the border, mm.
    pub fn way_out_mm(&self, lattice: &Lattice, at: Vec3, toward: Vec3) -> f32 {
        let per_mm = (toward / lattice.voxel_mm()).truncate();
        let border = Vec2::select(per_mm.cmpgt(Vec2::ZERO), self.high, self.low);
        let way = (border - at.truncate()) / per_mm;
        let still = per_mm.cmpeq(Vec2::ZERO);
        Vec2::select(still, Vec2::INFINITY, way)
            .min_element()
            .max(0.0)
    }
}
