//! An opened adapter: its device, its limits, and what became of it.

use super::adapters::{adapters, kind};
use super::numbers::NumberBuffer;
use crate::devices::DeviceKind;
use crate::engine::Lost;
use crate::refusal::Refusal;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use wgpu::{Adapter, DeviceDescriptor, PollType};

/// Storage buffers beside those of the tables: lanes, sums, control words, bright samples; and
/// buffers of numbers, of which that of the scene may be [`NumberBuffer::Storage`].
const OWN_BUFFERS: u32 = 4;
const NUMBER_BUFFERS: u32 = 2;
/// Most buffers for tables: more than any scene needs, and few enough to tell apart quickly.
const MAX_TABLE_BUFFERS: u32 = 28;
/// Words of a table's buffer are a multiple of this.
const BUFFER_STEP: u64 = 64;
/// A dispatch takes a fraction of a second; a device that is silent for so long is lost.
const PATIENCE: Duration = Duration::from_secs(60);

/// What a scene's buffers have to keep to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// The longest buffer that a shader can bind, bytes.
    pub binding_bytes: u64,
    /// How many of them there may be for tables.
    pub table_buffers: u32,
}

impl Limits {
    /// Words of a buffer of tables.
    pub fn words_per_buffer(&self) -> u64 {
        (self.binding_bytes / 4 / BUFFER_STEP * BUFFER_STEP).max(BUFFER_STEP)
    }
}

/// A device that can be sent work.
pub struct Device {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub limits: Limits,
    pub is_software: bool,
    /// The first error that nothing else caught.
    failure: Arc<Mutex<Option<String>>>,
}

impl Device {
    /// Opens the best adapter of this computer; `None` where there is none.
    ///
    /// # Errors
    /// [`Refusal::Unopened`].
    pub fn open_best() -> Result<Option<Device>, Refusal> {
        adapters().first().map(Device::open).transpose()
    }

    /// Opens an adapter. Its limits on buffers are asked for, and nothing else beyond what
    /// every adapter has.
    ///
    /// # Errors
    /// [`Refusal::Unopened`].
    pub fn open(adapter: &Adapter) -> Result<Device, Refusal> {
        let has = adapter.limits();
        let most = has.max_buffer_size.min(u64::from(u32::MAX));
        let binding_bytes = has.max_storage_buffer_binding_size.min(most);
        let is_software = kind(adapter) == DeviceKind::Software;
        let own = OWN_BUFFERS + u32::from(is_software);
        let most = has.max_buffers_and_acceleration_structures_per_shader_stage;
        let table_buffers = has
            .max_storage_buffers_per_shader_stage
            .saturating_sub(own)
            .min(most.saturating_sub(OWN_BUFFERS + NUMBER_BUFFERS))
            .min(MAX_TABLE_BUFFERS);
        if table_buffers == 0 {
            return Err(Refusal::Unopened);
        }
        let wanted = wgpu::Limits {
            max_storage_buffers_per_shader_stage: own + table_buffers,
            max_buffers_and_acceleration_structures_per_shader_stage: most,
            max_storage_buffer_binding_size: has.max_storage_buffer_binding_size,
            max_buffer_size: has.max_buffer_size,
            ..wgpu::Limits::downlevel_defaults()
        };
        let descriptor = DeviceDescriptor {
            label: Some("organza"),
            required_limits: wanted.or_worse_values_from(&has),
            ..DeviceDescriptor::default()
        };
        let opened = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|_| Refusal::Unopened)?;
        let failure = Arc::new(Mutex::new(None));
        let note = |failure: &Arc<Mutex<Option<String>>>| {
            let failure = Arc::clone(failure);
            move |what: String| {
                let mut first = failure.lock().unwrap_or_else(PoisonError::into_inner);
                first.get_or_insert(what);
            }
        };
        let (of_error, of_loss) = (note(&failure), note(&failure));
        device.on_uncaptured_error(Arc::new(move |e: wgpu::Error| of_error(e.to_string())));
        device.set_device_lost_callback(move |reason, message| {
            // Dropping a device is no loss.
            if reason != wgpu::DeviceLostReason::Destroyed {
                of_loss(message);
            }
        });
        Ok(Device {
            device,
            queue,
            limits: Limits {
                binding_bytes,
                table_buffers,
            },
            is_software,
            failure,
        })
    }

    /// The kind of buffer that holds the numbers of a scene.
    pub fn scene_numbers(&self) -> NumberBuffer {
        match self.is_software {
            true => NumberBuffer::Storage,
            false => NumberBuffer::Uniform,
        }
    }

    /// Waits until all that was sent is done.
    ///
    /// # Errors
    /// The device was lost, or something that was sent failed.
    pub fn wait(&self) -> Result<(), Lost> {
        let wait = PollType::Wait {
            submission_index: None,
            timeout: Some(PATIENCE),
        };
        let polled = self.device.poll(wait);
        self.check()?;
        polled.map(|_| ()).map_err(|e| Lost(e.to_string()))
    }

    /// Whether everything went well so far.
    ///
    /// # Errors
    /// What went wrong first.
    pub fn check(&self) -> Result<(), Lost> {
        let failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        match &*failure {
            Some(what) => Err(Lost(what.clone())),
            None => Ok(()),
        }
    }

    /// Notes a failure, as if the device had been lost: for tests.
    pub fn fail(&self, what: &str) {
        let mut failure = self.failure.lock().unwrap_or_else(PoisonError::into_inner);
        failure.get_or_insert(what.into());
    }
}
