//! Which `[nonwoven]` tables make sense.

use crate::Error;
use crate::cloth::build::check_colours;
use crate::cloth::ranges::check_ranges;
use crate::spec::{CurveKind, DraftSpec, FabricGeometry, NonwovenSpec, ThreadSetSpec};

/// Refuses values out of range, and tables that belong to threads.
pub(in crate::cloth) fn check(fabric: &FabricGeometry, spec: &NonwovenSpec) -> Result<(), Error> {
    check_colours("nonwoven", &spec.colours)?;
    for (key, is_given) in [
        ("draft", !is_empty(&fabric.draft)),
        ("warp", fabric.warp != ThreadSetSpec::default()),
        ("weft", fabric.weft != ThreadSetSpec::default()),
        ("pile", fabric.pile.is_some()),
    ] {
        if is_given {
            let message = "a nonwoven has no threads; expected either [nonwoven] or threads";
            return Err(Error::spec(key, message));
        }
    }
    if fabric.tile.repeats != [1, 1] {
        let message = "nonwoven.tile_mm gives the size of the tile";
        return Err(Error::spec("tile.repeats", message));
    }
    check_ranges(
        "nonwoven",
        &[
            (
                "areal_density_g_per_m2",
                Some(spec.areal_density_g_per_m2),
                [1.0, 5000.0],
                "g/m2",
            ),
            ("thickness_mm", Some(spec.thickness_mm), [0.02, 30.0], "mm"),
            ("length_mm", Some(spec.length_mm), [0.5, 1000.0], "mm"),
            ("anisotropy", spec.anisotropy, [0.05, 20.0], ""),
            (
                "out_of_plane_deg",
                spec.out_of_plane_deg,
                [0.0, 45.0],
                "degrees",
            ),
            ("curl_mm", spec.curl_mm, [0.3, 1000.0], "mm"),
            ("crimp_percent", spec.crimp_percent, [0.0, 60.0], "%"),
            ("crimps_per_cm", spec.crimps_per_cm, [0.5, 30.0], "per cm"),
            ("tile_mm[0]", Some(spec.tile_mm[0]), [0.5, 200.0], "mm"),
            ("tile_mm[1]", Some(spec.tile_mm[1]), [0.5, 200.0], "mm"),
        ],
    )?;
    if let Some(needling) = &spec.needling {
        let fibres = needling.fibres_per_punch.map(f64::from);
        check_ranges(
            "nonwoven.needling",
            &[
                (
                    "punches_per_cm2",
                    Some(needling.punches_per_cm2),
                    [1.0, 2000.0],
                    "per cm2",
                ),
                ("fibres_per_punch", fibres, [1.0, 200.0], ""),
                ("tuft_mm", needling.tuft_mm, [0.05, 2.0], "mm"),
                ("depth_mm", needling.depth_mm, [0.0, 10.0], "mm"),
            ],
        )?;
    }
    if let Some(bonding) = &spec.bonding {
        check_ranges(
            "nonwoven.bonding",
            &[
                (
                    "points_per_cm2",
                    Some(bonding.points_per_cm2),
                    [1.0, 400.0],
                    "per cm2",
                ),
                ("area_percent", Some(bonding.area_percent), [0.5, 50.0], "%"),
                (
                    "thickness_mm",
                    Some(bonding.thickness_mm),
                    [0.005, spec.thickness_mm],
                    "mm",
                ),
            ],
        )?;
    }
    if spec.crimps_per_cm.is_some() && spec.crimp_percent.is_none() {
        let message = "has no effect without nonwoven.crimp_percent";
        return Err(Error::spec("nonwoven.crimps_per_cm", message));
    }
    Ok(())
}

fn is_empty(d: &DraftSpec) -> bool {
    let named = [&d.weave, &d.wif, &d.knit, &d.openwork, &d.curves];
    named.iter().all(|n| n.is_none())
        && d.drawdown.is_none()
        && d.wales_per_cm.is_none()
        && d.curve_unit_mm.is_none()
        && d.curve_tile_mm.is_none()
        && d.curves_are == CurveKind::default()
        && !d.curves_collide
}
