//! Materials for other programs: textures of a tile of cloth, and the parameters of the
//! material models that those programs have, fitted to organza's own measurement.
//!
//! [`maps::Maps`] are made from paths that look straight down on every texel of one repeat
//! ([`organza_measure::gather_looks`]): height, normal, direction of the fibres, coverage,
//! colour. A [`model::Target`] is the published formula of one material model over a texel;
//! its free parameters are fitted by [`fit::fit_target`] to measured pairs of directions, some of which are
//! held out to judge the result. [`write`] turns maps and parameters into files.
//!
//! # Conventions
//! Directions point away from the cloth, in the fabric frame: x weft, y warp, z out of the
//! face. Pictures have the row of the largest y first; u runs along x. Angles of texels are
//! measured from x to y. The BSDF of a textured material is the mean over its texels of
//! coverage times BSDF times the cosine of the light about the texel's normal, divided by
//! the cosine about the cloth's normal.

pub mod albedo;
pub mod error_table;
pub mod fit;
pub mod layout;
pub mod lobe;
pub mod maps;
pub mod model;
pub mod relief;
pub mod texel;
pub mod write;
