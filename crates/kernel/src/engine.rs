//! What fills films with the paths of a scene that was laid out for it.

use crate::block::Block;
use crate::fibres::fibre_scene::FibreScene;
use crate::fibres::{CachePlan, CacheReport, KeptLight, LearnWatch, Stopped};
use crate::refusal::Refusal;
use crate::voxels::flat_scene::FlatScene;
use organza_film::Stats;
use std::sync::Arc;
use std::time::Duration;

/// Blocks of the film that a thread does one after the other in a pass, so that
/// threads end at about the same time.
const BLOCKS_PER_THREAD: u32 = 4;

/// Walks the paths of a scene.
///
/// # Contract
/// - One engine gives the same bits for the same seed, however the film is divided into
///   blocks and the samples into passes. Engines for processors agree bit for bit;
///   others agree with them within the noise.
/// - Threads call [`take`](Engine::take) at the same time, with blocks that share no
///   pixel. An engine that takes the whole film at once returns all rows from
///   [`rows_per_block`](Engine::rows_per_block): a pass then has one block and makes
///   one call.
/// - A render can be interrupted between blocks, so a block should take no longer than a
///   second.
/// - An engine off the processor can be lost. It then leaves the block as it was, and
///   another engine takes it from the start.
pub trait Engine: Send + Sync {
    /// Its name on the command line and in pictures.
    fn name(&self) -> &'static str;

    /// Bytes of the matter and tables.
    fn memory_bytes(&self) -> u64;

    /// What memory did not suffice for, if the matter is laid out in a slower way that
    /// takes less.
    fn saved_memory(&self) -> Option<&'static str> {
        None
    }

    /// Rows of pixels that a block should have, in a film of `rows` that so many threads
    /// share; at least one. Lanes of a processor run dry at the end of a block: few and
    /// large ones.
    fn rows_per_block(&self, rows: u32, threads: u32) -> u32 {
        rows.div_ceil(BLOCKS_PER_THREAD * threads.max(1)).max(1)
    }

    /// How long a pass should take: long beside what is done once a pass, short beside the
    /// patience of a user who interrupts.
    fn pass_time(&self) -> Duration {
        Duration::from_millis(500)
    }

    /// Takes the samples of a block.
    ///
    /// # Errors
    /// What walks the paths is gone; the block is then as it was.
    fn take(&self, block: &mut Block<'_>) -> Result<Stats, Lost>;

    /// Whether [`learn`](Engine::learn) learns anything.
    fn can_learn(&self) -> bool {
        false
    }

    /// Learns a cache of radiance for the samples that follow, unless it is learned; `None`
    /// of an engine or a scene without one.
    ///
    /// # Errors
    /// `watch` broke.
    fn learn(
        &self,
        _plan: &CachePlan,
        _watch: &LearnWatch<'_>,
    ) -> Result<Option<CacheReport>, Stopped> {
        Ok(None)
    }

    /// What was learned and is of use to other pictures.
    fn kept_light(&self) -> Option<KeptLight> {
        None
    }

    /// Whether [`learn`](Engine::learn) takes light that another picture has kept.
    fn takes_light(&self, _light: &KeptLight) -> bool {
        false
    }

    /// Why another engine goes on in this one's place, if it does.
    fn loss(&self) -> Option<&Lost> {
        None
    }
}

/// What walked the paths is gone, such as a graphics adapter that was reset: why, in the
/// words of its driver.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the device that traced the paths was lost: {0}")]
pub struct Lost(pub String);

/// An engine for a scene, or why there is none.
pub type MadeEngine = Result<Box<dyn Engine>, Refusal>;

/// An engine as it is registered in [`ENGINES`](crate::ENGINES): what it is called, and
/// how it is made.
#[derive(Clone, Copy, Debug)]
pub struct EngineRecord {
    /// Its name on the command line and in pictures.
    pub name: &'static str,
    /// One line for help texts, without a full stop.
    pub summary: &'static str,
    /// What a computer must have for it, in words after "needs".
    pub needs: &'static str,
    /// Whether this computer has it.
    pub is_available: fn() -> bool,
    /// Whether it may be chosen when the user names no engine.
    pub is_automatic: fn() -> bool,
    /// The engine for a scene of voxels. It refuses a scene that it cannot hold.
    pub for_voxels: fn(Arc<FlatScene>) -> MadeEngine,
    /// The engine for a scene of explicit fibres.
    pub for_fibres: fn(Arc<FibreScene>) -> MadeEngine,
}

impl EngineRecord {
    /// Refuses an engine that this computer does not have, before anything is laid out
    /// for it.
    ///
    /// # Errors
    /// [`Refusal::Unavailable`].
    pub fn check(&self) -> Result<(), Refusal> {
        if (self.is_available)() {
            return Ok(());
        }
        Err(Refusal::Unavailable {
            engine: self.name,
            needs: self.needs,
        })
    }
}
