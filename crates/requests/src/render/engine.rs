//! What takes the paths of a render.

use super::RenderJob;
use anyhow::Result;
use clap::ValueEnum;
use clap::builder::PossibleValue;
use organza_kernel::Refusal;
use organza_scene::scene_file::SceneFile;
use organza_transport::{
    ENGINES, Engine, EngineChoice, EngineRecord, KernelRefusal, RenderSettings, Scene, engine,
};
use organza_work::identity::EngineKind;
use organza_work::{after_option, of_file, of_key};
use std::sync::LazyLock;

/// What traces the paths, as `--engine` names it.
#[derive(Clone, Copy, Debug)]
pub enum EngineName {
    /// The fastest engine that computer and scene allow, otherwise the general walk.
    Auto,
    /// The general walk.
    Walk,
    /// The fastest engine for processors that computer and scene allow, otherwise the
    /// general walk.
    Cpu,
    /// An engine of the kernel.
    Kernel(&'static EngineRecord),
}

impl ValueEnum for EngineName {
    fn value_variants<'a>() -> &'a [Self] {
        static ALL: LazyLock<Vec<EngineName>> = LazyLock::new(|| {
            let engines = ENGINES.iter().map(EngineName::Kernel);
            let others = [EngineName::Auto, EngineName::Walk, EngineName::Cpu];
            others.into_iter().chain(engines).collect()
        });
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let (name, help) = match self {
            EngineName::Auto => (
                "auto",
                "The fastest engine that computer and scene allow: a graphics card, the widest \
                 kernel for the processor, or the walk",
            ),
            EngineName::Cpu => (
                "cpu",
                "The widest kernel that processor and scene allow, otherwise the walk",
            ),
            EngineName::Walk => ("walk", "The general walk, which supports every scene"),
            EngineName::Kernel(engine) => (engine.name, engine.summary),
        };
        Some(PossibleValue::new(name).help(help))
    }
}

/// The engine of a render.
pub struct Chosen<'a> {
    /// The engine with the scene laid out; without one the general walk takes the paths.
    pub engine: Option<Box<dyn Engine + 'a>>,
    /// Why the general walk takes them, if the user did not ask for it.
    pub why_walk: Option<KernelRefusal>,
}

impl Chosen<'_> {
    /// Which kind of engine it is.
    pub fn kind(&self) -> EngineKind {
        match self.engine {
            Some(_) => EngineKind::Kernel,
            None => EngineKind::Walk,
        }
    }

    /// Warns where the choice depends on the memory allowed: the same command
    /// gives another picture where there is more.
    pub fn warn(&self, args: &RenderJob) {
        if let Some(KernelRefusal::Kernel(Refusal::Memory(needed, allowed))) = self.why_walk {
            args.context.warn(format!(
                "{}: the general walk renders this scene, for the tables of the \
                 kernel need up to {needed} bytes of memory and {allowed} are allowed; where more \
                 are allowed, the kernel renders it, with other noise. --engine walk makes the \
                 choice independent of memory",
                args.scene.display()
            ));
        }
    }
}

/// Chooses the engine that `--engine` asks for.
///
/// # Errors
/// A kernel was asked for by name, and the scene does not suit it.
pub fn choose<'a>(
    args: &RenderJob,
    file: &SceneFile,
    scene: &'a Scene,
    settings: &RenderSettings,
    max_bytes: u64,
) -> Result<Chosen<'a>> {
    let choice = match args.engine {
        EngineName::Auto => EngineChoice::Fastest,
        EngineName::Cpu => EngineChoice::Processor,
        EngineName::Kernel(record) => EngineChoice::Named(record),
        EngineName::Walk => {
            // Of so many fibres a million pieces may lie in one place, where no cell holds them.
            const MANY_BYTES: u64 = 256 << 20;
            let is_many = scene.hierarchy_bytes() > MANY_BYTES;
            let made = is_many.then(|| engine(scene, settings, EngineChoice::Processor, max_bytes));
            let why = made.and_then(Result::err);
            check_walk(args, scene, why.as_ref(), max_bytes)?;
            return Ok(Chosen {
                engine: None,
                why_walk: None,
            });
        }
    };
    // Graphics cards do not tell direct light from other light, and learn none.
    let choice = match choice {
        EngineChoice::Named(record) if file.render.direct && record.name == "gpu" => {
            return Err(of_key(
                &args.scene,
                "render.direct",
                "graphics cards do not tell direct light from other light; expected --engine cpu, \
                 or false",
            ));
        }
        EngineChoice::Fastest if file.render.direct || args.light_flag().is_some() => {
            EngineChoice::Processor
        }
        choice => choice,
    };
    let made = match file.render.clamp {
        Some(_) => Err(KernelRefusal::Clamp),
        None => engine(scene, settings, choice, max_bytes),
    };
    match (made, choice) {
        (Err(why), EngineChoice::Named(record)) => Err(after_option(
            "engine",
            format!(
                "{}: {why}; --engine auto would use {}",
                record.name,
                match record.name {
                    "gpu" => "another engine",
                    _ => "the general walk",
                }
            ),
        )),
        (Err(why), _) => {
            check_walk(args, scene, Some(&why), max_bytes)?;
            Ok(Chosen {
                engine: None,
                why_walk: Some(why),
            })
        }
        (Ok(engine), _) => Ok(Chosen {
            engine: Some(engine),
            why_walk: None,
        }),
    }
}

/// Refuses explicit fibres whose cells would not fit into memory or hold too many pieces; `why`
/// is why the kernel does not render them.
fn check_walk(
    args: &RenderJob,
    scene: &Scene,
    why: Option<&KernelRefusal>,
    max_bytes: u64,
) -> Result<()> {
    if let Some(KernelRefusal::Kernel(Refusal::TooManyPieces)) = why {
        let why = Refusal::TooManyPieces;
        return Err(of_file(&args.scene, why));
    }
    let mut needed = scene.hierarchy_bytes();
    if needed <= max_bytes {
        return Ok(());
    }
    if let Some(KernelRefusal::Kernel(Refusal::Memory(in_cells, _))) = why {
        needed = needed.min(*in_cells);
    }
    Err(of_file(
        &args.scene,
        format!(
            "explicit fibres need about {needed} bytes of memory, {max_bytes} are allowed: use a \
             smaller tile or allow more"
        ),
    ))
}
