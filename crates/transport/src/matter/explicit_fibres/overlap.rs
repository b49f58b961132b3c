//! How much of the volume of explicit fibres lies in more than one of them.

use super::hierarchy::Placed;
use super::{BVH_LEAD_MM, ExplicitFibres};
use glam::{DVec3, IVec2, Vec3, Vec3A};
use obvhs::ray::Ray as BvhRay;
use organza_basis::PathRng;

/// Shares of a tile's box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Overlap {
    /// In at least one fibre.
    pub union: f64,
    /// The sum over fibres: more than `union` by what they share.
    pub sum: f64,
}

impl ExplicitFibres {
    /// How much room fibres take and how much of it they share, by `points`
    /// random points of the tile.
    pub fn measure_overlap(&self, points: u64, seed: u64) -> Overlap {
        let box_mm = self.cell_grid.bounds_mm();
        let low = box_mm.min.as_dvec3() - self.origin_mm;
        let (mut once, mut times) = (0u64, 0u64);
        for i in 0..points {
            let mut rng = PathRng::new(seed, 0, i);
            let u = Vec3::new(rng.unit(), rng.unit(), rng.unit());
            let fibres = self.fibres_at(low + (u * box_mm.size()).as_dvec3());
            once += u64::from(fibres > 0);
            times += fibres as u64;
        }
        let share = |n: u64| n as f64 / points.max(1) as f64;
        Overlap {
            union: share(once),
            sum: share(times),
        }
    }

    /// Number of fibres that hold a point of the tile.
    pub(super) fn fibres_at(&self, p: DVec3) -> usize {
        let lead = BVH_LEAD_MM * Vec3A::Z;
        let ray = BvhRay::new(p.as_vec3a() - lead, Vec3A::Z, 0.0, 2.0 * BVH_LEAD_MM);
        let mut found: Vec<(u32, IVec2)> = Vec::new();
        let hierarchy = self.hierarchy();
        hierarchy.boxes.ray_traverse_anyhit(ray, |_, leaf| {
            let Placed { piece, shift } = hierarchy.placed[leaf];
            let curve = self.curves.joints[piece as usize].strand;
            let shift_mm = shift.as_dvec2() * self.period_mm;
            let inside = self.curves.piece(piece, shift_mm).contains(p);
            if inside && !found.contains(&(curve, shift)) {
                found.push((curve, shift));
            }
        });
        found.len()
    }
}
