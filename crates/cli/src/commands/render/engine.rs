//! What takes the paths of a render.

use super::RenderArgs;
use crate::error::input;
use crate::identity::Engine;
use crate::output::note;
use anyhow::Result;
use organza_kernel::Refusal;
use organza_scene::scene_file::SceneFile;
use organza_transport::{Backend, KernelRefusal, RenderSettings, Scene, engine};

/// The engine that traces the paths, as `--backend` names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BackendName {
    /// The widest kernel that processor and scene allow, otherwise the walk
    Auto,
    /// The general walk, which supports every scene
    Walk,
    /// The kernel, one path at a time
    Scalar,
    /// The kernel, 16 paths at a time
    Avx2,
    /// The kernel, 32 paths at a time
    Avx512,
}

/// The engine of a render.
pub struct Chosen {
    /// The kernel, laid out; without one the general walk takes the paths.
    pub kernel: Option<Box<dyn organza_transport::Engine>>,
    /// Why the general walk takes them, if the user did not ask for it.
    pub why_walk: Option<KernelRefusal>,
}

impl Chosen {
    /// Which engine it is.
    pub fn kind(&self) -> Engine {
        match self.kernel {
            Some(_) => Engine::Kernel,
            None => Engine::Walk,
        }
    }

    /// Warns where the choice depends on the memory allowed: the same command
    /// gives another picture where there is more.
    pub fn warn(&self, args: &RenderArgs) {
        if let Some(KernelRefusal::Kernel(Refusal::Memory(needed, allowed))) = self.why_walk
            && !args.common.quiet
        {
            note!(
                "organza: warning: {}: the general walk renders this scene, for the tables of the \
                 kernel need up to {needed} bytes of memory and {allowed} are allowed; where more \
                 are allowed, the kernel renders it, with other noise. --backend walk makes the \
                 choice independent of memory",
                args.scene.display()
            );
        }
    }
}

/// Chooses the engine that `--backend` asks for.
///
/// # Errors
/// A kernel was asked for by name, and the scene does not suit it.
pub fn choose(
    args: &RenderArgs,
    file: &SceneFile,
    scene: &Scene,
    settings: &RenderSettings,
    max_bytes: u64,
) -> Result<Chosen> {
    let backend = match args.backend {
        BackendName::Auto => Backend::widest(),
        BackendName::Walk => {
            return Ok(Chosen {
                kernel: None,
                why_walk: None,
            });
        }
        BackendName::Scalar => Backend::Scalar,
        BackendName::Avx2 => Backend::Avx2,
        BackendName::Avx512 => Backend::Avx512,
    };
    let made = match file.render.clamp {
        Some(_) => Err(KernelRefusal::Clamp),
        None => engine(scene, settings, backend, max_bytes),
    };
    match made {
        Err(why) if args.backend != BackendName::Auto => Err(input(format!(
            "--backend {}: {why}; --backend auto would use the general walk",
            backend.name()
        ))),
        Err(why) => Ok(Chosen {
            kernel: None,
            why_walk: Some(why),
        }),
        Ok(kernel) => Ok(Chosen {
            kernel: Some(kernel),
            why_walk: None,
        }),
    }
}
