//! The bridge from scenes to the kernel: media described as its matter.
//!
//! Media do not know the kernel, and the kernel does not know media: both meet
//! here and nowhere else.

use crate::{
    AnyMedium, GridMedium, Integrator, MAX_EVENTS, Medium, RenderSettings, Scene, SggxOctreeMedium,
    VirtualFibreEvent, VirtualFibreMedium,
};
use glam::UVec3;
use organza_basis::CellGrid;
use organza_kernel::fibres::FibreScene;
use organza_kernel::{
    Backend, Engine, FibreEngine, FibreProbe, Kernel, Matter, NO_YARN, Population, Refusal,
    Substance, Unsuited, View, end_on_ratio,
};
use organza_scatter::virtual_fibres::population_sigma_t_per_mm;
use organza_scatter::{AxialFlake, Fibre};
use std::sync::Arc;

/// Most bytes of the cells of a patch that is measured.
const PROBE_BYTES: u64 = 4 << 30;

/// Why a scene is left to the general walk.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum KernelRefusal {
    /// Not one medium but none or several.
    #[error("the scene has {0} media; the kernel walks through one")]
    MediumCount(usize),
    /// A medium of other than micro-flakes or virtual fibres.
    #[error("the medium is neither micro-flakes about fibre axes nor virtual fibres")]
    NotFlakes,
    /// Samples are to be clamped.
    #[error("clamping needs the general walk")]
    Clamp,
    /// Exact stepping was asked for.
    #[error("exact stepping was asked for; the kernel tracks")]
    Integrator,
    /// Interpolated samples, or grids of different resolutions.
    #[error("a grid is not constant within voxels")]
    Interpolated,
    /// Fibres with a surface.
    #[error("virtual fibres are packed; the kernel walks event = \"plain\" of them")]
    Packed,
    /// Tables of local visibility.
    #[error("virtual fibres have tables of local visibility")]
    LocalVisibility,
    /// What the kernel itself refuses.
    #[error(transparent)]
    Kernel(#[from] Refusal),
}

/// Lays a scene out for the kernel, with tables of at most `max_bytes` bytes.
///
/// # Errors
/// Why the general walk must do it.
pub fn flatten(
    scene: &Scene,
    settings: &RenderSettings,
    backend: Backend,
    max_bytes: u64,
) -> Result<Kernel, KernelRefusal> {
    if settings.integrator != Integrator::Woodcock {
        return Err(KernelRefusal::Integrator);
    }
    let [medium] = &scene.media[..] else {
        return Err(KernelRefusal::MediumCount(scene.media.len()));
    };
    fn lay_out(
        matter: &impl Matter,
        scene: &Scene,
        settings: &RenderSettings,
        backend: Backend,
        max_bytes: u64,
    ) -> Result<Kernel, KernelRefusal> {
        let view = View {
            matter,
            lights: &scene.lights,
            camera: &scene.camera,
        };
        let (seed, max_bounces) = (settings.seed, settings.max_bounces.min(MAX_EVENTS));
        Ok(Kernel::new(&view, seed, max_bounces, backend, max_bytes)?)
    }
    match medium {
        AnyMedium::Grid(m) if !m.is_piecewise_constant() => Err(KernelRefusal::Interpolated),
        AnyMedium::Grid(m) => lay_out(m, scene, settings, backend, max_bytes),
        AnyMedium::SggxOctree(m) => lay_out(m, scene, settings, backend, max_bytes),
        AnyMedium::VirtualFibres(m) if m.event() == VirtualFibreEvent::Packed => {
            Err(KernelRefusal::Packed)
        }
        AnyMedium::VirtualFibres(m) if m.has_local_visibility() => {
            Err(KernelRefusal::LocalVisibility)
        }
        AnyMedium::VirtualFibres(m) => lay_out(m, scene, settings, backend, max_bytes),
        _ => Err(KernelRefusal::NotFlakes),
    }
}

/// What walks a scene in lanes: voxels, or explicit fibres in cells; at most
/// `max_bytes` bytes of matter and tables.
///
/// # Errors
/// Why the general walk must do it.
pub fn engine(
    scene: &Scene,
    settings: &RenderSettings,
    backend: Backend,
    max_bytes: u64,
) -> Result<Box<dyn Engine>, KernelRefusal> {
    let [AnyMedium::ExplicitFibres(fibres)] = &scene.media[..] else {
        let kernel = flatten(scene, settings, backend, max_bytes)?;
        return Ok(Box::new(kernel));
    };
    if !backend.is_available() {
        return Err(Refusal::Backend(backend).into());
    }
    let matter = fibres
        .matter(max_bytes)
        .map_err(|unfit| Refusal::of_fibres(unfit, max_bytes))?;
    let fibres = FibreScene::new(
        Arc::new(matter),
        &scene.lights,
        &scene.camera,
        settings.seed,
        settings.max_bounces.min(MAX_EVENTS),
    );
    let engine = FibreEngine::new(Arc::new(fibres), backend)?;
    Ok(Box::new(engine))
}

/// Explicit fibres of a scene in cells, for paths of any origin; `None` when there
/// is other matter, or cells do not suit it.
pub fn fibre_probe(scene: &Scene) -> Option<FibreProbe> {
    let [AnyMedium::ExplicitFibres(fibres)] = &scene.media[..] else {
        return None;
    };
    let matter = fibres.matter(PROBE_BYTES).ok()?;
    Some(FibreProbe::new(Arc::new(matter), Backend::widest()))
}

impl Matter for GridMedium {
    fn cell_grid(&self) -> &CellGrid {
        Medium::cell_grid(self)
    }

    fn fibres(&self) -> Option<&[Fibre]> {
        None
    }

    fn populations(&self, cell: UVec3, out: &mut Vec<Population>) -> Result<(), Unsuited> {
        let (sigma_t_per_mm, matrix, albedo) = self.values_of(cell);
        if sigma_t_per_mm == 0.0 {
            return Ok(());
        }
        let (across, flake) = AxialFlake::from_matrix(matrix).ok_or(Unsuited::NotAxial)?;
        let broadside_per_mm = sigma_t_per_mm * across;
        if broadside_per_mm > 0.0 {
            out.push(Population {
                broadside_per_mm,
                flake,
                substance: Substance::Flakes(albedo),
                yarn: NO_YARN,
            });
        }
        Ok(())
    }
}

impl Matter for SggxOctreeMedium {
    fn cell_grid(&self) -> &CellGrid {
        Medium::cell_grid(self)
    }

    fn fibres(&self) -> Option<&[Fibre]> {
        None
    }

    fn populations(&self, cell: UVec3, out: &mut Vec<Population>) -> Result<(), Unsuited> {
        let mixture = SggxOctreeMedium::populations(self, cell);
        out.extend(mixture.as_slice().iter().map(|c| {
            let materials = self.materials();
            Population {
                broadside_per_mm: c.broadside_per_mm() * materials.shape(c).0,
                flake: materials.flake(c),
                substance: Substance::Flakes(materials.albedo(c)),
                yarn: c.yarn,
            }
        }));
        Ok(())
    }
}

impl Matter for VirtualFibreMedium {
    fn cell_grid(&self) -> &CellGrid {
        Medium::cell_grid(self)
    }

    fn fibres(&self) -> Option<&[Fibre]> {
        Some(VirtualFibreMedium::fibres(self))
    }

    fn populations(&self, cell: UVec3, out: &mut Vec<Population>) -> Result<(), Unsuited> {
        let populations = self.populations_of(cell);
        out.extend(populations.iter().map(|c| Population {
            broadside_per_mm: population_sigma_t_per_mm(c, c.axis.any_orthonormal_vector()),
            flake: AxialFlake::new(c.axis, end_on_ratio(c.spread_rad)),
            substance: Substance::Fibres(c.material),
            yarn: c.yarn,
        }));
        Ok(())
    }
}
