//! The graphics adapters of this computer.

use crate::devices::{DeviceKind, DeviceSummary};
use wgpu::{Adapter, Backends, DeviceType, Instance, InstanceDescriptor};

/// All adapters, the one that an engine would use first.
pub fn adapters() -> Vec<Adapter> {
    let instance = Instance::new(InstanceDescriptor::new_without_display_handle());
    let mut all = pollster::block_on(instance.enumerate_adapters(Backends::PRIMARY));
    all.sort_by_key(|adapter| std::cmp::Reverse(kind(adapter)));
    all
}

/// What kind of device an adapter is.
pub fn kind(adapter: &Adapter) -> DeviceKind {
    match adapter.get_info().device_type {
        DeviceType::DiscreteGpu => DeviceKind::Discrete,
        DeviceType::IntegratedGpu => DeviceKind::Integrated,
        DeviceType::VirtualGpu => DeviceKind::Virtual,
        DeviceType::Cpu => DeviceKind::Software,
        DeviceType::Other => DeviceKind::Other,
    }
}

/// What the adapters say of themselves.
pub fn devices() -> Option<Vec<DeviceSummary>> {
    let summary = |adapter: &Adapter| {
        let (info, limits) = (adapter.get_info(), adapter.limits());
        DeviceSummary {
            name: info.name,
            kind: kind(adapter),
            interface: info.backend.to_string(),
            driver: format!("{} {}", info.driver, info.driver_info)
                .trim()
                .into(),
            max_binding_bytes: limits
                .max_storage_buffer_binding_size
                .min(limits.max_buffer_size),
            max_buffers: limits.max_storage_buffers_per_shader_stage,
        }
    };
    Some(adapters().iter().map(summary).collect())
}
