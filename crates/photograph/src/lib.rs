//! What a photograph of woven cloth shows: the grid of its threads, how its crossings repeat, and
//! how well a computed picture explains it.
//!
//! A photograph is linear colour. [`ThreadGrid`] finds spacing and direction of both systems in
//! its power spectrum. [`Repeat`] is how crossings repeat, [`Fold`] the mean over all repeats,
//! and [`Likeness`] compares that with a picture that was computed for a draft. [`ThreadColours`] are those
//! of stripes and checks.

mod crossings;
mod drafts;
mod error;
mod fold;
mod likeness;
mod photograph;
mod repeat;
mod shading;
mod spectrum;
mod straight;
mod thread_colours;
mod thread_grid;
mod vignetting;
mod weave_lattice;

pub use drafts::{is_same_weave, name_of};
pub use error::PhotographError;
pub use fold::{Fold, Folding, jackknife};
pub use likeness::{Likeness, blurred, explain};
pub use photograph::{MIN_SIDE, Photograph};
pub use repeat::{MAX_CROSSINGS, Repeat};
pub use shading::{Shading, ShadingSums};
pub use spectrum::{Peak, Spectrum};
pub use straight::{FINE_PX, Straightened, straightened};
pub use thread_colours::ThreadColours;
pub use thread_grid::ThreadGrid;
pub use vignetting::Vignetting;
pub use weave_lattice::{Wave, WeaveLattice};

/// The repeats of the crossings of a photograph, the best first, with the share of the
/// differences between crossings that each explains; at most `count`, none a multiple of one
/// before it.
pub fn repeats(photograph: &Photograph, grid: &ThreadGrid, count: usize) -> Vec<(Repeat, f64)> {
    Repeat::of_crossings(&crossings::Crossings::new(photograph, grid), count)
}
