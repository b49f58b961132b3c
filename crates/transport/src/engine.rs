//! The choice of engine: a scene laid out for an engine of the kernel, or why only the
//! general walk can render it.

use crate::levelled_engine::LevelledEngine;
use crate::{
    AnyMedium, Integrator, LevelledCloth, MAX_EVENTS, Medium, RenderSettings, Scene,
    VirtualFibreEvent, VirtualFibreMedium,
};
use organza_kernel::fibres::{FibreBody, FibreMatter, FibreScene};
use organza_kernel::{
    Backend, CPU_ENGINES, ENGINES, Engine, EngineRecord, FibreProbe, FlatScene, LaidOut, Matter,
    Refusal, Reserve, View,
};
use organza_mesh::Shell;
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
    /// Several representations, on a graphics card.
    #[error("the cloth shows several representations; engines for the processor take them")]
    Levels,
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
pub fn engine<'a>(
    scene: &'a Scene,
    settings: &RenderSettings,
    choice: EngineChoice,
    max_bytes: u64,
) -> Result<Box<dyn Engine + 'a>, KernelRefusal> {
    if let EngineChoice::Named(record) = choice {
        // Before anything is laid out in vain.
        record.check()?;
    }
    if let Some(cloth) = levelled_cloth(scene) {
        return by_levels(scene, cloth, settings, choice, max_bytes);
    }
    let laid_out = lay_out(scene, 0, settings, max_bytes)?;
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

/// The one cloth of a scene that shows several representations, if one does.
fn levelled_cloth(scene: &Scene) -> Option<&LevelledCloth> {
    let mut all = scene.media.iter().filter_map(|m| match m {
        AnyMedium::Levelled(cloth) if cloth.representation_count() > 1 => Some(&**cloth),
        _ => None,
    });
    all.next().filter(|_| all.next().is_none())
}

/// An engine for every representation of a cloth that the kernel can show; the general walk
/// shows the others.
fn by_levels<'a>(
    scene: &'a Scene,
    cloth: &LevelledCloth,
    settings: &RenderSettings,
    choice: EngineChoice,
    max_bytes: u64,
) -> Result<Box<dyn Engine + 'a>, KernelRefusal> {
    let mut left = max_bytes;
    let mut engines = Vec::new();
    let mut why = None;
    for level in 0..cloth.representation_count() {
        let laid_out = match cloth.part(level) {
            Some(_) => lay_out(scene, level, settings, left),
            None => Err(KernelRefusal::NotFlakes),
        };
        let made = laid_out.and_then(|laid_out| match choice {
            EngineChoice::Named(record) if CPU_ENGINES.iter().all(|e| e.name != record.name) => {
                Err(KernelRefusal::Levels)
            }
            EngineChoice::Named(record) => Ok(laid_out.engine(record)?),
            EngineChoice::Processor | EngineChoice::Fastest => {
                Ok(laid_out.fastest_engine(CPU_ENGINES)?)
            }
        });
        match made {
            Ok(engine) => {
                left = left.saturating_sub(engine.memory_bytes());
                engines.push(Some(engine));
            }
            Err(refusal) => {
                why = why.or((level == 0).then_some(refusal));
                engines.push(None);
            }
        }
    }
    // The finest representation is what takes the time.
    match why {
        Some(why) => Err(why),
        None => Ok(Box::new(LevelledEngine::new(scene, settings, engines))),
    }
}

/// What the kernel sees of a scene whose cloths show the representation of this number: media,
/// and the shells that they fill.
fn seen<'a>(scene: &'a Scene, level: usize) -> Vec<(&'a AnyMedium, Option<&'a Arc<Shell>>)> {
    let part = |m: &'a AnyMedium| match m {
        AnyMedium::Levelled(cloth) => {
            let level = level.min(cloth.representation_count() - 1);
            cloth.part(level).unwrap_or((m, None))
        }
        _ => (m, None),
    };
    scene.media.iter().map(part).collect()
}

/// Lays a scene out for any engine: explicit fibres in cells, packed ones in voxels with the
/// events of explicit fibres, other matter in voxels.
fn lay_out(
    scene: &Scene,
    level: usize,
    settings: &RenderSettings,
    max_bytes: u64,
) -> Result<LaidOut, KernelRefusal> {
    let Some(matter) = fibre_matter(scene, level, max_bytes) else {
        let flat = flatten_level(scene, level, settings, max_bytes)?;
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
fn fibre_matter(
    scene: &Scene,
    level: usize,
    max_bytes: u64,
) -> Option<Result<FibreMatter, KernelRefusal>> {
    let media = seen(scene, level);
    match &media[..] {
        [(AnyMedium::VirtualFibres(m), None)] if m.event() == VirtualFibreEvent::Packed => {
            if m.has_local_visibility() {
                return Some(Err(KernelRefusal::LocalVisibility));
            }
            let beside = beside_packed_bytes(m);
            let matter = FibreMatter::of_packed(m, left_beside(beside, max_bytes));
            Some(matter.map_err(|why| with_memory(why, beside, max_bytes).into()))
        }
        [(AnyMedium::HybridFibres(m), None)] => {
            let beside = beside_packed_bytes(m.packed());
            let matter = m.matter(left_beside(beside, max_bytes));
            Some(matter.map_err(|why| with_memory(why, beside, max_bytes).into()))
        }
        media if media.iter().any(|m| fibres_of(m).is_some()) => {
            Some(explicit_matter(media, max_bytes))
        }
        _ => None,
    }
}

/// Bytes of packed fibres while the kernel lays them out: the octree, and for every voxel the
/// tables of the general walk and room to work beyond what the kernel counts (measured).
fn beside_packed_bytes(medium: &VirtualFibreMedium) -> u64 {
    const OF_VOXEL: u64 = 27;
    let dims = Medium::cell_grid(medium).dims();
    medium.octree().memory_bytes() + OF_VOXEL * dims.as_u64vec3().element_product()
}

/// What is left for the kernel: at least so much that it says what it needs.
fn left_beside(bytes: u64, allowed: u64) -> u64 {
    allowed.saturating_sub(bytes).max(1 << 20)
}

/// A refusal that counts what else is in memory.
fn with_memory(why: Refusal, beside: u64, allowed: u64) -> Refusal {
    match why {
        Refusal::Memory(needed, _) => Refusal::Memory(needed + beside, allowed),
        other => other,
    }
}

/// Cloths of explicit fibres, and planes, in cells.
fn explicit_matter(
    media: &[(&AnyMedium, Option<&Arc<Shell>>)],
    max_bytes: u64,
) -> Result<FibreMatter, KernelRefusal> {
    let (mut bodies, mut planes) = (Vec::new(), Vec::new());
    for part in media {
        match (fibres_of(part), part.0) {
            (Some(body), _) => bodies.push(body),
            (None, AnyMedium::Plane(plane)) => planes.push(*plane),
            _ => return Err(KernelRefusal::MixedMedia),
        }
    }
    // The fibres themselves stay for the general walk.
    let beside = media.iter().map(|(medium, _)| match medium {
        AnyMedium::ExplicitFibres(fibres) => fibres.memory_bytes(),
        _ => 0,
    });
    let beside: u64 = beside.sum();
    let matter = FibreMatter::new(&bodies, planes, max_bytes.saturating_sub(beside));
    let refused = |unfit| with_memory(Refusal::of_fibres(unfit, max_bytes), beside, max_bytes);
    Ok(matter.map_err(refused)?)
}

/// Explicit fibres as the kernel takes them, flat or over a mesh; `None` of other matter.
fn fibres_of<'a>(
    (medium, shell): &(&'a AnyMedium, Option<&'a Arc<Shell>>),
) -> Option<FibreBody<'a>> {
    let AnyMedium::ExplicitFibres(fibres) = medium else {
        return None;
    };
    Some(fibres.body(shell.cloned()))
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
    flatten_level(scene, 0, settings, max_bytes)
}

/// [`flatten`] of the representation of this number of a cloth.
fn flatten_level(
    scene: &Scene,
    level: usize,
    settings: &RenderSettings,
    max_bytes: u64,
) -> Result<FlatScene, KernelRefusal> {
    if settings.integrator != Integrator::Woodcock {
        return Err(KernelRefusal::Integrator);
    }
    let media = seen(scene, level);
    let [(medium, None)] = &media[..] else {
        return Err(match media.len() {
            1 => KernelRefusal::NotFlakes,
            count => KernelRefusal::MediumCount(count),
        });
    };
    match medium {
        AnyMedium::Grid(m) if !m.is_piecewise_constant() => Err(KernelRefusal::Interpolated),
        AnyMedium::Grid(m) => flat_scene(m, scene, settings, max_bytes),
        AnyMedium::FlakeOctree(m) => flat_scene(m, scene, settings, max_bytes),
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
    let matter = fibre_matter(scene, 0, PROBE_BYTES)?.ok()?;
    Some(FibreProbe::new(Arc::new(matter), Backend::widest()))
}
