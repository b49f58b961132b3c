//! A cloth of several representations: engines for those that the kernel shows, the general
//! walk for the others.

use crate::walk::add_samples;
use crate::{AnyMedium, LevelledCloth, RenderSettings, Scene};
use glam::UVec2;
use organza_basis::PathRng;
use organza_film::Stats;
use organza_kernel::fibres::{CachePlan, CacheReport, KeptLight, LearnWatch, Stopped};
use organza_kernel::{Block, Engine, Lost};

/// Samples whose representations are known at the same time: a byte for each pixel of a block.
const AT_ONCE: u32 = 16;

/// Has every path walked by the engine of the representation that it meets.
///
/// Which one that is decides the same random number as in the general walk, so that samples of
/// the representations that the walk shows are those of a picture by the walk alone.
pub(crate) struct LevelledEngine<'a> {
    scene: &'a Scene,
    settings: RenderSettings,
    /// One for each representation, finest first; none where the general walk is taken.
    engines: Vec<Option<Box<dyn Engine>>>,
}

impl<'a> LevelledEngine<'a> {
    /// An engine of engines; the first representation has one.
    pub(crate) fn new(
        scene: &'a Scene,
        settings: &RenderSettings,
        engines: Vec<Option<Box<dyn Engine>>>,
    ) -> LevelledEngine<'a> {
        LevelledEngine {
            scene,
            settings: settings.clone(),
            engines,
        }
    }

    fn all(&self) -> impl Iterator<Item = &dyn Engine> {
        self.engines.iter().flatten().map(|e| &**e)
    }

    /// The representation that a sample meets.
    fn level(&self, cloth: &LevelledCloth, pixel: UVec2, sample: u32) -> u8 {
        let width = self.scene.camera.resolution().x;
        let stream = u64::from(pixel.y) * u64::from(width) + u64::from(pixel.x);
        let mut rng = PathRng::new(self.settings.seed, stream, u64::from(sample));
        let ray = self.scene.camera.ray(pixel, &mut rng);
        let tracking = self.scene.tracking(self.settings.integrator, ray, &mut rng);
        cloth.level_of(tracking.detail) as u8
    }

    /// Takes the samples of a block, of which `AT_ONCE` a pixel at most.
    fn take_some(&self, cloth: &LevelledCloth, block: &mut Block<'_>) -> Result<Stats, Lost> {
        let (min, width, samples) = (block.min, block.width, block.samples.clone());
        let count = samples.len();
        let place = |pixel: usize| min + UVec2::new(pixel as u32 % width, pixel as u32 / width);
        let levels: Vec<u8> = (0..block.pixels.len())
            .flat_map(|pixel| {
                let all = samples.clone();
                all.map(move |sample| self.level(cloth, place(pixel), sample))
            })
            .collect();
        let mut stats = Stats::default();
        for (level, engine) in (0u8..).zip(&self.engines) {
            if !levels.contains(&level) {
                continue;
            }
            let Some(engine) = engine else {
                for (pixel, out) in block.pixels.iter_mut().enumerate() {
                    let of_pixel = levels.iter().skip(pixel * count).take(count);
                    for (sample, of_sample) in samples.clone().zip(of_pixel) {
                        if *of_sample == level {
                            let index = u64::from(sample);
                            let direct = block.direct.as_deref_mut();
                            add_samples(
                                self.scene,
                                &self.settings,
                                f32::INFINITY,
                                place(pixel),
                                index..index + 1,
                                (&mut *out, direct.map(|film| &mut film[pixel])),
                                &mut stats,
                            );
                        }
                    }
                }
                continue;
            };
            let takes = |pixel: UVec2, sample: u32| {
                let at = pixel - min;
                let pixel = (at.y * width + at.x) as usize;
                let of_pixel = pixel * count + (sample - samples.start) as usize;
                levels.get(of_pixel) == Some(&level)
            };
            let mut part = Block {
                pixels: &mut *block.pixels,
                direct: block.direct.as_deref_mut(),
                width,
                min,
                samples: samples.clone(),
                takes: Some(&takes),
            };
            stats.merge(&engine.take(&mut part)?);
        }
        Ok(stats)
    }
}

impl Engine for LevelledEngine<'_> {
    /// That of the finest representation.
    fn name(&self) -> &'static str {
        self.all().next().map_or("walk", |e| e.name())
    }

    fn memory_bytes(&self) -> u64 {
        self.all().map(|e| e.memory_bytes()).sum()
    }

    fn saved_memory(&self) -> Option<&'static str> {
        self.all().find_map(|e| e.saved_memory())
    }

    fn rows_per_block(&self, rows: u32, threads: u32) -> u32 {
        let all = self.all().map(|e| e.rows_per_block(rows, threads));
        all.min().unwrap_or(1)
    }

    fn can_learn(&self) -> bool {
        self.all().any(|e| e.can_learn())
    }

    /// The finest representation that has a cache learns one.
    fn learn(
        &self,
        plan: &CachePlan,
        watch: &LearnWatch<'_>,
    ) -> Result<Option<CacheReport>, Stopped> {
        for engine in self.all() {
            let learned = engine.learn(plan, watch)?;
            if learned.is_some() {
                return Ok(learned);
            }
        }
        Ok(None)
    }

    fn kept_light(&self) -> Option<KeptLight> {
        self.all().find_map(|engine| engine.kept_light())
    }

    fn takes_light(&self, light: &KeptLight) -> bool {
        let mut learn = self.all().filter(|engine| engine.can_learn());
        learn.next().is_some_and(|engine| engine.takes_light(light))
    }

    fn take(&self, block: &mut Block<'_>) -> Result<Stats, Lost> {
        let cloth = self.scene.media.iter().find_map(|m| match m {
            AnyMedium::Levelled(cloth) if cloth.representation_count() > 1 => Some(cloth),
            _ => None,
        });
        let mut stats = Stats::default();
        let Some(cloth) = cloth else {
            return Ok(stats);
        };
        let samples = block.samples.clone();
        let mut start = samples.start;
        while start < samples.end {
            let end = samples.end.min(start.saturating_add(AT_ONCE));
            stats.merge(&self.take_some(
                cloth,
                &mut Block {
                    pixels: &mut *block.pixels,
                    direct: block.direct.as_deref_mut(),
                    width: block.width,
                    min: block.min,
                    samples: start..end,
                    takes: None,
                },
            )?);
            start = end;
        }
        Ok(stats)
    }
}
