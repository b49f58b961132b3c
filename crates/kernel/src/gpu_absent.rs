//! The engine for graphics adapters in a program that was built without it: a name, so that
//! messages can say what is missing, and pictures of other programs are understood.

use crate::devices::DeviceSummary;
use crate::engine::EngineRecord;
use crate::refusal::Refusal;

const NAME: &str = "gpu";
const NEEDS: &str = "a program built with the feature gpu (cargo build --features gpu)";
const ABSENT: Refusal = Refusal::Unavailable {
    engine: NAME,
    needs: NEEDS,
};

/// Not there.
pub const GPU: EngineRecord = EngineRecord {
    name: NAME,
    summary: "The kernel on a graphics adapter; not part of this program",
    needs: NEEDS,
    is_available: || false,
    is_automatic: || false,
    for_voxels: |_| Err(ABSENT),
    for_fibres: |_| Err(ABSENT),
};

/// Nothing is known of adapters.
pub fn devices() -> Option<Vec<DeviceSummary>> {
    None
}
