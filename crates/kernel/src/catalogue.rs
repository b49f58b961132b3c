//! The engines that there are.

use crate::cpu;
use crate::devices::DeviceSummary;
use crate::engine::EngineRecord;
#[cfg(feature = "gpu")]
use crate::gpu;
#[cfg(not(feature = "gpu"))]
use crate::gpu_absent as gpu;

/// All engines, slowest first: without a choice, the last one that may be chosen
/// ([`EngineRecord::is_automatic`]) and that takes the scene renders it.
pub const ENGINES: &[EngineRecord] = &[cpu::SCALAR, cpu::AVX2, cpu::AVX512, gpu::GPU];

/// Those for processors, slowest first. All of them give the same bits.
pub const CPU_ENGINES: &[EngineRecord] = &[cpu::SCALAR, cpu::AVX2, cpu::AVX512];

/// The engine with that name on the command line.
pub fn engine_named(name: &str) -> Option<&'static EngineRecord> {
    ENGINES.iter().find(|e| e.name == name)
}

/// The adapters of this computer, the one that the engine `gpu` uses first; `None` in a
/// program that was built without the feature `gpu`.
pub fn devices() -> Option<Vec<DeviceSummary>> {
    gpu::devices()
}
