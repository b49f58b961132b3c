//! The measurements of every model.

use super::LIGHTS;
use crate::{Picture, ReportError};
use organza_basis::Watch;
use organza_measure::{
    Albedo, Angles, Effort, Pair, PairValue, PatchResponse, TexelGrid, in_plane_layout,
    measure_albedos, measure_pairs, measure_texture, reciprocity,
};
use std::time::Instant;

/// Angle of the light in the planes of weft and warp, degrees.
const IN_PLANE_DEG: f64 = 30.0;

/// Directions of light whose shares are measured: polar angle and azimuth, degrees.
const INCIDENT_DEG: [[f64; 2]; 4] = [[0.0, 0.0], [60.0, 0.0], [60.0, 90.0], [180.0, 0.0]];

/// Changes the random numbers of the pairs whose directions are exchanged.
const REVERSE_SEED: u64 = 0x5eed;

/// The measurements of a model.
pub struct Measurement {
    /// Its name.
    pub model: String,
    /// Values at the layout's pairs.
    pub layout: Vec<PairValue>,
    /// Values in the planes of weft and warp.
    pub in_plane: Vec<PairValue>,
    /// The shares of light.
    pub albedos: Vec<Albedo>,
    /// Pictures under each light.
    pub pictures: Vec<Picture>,
    /// Largest departure from reciprocity, standard errors.
    pub reciprocity: Option<f64>,
    /// Paths traced.
    pub paths: u64,
    /// Time taken.
    pub seconds: f64,
}

impl Measurement {
    /// Values that were measured elsewhere, at the layout's pairs alone.
    pub fn of_data(model: impl Into<String>, layout: Vec<PairValue>) -> Measurement {
        Measurement {
            model: model.into(),
            layout,
            in_plane: Vec::new(),
            albedos: Vec::new(),
            pictures: Vec::new(),
            reciprocity: None,
            paths: 0,
            seconds: 0.0,
        }
    }
}

/// The measurements of every model, and their effort.
pub struct ComparisonPlan {
    /// Pairs of directions.
    pub layout: Vec<Pair>,
    /// Paths per pair, and the target error.
    pub effort: Effort,
    /// Texels of the pictures.
    pub grid: TexelGrid,
    /// Paths per texel.
    pub texel_paths: u64,
}

impl ComparisonPlan {
    /// Measures a model. `watch` is called with the number of finished paths, from any thread.
    ///
    /// # Errors
    /// See [`organza_measure::MeasureError`].
    pub fn measure(
        &self,
        model: &str,
        patch: &impl PatchResponse,
        watch: Watch<'_>,
    ) -> Result<Measurement, ReportError> {
        let started = Instant::now();
        let effort = &self.effort;
        let main = measure_pairs(patch, &self.layout, effort, watch)?;
        let in_plane = measure_pairs(patch, &in_plane_layout(IN_PLANE_DEG), effort, watch)?;
        let exchanged = |v: &PairValue| Pair::new(v.pair.exitant, v.pair.incident);
        let reverse: Vec<Pair> = in_plane.list.iter().map(exchanged).collect();
        let again = Effort {
            seed: effort.seed ^ REVERSE_SEED,
            ..*effort
        };
        let reverse = measure_pairs(patch, &reverse, &again, watch)?;
        let incident = INCIDENT_DEG.map(|[theta_deg, phi_deg]| Angles { theta_deg, phi_deg });
        let many = Effort {
            paths: (16 * effort.paths).max(8192),
            target_error: None,
            ..*effort
        };
        let albedos = measure_albedos(patch, &incident, &many, watch)?;
        let mut pictures = Vec::new();
        for light in &LIGHTS {
            let pair = Pair::new(light.direction, Angles::NORMAL);
            // Pictures are no part of what is counted.
            let (grid, paths) = (&self.grid, self.texel_paths);
            let texture = measure_texture(patch, pair, grid, paths, effort.seed, &|_| watch(0))?;
            pictures.push(Picture::new(self.grid.texels.to_array(), texture.mean));
        }
        Ok(Measurement {
            model: model.into(),
            reciprocity: reciprocity(&in_plane.list, &reverse.list),
            paths: main.stats.paths + in_plane.stats.paths + albedos.stats.paths,
            layout: main.list,
            in_plane: in_plane.list,
            albedos: albedos.list,
            pictures,
            seconds: started.elapsed().as_secs_f64(),
        })
    }
}
