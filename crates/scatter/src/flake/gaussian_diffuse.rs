//! `flake = "gaussian-diffuse"`: diffuse flakes with a truncated Gaussian profile.
//!
//! The fibres of \[Schroeder2012] seen as matt instead of glossy, by the diffuse
//! phase function of \[Heitz2015]: for yarns whose gloss is lost in short, curled or
//! dyed-through fibres.

use super::catalogue::FlakeRecord;
use super::distribution::{Bands, Diffuse};
use super::gaussian::GaussianBand;
use std::sync::Arc;

pub(super) const FAMILY: FlakeRecord = FlakeRecord {
    name: "gaussian-diffuse",
    about: "diffuse flakes with a truncated Gaussian about the fibre's cross-section",
    scattering: |_| Arc::new(Diffuse(Bands::<GaussianBand>::new())),
};
