//! Groups of flags that belong to one kind of fit, and the refusal of those of other kinds.

use super::FitArgs;
use crate::error::of_option;
use anyhow::Result;

/// Flags that describe a picture, and whether they are given.
pub fn picture_flags(args: &FitArgs) -> [(&'static str, bool); 8] {
    [
        ("--light", args.light.is_some()),
        ("--view", args.view.is_some()),
        ("--width-mm", args.width_mm.is_some()),
        ("--white", args.white.is_some()),
        ("--region", args.region.is_some()),
        ("--region-of", !args.region_of.is_empty()),
        ("--noise", args.noise.is_some()),
        ("--blur-px", args.blur_px.is_some()),
    ]
}

/// Flags that only volumes have, and whether they are given.
pub fn volume_flags(args: &FitArgs) -> [(&'static str, bool); 5] {
    [
        ("--region", args.region.is_some()),
        ("--region-of", !args.region_of.is_empty()),
        ("--noise", args.noise.is_some()),
        ("--blur-px", args.blur_px.is_some()),
        ("--fit-density", args.fit_density),
    ]
}

/// Refuses the first of these flags that is given.
pub fn refuse_given(flags: &[(&str, bool)], why: &str) -> Result<()> {
    match flags.iter().find(|(_, is_given)| *is_given) {
        Some((flag, _)) => Err(of_option(flag, why)),
        None => Ok(()),
    }
}

/// Refuses flags that only volumes have.
pub fn refuse_volume_flags(args: &FitArgs) -> Result<()> {
    let why = "applies only to a scene with a volume, or to a volume file";
    refuse_given(&volume_flags(args), why)
}
