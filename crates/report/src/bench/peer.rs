//! Pictures of the scenes of the bench, made by other programs.

use crate::ReportError;
use organza_measure::{Cost, NoisyPicture};
use organza_scene::read;
use serde::Deserialize;
use std::path::Path;

/// A file of pictures.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct PeerFile {
    pictures: Vec<Peer>,
}

/// One picture.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Peer {
    /// Name and version of the program, and its settings.
    pub program: String,
    /// Name of the scene of the bench, without its ending.
    pub scene: String,
    /// Processor seconds before and while tracing.
    setup_s: f64,
    render_s: f64,
    #[serde(default)]
    memory_bytes: u64,
    /// Radiance, red, green and blue of every pixel, row by row from the top.
    mean: Vec<[f64; 3]>,
    /// Variance of `mean`.
    variance: Vec<[f64; 3]>,
}

impl Peer {
    /// The pictures of a file, each of `pixels` pixels.
    ///
    /// # Errors
    /// Names the file and the picture.
    pub fn read(path: &Path, pixels: usize) -> Result<Vec<Peer>, ReportError> {
        let fail = |why: String| ReportError::of_file(path, why);
        let file: PeerFile =
            serde_json::from_str(&read::text(path)?).map_err(|e| fail(e.to_string()))?;
        for peer in &file.pictures {
            let sizes = [peer.mean.len(), peer.variance.len()];
            if sizes != [pixels; 2] {
                return Err(fail(format!(
                    "{}: expected {pixels} pixels, found {} of mean and {} of variance",
                    peer.scene, sizes[0], sizes[1]
                )));
            }
            let good = |v: &f64| v.is_finite() && *v >= 0.0;
            let variances = peer.variance.iter().flatten();
            if !variances.chain([&peer.setup_s, &peer.render_s]).all(good)
                || !peer.mean.iter().flatten().all(|v| v.is_finite())
            {
                return Err(fail(format!(
                    "{}: expected finite numbers, variances and seconds of at least 0",
                    peer.scene
                )));
            }
        }
        Ok(file.pictures)
    }

    /// Its picture.
    pub(super) fn picture(&self) -> NoisyPicture {
        NoisyPicture {
            mean: self.mean.clone(),
            variance: self.variance.clone(),
        }
    }

    /// Its cost, for a picture of so many pixels along an edge with that relative noise.
    pub(super) fn cost(&self, resolution: u32, noise: f64) -> Cost {
        Cost::of_picture(
            u64::from(resolution).pow(2),
            self.setup_s,
            self.render_s,
            noise,
            self.memory_bytes,
        )
    }
}
