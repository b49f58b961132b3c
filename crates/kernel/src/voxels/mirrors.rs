//! Mirrors of the SGGX distribution about the fibres of a voxel, one population in every lane.

use super::event::{Event, Meeting, Turn};
use super::flat_scene::FlatScene;
use super::voxel_words::VoxelWords;
use glam::Vec3;
use organza_lanes::math::{LaneRng, V3};
use organza_lanes::{Floats, Ints};
use organza_scatter::AxialFlake;

/// A flake population that reflects what came along `-w_out`.
pub struct Mirrors<F: Floats> {
    flakes: AxialFlake<F>,
    w_out: V3<F>,
    per_area: F,
    albedo: V3<F>,
}

impl<F: Floats> Event<F> for Mirrors<F> {
    #[inline(always)]
    fn area_squared(_: &FlatScene, voxel: VoxelWords<F::Ints>, along: F, across: F) -> F {
        ellipsoid(voxel, along, across)
    }

    #[inline(always)]
    fn new(
        scene: &FlatScene,
        met: &Meeting<F>,
        _rng: &mut LaneRng<F::Ints>,
        _mask: F::Mask,
    ) -> Self {
        let flakes = AxialFlake::about(met.voxel.axis(), met.voxel.end_on());
        Mirrors {
            flakes,
            w_out: met.w_out,
            per_area: F::splat(1.0) / flakes.area(met.w_out),
            albedo: scene.medium.albedo_at(met.place),
        }
    }

    #[inline(always)]
    fn common(&self) -> V3<F> {
        self.albedo
    }

    #[inline(always)]
    fn toward(&self, _scene: &FlatScene, w_in: V3<F>) -> (F, V3<F>) {
        let phase = self.flakes.phase(self.w_out, self.per_area, w_in);
        let (x, y, z) = (phase, phase, phase);
        (phase, V3 { x, y, z })
    }

    #[inline(always)]
    fn turn(&self, _scene: &FlatScene, rng: &mut LaneRng<F::Ints>, mask: F::Mask) -> Turn<F> {
        let [turns, height, u] = rng.units(mask);
        Turn {
            direction: self.flakes.mirror(self.w_out, self.per_area, turns, height),
            weight: V3::splat(Vec3::ONE),
            u,
        }
    }
}

/// See [`Event::area_squared`]: of flakes of the SGGX distribution.
#[inline(always)]
pub fn ellipsoid<U: Ints>(voxel: VoxelWords<U>, along: U::Floats, across: U::Floats) -> U::Floats {
    let end_on = voxel.end_on();
    (end_on * end_on).mul_add(along, across)
}
