//! The choice of engine: a scene laid out for an engine of the kernel, or why only the
//! general walk can render it.

use crate::{
    AnyMedium, Draping, Integrator, MAX_EVENTS, Medium, RenderSettings, Scene, VirtualFibreEvent,
};
use organza_kernel::fibres::{Drape, FibreBody, FibreMatter, FibrePlane, FibreScene};
use organza_kernel::{
    Backend, CPU_ENGINES, ENGINES, Engine, EngineRecord, FibreProbe, FlatScene, LaidOut, Matter,
    Refusal, Reserve, View,
};
use std::sync::Arc;

/// Most bytes of the cells of a patch that is measured.
const PROBE_BYTES: u64 = 4 << 30;

/// Why a scene is left to the general walk.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum KernelRefusal {
    /// Not one medium but none or several.
    #[error("the scene has {0} media; the kernel walks through one")]
    MediumCount(usize),
    /// Explicit fibres, and other media beside them.
    #[error("explicit fibres and other media are mixed; the kernel walks through one kind")]
    MixedMedia,
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
    /// Fibres with a surface, asked to be laid out as matter that has none.
    #[error("virtual fibres are packed; they are laid out with the events of explicit fibres")]
    Packed,
    /// Tables of local visibility.
    #[error("virtual fibres have tables of local visibility")]
    LocalVisibility,
    /// What the kernel itself refuses.
    #[error(transparent)]
    Kernel(#[from] Refusal),
}

/// Which engine of the kernel renders a scene.
#[derive(Clone, Copy, Debug)]
pub enum EngineChoice {
    /// The fastest that this computer has and that takes the scene. One off the processor
    /// is backed by one for the processor, which goes on if it is lost.
    Fastest,
    /// The same among those for the processor.
    Processor,
    /// That of a record.
    Named(&'static EngineRecord),
}

/// The engine for a scene. Matter and tables have at most `max_bytes` bytes.
///
/// # Errors
/// Why the general walk must render the scene.
pub fn engine(
    scene: &Scene,
    settings: &RenderSettings,
    choice: EngineChoice,
    max_bytes: u64,
) -> Result<Box<dyn Engine>, KernelRefusal> {
    if let EngineChoice::Named(record) = choice {
        // Before anything is laid out in vain.
        record.check()?;
    }
    let laid_out = lay_out(scene, settings, max_bytes)?;
    Ok(match choice {
        EngineChoice::Named(record) => laid_out.engine(record)?,
        EngineChoice::Processor => laid_out.fastest_engine(CPU_ENGINES)?,
        EngineChoice::Fastest => {
            let engine = laid_out.fastest_engine(ENGINES)?;
            if CPU_ENGINES.iter().any(|cpu| cpu.name == engine.name()) {
                return Ok(engine);
            }
            Box::new(Reserve::new(engine, move || {
                laid_out.fastest_engine(CPU_ENGINES)
            }))
        }
    })
}

/// Lays a scene out for any engine: explicit fibres in cells, packed ones in voxels with the
/// events of explicit fibres, other matter in voxels.
fn lay_out(
    scene: &Scene,
    settings: &RenderSettings,
    max_bytes: u64,
) -> Result<LaidOut, KernelRefusal> {
    let Some(matter) = fibre_matter(scene, max_bytes) else {
        let flat = flatten(scene, settings, max_bytes)?;
        return Ok(LaidOut::Voxels(Arc::new(flat)));
    };
    let matter = matter?;
    if settings.integrator != Integrator::Woodcock && matter.has_packed() {
        return Err(KernelRefusal::Integrator);
    }
    let fibres = FibreScene::new(
        Arc::new(matter),
        &scene.lights,
        &scene.camera,
        settings.seed,
        settings.max_bounces.min(MAX_EVENTS),
    );
    Ok(LaidOut::Fibres(Arc::new(fibres)))
}

/// Fibres with surfaces laid out in at most `max_bytes`: cloths of explicit fibres and
/// planes, or packed fibres; `None` of a scene of other matter.
fn fibre_matter(scene: &Scene, max_bytes: u64) -> Option<Result<FibreMatter, KernelRefusal>> {
    match &scene.media[..] {
        [AnyMedium::VirtualFibres(m)] if m.event() == VirtualFibreEvent::Packed => {
            if m.has_local_visibility() {
                return Some(Err(KernelRefusal::LocalVisibility));
            }
            let matter = FibreMatter::of_packed(m, max_bytes);
            Some(matter.map_err(KernelRefusal::from))
        }
        [AnyMedium::HybridFibres(m)] => Some(m.matter(max_bytes).map_err(KernelRefusal::from)),
        media if media.iter().any(|m| fibres_of(m).is_some()) => {
            Some(explicit_matter(scene, max_bytes))
        }
        _ => None,
    }
}

/// Cloths of explicit fibres, and planes, in cells.
fn explicit_matter(scene: &Scene, max_bytes: u64) -> Result<FibreMatter, KernelRefusal> {
    let (mut bodies, mut planes) = (Vec::new(), Vec::new());
    for medium in &scene.media {
        match (fibres_of(medium), medium) {
            (Some(body), _) => bodies.push(body),
            (None, AnyMedium::Plane(plane)) => planes.push(FibrePlane::from(plane)),
            _ => return Err(KernelRefusal::MixedMedia),
        }
    }
    let matter = FibreMatter::new(&bodies, planes, max_bytes);
    Ok(matter.map_err(|unfit| Refusal::of_fibres(unfit, max_bytes))?)
}

/// Explicit fibres as the kernel takes them, flat or over a mesh; `None` of other matter.
fn fibres_of(medium: &AnyMedium) -> Option<FibreBody<'_>> {
    match medium {
        AnyMedium::ExplicitFibres(fibres) => Some(fibres.body(None)),
        AnyMedium::Levelled(cloth) => {
            let (fibres, draping) = cloth.draped_fibres()?;
            let drape: Arc<dyn Drape> = Arc::<Draping>::clone(draping);
            Some(fibres.body(Some(drape)))
        }
        _ => None,
    }
}

/// Lays a scene of one medium in voxels out as plain buffers of at most `max_bytes` bytes.
///
/// # Errors
/// Why the general walk must render the scene.
pub fn flatten(
    scene: &Scene,
    settings: &RenderSettings,
    max_bytes: u64,
) -> Result<FlatScene, KernelRefusal> {
    if settings.integrator != Integrator::Woodcock {
        return Err(KernelRefusal::Integrator);
    }
    let [medium] = &scene.media[..] else {
        return Err(KernelRefusal::MediumCount(scene.media.len()));
    };
    match medium {
        AnyMedium::Grid(m) if !m.is_piecewise_constant() => Err(KernelRefusal::Interpolated),
        AnyMedium::Grid(m) => flat_scene(m, scene, settings, max_bytes),
        AnyMedium::SggxOctree(m) => flat_scene(m, scene, settings, max_bytes),
        AnyMedium::VirtualFibres(m) if m.event() == VirtualFibreEvent::Packed => {
            Err(KernelRefusal::Packed)
        }
        AnyMedium::VirtualFibres(m) if m.has_local_visibility() => {
            Err(KernelRefusal::LocalVisibility)
        }
        AnyMedium::VirtualFibres(m) => flat_scene(m, scene, settings, max_bytes),
        _ => Err(KernelRefusal::NotFlakes),
    }
}

fn flat_scene(
    matter: &impl Matter,
    scene: &Scene,
    settings: &RenderSettings,
    max_bytes: u64,
) -> Result<FlatScene, KernelRefusal> {
    let view = View {
        matter,
        lights: &scene.lights,
        camera: &scene.camera,
    };
    let max_bounces = settings.max_bounces.min(MAX_EVENTS);
    Ok(FlatScene::new(
        &view,
        settings.seed,
        max_bounces,
        max_bytes,
    )?)
}

/// Explicit or packed fibres of a scene, for paths of any origin; `None` when there
/// is other matter, or the kernel does not suit it.
pub fn fibre_probe(scene: &Scene) -> Option<FibreProbe> {
    if let [AnyMedium::ExplicitFibres(fibres)] = &scene.media[..] {
        let matter = fibres.alone_in_cells(PROBE_BYTES).ok()?;
        return Some(FibreProbe::new(Arc::new(matter), Backend::widest()));
    }
    let matter = fibre_matter(scene, PROBE_BYTES)?.ok()?;
    Some(FibreProbe::new(Arc::new(matter), Backend::widest()))
}
