//! Micro-flakes of any family: lanes fly and look up side by side, and scatter one by one, as
//! the family does for the general walk.

use super::event::{Event, Meeting, Turn};
use super::flat_scene::FlatScene;
use super::voxel_words::VoxelWords;
use super::walk::{loaded, stored};
use glam::Vec3;
use organza_basis::{PathRng, Rgb};
use organza_lanes::math::{LaneRng, V3, path_rngs};
use organza_lanes::{Floats, Ints, MAX_LANES, Mask, SetBits};
use organza_scatter::{DiffuseFlake, FlakePopulation, FlakeScattering, Lobe};

/// The flakes that every lane meets.
pub struct LoneFlakes<F: Floats> {
    met: [Met; MAX_LANES],
    /// The lanes that meet any.
    mask: F::Mask,
}

/// The flakes of one lane.
#[derive(Clone, Copy)]
struct Met {
    population: FlakePopulation,
    /// The one that was drawn, if the family does so.
    flake: Option<DiffuseFlake>,
    w_out: Vec3,
}

const NOTHING: Met = Met {
    population: FlakePopulation {
        axis: Vec3::Z,
        end_on: 1.0,
        albedo: Rgb::BLACK,
        material: 0,
    },
    flake: None,
    w_out: Vec3::Z,
};

impl<F: Floats> Event<F> for LoneFlakes<F> {
    #[inline(always)]
    fn area_squared(scene: &FlatScene, voxel: VoxelWords<F::Ints>, along: F, across: F) -> F {
        let (code, end_on) = (voxel.end_on_code(), voxel.end_on());
        match scene.medium.flakes() {
            Some(flakes) => flakes.area_squared(code, along, across, end_on),
            None => F::splat(0.0),
        }
    }

    #[inline(always)]
    fn new(scene: &FlatScene, met: &Meeting<F>, rng: &mut LaneRng<F::Ints>, mask: F::Mask) -> Self {
        let (axis, w_out) = (stored(met.voxel.axis()), stored(met.w_out));
        let albedo = stored::<F>(scene.medium.albedo_at(met.place));
        let (mut end_on, mut materials) = ([0.0; MAX_LANES], [0; MAX_LANES]);
        met.voxel.end_on().store(&mut end_on);
        scene.medium.material_at(met.place).store(&mut materials);
        let mut own = LoneFlakes {
            met: [NOTHING; MAX_LANES],
            mask,
        };
        for lane in SetBits(mask.bits()) {
            let [axis, w_out, albedo] = [&axis, &w_out, &albedo].map(|v| of_lane(v, lane));
            own.met[lane].w_out = w_out;
            own.met[lane].population = FlakePopulation {
                axis: axis.normalize(),
                end_on: end_on[lane],
                albedo: Rgb(albedo),
                material: materials[lane] as u16,
            };
        }
        if let Some(scattering) = scattering(scene).filter(|s| s.draws_flakes()) {
            let rngs = path_rngs(rng, mask);
            for lane in SetBits(mask.bits()) {
                let met = &mut own.met[lane];
                met.flake = scattering.draw_flake(&met.population, met.w_out, &mut rngs(lane));
            }
        }
        own
    }

    #[inline(always)]
    fn common(&self) -> V3<F> {
        V3::splat(Vec3::ONE)
    }

    #[inline(always)]
    fn toward(&self, scene: &FlatScene, w_in: V3<F>) -> (F, V3<F>) {
        let w_in = stored(w_in);
        let mut values = [[0.0; MAX_LANES]; 3];
        if let Some(scattering) = scattering(scene) {
            for lane in SetBits(self.mask.bits()) {
                let value = self.met[lane].toward(scattering, of_lane(&w_in, lane)).0;
                put(&mut values, lane, value.0);
            }
        }
        let values = loaded::<F>(&values);
        (values.sum() * F::splat(1.0 / 3.0), values)
    }

    #[inline(always)]
    fn turn(&self, scene: &FlatScene, rng: &mut LaneRng<F::Ints>, mask: F::Mask) -> Turn<F> {
        let mut directions = [[0.0; MAX_LANES], [0.0; MAX_LANES], [1.0; MAX_LANES]];
        let mut weights = [[0.0; MAX_LANES]; 3];
        if let Some(scattering) = scattering(scene) {
            let rngs = path_rngs(rng, mask);
            for lane in SetBits(self.mask.bits()) {
                if let Some((w_in, weight)) = self.met[lane].turn(scattering, &mut rngs(lane)) {
                    put(&mut directions, lane, w_in);
                    put(&mut weights, lane, weight.0);
                }
            }
        }
        let [u, ..] = rng.units(mask);
        Turn {
            direction: loaded(&directions),
            weight: loaded(&weights),
            u,
        }
    }
}

impl Met {
    /// Albedo times phase, and phase.
    fn toward(&self, scattering: &dyn FlakeScattering, w_in: Vec3) -> (Rgb, f32) {
        match &self.flake {
            Some(flake) => (flake.eval(self.w_out, w_in), flake.pdf(self.w_out, w_in)),
            None => scattering.eval(&self.population, self.w_out, w_in),
        }
    }

    /// Draws where light comes from, and its weight.
    fn turn(&self, scattering: &dyn FlakeScattering, rng: &mut PathRng) -> Option<(Vec3, Rgb)> {
        if let Some(flake) = &self.flake {
            let drawn = flake.sample(self.w_out, rng)?;
            return Some((drawn.w_in, drawn.weight));
        }
        let w_in = scattering.sample(&self.population, self.w_out, rng)?;
        let (value, pdf) = self.toward(scattering, w_in);
        (pdf > 0.0).then(|| (w_in, value / pdf))
    }
}

fn scattering(scene: &FlatScene) -> Option<&dyn FlakeScattering> {
    scene.medium.flakes().map(|flakes| &*flakes.scattering)
}

fn of_lane(v: &[[f32; MAX_LANES]; 3], lane: usize) -> Vec3 {
    Vec3::from_array(v.map(|x| x[lane]))
}

fn put(v: &mut [[f32; MAX_LANES]; 3], lane: usize, x: Vec3) {
    for (column, x) in v.iter_mut().zip(x.to_array()) {
        column[lane] = x;
    }
}
