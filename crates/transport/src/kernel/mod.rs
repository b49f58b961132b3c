//! The fast way through cloth: many paths at once, one in each lane of a
//! vector, over matter laid out for it.
//!
//! One source, [`walk`], for every [`Backend`]; which back end walks makes no
//! difference to any bit of the picture. What the kernel cannot do is told by
//! [`Kernel::new`], and the general walk ([`crate::trace_path`]) does it; that
//! one is also its oracle: both estimate the same picture with other random
//! numbers.
//!
//! Light of one direction, or of a rectangle, comes from a table that an
//! occasional exact shadow ray corrects ([`light_table`]), environments by
//! escaping, what is bright in a picture by shadow rays again ([`environment`]).

mod borders;
mod environment;
#[cfg(test)]
mod environment_tests;
mod event;
mod fibre_tables;
#[cfg(test)]
mod fibre_tests;
mod fibres;
mod film_rays;
mod flakes;
mod flat_medium;
mod lanes;
mod light_table;
mod math;
#[cfg(test)]
mod matter_tests;
mod panel;
mod posts;
mod reach;
mod shadow_ray;
mod tally;
#[cfg(test)]
mod tests;
#[cfg(target_arch = "x86_64")]
mod vector;
mod voxel_words;
mod walk;

pub(crate) use fibre_tables::end_on_ratio;
pub(crate) use flat_medium::{NO_YARN, Population, Substance};
pub(crate) use tally::{Brightness, Tally};

use crate::{
    AnyMedium, Hemisphere, Integrator, Light, Medium, Pixel, RenderSettings, Scene, Stats,
};
use borders::Borders;
use environment::{Parts, Sky};
use fibre_tables::FibreTables;
use fibres::Fibres;
use film_rays::FilmRays;
use flakes::Mirrors;
use flat_medium::{FlatMedium, Unsuited};
use glam::{UVec2, Vec3};
use light_table::{LightTable, Nodes, RESIDUAL_FLOOR_OF_GUESSES, extinctions};
use organza_basis::Rgb;
use organza_scatter::Fibre;
use panel::Panel;
use std::ops::Range;

/// What walks the paths of the kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Backend {
    /// One path at a time.
    Scalar,
    /// Two vectors of eight.
    Avx2,
    /// Two vectors of sixteen.
    Avx512,
}

impl Backend {
    /// All: they give the same bits.
    pub const ALL: [Backend; 3] = [Backend::Scalar, Backend::Avx2, Backend::Avx512];

    /// The widest that this processor has.
    pub fn widest() -> Backend {
        if Backend::Avx512.is_available() {
            Backend::Avx512
        } else if Backend::Avx2.is_available() {
            Backend::Avx2
        } else {
            Backend::Scalar
        }
    }

    /// Whether this processor has it.
    pub fn is_available(self) -> bool {
        match self {
            Backend::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Backend::Avx2 => {
                std::arch::is_x86_feature_detected!("avx2")
                    && std::arch::is_x86_feature_detected!("fma")
            }
            #[cfg(target_arch = "x86_64")]
            Backend::Avx512 => {
                Backend::Avx2.is_available()
                    && std::arch::is_x86_feature_detected!("avx512f")
                    && std::arch::is_x86_feature_detected!("avx512bw")
                    && std::arch::is_x86_feature_detected!("avx512dq")
                    && std::arch::is_x86_feature_detected!("avx512vl")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// Its name on the command line and in pictures.
    pub fn name(self) -> &'static str {
        match self {
            Backend::Scalar => "scalar",
            Backend::Avx2 => "avx2",
            Backend::Avx512 => "avx512",
        }
    }
}

/// Why the kernel leaves a scene to the general walk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum KernelRefusal {
    /// Not one medium but none or several.
    #[error("the scene has {0} media; the kernel walks through one")]
    MediumCount(usize),
    /// A medium of other than micro-flakes or virtual fibres.
    #[error("what scatters is no micro-flakes about fibre axes, nor virtual fibres")]
    NotFlakes,
    /// A medium that does not suit it.
    #[error(transparent)]
    Medium(#[from] Unsuited),
    /// Fibres of which the walk draws better.
    #[error("fibres are so rough, or point so many ways, that the general walk draws them better")]
    Skewed,
    /// A picture of too many pixels.
    #[error("a picture of light has more than 65536 pixels along an edge")]
    Picture,
    /// A rectangle that the walk finds better.
    #[error("a rectangle light stands in the matter or near to it for its size")]
    Panel,
    /// Samples are to be clamped.
    #[error("samples are to be clamped, which the general walk does")]
    Clamp,
    /// Exact stepping was asked for.
    #[error("exact stepping was asked for; the kernel tracks")]
    Integrator,
    /// Its tables would take too much.
    #[error("its tables would take up to {0} bytes, more than {1}")]
    Memory(u64, u64),
    /// The processor lacks it.
    #[error("this processor does not have {0:?}")]
    Backend(Backend),
}

/// Lanes draw inclinations by the blur, and tangents of widely spread fibres with
/// weights; the walk tries until neither needs one. Up to this blur, 20 degrees,
/// an event's weight has a variance below 0.04, and 0.13 more among populations
/// spread by more than a radian, which may have this share of the extinction.
/// Beyond, walks of tens of events hide what they carry in rare bright paths: a
/// thick heap of fibres of 34 degrees blur sent back 0.96 of what it got in nine
/// million paths, though no event loses any.
const MOST_BLUR_RAD: f32 = 0.35;
const MOST_WIDE: f32 = 0.2;

/// A scene laid out for lanes.
pub struct Kernel {
    backend: Backend,
    medium: FlatMedium,
    /// Of a medium of flakes empty.
    fibres: FibreTables,
    /// For lengths in units of one over the medium's scale.
    voxels_per_length: Vec3,
    nodes: Nodes,
    lights: Vec<LightTable>,
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

/// Pixels across a strip of neighbours.
const STRIP: u32 = 8;

/// A part of the film and the samples to take in it.
pub(crate) struct Block<'a> {
    /// Whole rows.
    pub pixels: &'a mut [Pixel],
    /// Pixels in a row.
    pub width: u32,
    /// The first pixel's place in the whole picture.
    pub min: UVec2,
    pub samples: Range<u32>,
}

impl Block<'_> {
    /// The pixel that is walked as number `turn`, and its column and row in the
    /// whole picture. Neighbours in the picture follow each other in strips, so
    /// that the lanes look at the same part of the matter.
    fn pixel(&self, turn: usize) -> Option<(usize, u32, u32)> {
        if turn >= self.pixels.len() {
            return None;
        }
        let (turn, width) = (turn as u32, self.width);
        let rows = self.pixels.len() as u32 / width;
        let strip = turn / (STRIP * rows);
        let across = STRIP.min(width - strip * STRIP);
        let within = turn - strip * STRIP * rows;
        let (x, y) = (strip * STRIP + within % across, within / across);
        let index = (y * width + x) as usize;
        Some((index, self.min.x + x, self.min.y + y))
    }
}

impl Kernel {
    /// Lays a scene out for a back end.
    ///
    /// # Errors
    /// Why the general walk must do it.
    pub fn new(
        scene: &Scene,
        settings: &RenderSettings,
        backend: Backend,
        most_bytes: u64,
    ) -> Result<Kernel, KernelRefusal> {
        if !backend.is_available() {
            return Err(KernelRefusal::Backend(backend));
        }
        if settings.integrator != Integrator::Woodcock {
            return Err(KernelRefusal::Integrator);
        }
        let [medium] = &scene.media[..] else {
            return Err(KernelRefusal::MediumCount(scene.media.len()));
        };
        let lattice = match medium {
            AnyMedium::Grid(m) => *m.lattice(),
            AnyMedium::Cloth(m) => *m.lattice(),
            AnyMedium::Fibres(m) => *m.lattice(),
            _ => return Err(KernelRefusal::NotFlakes),
        };
        let borders = Borders::of(&lattice);
        let mut parallel = Vec::new();
        let mut panels = Vec::new();
        let mut environment = [Vec3::ZERO; 2];
        let mut pictures = Vec::new();
        for light in &scene.lights {
            match light {
                Light::Directional {
                    direction,
                    irradiance,
                } => parallel.push((*direction, *irradiance)),
                Light::Environment {
                    radiance,
                    hemisphere,
                } => {
                    if *hemisphere != Hemisphere::Front {
                        environment[0] += radiance.0;
                    }
                    if *hemisphere != Hemisphere::Back {
                        environment[1] += radiance.0;
                    }
                }
                Light::Image { image, .. } if image.size().max_element() > 1 << 16 => {
                    return Err(KernelRefusal::Picture);
                }
                Light::Image { image, .. } => pictures.push((image, Parts::of(image))),
                Light::Rectangle { rectangle, .. } => {
                    panels.push(Panel::new(rectangle, &lattice).ok_or(KernelRefusal::Panel)?);
                }
            }
        }
        let of_pictures: u64 = pictures.iter().map(|(_, p)| p.bytes(&lattice)).sum();
        let bytes = FlatMedium::least_bytes(&lattice)
            + LightTable::most_bytes(&lattice, (parallel.len() + panels.len()) as u64)
            + of_pictures;
        if bytes > most_bytes {
            return Err(KernelRefusal::Memory(bytes, most_bytes));
        }
        let (medium, fibres) = match medium {
            AnyMedium::Grid(m) => (FlatMedium::from_grid(m)?, FibreTables::none()),
            AnyMedium::Cloth(m) => (FlatMedium::from_cloth(m)?, FibreTables::none()),
            AnyMedium::Fibres(m) => {
                let medium = FlatMedium::from_fibres(m)?;
                let fibres = || medium.fibres().filter_map(|i| m.fibres().get(i));
                let is_rough = |f: &Fibre| f.far_parts().blurs_rad()[0] > MOST_BLUR_RAD;
                if fibres().any(is_rough) || medium.wide_share() > MOST_WIDE {
                    return Err(KernelRefusal::Skewed);
                }
                let tables = FibreTables::new(fibres());
                (medium, tables)
            }
            _ => return Err(KernelRefusal::NotFlakes),
        };
        let panels = panels.into_iter().map(|panel| {
            let (direction, radiance) = (panel.direction(&lattice), panel.radiance());
            (direction, radiance, Some(panel))
        });
        let parallel = parallel.into_iter().map(|(d, e)| (d, e, None));
        let lamps: Vec<(Vec3, Rgb, Option<Panel>)> = parallel.chain(panels).collect();
        let extinctions = lamps.iter().map(|(d, ..)| extinctions(&medium, -*d));
        let extinctions: Vec<Vec<f32>> = extinctions.collect();
        // Lamps are wide: a fine table toward their middles would be no better.
        let nodes = Nodes::new(&lattice, extinctions.iter().map(Vec::as_slice));
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
            let is_guess = panel.is_some() || (lattice.repeats() && borders.is_some());
            let mut light = LightTable::new(lattice, nodes, direction, irradiance, extinctions);
            light.panel = panel;
            if is_guess {
                light.residual_floor = RESIDUAL_FLOOR_OF_GUESSES;
            }
            light
        });
        let mut lights: Vec<LightTable> = tables.collect();
        Ok(Kernel {
            backend,
            depths: light_table::side_by_side(&mut lights),
            lights,
            nodes,
            voxels_per_length: 1.0 / (lattice.voxel_mm() * medium.scale_per_mm),
            medium,
            fibres,
            environment,
            skies,
            borders,
            rays: FilmRays::new(&scene.camera, &lattice),
            film_width: scene.camera.resolution().x,
            seed: settings.seed,
            max_bounces: settings.max_bounces,
            brightness: Brightness::of(brightest),
            residual_scale: 3.0,
        })
    }

    /// What walks.
    pub fn backend(&self) -> Backend {
        self.backend
    }

    /// Bytes of the matter and tables.
    pub fn memory_bytes(&self) -> u64 {
        let tables: u64 = self.lights.iter().map(LightTable::memory_bytes).sum();
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
        let lattice = &self.medium.lattice;
        let depth_mm = depth / self.medium.scale_per_mm;
        let panels = self.lights.iter().filter_map(|light| light.panel.as_ref());
        panels
            .map(|panel| panel.in_sight(lattice, at, direction, depth_mm, behind))
            .sum()
    }

    /// Takes the samples of a block.
    pub(crate) fn take(&self, block: &mut Block<'_>) -> Stats {
        dispatch(self, block)
    }
}

/// Walks through what there is.
#[inline(always)]
fn by_matter<F: lanes::Floats>(kernel: &Kernel, block: &mut Block<'_>) -> Stats {
    if kernel.medium.is_of_fibres {
        walk::walk::<F, Fibres<F>>(kernel, block)
    } else {
        walk::walk::<F, Mirrors<F>>(kernel, block)
    }
}

/// Walks with the kernel's back end: the one place where code for instructions
/// that a processor may lack is entered, after [`Kernel::new`] has asked it.
#[allow(unsafe_code)]
fn dispatch(kernel: &Kernel, block: &mut Block<'_>) -> Stats {
    #[cfg(target_arch = "x86_64")]
    {
        use lanes::Two;

        #[target_feature(
            enable = "avx512f,avx512bw,avx512dq,avx512vl,avx2,fma,bmi1,bmi2,popcnt,lzcnt"
        )]
        fn avx512(kernel: &Kernel, block: &mut Block<'_>) -> Stats {
            by_matter::<Two<vector::avx512::F>>(kernel, block)
        }

        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        fn avx2(kernel: &Kernel, block: &mut Block<'_>) -> Stats {
            by_matter::<Two<vector::avx2::F>>(kernel, block)
        }

        /// One lane, where fused products need no function call.
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        fn fused(kernel: &Kernel, block: &mut Block<'_>) -> Stats {
            by_matter::<lanes::one::F>(kernel, block)
        }

        match kernel.backend {
            Backend::Avx512 => return unsafe { avx512(kernel, block) },
            Backend::Avx2 => return unsafe { avx2(kernel, block) },
            Backend::Scalar if Backend::Avx2.is_available() => {
                return unsafe { fused(kernel, block) };
            }
            Backend::Scalar => {}
        }
    }
    by_matter::<lanes::one::F>(kernel, block)
}
