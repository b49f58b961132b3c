//! Passes: all samples of a block, in short dispatches.

use super::device::Device;
use super::program::{
    BRIGHT, CONTROL, LANES, PASS_NUMBERS, PassNumbers, Program, ProgramScene, SCENE_NUMBERS, SUMS,
    TABLES,
};
use super::slots::{SLOT_BYTES, SLOT_WORDS};
use super::tables::Split;
use crate::engine::Lost;
use std::sync::mpsc;
use std::time::{Duration, Instant};
use wgpu::{
    BindGroup, BindGroupDescriptor, BindGroupEntry, Buffer, BufferDescriptor, BufferUsages,
};

/// How long a dispatch should take: watchdogs of systems end those of two seconds.
const DISPATCH: Duration = Duration::from_millis(40);
/// Steps of the first dispatch, and the most and least of any.
const FIRST_STEPS: u32 = 16;
const STEPS: [u32; 2] = [1, 4096];
/// Lanes of a workgroup, as in `lanes.wgsl`.
const GROUP: u32 = 64;
/// Words of the control buffer.
const CONTROL_WORDS: usize = 4 + 2 * COUNTS;
/// Counts of work in it.
pub const COUNTS: usize = 8;
/// Words of a bright sample, and how many of them the list holds.
pub const BRIGHT_WORDS: usize = 12;
const BRIGHT_ROOM: u32 = 4096;
/// Bytes that are copied to or from the device at once.
const CHUNK_BYTES: u64 = 64 << 20;

/// What a pass found.
pub struct PassResult {
    /// Words of all slots.
    pub slots: Vec<u32>,
    /// Samples too bright for them, [`BRIGHT_WORDS`] each.
    pub bright: Vec<u32>,
    /// Counts of work: paths, tentative collisions, collisions, shadow rays, their steps,
    /// cut paths, rejected samples, majorant violations.
    pub counts: [u64; COUNTS],
    /// The brightest sample.
    pub brightest: f32,
}

fn no_sums() -> Lost {
    Lost("there is no room for sums".into())
}

/// Buffers and program of a scene on a device.
pub struct Session {
    pub device: Device,
    program: Program,
    lanes: u32,
    /// Steps of every dispatch; `None` adapts them to the time that they take.
    fixed_steps: Option<u32>,
    steps: u32,
    scene_numbers: Buffer,
    tables: Vec<Buffer>,
    lane_states: Buffer,
    control: Buffer,
    bright: Buffer,
    control_copy: Buffer,
    bright_copy: Buffer,
    pass_numbers: Buffer,
    sums: Option<Sums>,
}

/// Sums of slots, and a buffer through which they come back.
struct Sums {
    buffer: Buffer,
    copy: Buffer,
    slots: u32,
    bind_group: BindGroup,
}

/// How a session divides its work; the result does not depend on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Division {
    /// Paths that are walked at once.
    pub lanes: u32,
    /// Steps of every dispatch; `None` adapts them to the time that they take.
    pub steps: Option<u32>,
    /// The longest buffer of a table, bytes; `None` is the adapter's limit.
    pub table_bytes: Option<u64>,
}

impl Session {
    /// Sends a scene, whose tables are split so, to a device.
    ///
    /// # Errors
    /// The device does not take it.
    pub fn new(
        device: Device,
        scene: &ProgramScene<'_>,
        split: &Split,
        division: &Division,
    ) -> Result<Session, Lost> {
        let lanes = division.lanes.div_ceil(GROUP) * GROUP;
        let counts = split.buffers();
        let source = scene.source(split, device.scene_numbers());
        let program = Program::new(&device, source, counts.len() as u32)?;
        let buffer = |bytes: u64, usage: BufferUsages| {
            device.device.create_buffer(&BufferDescriptor {
                label: Some("organza"),
                size: bytes.max(16),
                usage,
                mapped_at_creation: false,
            })
        };
        let written = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let uniform = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let read = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        let control_bytes = 4 * CONTROL_WORDS as u64;
        let bright_bytes = 4 * BRIGHT_WORDS as u64 * u64::from(BRIGHT_ROOM);
        let numbers = scene.numbers.words();
        let session = Session {
            scene_numbers: buffer(4 * numbers.len() as u64, uniform | written),
            pass_numbers: buffer(
                4 * PassNumbers::default().numbers().words().len() as u64,
                uniform,
            ),
            tables: counts.iter().map(|n| buffer(4 * n, written)).collect(),
            lane_states: buffer(4 * u64::from(lanes) * u64::from(scene.lane_words), written),
            control: buffer(control_bytes, written | BufferUsages::COPY_SRC),
            bright: buffer(bright_bytes, written | BufferUsages::COPY_SRC),
            control_copy: buffer(control_bytes, read),
            bright_copy: buffer(bright_bytes, read),
            program,
            lanes,
            fixed_steps: division.steps,
            steps: division.steps.unwrap_or(FIRST_STEPS),
            sums: None,
            device,
        };
        session.upload(scene, split)?;
        Ok(session)
    }

    /// Writes numbers and tables, so much at a time that the copies on the way stay small.
    fn upload(&self, scene: &ProgramScene<'_>, split: &Split) -> Result<(), Lost> {
        let queue = &self.device.queue;
        let numbers = bytemuck::cast_slice(scene.numbers.words());
        queue.write_buffer(&self.scene_numbers, 0, numbers);
        let (mut outcome, mut on_the_way) = (Ok(()), 0);
        scene.tables.for_each_piece(split, |buffer, first, words| {
            for (i, chunk) in words.chunks((CHUNK_BYTES / 4) as usize).enumerate() {
                if outcome.is_err() {
                    return;
                }
                let at = 4 * first + CHUNK_BYTES * i as u64;
                queue.write_buffer(&self.tables[buffer], at, bytemuck::cast_slice(chunk));
                on_the_way += 4 * chunk.len() as u64;
                if on_the_way >= CHUNK_BYTES {
                    queue.submit([]);
                    outcome = self.device.wait();
                    on_the_way = 0;
                }
            }
        });
        outcome?;
        queue.submit([]);
        self.device.wait()
    }

    /// Slots that a pass may have.
    pub fn max_slots(device: &Device) -> u32 {
        // Sums of a million slots, 128 MiB, keep any card busy.
        (device.limits.binding_bytes / SLOT_BYTES).min(1 << 20) as u32
    }

    /// Slots of a pixel that keep all lanes busy.
    pub fn slots_per_pixel(&self, pixels: u32, samples: u32) -> u32 {
        let wanted = (4 * self.lanes).div_ceil(pixels.max(1));
        wanted.clamp(1, samples.max(1))
    }

    /// Takes all samples of a pass; `numbers` says which, but for lanes and steps.
    ///
    /// # Errors
    /// The device was lost.
    pub fn take(&mut self, mut numbers: PassNumbers) -> Result<PassResult, Lost> {
        self.make_sums(numbers.slots);
        numbers.bright_room = BRIGHT_ROOM;
        numbers.lanes = self.lanes.min(numbers.slots.div_ceil(GROUP) * GROUP);
        let Some(sums) = &self.sums else {
            return Err(no_sums());
        };
        let device = &self.device.device;
        let mut encoder = device.create_command_encoder(&Default::default());
        encoder.clear_buffer(&self.lane_states, 0, None);
        encoder.clear_buffer(&self.control, 0, None);
        let sums_bytes = SLOT_BYTES * u64::from(numbers.slots);
        encoder.clear_buffer(&sums.buffer, 0, Some(sums_bytes));
        self.device.queue.submit([encoder.finish()]);
        let mut bright = Vec::new();
        loop {
            numbers.steps = self.steps;
            let began = Instant::now();
            let control = self.dispatch(&numbers)?;
            let steps = self.steps_after(began.elapsed());
            let more = control[2].min(BRIGHT_ROOM) as usize;
            if more > 0 {
                let bytes = 4 * (BRIGHT_WORDS * more) as u64;
                self.read(&self.bright, &self.bright_copy, 0, bytes, &mut bright)?;
            }
            if control[1] > 0 {
                self.steps = steps;
                continue;
            }
            let Some(sums) = &self.sums else {
                return Err(no_sums());
            };
            let count = |k: usize| {
                let [low, high] = [control[4 + 2 * k], control[5 + 2 * k]];
                u64::from(low) | u64::from(high) << 32
            };
            let mut slots = Vec::with_capacity(SLOT_WORDS * numbers.slots as usize);
            let mut at = 0;
            while at < sums_bytes {
                let bytes = (sums_bytes - at).min(CHUNK_BYTES);
                self.read(&sums.buffer, &sums.copy, at, bytes, &mut slots)?;
                at += bytes;
            }
            return Ok(PassResult {
                slots,
                bright,
                counts: std::array::from_fn(count),
                brightest: f32::from_bits(control[3]),
            });
        }
    }

    /// One dispatch; gives the control words after it.
    fn dispatch(&self, numbers: &PassNumbers) -> Result<Vec<u32>, Lost> {
        let Some(sums) = &self.sums else {
            return Err(no_sums());
        };
        let (device, queue) = (&self.device.device, &self.device.queue);
        let words = numbers.numbers();
        queue.write_buffer(&self.pass_numbers, 0, bytemuck::cast_slice(words.words()));
        // Lanes at work, and bright samples, are counted anew.
        queue.write_buffer(&self.control, 4, &[0; 8]);
        let mut encoder = device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.program.pipeline);
            pass.set_bind_group(0, &sums.bind_group, &[]);
            pass.dispatch_workgroups(numbers.lanes / GROUP, 1, 1);
        }
        queue.submit([encoder.finish()]);
        let mut control = Vec::with_capacity(CONTROL_WORDS);
        let bytes = 4 * CONTROL_WORDS as u64;
        self.read(&self.control, &self.control_copy, 0, bytes, &mut control)?;
        Ok(control)
    }

    /// Steps of the next dispatch, by the time that the last one took.
    fn steps_after(&self, took: Duration) -> u32 {
        if let Some(steps) = self.fixed_steps {
            return steps;
        }
        let share = DISPATCH.as_secs_f64() / took.as_secs_f64().max(1e-6);
        let steps = f64::from(self.steps) * share.clamp(0.25, 2.0);
        (steps as u32).clamp(STEPS[0], STEPS[1])
    }

    /// Appends a part of a buffer, by way of one that can be mapped.
    fn read(
        &self,
        from: &Buffer,
        by: &Buffer,
        at: u64,
        bytes: u64,
        out: &mut Vec<u32>,
    ) -> Result<(), Lost> {
        let device = &self.device.device;
        let mut encoder = device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(from, at, by, 0, bytes);
        self.device.queue.submit([encoder.finish()]);
        let (send, receive) = mpsc::channel();
        by.map_async(wgpu::MapMode::Read, 0..bytes, move |mapped| {
            // Nobody waits any more once the device is given up.
            let _ = send.send(mapped);
        });
        self.device.wait()?;
        let lost = |e: &dyn std::fmt::Display| Lost(e.to_string());
        let mapped = receive.try_recv().map_err(|e| lost(&e))?;
        mapped.map_err(|e| lost(&e))?;
        {
            let view = by.get_mapped_range(0..bytes).map_err(|e| lost(&e))?;
            out.extend(bytemuck::pod_collect_to_vec::<u8, u32>(&view));
        }
        by.unmap();
        Ok(())
    }

    /// Makes room for the sums of so many slots.
    fn make_sums(&mut self, slots: u32) {
        if self.sums.as_ref().is_some_and(|sums| sums.slots >= slots) {
            return;
        }
        // The former ones go first.
        self.sums = None;
        let device = &self.device.device;
        let bytes = SLOT_BYTES * u64::from(slots);
        let buffer = |size: u64, usage: BufferUsages| {
            device.create_buffer(&BufferDescriptor {
                label: Some("organza sums"),
                size,
                usage,
                mapped_at_creation: false,
            })
        };
        let sums = buffer(
            bytes,
            BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
        );
        let copy = buffer(
            bytes.min(CHUNK_BYTES),
            BufferUsages::MAP_READ | BufferUsages::COPY_DST,
        );
        let mut bound = vec![
            (SCENE_NUMBERS, &self.scene_numbers),
            (PASS_NUMBERS, &self.pass_numbers),
            (LANES, &self.lane_states),
            (SUMS, &sums),
            (CONTROL, &self.control),
            (BRIGHT, &self.bright),
        ];
        bound.extend((TABLES..).zip(&self.tables));
        let entries: Vec<BindGroupEntry<'_>> = bound
            .into_iter()
            .map(|(binding, buffer)| BindGroupEntry {
                binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        let bind_group = device.create_bind_group(&BindGroupDescriptor {
            label: Some("organza"),
            layout: &self.program.layout,
            entries: &entries,
        });
        self.sums = Some(Sums {
            buffer: sums,
            copy,
            slots,
            bind_group,
        });
    }
}
