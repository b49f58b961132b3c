//! What is to be learned, and what came of it.

use super::error_map::ErrorMap;
use super::kept::KeptLight;
pub use organza_basis::Stopped;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Which fibres end paths.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CacheMode {
    /// The second and later ones: every sample looks for light at the fibre that it sees.
    #[default]
    SecondFibre,
    /// The first as well, where samples may share light: where fibres are as wide as pixels, and
    /// in flat cloth.
    FirstFibre,
}

/// What is to be learned before a picture is rendered.
#[derive(Clone, Debug, PartialEq)]
pub struct CachePlan {
    /// Which fibres end paths.
    pub mode: CacheMode,
    /// How much to learn, in units of the time of a picture: see
    /// [`CachePlan::of_picture`].
    pub work: u64,
    /// Most bytes of bins and of what flows between them while they learn.
    pub bytes: u64,
    /// More is learned where the error of blocks is surely above this fraction of the
    /// picture's mean, see [`CacheReport::block_error_squared`].
    pub block_error: f64,
    /// Light at later fibres that another picture of this cloth has learned: it is taken as it
    /// is, and only what samples share at their first fibres is learned.
    pub kept: Option<Arc<KeptLight>>,
}

impl CachePlan {
    /// Work for every pixel: pieces of fibre that rays are held against, in sixteens.
    const WORK_PER_PIXEL: f64 = 250.0;
    /// So many times more is learned where samples share the light of their first fibres: there
    /// learning replaces samples.
    pub(super) const SHARED: f64 = 4.0;
    /// A smaller picture learns as much as one of so many pixels.
    const MIN_PIXELS: u64 = 1 << 17;
    /// Bytes of bins.
    pub const BYTES: u64 = 384 << 20;

    /// The plan for a picture of so many pixels; `factor` times the usual work. What is
    /// learned depends on scene and picture alone, not on samples, so that all parts of a
    /// picture learn the same.
    pub fn of_picture(mode: CacheMode, pixels: u64, factor: f64) -> CachePlan {
        let pixels = pixels.max(CachePlan::MIN_PIXELS) as f64;
        CachePlan {
            mode,
            work: (factor * pixels * CachePlan::WORK_PER_PIXEL) as u64,
            bytes: CachePlan::BYTES,
            block_error: f64::INFINITY,
            kept: None,
        }
    }
}

/// What was learned, and how far it is from the light that further paths found, which the
/// tables did not learn from. Errors are relative to the mean of the picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CacheReport {
    /// Paths that were walked to their ends.
    pub paths: u64,
    /// Paths that filled the bins at the first fibre.
    pub shared_paths: u64,
    /// Bins at the second and at the first fibre.
    pub bins: [u64; 2],
    /// Of the whole picture, and its standard error.
    pub mean_error: [f64; 2],
    /// Square of the root mean square over blocks of 16 x 16 pixels, and its standard error;
    /// may be negative by chance.
    pub block_error_squared: [f64; 2],
    /// Noise of what samples share, root mean square over samples.
    pub shared_noise: f64,
    /// The same over the value that is shared: in half the samples it is below the first, in
    /// all but a hundredth below the second.
    pub shared_noise_of_value: [f64; 2],
    /// Errors of blocks over the picture.
    pub error_map: ErrorMap,
    /// Digest of the tables.
    pub digest: u64,
}

impl CacheReport {
    /// Pixels along an edge of a block.
    pub const BLOCK: u32 = 16;

    /// Root mean square error of blocks, and the least that it hardly exceeds (two standard
    /// errors more).
    pub fn block_error(&self) -> (f64, f64) {
        let [square, se] = self.block_error_squared;
        (square.max(0.0).sqrt(), (square + 2.0 * se).max(0.0).sqrt())
    }

    /// Takes the share of the error of the whole picture that is more than its noise
    /// (\[JamesStein1961\]) out of the errors, and returns it: so far is the light of the cache
    /// corrected.
    pub(super) fn correct_mean(&mut self) -> f64 {
        let [error, se] = self.mean_error;
        let squared = error * error;
        if squared <= se * se {
            return 0.0;
        }
        let kept = 1.0 - se * se / squared;
        let left = (1.0 - kept) * error;
        self.mean_error[0] = left;
        self.block_error_squared[0] -= squared - left * left;
        kept
    }

    /// Whether the error of blocks is above a limit by more than two standard errors.
    pub fn is_surely_above(&self, limit: f64) -> bool {
        let [square, se] = self.block_error_squared;
        square - 2.0 * se > limit * limit
    }
}

/// Called now and then with the share that is learned; may break to stop.
pub type LearnWatch<'a> = dyn Fn(f64) -> ControlFlow<()> + Sync + 'a;

#[cfg(test)]
mod tests {
    use super::*;

    /// What is surely an error is taken out of the mean and of the blocks, and noise is left alone.
    #[test]
    fn the_mean_is_corrected_by_what_is_more_than_noise() {
        let with = |error: f64| CacheReport {
            mean_error: [error, 0.01],
            block_error_squared: [0.05, 0.01],
            ..CacheReport::default()
        };
        let mut of_noise = with(-0.01);
        assert_eq!(of_noise.correct_mean(), 0.0);
        assert_eq!(of_noise, with(-0.01));
        let mut sure = with(-0.1);
        let kept = sure.correct_mean();
        assert!((kept - 0.99).abs() < 1e-12);
        assert!((sure.mean_error[0] + 0.001).abs() < 1e-12);
        assert!((sure.block_error_squared[0] - (0.05 - 0.01 + 1e-6)).abs() < 1e-12);
    }
}
