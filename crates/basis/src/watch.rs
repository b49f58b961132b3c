//! Long computations that say how far they are, and that whoever watches them can stop.

use std::ops::ControlFlow;

/// Told how far a computation is, from any thread. By breaking it stops the computation, which
/// then ends soon with an error that is or holds [`Stopped`].
pub type Watch<'a, T = u64> = &'a (dyn Fn(T) -> ControlFlow<()> + Sync);

/// The computation was stopped by whoever watched it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("stopped")]
pub struct Stopped;

impl Stopped {
    /// Turns the answer of a [`Watch`] into a result, which `?` passes on.
    ///
    /// # Errors
    /// The answer is to stop.
    pub fn check(answer: ControlFlow<()>) -> Result<(), Stopped> {
        match answer {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Stopped),
        }
    }
}

/// A [`Watch`] that looks at nothing and never stops.
pub fn unwatched<T>(_: T) -> ControlFlow<()> {
    ControlFlow::Continue(())
}
