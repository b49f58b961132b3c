//! After how many threads everything repeats.

use crate::Error;
use crate::named::gcd;
use crate::spec::{FabricGeometry, ThreadSetSpec};

/// Copies of the smallest repeat along x and y.
pub(super) fn repeats(fabric: &FabricGeometry) -> Result<[usize; 2], Error> {
    if fabric.tile.repeats.contains(&0) {
        let found = fabric.tile.repeats;
        let message = format!("expected two whole numbers from 1, found {found:?}");
        return Err(Error::spec("tile.repeats", message));
    }
    Ok(fabric.tile.repeats.map(|r| r as usize))
}

/// Number of threads of a system after which draft, yarns and colours all repeat.
pub(super) fn threads(draft: usize, yarns: &[usize], spec: &ThreadSetSpec) -> usize {
    lcm(draft, lcm(yarns.len(), spec.colours.len().max(1)))
}

/// The least common multiple, or the largest number where that is larger.
pub(super) fn lcm(a: usize, b: usize) -> usize {
    (a / gcd(a, b)).saturating_mul(b)
}
