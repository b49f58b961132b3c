//! Surface reflectance models of woven cloth: the complete model of Irawan \[Irawan2008], with
//! extensions for the questions that it leaves open.
//!
//! A cloth is a repeat of visible yarn segments, cut from any draft ([`weave`]). Each segment
//! is a curved cylinder of fibres that reflect light onto cones ([`segment`]). The texture
//! model distributes this light over the rectangle of the segment, and the reflectance model
//! integrates over it; the mean of the texture is the reflectance. [`WovenSurface`] joins them:
//! two faces, noise, gaps and transmitted light, optional shadowing, sampling. [`SurfaceSpec`]
//! is its description in files, with the six fabrics of the thesis as presets. The
//! [`catalogue`] lists this and the other surface models that a fabric file can name.
//!
//! # Conventions
//! The fabric frame is right-handed: x along the weft, y along the warp, z out
//! of the face. Directions are unit vectors that point away from the cloth. A
//! value is radiance out over irradiance on the fabric plane, 1/sr, without a
//! cosine. The frame of a segment has x across, y along the yarn.
//!
//! ```
//! use glam::Vec3;
//! use organza_scatter::{Footprint, Surface};
//! use organza_surface::SurfaceSpec;
//!
//! # fn main() -> Result<(), organza_surface::Error> {
//! let denim = SurfaceSpec::preset("denim")?.build()?;
//! let (to_light, to_eye) = (Vec3::new(0.6, 0.0, 0.8), Vec3::Z);
//! // A pixel that sees the whole repeat, and more.
//! let value = denim.eval(to_eye, to_light, Footprint::FAR);
//! assert!(value.is_valid() && !value.is_black());
//! let back = denim.eval(to_light, to_eye, Footprint::FAR);
//! assert!((value.0 - back.0).abs().max_element() < 1e-5);
//! # Ok(())
//! # }
//! ```

// Negated comparisons are intended: a NaN takes the safe branch.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

mod around_cone;
mod band;
pub mod catalogue;
mod cloth;
pub mod components;
mod cone;
pub mod diffuse;
mod energy;
pub mod error;
mod face;
mod filament;
mod half_vector;
mod local;
mod noise;
pub mod parameters;
pub mod phase;
pub mod quadrature;
pub mod real;
mod round;
pub mod segment;
mod sequence;
pub mod shadowing;
pub mod spec;
pub mod spine;
mod staple;
mod stretches;
pub mod table;
pub mod transmission;
pub mod transmission_fit;
pub mod weave;
pub mod woven_surface;

pub use catalogue::{ClothSurface, SurfaceKind, SurfaceTable};
pub use components::{Components, Parts};
pub use error::Error;
pub use parameters::{WovenParameters, YarnParameters};
pub use spec::SurfaceSpec;
pub use transmission_fit::MeasuredTransmission;
pub use woven_surface::WovenSurface;
