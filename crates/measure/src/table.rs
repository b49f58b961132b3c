//! Results as CSV.

use crate::{Albedo, Angles, LampAxis, Measured, PairValue, SweepValue};
use std::io::{Result, Write};

/// Writes pairs with value and standard error per channel, 1/sr.
///
/// # Errors
/// Those of the writer.
pub fn write_pairs(list: &[PairValue], out: &mut (impl Write + ?Sized)) -> Result<()> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record([
        "theta_i", "phi_i", "theta_o", "phi_o", "r", "g", "b", "se_r", "se_g", "se_b",
    ])?;
    for PairValue { pair, bsdf, .. } in list {
        let directions = angles(&pair.incident).chain(angles(&pair.exitant));
        table.write_record(directions.chain(numbers(bsdf)))?;
    }
    table.flush()
}

/// Writes incident directions with reflectance, scattered transmittance, direct
/// transmittance and absorptance: value and standard error per channel each.
///
/// # Errors
/// Those of the writer.
pub fn write_albedos(list: &[Albedo], out: &mut (impl Write + ?Sized)) -> Result<()> {
    let mut table = csv::Writer::from_writer(out);
    let mut header = vec!["theta_i".to_owned(), "phi_i".to_owned()];
    for part in ["reflected", "transmitted", "direct", "absorbed"] {
        for prefix in ["", "se_"] {
            header.extend(["r", "g", "b"].map(|channel| format!("{prefix}{part}_{channel}")));
        }
    }
    table.write_record(header)?;
    for a in list {
        let parts = [&a.reflected, &a.transmitted, &a.direct, &a.absorbed];
        let values = parts.into_iter().flat_map(numbers);
        table.write_record(angles(&a.incident).chain(values))?;
    }
    table.flush()
}

/// Writes mean intensities under a moving linear light.
///
/// # Errors
/// Those of the writer.
pub fn write_sweep(list: &[SweepValue], out: &mut (impl Write + ?Sized)) -> Result<()> {
    let mut table = csv::Writer::from_writer(out);
    table.write_record(["axis", "angle", "r", "g", "b", "se_r", "se_g", "se_b"])?;
    for SweepValue { lamp, intensity } in list {
        let axis = match lamp.axis {
            LampAxis::Weft => "weft",
            LampAxis::Warp => "warp",
        };
        let place = [axis.to_owned(), lamp.angle_deg.to_string()];
        table.write_record(place.into_iter().chain(numbers(intensity)))?;
    }
    table.flush()
}

fn angles(a: &Angles) -> impl Iterator<Item = String> {
    [a.theta_deg, a.phi_deg].map(|x| x.to_string()).into_iter()
}

fn numbers(m: &Measured) -> impl Iterator<Item = String> {
    m.mean.iter().chain(&m.se).map(f64::to_string)
}
