//! Diffuse flakes of the SGGX distribution about the fibres of a voxel [Heitz2015], one in
//! every lane: drawn as it is seen, for lights and walk alike.

use super::event::{Event, Meeting, Turn};
use super::flat_scene::FlatScene;
use super::mirrors::ellipsoid;
use super::voxel_words::VoxelWords;
use glam::Vec3;
use organza_lanes::Floats;
use organza_lanes::math::{LaneRng, V3, on_sphere};
use organza_scatter::AxialFlake;
use std::f32::consts::FRAC_1_PI;

/// A diffuse flake.
pub struct DiffuseFlakes<F: Floats> {
    /// Unit normal on the side that was seen.
    normal: V3<F>,
    albedo: V3<F>,
}

impl<F: Floats> Event<F> for DiffuseFlakes<F> {
    #[inline(always)]
    fn area_squared(_: &FlatScene, voxel: VoxelWords<F::Ints>, along: F, across: F) -> F {
        ellipsoid(voxel, along, across)
    }

    #[inline(always)]
    fn new(scene: &FlatScene, met: &Meeting<F>, rng: &mut LaneRng<F::Ints>, mask: F::Mask) -> Self {
        let flakes = AxialFlake::about(met.voxel.axis(), met.voxel.end_on());
        let per_area = F::splat(1.0) / flakes.area(met.w_out);
        let [turns, height, _] = rng.units(mask);
        let m = flakes.visible_direction(met.w_out, per_area, turns, height);
        DiffuseFlakes {
            normal: unit(m, met.w_out),
            albedo: scene.medium.albedo_at(met.place),
        }
    }

    #[inline(always)]
    fn common(&self) -> V3<F> {
        self.albedo
    }

    #[inline(always)]
    fn toward(&self, _scene: &FlatScene, w_in: V3<F>) -> (F, V3<F>) {
        let cos = self.normal.dot(w_in).max(F::splat(0.0));
        let phase = cos * F::splat(FRAC_1_PI);
        (phase, V3::splat(Vec3::ONE).scaled(phase))
    }

    #[inline(always)]
    fn turn(&self, _scene: &FlatScene, rng: &mut LaneRng<F::Ints>, mask: F::Mask) -> Turn<F> {
        let [turns, height, u] = rng.units(mask);
        // A unit vector plus a uniform one has a cosine around the first.
        let w_in = self.normal + on_sphere(turns, height);
        Turn {
            direction: unit(w_in, self.normal),
            weight: V3::splat(Vec3::ONE),
            u,
        }
    }
}

/// A vector brought to unit length; `other` where it is lost in rounding.
#[inline(always)]
fn unit<F: Floats>(v: V3<F>, other: V3<F>) -> V3<F> {
    let squared = v.dot(v);
    let is_long = F::splat(1e-20).below(squared);
    v.scaled(F::splat(1.0) / squared.sqrt())
        .or_where_not(is_long, other)
}
