//! An engine with another one that goes on if it is lost.

use crate::block::Block;
use crate::engine::{Engine, Lost, MadeEngine};
use crate::fibres::{CachePlan, CacheReport, KeptLight, LearnWatch, Stopped};
use glam::UVec2;
use organza_film::Stats;
use rayon::prelude::*;
use std::sync::OnceLock;
use std::time::Duration;

/// An engine off the processor, and how one for the processor is made of the same scene.
///
/// A block that the first engine could not finish is as it was, so the other one takes it
/// from the start: the film then has samples of both, none of them twice.
pub struct Reserve {
    engine: Box<dyn Engine>,
    make: Box<dyn Fn() -> MadeEngine + Send + Sync>,
    loss: OnceLock<Lost>,
    other: OnceLock<Option<Box<dyn Engine>>>,
    name_of_both: OnceLock<&'static str>,
}

impl Reserve {
    /// An engine, and how the one that goes on is made.
    pub fn new(
        engine: Box<dyn Engine>,
        make: impl Fn() -> MadeEngine + Send + Sync + 'static,
    ) -> Reserve {
        Reserve {
            engine,
            make: Box::new(make),
            loss: OnceLock::new(),
            other: OnceLock::new(),
            name_of_both: OnceLock::new(),
        }
    }

    /// The engine that goes on.
    fn other(&self, loss: &Lost) -> Result<&dyn Engine, Lost> {
        let made = self.other.get_or_init(|| (self.make)().ok());
        made.as_deref().ok_or_else(|| loss.clone())
    }
}

impl Engine for Reserve {
    /// Of both, joined by `+`, once the first one is lost.
    fn name(&self) -> &'static str {
        match self.other.get() {
            Some(Some(other)) => self.name_of_both.get_or_init(|| {
                // Once in a render, and of a few letters.
                Box::leak(format!("{}+{}", self.engine.name(), other.name()).into_boxed_str())
            }),
            _ => self.engine.name(),
        }
    }

    fn memory_bytes(&self) -> u64 {
        self.engine.memory_bytes()
    }

    fn saved_memory(&self) -> Option<&'static str> {
        self.engine.saved_memory()
    }

    fn rows_per_block(&self, rows: u32, threads: u32) -> u32 {
        match self.other.get() {
            Some(Some(other)) => other.rows_per_block(rows, threads),
            _ => self.engine.rows_per_block(rows, threads),
        }
    }

    fn pass_time(&self) -> Duration {
        match self.other.get() {
            Some(Some(other)) => other.pass_time(),
            _ => self.engine.pass_time(),
        }
    }

    fn take(&self, block: &mut Block<'_>) -> Result<Stats, Lost> {
        if self.loss.get().is_none() {
            match self.engine.take(block) {
                Ok(stats) => return Ok(stats),
                Err(lost) => {
                    // Blocks that are taken at the same time are lost for one reason.
                    let _ = self.loss.set(lost);
                }
            }
        }
        let Some(loss) = self.loss.get() else {
            return Err(Lost("for no known reason".into()));
        };
        let other = self.other(loss)?;
        let threads = rayon::current_num_threads() as u32;
        let rows = other.rows_per_block(block.pixels.len() as u32 / block.width, threads);
        let (width, min, samples) = (block.width, block.min, block.samples.clone());
        let takes = block.takes;
        block
            .pixels
            .par_chunks_mut((rows * width) as usize)
            .enumerate()
            .map(|(i, pixels)| {
                other.take(&mut Block {
                    pixels,
                    direct: None, // no engine with a reserve fills it
                    width,
                    min: min + UVec2::new(0, i as u32 * rows),
                    samples: samples.clone(),
                    takes,
                })
            })
            .try_reduce(Stats::default, |mut a, b| {
                a.merge(&b);
                Ok(a)
            })
    }

    fn can_learn(&self) -> bool {
        self.engine.can_learn()
    }

    fn learn(
        &self,
        plan: &CachePlan,
        watch: &LearnWatch<'_>,
    ) -> Result<Option<CacheReport>, Stopped> {
        self.engine.learn(plan, watch)
    }

    fn kept_light(&self) -> Option<KeptLight> {
        self.engine.kept_light()
    }

    fn takes_light(&self, light: &KeptLight) -> bool {
        self.engine.takes_light(light)
    }

    fn loss(&self) -> Option<&Lost> {
        self.loss.get()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Loses every block, or says that it took it.
    struct Named {
        name: &'static str,
        is_lost: bool,
    }

    impl Engine for Named {
        fn name(&self) -> &'static str {
            self.name
        }

        fn memory_bytes(&self) -> u64 {
            0
        }

        fn take(&self, _: &mut Block<'_>) -> Result<Stats, Lost> {
            match self.is_lost {
                true => Err(Lost("unplugged".into())),
                false => Ok(Stats::default()),
            }
        }
    }

    #[test]
    fn both_engines_are_named_once_the_first_is_lost() {
        let made = |name, is_lost| -> Box<dyn Engine> { Box::new(Named { name, is_lost }) };
        for (is_lost, name) in [(false, "card"), (true, "card+lanes")] {
            let engine = Reserve::new(made("card", is_lost), move || Ok(made("lanes", false)));
            assert_eq!(engine.name(), "card");
            let mut block = Block {
                pixels: &mut [],
                direct: None,
                width: 1,
                min: UVec2::ZERO,
                samples: 0..1,
                takes: None,
            };
            assert!(engine.take(&mut block).is_ok());
            assert_eq!(engine.name(), name);
            assert_eq!(engine.loss().is_some(), is_lost);
        }
    }
}
