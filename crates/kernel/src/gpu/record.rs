//! The engine in the table of engines.

use super::adapters;
use super::engine::{GpuEngine, NAME, NEEDS};
use crate::devices::DeviceKind;
use crate::engine::EngineRecord;
use std::sync::OnceLock;

/// A graphics adapter.
pub const GPU: EngineRecord = EngineRecord {
    name: NAME,
    summary: "The kernel on a graphics adapter",
    needs: NEEDS,
    is_available: || best().is_some(),
    is_automatic: || best().is_some_and(|kind| kind != DeviceKind::Software),
    for_voxels: |scene| Ok(Box::new(GpuEngine::for_voxels(&scene, None)?)),
    for_fibres: |scene| Ok(Box::new(GpuEngine::for_fibres(&scene, None)?)),
};

/// The kind of the best adapter of this computer, which does not change.
fn best() -> Option<DeviceKind> {
    static BEST: OnceLock<Option<DeviceKind>> = OnceLock::new();
    *BEST.get_or_init(|| adapters::adapters().first().map(adapters::kind))
}
