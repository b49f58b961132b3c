//! Why the kernel leaves a scene to the general walk.

use crate::fibres::cells::Unfit;
use crate::matter::Unsuited;
use organza_lanes::Backend;

/// Why the kernel leaves a view to another walk.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Refusal {
    /// A medium that does not suit it.
    #[error(transparent)]
    Medium(#[from] Unsuited),
    /// Fibres of which the walk draws better.
    #[error(
        "fibres are very rough, point in many directions, or lie very thick and white; the \
         general walk samples them with less noise"
    )]
    Skewed,
    /// A picture of too many pixels.
    #[error("an environment picture has more than 65536 pixels along an edge")]
    Picture,
    /// A light that rays meet between the fibres.
    #[error("a light with an area is inside the matter")]
    LightInMatter,
    /// A light that shadow rays do not look for.
    #[error("a light with a place is found by the walk alone")]
    LightOfWalks,
    /// Its tables would take too much.
    #[error("its tables would take up to {0} bytes, more than {1}")]
    Memory(u64, u64),
    /// More words in a table than lanes can address.
    #[error("one of its tables would have {0} words, more than 2^31")]
    Words(u64),
    /// More pieces of fibre than can be numbered.
    #[error("there are more pieces of fibre than cells can hold")]
    TooManyPieces,
    /// The computer lacks what an engine needs.
    #[error("the engine {engine} needs {needs}, which this computer does not have")]
    Unavailable {
        /// The engine.
        engine: &'static str,
        /// What it needs.
        needs: &'static str,
    },
    /// A cloth of blocks, which the engine does not take.
    #[error("the engine {0} does not take cloths of blocks")]
    Blocks(&'static str),
    /// No engine may be chosen.
    #[error("this computer has no engine of the kernel")]
    NoEngine,
    /// More than a graphics adapter can hold.
    #[error("its tables take {0} bytes, and the graphics adapter binds at most {1}")]
    Binding(u64, u64),
    /// A graphics adapter that is there but cannot be used.
    #[error("the graphics adapter could not be opened, or does not take the program")]
    Unopened,
    /// A scene that an engine does not take although another one does.
    #[error("the engine gpu does not take {0} yet")]
    NotYet(&'static str),
}

impl Refusal {
    /// Refuses an engine that the processor has no instructions for.
    pub(crate) fn without(backend: Backend) -> Result<(), Refusal> {
        match backend.is_available() {
            true => Ok(()),
            false => Err(Refusal::Unavailable {
                engine: backend.name(),
                needs: backend.needs(),
            }),
        }
    }

    /// Of fibres for which `max_bytes` were allowed.
    pub fn of_fibres(unfit: Unfit, max_bytes: u64) -> Refusal {
        match unfit {
            Unfit::TooMany => Refusal::TooManyPieces,
            Unfit::Memory(bytes) => Refusal::Memory(bytes, max_bytes),
        }
    }
}
