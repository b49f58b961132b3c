//! Results as CSV.

use crate::{Albedo, Angles, LampAxis, Measured, Pair, PairValue, SweepValue};
use std::io::{Result, Write};

/// Writes pairs with value and standard error per channel, 1/sr.
///
/// # Errors
/// Those of the writer.
pub fn write_pairs(list: &[PairValue], out: &mut (impl Write + ?Sized)) -> Result<()> {
    writeln!(out, "theta_i,phi_i,theta_o,phi_o,r,g,b,se_r,se_g,se_b")?;
    for PairValue {
        pair: Pair { incident, exitant },
        bsdf,
        ..
    } in list
    {
        write_angles(incident, out)?;
        write!(out, ",")?;
        write_angles(exitant, out)?;
        write_measured(bsdf, out)?;
        writeln!(out)?;
    }
    Ok(())
}

/// Writes incident directions with reflectance, scattered transmittance, direct
/// transmittance and absorptance: value and standard error per channel each.
///
/// # Errors
/// Those of the writer.
pub fn write_albedos(list: &[Albedo], out: &mut (impl Write + ?Sized)) -> Result<()> {
    write!(out, "theta_i,phi_i")?;
    for part in ["reflected", "transmitted", "direct", "absorbed"] {
        for prefix in ["", "se_"] {
            for channel in ["r", "g", "b"] {
                write!(out, ",{prefix}{part}_{channel}")?;
            }
        }
    }
    writeln!(out)?;
    for a in list {
        write_angles(&a.incident, out)?;
        for part in [&a.reflected, &a.transmitted, &a.direct, &a.absorbed] {
            write_measured(part, out)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Writes mean intensities under a swung linear light.
///
/// # Errors
/// Those of the writer.
pub fn write_sweep(list: &[SweepValue], out: &mut (impl Write + ?Sized)) -> Result<()> {
    writeln!(out, "axis,angle,r,g,b,se_r,se_g,se_b")?;
    for SweepValue { lamp, intensity } in list {
        let axis = match lamp.axis {
            LampAxis::Weft => "weft",
            LampAxis::Warp => "warp",
        };
        write!(out, "{axis},{}", lamp.angle_deg)?;
        write_measured(intensity, out)?;
        writeln!(out)?;
    }
    Ok(())
}

fn write_angles(a: &Angles, out: &mut (impl Write + ?Sized)) -> Result<()> {
    write!(out, "{},{}", a.theta_deg, a.phi_deg)
}

fn write_measured(m: &Measured, out: &mut (impl Write + ?Sized)) -> Result<()> {
    for x in m.mean.iter().chain(&m.se) {
        write!(out, ",{x}")?;
    }
    Ok(())
}
