//! Random points of fibres.

use super::ExplicitFibres;
use glam::Vec3;
use organza_basis::PathRng;

impl ExplicitFibres {
    /// A point of the axis of a fibre of a material, even in length, with its
    /// tangent and radius; `None` when there is none.
    pub(crate) fn random_point(
        &self,
        material: usize,
        rng: &mut PathRng,
    ) -> Option<(Vec3, Vec3, f32)> {
        let joints = &self.curves.joints;
        let longest = 12.5 * joints.iter().fold(0.0f32, |r, j| r.max(j.radius_mm));
        // As many tries as would find the rarest of a hundred materials.
        (0..4096).find_map(|_| {
            let index = rng.below(joints.len() as u32 - 1);
            let [a, b] = [joints[index as usize], joints[index as usize + 1]];
            let of_material = usize::from(self.curves.curve_of(index).material) == material;
            let length = a.position.distance(b.position);
            let taken = a.strand == b.strand && of_material && rng.unit() * longest < length;
            let share = rng.unit();
            taken.then(|| {
                let at = a.position.lerp(b.position, share) + self.origin_mm;
                let radius_mm = a.radius_mm + share * (b.radius_mm - a.radius_mm);
                (at, self.curves.tangent(index, share), radius_mm)
            })
        })
    }
}
