//! Virtual goniometer over a patch of cloth.
//!
//! A [`PatchResponse`] answers two questions about any kind of patch: how much light it
//! scatters from one direction into another, and where the light from one direction goes.
//! [`VolumePatch`] traces paths through media, [`SurfacePatch`] evaluates a reflectance model.
//! [`measure_pairs`] and [`measure_albedos`] turn the answers into means with standard errors.
//!
//! # Conventions Directions are unit vectors that point away from the cloth, in the fabric
//! frame: x weft, y warp, z out of the face. A pair whose directions lie on one side is
//! reflection, on two sides transmission; the light may come from behind. The BSDF is `L_o /
//! (E_perp |cos theta_i|)`, 1/sr, and excludes light that passes straight through, which is not
//! a function of direction but a share: [`Energy::direct`].
//!
//! # Determinism Seed, pair and index determine the random numbers of a path. Paths are added
//! in order, in chunks of fixed size.
//!
//! ```
//! use organza_basis::unwatched;
//! use organza_measure::{Effort, SurfacePatch, measure_albedos, measure_pairs, parse_incident, parse_pairs};
//! use organza_surface::SurfaceSpec;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let patch = SurfacePatch(SurfaceSpec::preset("denim")?.build()?);
//! let effort = Effort::new(256, 1);
//! let pairs = parse_pairs("theta_i,phi_i,theta_o,phi_o\n30,0,45,180\n")?;
//! let results = measure_pairs(&patch, &pairs, &effort, &unwatched)?;
//! let bsdf = results.list[0].bsdf;
//! println!("{:?} +- {:?} 1/sr", bsdf.mean, bsdf.se);
//!
//! let incident = parse_incident("theta_i,phi_i\n30,0\n")?;
//! let results = measure_albedos(&patch, &incident, &effort, &unwatched)?;
//! assert!(results.list[0].reflected.mean[0] < 1.0);
//! # Ok(())
//! # }
//! ```

mod adaptive;
mod adaptive_file;
mod appearance;
mod bilinear_warp;
mod cost;
mod far_table;
mod far_texture;
pub mod fit;
mod fit_surface;
mod goniometer;
mod held_out;
mod klems;
mod klems_file;
mod layout;
mod looks;
mod low_rank;
mod metrics;
mod pairs;
mod parts;
mod patch;
mod picture_error;
mod picture_match;
mod picture_moments;
mod pixel_patch;
mod polynomial_map;
mod polynomial_map_file;
mod shade;
mod shade_class;
mod sharpening;
mod solar_patch;
mod surface_patch;
mod sweep;
mod table;
mod table_noise;
mod tensor_tree;
mod tensor_tree_file;
mod texture;
mod volume_patch;

pub use adaptive::{AdaptiveBrdf, AdaptiveGrid, AdaptiveResult, measure_adaptive};
pub use adaptive_file::write_adaptive;
pub use appearance::{Appearance, AppearanceFit, AppearanceSearch, Simulate, fit_appearance};
pub use cost::{Cost, Growth, PICTURE_PIXELS, growth, pareto_front};
pub use far_table::{NodeSums, far_matrix, measure_node};
pub use far_texture::{TexelSums, far_texture, measure_texels, texture_rings};
pub use fit_surface::{FitError, FittedSurface, fit_surface};
pub use goniometer::{
    Albedo, Effort, MeasureError, Measured, PairValue, Results, measure_albedo_rows,
    measure_albedos, measure_openness, measure_pair_rows, measure_pairs,
};
pub use held_out::{HeldOutError, HeldOutKind, held_out_bound, held_out_errors, held_out_pairs};
pub use klems::{KlemsBasis, KlemsBsdf, KlemsMatrix, KlemsPatch, measure_klems};
pub use klems_file::{
    KlemsBand, KlemsFileError, KlemsParts, SolarKlems, read_klems, read_klems_parts, write_klems,
};
pub use layout::{
    grid_directions, grid_layout, in_plane_layout, irawan_exitant, irawan_incident, irawan_layout,
};
pub use looks::{LookSums, gather_looks};
pub use metrics::{Difference, Figure, difference, reciprocity};
pub use pairs::{
    Angles, Pair, PairsError, PairsErrorKind, distinct_incident, parse_incident, parse_pairs,
    parse_values,
};
pub use patch::{
    Draw, DrawNumbered, Energy, Exit, FirstSight, Look, PatchResponse, PathNames, PathRun,
};
pub use picture_error::{NoisyPicture, PictureError, picture_error};
pub use picture_match::{
    PictureMatch, PictureSearch, PictureStatistics, match_colour, match_picture,
};
pub use picture_moments::{MIN_SIDE, MatchedPicture};
pub use pixel_patch::PixelPatch;
pub use polynomial_map::{
    MapEffort, PolynomialMap, measure_polynomial_map, memory_bytes as polynomial_map_memory_bytes,
};
pub use polynomial_map_file::write_polynomial_map;
pub use shade::{ShadeFigures, Share, SideShares, measure_shade, measure_sides};
pub use shade_class::{ShadeClass, ShadeClasses};
pub use sharpening::{MOST_STEPS, Sharpened, Sharpening};
pub use solar_patch::SolarPatch;
pub use surface_patch::SurfacePatch;
pub use sweep::{
    LampAxis, LampPosition, SweepValue, front_and_back, lamp_positions, measure_sweep,
};
pub use table::{write_albedos, write_pairs, write_sweep};
pub use table_noise::{RingNoise, TableErrors, ring_noise};
pub use tensor_tree::{TensorTree, TreeCell, TreeLayout, TreeRank, measure_tensor_tree};
pub use tensor_tree_file::write_tensor_tree;
pub use texture::{TexelGrid, Texture, measure_texture};
pub use volume_patch::{PatchError, VolumePatch};
