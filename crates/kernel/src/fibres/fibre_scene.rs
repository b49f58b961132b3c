//! Explicit fibres, what lights them and the camera, as data for any engine.

use super::cache::RadianceCache;
use super::importance::Importance;
use super::matter::FibreMatter;
use organza_film::{Brightness, Camera};
use organza_light::{KernelLight, Light};
use std::sync::{Arc, OnceLock};

/// A view of explicit fibres. It knows no back end.
///
/// # Buffers
/// | buffer | index | what it holds |
/// |---|---|---|
/// | `matter.bodies[i].cells.heads` | cell | the first block of each kind and their numbers: [`Head`](super::cells::Head) |
/// | `matter.bodies[i].cells.blocks` | block | sixteen cylinders in the frame of their cell: [`PieceBlock`](super::block::PieceBlock) |
/// | `matter.bodies[i].cells.hulls` | hull block | sixteen other pieces: [`HullBlock`](super::hull::HullBlock) |
/// | `matter.joints.words` | 8 x joint | what is asked of a piece once it is met: [`JointTable`](super::joint_table::JointTable) |
/// | `matter.packed` | | packed fibres in voxels, if paths meet them: [`FibreVolume`](crate::packed::FibreVolume) |
/// | `matter.optics.words` | 32 x material | how fibres scatter: [`Optics`](organza_scatter::near::Optics) |
///
/// Lengths are in mm. Places in a cell are counted from its centre, so that `f32` suffices
/// anywhere; the [grid](super::grid::Grid) holds the cells' edges and numbers.
///
/// Lights and camera are few, so they stay as they are described: [`Light::for_kernel`]
/// gives the plain numbers of every light that has them, and [`Camera::parts`] those of
/// the camera.
///
/// # What an engine must do
/// - A ray walks cell by cell, and a hit counts only before the far side of its cell.
/// - Paths meet packed fibres from the event on that [`Switch`](crate::packed::Switch)
///   says; an engine that cannot follow them refuses matter that
///   [has packed fibres](super::FibreMatter::has_packed).
/// - An engine may divide paths and end them by the importance of their ways, or end them
///   by what they carry alone.
/// - An event samples every light by a shadow ray, unless only walks find it, and
///   weighs both where both find it: see [`organza_light::LightSearch`].
/// - The engine for processors draws directions toward lights with a place lane by
///   lane, with [`Light::sample_toward`]; one that cannot call lights draws by their numbers.
pub struct FibreScene {
    /// The fibres; scenes of one cloth share them.
    pub(crate) matter: Arc<FibreMatter>,
    /// Lights; their light adds.
    pub(crate) lights: Vec<Light>,
    pub(crate) camera: Camera,
    /// Names all random numbers.
    pub(crate) seed: u64,
    /// Longest path in events.
    pub(crate) max_bounces: u32,
    /// The unit in which samples are summed.
    pub(crate) brightness: Brightness,
    /// What an engine may divide paths by.
    pub(crate) importance: Option<Importance>,
    /// Radiance at fibres, once it is learned.
    pub(crate) cache: OnceLock<RadianceCache>,
}

impl FibreScene {
    /// Matter, lights and a camera. `seed` names all random numbers; paths have at
    /// most `max_bounces` events.
    pub fn new(
        matter: Arc<FibreMatter>,
        lights: &[Light],
        camera: &Camera,
        seed: u64,
        max_bounces: u32,
    ) -> FibreScene {
        let importance = Importance::new(lights, matter.middle_mm());
        let brightest = lights.iter().map(brightness).fold(0.0, f32::max);
        FibreScene {
            matter,
            lights: lights.to_vec(),
            camera: *camera,
            seed,
            max_bounces,
            brightness: Brightness::of(brightest),
            importance,
            cache: OnceLock::new(),
        }
    }

    /// Bytes of the cells and tables.
    pub fn memory_bytes(&self) -> u64 {
        let cache = self.cache.get().map_or(0, RadianceCache::memory_bytes);
        self.matter.memory_bytes() + cache
    }
}

/// The brightest that a light can make a pixel, roughly: samples above a hundred
/// times of it are counted one by one.
pub(crate) fn brightness(light: &Light) -> f32 {
    match light.for_kernel() {
        KernelLight::Parallel { irradiance, .. } => irradiance.max_component(),
        KernelLight::Sky { radiance, .. } => radiance.max_component(),
        KernelLight::Picture(image) => {
            let pixels = image.pixels().iter().map(|p| p.max_component());
            pixels.fold(0.0, f32::max)
        }
        KernelLight::Panel(rectangle) => rectangle.radiance().max_component(),
        KernelLight::Spot(_) => 1.0,
        KernelLight::Placed { radiance, .. } => radiance.max_component(),
    }
}
