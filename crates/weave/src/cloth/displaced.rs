//! Threads beside their places: marks of the reed, and threads that wander sideways.

use crate::Error;
use crate::relax::System;
use crate::spec::{FabricGeometry, ThreadSetSpec, ThreadWanderSpec};
use crate::sway::{Lane, MAX_SHARE, Sway, reed, sways};

/// Families of random numbers of the sideways wandering.
const WARP_SWAY: u64 = 7 << 40;
const WEFT_SWAY: u64 = 8 << 40;

/// Moves the ends of each dent of the reed together.
pub(super) fn mark_by_reed(
    fabric: &FabricGeometry,
    warp: &mut System,
    width_mm: &[f64],
) -> Result<(), Error> {
    if fabric.weft.reed_dents.is_some() {
        let message = "only the warp passes through a reed; give warp.reed_dents";
        return Err(Error::spec("weft.reed_dents", message));
    }
    let Some(dents) = fabric.warp.reed_dents else {
        return Ok(());
    };
    if !(2..=64).contains(&dents.ends) {
        let message = format!("expected 2 to 64 ends, found {}", dents.ends);
        return Err(Error::spec("warp.reed_dents.ends", message));
    }
    if !(0.0..=100.0).contains(&dents.gap_percent) {
        let message = format!(
            "expected a number from 0 to 100, found {}",
            dents.gap_percent
        );
        return Err(Error::spec("warp.reed_dents.gap_percent", message));
    }
    let spacing_mm = warp.period_mm / warp.position_mm.len() as f64;
    let closer_mm = 0.01 * dents.gap_percent * spacing_mm / f64::from(dents.ends - 1);
    reed(
        &mut warp.position_mm,
        width_mm,
        dents.ends as usize,
        closer_mm,
    );
    Ok(())
}

/// The displacements of the ends and of the picks; empty where no thread wanders.
pub(super) fn thread_sways(
    fabric: &FabricGeometry,
    systems: [&System; 2],
    widths_mm: [Vec<f64>; 2],
    seed: u64,
) -> Result<[Vec<Sway>; 2], Error> {
    let [warp, weft] = systems;
    let wander = [
        thread_wander("warp", &fabric.warp, warp)?,
        thread_wander("weft", &fabric.weft, weft)?,
    ];
    if wander == [None, None] {
        return Ok([Vec::new(), Vec::new()]);
    }
    let lane = |system: &'_ System, width_mm, wander, family| Lane {
        position_mm: system.position_mm.clone(),
        period_mm: system.period_mm,
        width_mm,
        wander,
        family,
    };
    let [of_warp, of_weft] = widths_mm;
    let warp = lane(warp, of_warp, wander[0], WARP_SWAY);
    let weft = lane(weft, of_weft, wander[1], WEFT_SWAY);
    Ok(sways([&warp, &weft], seed))
}

/// The wandering of a system, checked.
fn thread_wander(
    name: &str,
    spec: &ThreadSetSpec,
    system: &System,
) -> Result<Option<ThreadWanderSpec>, Error> {
    let Some(wander) = spec.wander else {
        return Ok(None);
    };
    let spacing_um = 1e3 * system.period_mm / system.position_mm.len() as f64;
    let most_um = MAX_SHARE * spacing_um;
    for (key, value, from, to) in [
        ("amplitude_um", wander.amplitude_um, 0.0, most_um),
        ("length_mm", wander.length_mm, 0.01, 1e5),
    ] {
        if !(from..=to).contains(&value) {
            let message = format!("expected a number from {from} to {to:.4}, found {value}");
            return Err(Error::spec(format!("{name}.wander.{key}"), message));
        }
    }
    Ok(Some(wander).filter(|w| w.amplitude_um > 0.0))
}
