//! The engine for graphics adapters.

use super::device::{Device, Limits};
use super::numbers::NumberBuffer;
use super::pass::{BRIGHT_WORDS, Division, PassResult, Session};
use super::program::{PassNumbers, ProgramScene};
use super::slots::{SLOT_WORDS, add_bright, bright_sample, tally};
use super::{fibre_scene, voxel_scene};
use crate::block::Block;
use crate::engine::{Engine, Lost};
use crate::fibres::fibre_scene::FibreScene;
use crate::refusal::Refusal;
use crate::voxels::flat_scene::FlatScene;
use organza_film::{Brightness, Stats};
use rayon::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Samples whose sums a slot holds for sure: as many as [`organza_film::Tally`].
const SAMPLES_PER_SLOT: u32 = 512;

/// What every adapter offers.
const COMMON_LIMITS: Limits = Limits {
    binding_bytes: 128 << 20,
    table_buffers: 4,
};

/// Lanes of a card, and of a program on the processor.
const LANES: u32 = 1 << 17;
const SOFTWARE_LANES: u32 = 1 << 12;

/// Walks the paths of a scene on a graphics adapter.
pub struct GpuEngine {
    session: Mutex<Session>,
    brightness: Brightness,
    memory_bytes: u64,
    film_width: u32,
    max_slots: u32,
}

impl GpuEngine {
    /// An engine for a scene of voxels on the best adapter of this computer; `division`
    /// makes no difference to the result.
    ///
    /// # Errors
    /// There is no adapter, or it cannot hold the scene.
    pub fn for_voxels(
        scene: &Arc<FlatScene>,
        division: Option<Division>,
    ) -> Result<GpuEngine, Refusal> {
        if scene.medium.blocks.is_some() {
            return Err(Refusal::Blocks("gpu"));
        }
        let mut placed = scene.lights.iter().filter_map(|l| l.placed.as_ref());
        if placed.any(|light| light.panel.is_none()) {
            return Err(Refusal::NotYet(
                "spots, discs and very near rectangles beside voxels",
            ));
        }
        let program = || voxel_scene::program_scene(scene);
        GpuEngine::new(program, scene.memory_bytes(), division)
    }

    /// The same for a scene of explicit fibres.
    ///
    /// # Errors
    /// There is no adapter, it cannot hold the scene, or the engine does not take it.
    pub fn for_fibres(
        scene: &Arc<FibreScene>,
        division: Option<Division>,
    ) -> Result<GpuEngine, Refusal> {
        let program = || fibre_scene::program_scene(scene);
        GpuEngine::new(program, scene.memory_bytes(), division)
    }

    /// The source of the program for a scene of voxels, on an adapter with common limits.
    ///
    /// # Errors
    /// The scene is too large for such an adapter.
    pub fn source_for_voxels(scene: &Arc<FlatScene>) -> Result<String, Refusal> {
        let scene = voxel_scene::program_scene(scene)?;
        let split = scene.tables.split(&COMMON_LIMITS)?;
        Ok(scene.source(&split, NumberBuffer::Uniform))
    }

    /// Fails as if the device were lost, from now on: for tests.
    pub fn lose(&self) {
        let session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        session.device.fail("lost on purpose");
    }

    fn new<'a>(
        scene: impl FnOnce() -> Result<ProgramScene<'a>, Refusal>,
        memory_bytes: u64,
        division: Option<Division>,
    ) -> Result<GpuEngine, Refusal> {
        let mut device = Device::open_best()?.ok_or(NO_ADAPTER)?;
        let division = division.unwrap_or(Division {
            lanes: if device.is_software {
                SOFTWARE_LANES
            } else {
                LANES
            },
            steps: None,
            table_bytes: None,
        });
        let mut limits = device.limits;
        if let Some(bytes) = division.table_bytes {
            limits.binding_bytes = limits.binding_bytes.min(bytes);
        }
        let scene = scene()?;
        let split = scene.tables.split(&limits)?;
        let max_slots = Session::max_slots(&device);
        device.limits = limits;
        let session = Session::new(device, &scene, &split, &division);
        Ok(GpuEngine {
            session: Mutex::new(session.map_err(|_| Refusal::Unopened)?),
            brightness: scene.brightness,
            memory_bytes,
            film_width: scene.film_width,
            max_slots,
        })
    }

    /// Takes some samples of every pixel of a block, few enough for the slots: slots of a
    /// pixel, and what was found.
    fn take_some(
        &self,
        session: &mut Session,
        block: &Block<'_>,
        samples: [u32; 2],
    ) -> Result<(u32, PassResult), Lost> {
        let pixels = block.pixels.len() as u32;
        let slots_per_pixel = session
            .slots_per_pixel(pixels, samples[1] - samples[0])
            .min((self.max_slots / pixels.max(1)).max(1));
        let found = session.take(PassNumbers {
            slots: pixels * slots_per_pixel,
            slots_per_pixel,
            pixels,
            left: block.min.x,
            top: block.min.y,
            width: block.width,
            rows: pixels / block.width,
            samples,
            ..PassNumbers::default()
        })?;
        Ok((slots_per_pixel, found))
    }

    /// Adds what was found to the pixels of a block.
    fn add(&self, block: &mut Block<'_>, slots_per_pixel: u32, found: &PassResult) {
        let (pixels, width) = (block.pixels.len(), block.width as usize);
        let rows = pixels / width;
        let lines = block.pixels.par_chunks_mut(width).enumerate();
        lines.for_each(|(y, line)| {
            for (x, pixel) in line.iter_mut().enumerate() {
                let turn = Block::turn(x, y, width, rows);
                for part in 0..slots_per_pixel as usize {
                    let slot = SLOT_WORDS * (part * pixels + turn);
                    let mut own = tally(&found.slots[slot..][..SLOT_WORDS]);
                    own.flush(&self.brightness, pixel);
                }
            }
        });
        for words in found.bright.chunks_exact(BRIGHT_WORDS) {
            let (slot, sample) = bright_sample(words);
            if let Some((pixel, ..)) = block.pixel(slot as usize % pixels) {
                add_bright(&sample, &self.brightness, &mut block.pixels[pixel]);
            }
        }
    }
}

fn stats(found: &PassResult) -> Stats {
    let [
        paths,
        tentative,
        collisions,
        shadow_rays,
        shadow_steps,
        cut,
        rejected,
        majorant_violations,
    ] = found.counts;
    Stats {
        paths,
        tentative,
        collisions,
        shadow_rays,
        shadow_steps,
        cut,
        rejected,
        majorant_violations,
        brightest: found.brightest,
        ..Stats::default()
    }
}

/// Why there is no engine on a computer without adapters.
pub const NO_ADAPTER: Refusal = Refusal::Unavailable {
    engine: NAME,
    needs: NEEDS,
};

/// The name of the engine.
pub const NAME: &str = "gpu";
/// What it needs.
pub const NEEDS: &str = "a graphics adapter with Vulkan, Metal or Direct3D 12";

impl Engine for GpuEngine {
    fn name(&self) -> &'static str {
        NAME
    }

    fn memory_bytes(&self) -> u64 {
        self.memory_bytes
    }

    /// As many rows as there are slots for.
    fn rows_per_block(&self, _rows: u32, _threads: u32) -> u32 {
        (self.max_slots / self.film_width.max(1)).max(1)
    }

    /// Sums come back from the adapter once a pass, and the last paths of a pass leave most
    /// lanes idle.
    fn pass_time(&self) -> Duration {
        Duration::from_secs(3)
    }

    fn take(&self, block: &mut Block<'_>) -> Result<Stats, Lost> {
        let mut session = self.session.lock().unwrap_or_else(PoisonError::into_inner);
        let mut all = Vec::new();
        let mut first = block.samples.start;
        while first < block.samples.end {
            let most = first.saturating_add(SAMPLES_PER_SLOT);
            let end = block.samples.end.min(most);
            all.push(self.take_some(&mut session, block, [first, end])?);
            first = end;
        }
        // Only now: what a lost device leaves behind is no part of a film.
        let mut sum = Stats::default();
        for (slots_per_pixel, found) in &all {
            self.add(block, *slots_per_pixel, found);
            sum.merge(&stats(found));
        }
        Ok(sum)
    }
}
