//! The flags of a fit to photographs that no other fit has.

use crate::flags::values::{parse_crop, parse_positive, parse_share};
use clap::Args;
use organza_photograph::Vignetting;
use organza_transport::Crop;
use std::path::PathBuf;

/// How photographs of a cloth were taken, and what is known of the cloth.
#[derive(Debug, Default, Args)]
pub struct PhotographArgs {
    /// Cloths: the weave, by name or as a .wif file [default: recognised]
    #[arg(long, value_name = "NAME|FILE")]
    pub draft: Option<String>,
    /// Cloths: how likely a draft that was not given is at least, a share such as 0.7 [default: any, the likeliest draft is taken]
    #[arg(long, value_name = "SHARE", value_parser = parse_share)]
    pub accept: Option<f64>,
    /// Cloths: stop at the first guess: threads, draft, and colours of one comparison
    #[arg(long)]
    pub quick: bool,
    /// Cloths: the part of both photographs that is used, from pixel X0,Y0 at the upper left to before X1,Y1; --width-mm stays that of the whole photograph
    #[arg(long, value_name = "X0,Y0,X1,Y1", allow_hyphen_values = true, value_parser = parse_crop)]
    pub crop: Option<Crop>,
    /// Cloths: folder for a page with photographs and pictures side by side
    #[arg(long, value_name = "FOLDER")]
    pub report: Option<PathBuf>,
    /// Cloths: distance of the camera from the middle of the cloth; parallel rays without it
    #[arg(long, value_name = "MM", value_parser = parse_positive)]
    pub camera_mm: Option<f64>,
    /// Cloths: distance of the lamp in front from the middle of the cloth; parallel light without it
    #[arg(long, value_name = "MM", value_parser = parse_positive)]
    pub light_mm: Option<f64>,
    /// Cloths: the same of the lamp behind
    #[arg(long, value_name = "MM", value_parser = parse_positive)]
    pub back_light_mm: Option<f64>,
    /// Cloths: by how much both photographs darken away from their middle, coefficients A,B of 1 + A r^2 + B r^4 with r = 1 in the corners, or "fit" [default: 0,0]
    #[arg(long, value_name = "A,B|fit", allow_hyphen_values = true, value_parser = parse_vignetting)]
    pub vignetting: Option<VignettingFlag>,
    /// Cloths: find the exposure as well; --white is where the search starts
    #[arg(long)]
    pub fit_white: bool,
    /// Cloths: find the directions towards the lamps as well; --light and --back-light are where the search starts
    #[arg(long)]
    pub fit_light: bool,
}

impl PhotographArgs {
    /// Each flag, and whether it is given.
    pub fn given(&self) -> [(&'static str, bool); 11] {
        [
            ("--draft", self.draft.is_some()),
            ("--accept", self.accept.is_some()),
            ("--quick", self.quick),
            ("--crop", self.crop.is_some()),
            ("--report", self.report.is_some()),
            ("--camera-mm", self.camera_mm.is_some()),
            ("--light-mm", self.light_mm.is_some()),
            ("--back-light-mm", self.back_light_mm.is_some()),
            ("--vignetting", self.vignetting.is_some()),
            ("--fit-white", self.fit_white),
            ("--fit-light", self.fit_light),
        ]
    }
}

/// Vignetting as the flag states it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum VignettingFlag {
    /// It is known.
    Known(Vignetting),
    /// It is to be found.
    Fit,
}

fn parse_vignetting(text: &str) -> Result<VignettingFlag, String> {
    if text.trim() == "fit" {
        return Ok(VignettingFlag::Fit);
    }
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    let known = match numbers.as_deref() {
        Some(&[a, b]) => Some(Vignetting { a, b }),
        _ => None,
    };
    // Light is left everywhere, to the corners.
    let is_light = |v: &Vignetting| (0..=20).all(|i| v.factor(f64::from(i) / 20.0) > 0.05);
    known
        .filter(is_light)
        .map(VignettingFlag::Known)
        .ok_or_else(|| {
            "expected \"fit\", or two numbers A,B with 1 + A r^2 + B r^4 above 0.05 for r from 0 to 1"
                .into()
        })
}
