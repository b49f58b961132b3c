//! What fills films with the paths of a scene that was laid out for it.

use crate::{Block, Kernel};
use organza_film::Stats;

/// Blocks of the film that a thread does one after the other in a pass, so that
/// threads end at about the same time.
const BLOCKS_PER_THREAD: u32 = 4;

/// Walks the paths of a view: whatever walks, the same seed gives the same bits.
pub trait Engine: Send + Sync {
    /// Its name on the command line and in pictures.
    fn name(&self) -> &'static str;

    /// Bytes of the matter and tables.
    fn memory_bytes(&self) -> u64;

    /// Rows of pixels that a block should have, in a film of `rows` that so many threads
    /// share. Lanes of a processor run dry at the end of a block: few and large ones.
    fn rows_per_block(&self, rows: u32, threads: u32) -> u32 {
        rows.div_ceil(BLOCKS_PER_THREAD * threads.max(1)).max(1)
    }

    /// Takes the samples of a block.
    fn take(&self, block: &mut Block<'_>) -> Stats;
}

impl Engine for Kernel {
    fn name(&self) -> &'static str {
        self.backend().name()
    }

    fn memory_bytes(&self) -> u64 {
        Kernel::memory_bytes(self)
    }

    fn take(&self, block: &mut Block<'_>) -> Stats {
        Kernel::take(self, block)
    }
}

impl Engine for Box<dyn Engine> {
    fn name(&self) -> &'static str {
        (**self).name()
    }

    fn memory_bytes(&self) -> u64 {
        (**self).memory_bytes()
    }

    fn rows_per_block(&self, rows: u32, threads: u32) -> u32 {
        (**self).rows_per_block(rows, threads)
    }

    fn take(&self, block: &mut Block<'_>) -> Stats {
        (**self).take(block)
    }
}
