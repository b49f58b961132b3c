//! Explicit fibres on a processor: waves of paths, for films and for measurements.

use crate::block::Block;
use crate::engine::{Engine, Lost};
use crate::fibres::cache::learn::learn;
use crate::fibres::cache::{
    CachePlan, CacheReport, CacheUse, KeptLight, LearnWatch, RadianceCache, Stopped,
};
use crate::fibres::fibre_scene::FibreScene;
use crate::fibres::walk::Walk;
use crate::fibres::work::{FilmWork, Work};
use crate::refusal::Refusal;
use organza_film::Stats;
use organza_lanes::dispatch::{Job, dispatch_sixteen};
use organza_lanes::{Backend, Floats};
use std::sync::Arc;

/// Walks explicit fibres on a processor.
pub struct FibreEngine {
    scene: Arc<FibreScene>,
    backend: Backend,
}

impl FibreEngine {
    /// An engine for a scene, with the instructions of a back end.
    ///
    /// # Errors
    /// When the processor lacks them.
    pub fn new(scene: Arc<FibreScene>, backend: Backend) -> Result<FibreEngine, Refusal> {
        Refusal::without(backend)?;
        Ok(FibreEngine { scene, backend })
    }
}

impl Engine for FibreEngine {
    fn name(&self) -> &'static str {
        self.backend.name()
    }

    fn memory_bytes(&self) -> u64 {
        self.scene.memory_bytes()
    }

    fn saved_memory(&self) -> Option<&'static str> {
        self.scene
            .matter
            .has_lists()
            .then_some("copies of fibres in cells, which hold lists")
    }

    fn take(&self, block: &mut Block<'_>) -> Result<Stats, Lost> {
        let scene = &*self.scene;
        let mut work = FilmWork::new(block, &scene.camera, scene.seed, scene.brightness);
        let cache = scene.cache.get().map(RadianceCache::to_read);
        Ok(self.walk(cache.unwrap_or_default(), &mut work))
    }

    fn can_learn(&self) -> bool {
        true
    }

    fn learn(
        &self,
        plan: &CachePlan,
        watch: &LearnWatch<'_>,
    ) -> Result<Option<CacheReport>, Stopped> {
        let scene = &*self.scene;
        if scene.cache.get().is_none() {
            let walker = |cache: CacheUse<'_>, work: &mut dyn Work| self.walk(cache, work);
            let learned = learn(scene, plan, &walker, watch)?;
            // Whoever learned it first learned the same.
            let _ = scene.cache.set(learned);
        }
        Ok(scene.cache.get().map(|cache| cache.report.clone()))
    }

    fn kept_light(&self) -> Option<KeptLight> {
        let scene = &*self.scene;
        let cache = scene.cache.get();
        cache.map(|cache| KeptLight::of(cache, &scene.matter))
    }

    fn takes_light(&self, light: &KeptLight) -> bool {
        light.is_of(&self.scene.matter)
    }
}

impl FibreEngine {
    fn walk(&self, cache: CacheUse<'_>, work: &mut dyn Work) -> Stats {
        let scene = &*self.scene;
        let walk = Walk {
            matter: &scene.matter,
            lights: &scene.lights,
            max_bounces: scene.max_bounces,
            importance: scene.importance.as_ref(),
            cache,
        };
        run(&walk, self.backend, work)
    }
}

/// Walks all paths of some work.
pub fn run(walk: &Walk<'_>, backend: Backend, work: &mut dyn Work) -> Stats {
    struct Run<'a, 'b> {
        walk: &'a Walk<'a>,
        work: &'b mut dyn Work,
    }
    impl Job for Run<'_, '_> {
        type Output = Stats;
        #[inline(always)]
        fn run<F: Floats>(self) -> Stats {
            self.walk.run::<F>(self.work)
        }
    }
    dispatch_sixteen(backend, Run { walk, work })
}
