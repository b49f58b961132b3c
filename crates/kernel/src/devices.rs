//! Graphics adapters, as they describe themselves.

/// What kind of device an adapter is, the least preferred first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DeviceKind {
    /// A program on the processor, such as llvmpipe: for tests.
    Software,
    /// Not known.
    Other,
    /// Part of a graphics card that is shared between systems.
    Virtual,
    /// It shares the processor's memory.
    Integrated,
    /// A card with memory of its own.
    Discrete,
}

impl DeviceKind {
    /// In one word.
    pub fn name(self) -> &'static str {
        match self {
            DeviceKind::Software => "software",
            DeviceKind::Other => "unknown",
            DeviceKind::Virtual => "virtual",
            DeviceKind::Integrated => "integrated",
            DeviceKind::Discrete => "discrete",
        }
    }
}

/// A graphics adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceSummary {
    /// Its name.
    pub name: String,
    /// What kind of device it is.
    pub kind: DeviceKind,
    /// The interface that it is reached by, such as Vulkan.
    pub interface: String,
    /// Name and version of its driver.
    pub driver: String,
    /// The longest buffer that a shader can bind, bytes.
    pub max_binding_bytes: u64,
    /// How many buffers a shader can bind.
    pub max_buffers: u32,
}
