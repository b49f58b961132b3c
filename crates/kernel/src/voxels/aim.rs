//! Direct light for lanes: tabulated estimates, corrected by exact rays.

use super::blocks::Blocks;
use super::flat_scene::FlatScene;
use super::optical_depth_table::OpticalDepthTable;
use super::shadow_ray::ShadowRay;
use super::walk::{Paths, stored};
use glam::Vec3;
use organza_film::Stats;
use organza_lanes::math::{V3, exp2};
use organza_lanes::{Floats, MAX_LANES, Mask, SetBits};
use std::f32::consts::LOG2_E;

/// An exact shadow ray is followed for sure to so much more optical depth than
/// the table promises.
const SURE_DEPTH: f32 = 2.0;

/// Light that a lane looks for.
pub struct Aim<F: Floats> {
    /// What is scattered of it, 1/sr.
    pub grey: F,
    /// Unit direction toward it.
    pub toward: V3<F>,
    /// To the light, mm.
    pub distance_mm: F,
    /// What a table says.
    pub table_depth: F,
    /// A random number.
    pub u: F,
}

impl<F: Floats> Aim<F> {
    /// Transmittance: as the table says it, set right by an exact ray with a
    /// chance that goes with the light there is.
    #[inline(always)]
    pub fn transmittance(
        &self,
        scene: &FlatScene,
        light: &OpticalDepthTable,
        paths: &Paths<F>,
        mean_throughput: F,
        met: F::Mask,
        stats: &mut Stats,
    ) -> F {
        let through = exp2(self.table_depth * F::splat(-LOG2_E));
        let share = mean_throughput * self.grey * F::splat(scene.residual_scale);
        let keep = (share * (through + F::splat(light.residual_floor))).min(F::splat(1.0));
        let traced = met & self.u.below(keep);
        if !traced.any() {
            return through;
        }
        let exact = self.transmittances(scene, light, paths, self.u / keep, traced, stats);
        let set_right = (exact - through) / keep + through;
        set_right.or_where_not(traced, through)
    }

    /// Exact transmittances of the lanes of a mask, one after the other.
    #[inline(always)]
    fn transmittances(
        &self,
        scene: &FlatScene,
        light: &OpticalDepthTable,
        paths: &Paths<F>,
        chance: F,
        traced: F::Mask,
        stats: &mut Stats,
    ) -> F {
        let (at, toward) = (stored(paths.at), stored(self.toward));
        let beyond = stored(V3::new(paths.beyond[0], paths.beyond[1], F::splat(0.0)));
        let numbers = stored(V3::new(self.distance_mm, self.table_depth, chance));
        let mut through = [0.0; MAX_LANES];
        for lane in SetBits(traced.bits()) {
            let [at, toward, beyond, numbers] =
                [&at, &toward, &beyond, &numbers].map(|v| Vec3::from_array(v.map(|x| x[lane])));
            let border_mm = scene.borders.map_or(f32::INFINITY, |borders| {
                borders.way_out_mm(&scene.medium.cell_grid, at + beyond, toward)
            });
            let medium = &scene.medium;
            let blocks = medium.blocks.as_deref().map(|blocks| {
                let block = medium.cell_grid.dims();
                (blocks, Blocks::crossing(beyond.truncate(), block))
            });
            let ray = ShadowRay {
                cell_grid: &medium.cell_grid,
                blocks,
                at,
                toward,
                reach_mm: numbers.x.min(border_mm),
                sure_depth: numbers.y + SURE_DEPTH,
                chance: numbers.z,
            };
            let (t, steps) = light.transmittance(&scene.medium, &ray);
            through[lane] = t;
            stats.shadow_rays += 1;
            stats.shadow_steps += steps;
        }
        F::load(&through)
    }
}
