//! Waves of paths for films and for measurements.

use super::matter::FibreMatter;
use super::walk::Walk;
use super::work::{FilmWork, Work};
use crate::cpu::lanes::Floats;
use crate::cpu::{Job, dispatch_sixteen};
use crate::{Backend, Block};
use organza_film::{Brightness, Camera, Stats};
use organza_light::{KernelLight, Light};
use std::sync::Arc;

/// A view of fibres, ready to be walked.
pub struct FibreKernel {
    matter: Arc<FibreMatter>,
    lights: Vec<Light>,
    camera: Camera,
    backend: Backend,
    seed: u64,
    max_bounces: u32,
    brightness: Brightness,
}

impl FibreKernel {
    /// Matter, lights and a camera. `seed` names all random numbers; paths have at
    /// most `max_bounces` events.
    pub fn new(
        matter: Arc<FibreMatter>,
        lights: &[Light],
        camera: &Camera,
        (seed, max_bounces): (u64, u32),
        backend: Backend,
    ) -> FibreKernel {
        let brightest = lights.iter().map(brightness).fold(0.0, f32::max);
        FibreKernel {
            matter,
            lights: lights.to_vec(),
            camera: *camera,
            backend,
            seed,
            max_bounces,
            brightness: Brightness::of(brightest),
        }
    }

    /// The instructions that its lanes use.
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// Bytes of the cells and tables.
    pub fn memory_bytes(&self) -> u64 {
        self.matter.memory_bytes()
    }

    /// Takes the samples of a block.
    pub fn take(&self, block: &mut Block<'_>) -> Stats {
        let mut work = FilmWork::new(block, &self.camera, self.seed, self.brightness);
        let walk = Walk {
            matter: &self.matter,
            lights: &self.lights,
            max_bounces: self.max_bounces,
        };
        run(&walk, self.backend, &mut work)
    }
}

/// Walks all paths of some work.
pub fn run(walk: &Walk<'_>, backend: Backend, work: &mut dyn Work) -> Stats {
    struct Run<'a, 'b> {
        walk: &'a Walk<'a>,
        work: &'b mut dyn Work,
    }
    impl Job for Run<'_, '_> {
        type Output = Stats;
        #[inline(always)]
        fn run<F: Floats>(self) -> Stats {
            self.walk.run::<F>(self.work)
        }
    }
    dispatch_sixteen(backend, Run { walk, work })
}

/// The brightest that a light can make a pixel, roughly: samples above a hundred
/// times of it are counted one by one.
fn brightness(light: &Light) -> f32 {
    match light.for_kernel() {
        KernelLight::Parallel { irradiance, .. } => irradiance.max_component(),
        KernelLight::Sky { radiance, .. } => radiance.max_component(),
        KernelLight::Picture(image) => {
            let pixels = image.pixels().iter().map(|p| p.max_component());
            pixels.fold(0.0, f32::max)
        }
        KernelLight::Panel(rectangle) => rectangle.radiance().max_component(),
        KernelLight::Walk(_) => 1.0,
    }
}
