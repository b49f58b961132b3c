//! The engines that there are.

use crate::cpu;
use crate::engine::EngineRecord;

/// All engines, slowest first: without a choice, the last one that this computer has and
/// that takes the scene renders it.
pub const ENGINES: &[EngineRecord] = &[cpu::SCALAR, cpu::AVX2, cpu::AVX512];

/// The engine with that name on the command line.
pub fn engine_named(name: &str) -> Option<&'static EngineRecord> {
    ENGINES.iter().find(|e| e.name == name)
}
