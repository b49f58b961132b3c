//! Many paths at once, one in each lane of a vector, over matter laid out flat.
//!
//! One source, [`voxels::walk`], for every [`Backend`]; which back end walks makes no
//! difference to any bit of the picture. The kernel knows neither the general walk
//! nor its media: whoever has matter describes it by the trait [`Matter`], and what
//! the kernel cannot do is a [`Refusal`]. The general walk is its oracle: both
//! estimate the same picture with other random numbers.
//!
//! Light of one direction, or of a rectangle, comes from a table that an occasional
//! exact shadow ray corrects ([`voxels::optical_depth_table`]), environments by escaping, what
//! is bright in a picture by shadow rays again ([`voxels::environment`]).
//!
//! # Rooms
//! - [`cpu`]: lanes of processors, and the code for their instructions.
//! - [`fibres`]: explicit fibres in cells.
//! - [`voxels`]: micro-flakes and virtual fibres in voxels.
//! - [`proofs`]: kernels that are wrong on purpose, for tests.

mod block;
#[allow(missing_docs)]
mod cpu;
mod engine;
pub mod fibres;
mod matter;
pub mod proofs;
mod refusal;
mod roulette;
mod voxels;

pub use block::Block;
pub use cpu::{Backend, FibreEngine, FibreProbe, ProbePaths};
pub use engine::Engine;
pub use matter::{Matter, NO_YARN, Population, Substance};
pub use refusal::{Refusal, Unsuited};
pub use voxels::fibre_tables::end_on_ratio;

use glam::Vec3;
use organza_basis::Rgb;
use organza_film::{Brightness, Camera, Stats};
use organza_light::{Hemisphere, KernelLight, Light};
use organza_scatter::Fibre;
use voxels::borders::Borders;
use voxels::environment::{Parts, Sky};
use voxels::event_weights::{EventWeights, are_even};
use voxels::fibre_tables::FibreTables;
use voxels::film_rays::FilmRays;
use voxels::flat_medium::FlatMedium;
use voxels::optical_depth_table::{
    self, Nodes, OpticalDepthTable, RESIDUAL_FLOOR_OF_GUESSES, extinctions,
};
use voxels::panel::Panel;

/// Lanes draw inclinations by the blur, and tangents of widely spread fibres with
/// weights; the walk tries until neither needs one. Up to this blur, 20 degrees,
/// an event's weight has a variance below 0.04, and 0.13 more among populations
/// spread by more than a radian, which may have this share of the extinction.
/// Beyond, walks of tens of events hide what they carry in rare bright paths: a
/// thick heap of fibres of 34 degrees blur sent back 0.96 of what it got in nine
/// million paths, though no event loses any.
const MAX_KERNEL_BLUR_RAD: f32 = 0.35;
const MAX_WIDE: f32 = 0.2;

/// A scene laid out for lanes.
pub struct Kernel {
    backend: Backend,
    medium: FlatMedium,
    /// Of a medium of flakes empty.
    fibres: FibreTables,
    /// For lengths in units of one over the medium's scale.
    voxels_per_length: Vec3,
    nodes: Nodes,
    lights: Vec<OpticalDepthTable>,
    /// Optical depths toward them.
    depths: Vec<u32>,
    /// Radiance from directions with z below zero, and from others.
    environment: [Vec3; 2],
    skies: Vec<Sky>,
    borders: Option<Borders>,
    rays: FilmRays,
    film_width: u32,
    seed: u64,
    max_bounces: u32,
    brightness: Brightness,
    /// An exact shadow ray is traced with a probability of the light scattered
    /// toward the camera, over the irradiance, per steradian, times this,
    /// times what the table lets through, plus a little.
    residual_scale: f32,
}

/// Lanes look words up by signed numbers.
const MAX_WORDS: u64 = 1 << 31;

/// What a picture is made of: matter, what lights it, and the camera that looks at it.
pub struct View<'a, M> {
    /// Matter.
    pub matter: &'a M,
    /// Lights; their light adds.
    pub lights: &'a [Light],
    /// The camera.
    pub camera: &'a Camera,
}

impl Kernel {
    /// Lays matter, lights and camera rays out for a back end. `seed` names all
    /// random numbers, paths have at most `max_bounces` events, and all tables
    /// together at most `max_bytes`.
    ///
    /// # Errors
    /// Why another walk must do it.
    pub fn new(
        view: &View<'_, impl Matter>,
        seed: u64,
        max_bounces: u32,
        backend: Backend,
        max_bytes: u64,
    ) -> Result<Kernel, Refusal> {
        if !backend.is_available() {
            return Err(Refusal::Backend(backend));
        }
        let cell_grid = *view.matter.cell_grid();
        let borders = Borders::of(&cell_grid);
        let mut parallel = Vec::new();
        let mut panels = Vec::new();
        let mut environment = [Vec3::ZERO; 2];
        let mut pictures = Vec::new();
        for light in view.lights {
            match light.for_kernel() {
                KernelLight::Parallel {
                    direction,
                    irradiance,
                } => parallel.push((direction, irradiance)),
                KernelLight::Sky {
                    radiance,
                    hemisphere,
                } => {
                    if hemisphere != Hemisphere::Front {
                        environment[0] += radiance.0;
                    }
                    if hemisphere != Hemisphere::Back {
                        environment[1] += radiance.0;
                    }
                }
                KernelLight::Picture(image) if image.size().max_element() > 1 << 16 => {
                    return Err(Refusal::Picture);
                }
                KernelLight::Picture(image) => pictures.push((image, Parts::of(image))),
                KernelLight::Panel(rectangle) => {
                    panels.push(Panel::new(rectangle, &cell_grid).ok_or(Refusal::Panel)?);
                }
                KernelLight::Walk(what) => return Err(Refusal::Light(what)),
            }
        }
        let of_pictures: u64 = pictures.iter().map(|(_, p)| p.bytes(&cell_grid)).sum();
        let bytes = FlatMedium::min_bytes(&cell_grid)
            + OpticalDepthTable::max_bytes(&cell_grid, (parallel.len() + panels.len()) as u64)
            + of_pictures;
        if bytes > max_bytes {
            return Err(Refusal::Memory(bytes, max_bytes));
        }
        let mut medium = FlatMedium::new(view.matter)?;
        let fibres = match view.matter.fibres() {
            None => FibreTables::none(),
            Some(all) => {
                medium.is_of_fibres = true;
                let fibres = || medium.fibres().filter_map(|i| all.get(i));
                let is_rough = |f: &Fibre| f.far_parts().blurs_rad()[0] > MAX_KERNEL_BLUR_RAD;
                if fibres().any(is_rough) || medium.wide_share() > MAX_WIDE {
                    return Err(Refusal::Skewed);
                }
                let tables = FibreTables::new(fibres());
                let (thickness, of_tangents) = medium.thickness_and_variance();
                let is_even = |weights: &EventWeights| {
                    let variance = weights.variance + of_tangents;
                    are_even(
                        EventWeights {
                            variance,
                            ..*weights
                        },
                        thickness,
                    )
                };
                if !tables.weights.iter().all(is_even) {
                    return Err(Refusal::Skewed);
                }
                tables
            }
        };
        let panels = panels.into_iter().map(|panel| {
            let (direction, radiance) = (panel.direction(&cell_grid), panel.radiance());
            (direction, radiance, Some(panel))
        });
        let parallel = parallel.into_iter().map(|(d, e)| (d, e, None));
        let lamps: Vec<(Vec3, Rgb, Option<Panel>)> = parallel.chain(panels).collect();
        let extinctions = lamps.iter().map(|(d, ..)| extinctions(&medium, -*d));
        let extinctions: Vec<Vec<f32>> = extinctions.collect();
        // Lamps are wide: a fine table toward their middles would be no better.
        let nodes = Nodes::new(&cell_grid, extinctions.iter().map(Vec::as_slice));
        let texels = pictures.iter().map(|(_, parts)| parts.words()).max();
        let words = (nodes.words() * lamps.len().max(1) as u64).max(texels.unwrap_or(0));
        let words = words.max(fibres.words.len() as u64);
        if words >= MAX_WORDS {
            return Err(Refusal::Words(words));
        }
        let skies: Vec<Sky> = pictures
            .iter()
            .map(|(image, parts)| Sky::new(&medium, nodes, image, parts))
            .collect();
        let of_lamp = |(_, irradiance, panel): &(Vec3, Rgb, Option<Panel>)| match panel {
            Some(panel) => panel.brightness(),
            None => irradiance.max_component(),
        };
        let brightest = lamps
            .iter()
            .map(of_lamp)
            .chain(environment.iter().map(|e| e.max_element()))
            .chain(skies.iter().map(|s| s.brightest))
            .fold(0.0, f32::max);
        let tables = lamps.into_iter().zip(extinctions);
        let tables = tables.map(|((direction, irradiance, panel), extinctions)| {
            let is_guess = panel.is_some() || (cell_grid.repeats() && borders.is_some());
            let mut light =
                OpticalDepthTable::new(cell_grid, nodes, direction, irradiance, extinctions);
            light.panel = panel;
            if is_guess {
                light.residual_floor = RESIDUAL_FLOOR_OF_GUESSES;
            }
            light
        });
        let mut lights: Vec<OpticalDepthTable> = tables.collect();
        Ok(Kernel {
            backend,
            depths: optical_depth_table::side_by_side(&mut lights),
            lights,
            nodes,
            voxels_per_length: 1.0 / (cell_grid.voxel_mm() * medium.scale_per_mm),
            medium,
            fibres,
            environment,
            skies,
            borders,
            rays: FilmRays::new(view.camera, &cell_grid),
            film_width: view.camera.resolution().x,
            seed,
            max_bounces,
            brightness: Brightness::of(brightest),
            residual_scale: 3.0,
        })
    }

    /// The instructions that its lanes use.
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// Bytes of the matter and tables.
    pub fn memory_bytes(&self) -> u64 {
        let tables: u64 = self
            .lights
            .iter()
            .map(OpticalDepthTable::memory_bytes)
            .sum();
        let skies: u64 = self.skies.iter().map(Sky::memory_bytes).sum();
        let matter = self.medium.memory_bytes() + self.fibres.memory_bytes();
        matter + skies + tables + 4 * self.depths.len() as u64
    }

    fn has_panels(&self) -> bool {
        self.lights.iter().any(|light| light.panel.is_some())
    }

    /// What a ray from the camera sees of panels before the matter, or behind;
    /// see [`Panel::in_sight`]. The depth is in lengths of the walk.
    fn panels_in_sight(&self, at: Vec3, direction: Vec3, depth: f32, behind: bool) -> Vec3 {
        let cell_grid = &self.medium.cell_grid;
        let depth_mm = depth / self.medium.scale_per_mm;
        let panels = self.lights.iter().filter_map(|light| light.panel.as_ref());
        panels
            .map(|panel| panel.in_sight(cell_grid, at, direction, depth_mm, behind))
            .sum()
    }

    /// Takes the samples of a block.
    pub fn take(&self, block: &mut Block<'_>) -> Stats {
        cpu::dispatch(self, block)
    }
}
