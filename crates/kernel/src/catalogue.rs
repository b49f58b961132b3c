//! The engines that there are.

use crate::cpu;
use crate::engine::EngineRecord;

/// All engines, slowest first.
pub const ENGINES: &[EngineRecord] = &[cpu::SCALAR, cpu::AVX2, cpu::AVX512];

/// The engine that renders without a choice: the last one that this computer has.
pub fn default_engine() -> &'static EngineRecord {
    let mut available = ENGINES.iter().rev().filter(|e| (e.is_available)());
    available.next().unwrap_or(&ENGINES[0])
}

/// The engine with that name on the command line.
pub fn engine_named(name: &str) -> Option<&'static EngineRecord> {
    ENGINES.iter().find(|e| e.name == name)
}
