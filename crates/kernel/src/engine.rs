//! What fills films with the paths of a scene that was laid out for it.

use crate::fibres::FibreKernel;
use crate::{Backend, Block, Kernel};
use organza_film::Stats;

/// Walks the paths of a view: whatever walks, the same seed gives the same bits.
pub trait Engine: Send + Sync {
    /// The instructions that its lanes use.
    fn backend(&self) -> Backend;

    /// Bytes of the matter and tables.
    fn memory_bytes(&self) -> u64;

    /// Takes the samples of a block.
    fn take(&self, block: &mut Block<'_>) -> Stats;
}

impl Engine for Kernel {
    fn backend(&self) -> Backend {
        Kernel::backend(self)
    }

    fn memory_bytes(&self) -> u64 {
        Kernel::memory_bytes(self)
    }

    fn take(&self, block: &mut Block<'_>) -> Stats {
        Kernel::take(self, block)
    }
}

impl Engine for FibreKernel {
    fn backend(&self) -> Backend {
        FibreKernel::backend(self)
    }

    fn memory_bytes(&self) -> u64 {
        FibreKernel::memory_bytes(self)
    }

    fn take(&self, block: &mut Block<'_>) -> Stats {
        FibreKernel::take(self, block)
    }
}

impl Engine for Box<dyn Engine> {
    fn backend(&self) -> Backend {
        (**self).backend()
    }

    fn memory_bytes(&self) -> u64 {
        (**self).memory_bytes()
    }

    fn take(&self, block: &mut Block<'_>) -> Stats {
        (**self).take(block)
    }
}
