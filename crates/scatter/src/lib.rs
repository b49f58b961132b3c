//! Scattering of light by cloth: micro-flakes, fibres, and virtual scattering
//! among fibres, each with sampling, value and density that agree exactly.
//!
//! # What to call when
//!
//! | a tracker that has | asks for extinction | and at a collision for |
//! |---|---|---|
//! | micro-flakes of one axis | density x [`MicroFlake::projected_area`] of [`AxialFlake`] | [`MicroFlake::eval`] toward lights, [`MicroFlake::sample`] for the next direction; or both as a [`Lobe`] by [`SpecularFlakes`] |
//! | micro-flakes from six numbers | the same of [`Sggx`] | the same |
//! | rough-fibre flakes of a width | the same of [`BandFlakes`] | the same |
//! | a mixture, as flakes of a [`FlakeFamily`] | [`FlakeMixtures::sigma_t_per_mm`] | the other methods of [`FlakeMixtures`] |
//! | diffuse flakes | as above | [`DiffuseFlake::meet`] once, then its [`Lobe`] |
//! | a [`Mixture`](organza_basis::Mixture), plain virtual scattering | [`sigma_t_per_mm`] | [`meet_fibre`], then [`Fibre::far_field`] of its tangent |
//! | a mixture, packed fibres | [`sigma_t_per_mm`] x [`void_multiplier`], looked up at [`PackedEvent::axis_mm`] | [`meet_fibre`], [`PackedEvent::draw`], [`Fibre::near_field`], and on from [`PackedEvent::exit_mm`] |
//! | cloth without thickness | [`Surface::gap`] | the other methods of [`Surface`] |
//! | explicit fibres | - | [`FibreFrame::new`], [`FibreFrame::offset`] of the surface normal, [`Fibre::near_field`], and on from the axis plus the radius times [`NearField::exit_normal`] |
//!
//! The directions, measures and weights of all of these are those of [`Lobe`]:
//! unit vectors away from the event, `w_out` back along the walk, `w_in` where
//! light comes from; `weight` is all that the throughput is multiplied by.
//!
//! An event in a medium of packed fibres, for a light from above:
//!
//! ```
//! use glam::Vec3;
//! use organza_basis::{FibrePopulation, Mixture, PathRng, Rgb};
//! use organza_scatter::*;
//!
//! # fn main() -> Result<(), Error> {
//! // Per material, once.
//! let fibre = Fibre::from(DielectricFibre::new(DielectricParameters {
//!     ior: 1.55,
//!     absorption_radii: absorption_for_colour(1.55, Rgb::new(0.8, 0.3, 0.2)),
//!     longitudinal_rad: 0.1,
//!     azimuthal_rad: 0.2,
//! })?);
//!
//! // Per collision: the populations there, and the walk's way back.
//! let mut mixture = Mixture::EMPTY;
//! mixture.push(FibrePopulation {
//!     length_density_per_mm2: 1000.0,
//!     axis: Vec3::X,
//!     spread_rad: 0.1,
//!     radius_mm: 0.008,
//!     ..Default::default()
//! });
//! let (point_mm, w_out) = (Vec3::ZERO, Vec3::new(0.0, 0.6, 0.8));
//! let mut rng = PathRng::from_seed(1);
//! assert!(sigma_t_per_mm(&mixture, w_out) <= mixture.broadside_per_mm());
//! if let Some(met) = meet_fibre(&mixture, w_out, &mut rng) {
//!     let radius_mm = mixture.as_slice()[met.population].radius_mm;
//!     let event = PackedEvent::draw(point_mm, w_out, met.tangent, radius_mm, &mut rng);
//!     // Here the tracker accepts by the density at event.axis_mm().
//!     let lobe = fibre.near_field(event.frame, event.offset);
//!     let to_light = Vec3::Z;
//!     let shadow_start = event.exit_mm(&lobe, to_light, &mut rng);
//!     let from_light = lobe.eval(w_out, to_light); // times radiance and transmittance
//!     assert!(from_light.is_valid() && shadow_start.is_finite());
//!     if let Some(next) = lobe.sample(w_out, &mut rng) {
//!         let throughput = Rgb::WHITE * next.weight;
//!         let walk_on_from = event.exit_mm(&lobe, next.w_in, &mut rng);
//!         assert!(throughput.is_valid() && walk_on_from.is_finite());
//!     }
//! }
//! # Ok(())
//! # }
//! ```
//!
//! # Models
//!
//! | model | source | parameters | limits |
//! |---|---|---|---|
//! | [`AxialFlake`], [`Sggx`] mirrors ([`SpecularFlakes`]) | [Heitz2015] | end-on ratio; matrix of areas; albedo | ratio 0.001 to 1, smaller is raised |
//! | the same, diffuse ([`DiffuseFlake`]) | [Heitz2015] | the same | one flake a collision: noisier than mirrors |
//! | the same, each a piece of a clear fibre ([`TransmittingFlakes`]) | [Heitz2015], [Marschner2003] | the same; index, absorption times radius | round fibres; index from 1.05; azimuth of light reflected once inside taken as linear in the angle of incidence, reflected more often as from a mirror |
//! | [`GaussianBand`] mirrors | [Schroeder2012] | gamma, deviation of the cosine between normal and fibre, no unit | 0.0001 to 10000, cut; areas to 1e-3 |
//! | [`SineBand`] mirrors | [Schroeder2012] | power, no unit | 0 to 1e8, cut; areas to 1e-3 |
//! | [`DielectricFibre`], near and far field | [Marschner2003] | index; absorption times radius; widths, radians | index 1 to 3; widths half a degree to 34 along, 1 to 90 about; energy to 1e-3, to 1e-2 within 5 degrees of the fibre |
//! | the same of a [`Section`] that is not round | [Khungurn2017], [Aliaga2017] | and the outline | the near field is the far field at every offset |
//! | [`FittedFibre`], R and TT | [Khungurn2015] | two colours; three widths, radians | widths half a degree to 34, 90 about; fitted, so not physical: reflectances up to 0.99 |
//! | [`MeasuredFibre`] | this crate | up to three lobes: colour, width, profile around the fibre | colours add up to 1 at most, the same at every inclination; the near field is the far field |
//! | virtual scattering, plain ([`meet_fibre`]) | [Schroeder2011] | populations: length per volume, 1/mm^2; radius, mm; spread, radians | fibres strewn at random; cross-sections to 1e-3 |
//! | the same, packed ([`PackedEvent`]) | this crate | and the packing | packing to 0.7; see [`packed_fibre`] |
//!
//! Flakes of every kind name their width by the ratio of end-on to broadside area:
//! [`BandProfile::end_on_ratio`] and [`BandProfile::with_end_on_ratio`] convert,
//! and the areas of the families then agree to 2 % of the broadside one (tested).
//!
//! A model of your own implements [`FibreModel`], [`Lobe`] or [`MicroFlake`]; [`proofs`] tests it
//! in ten lines.
//!
//! # What holds
//! - Phase functions integrate to one and `projected_area(a) eval(a, b)` is
//!   symmetric; fibres keep energy and `sin(angle(a, t)) eval(a, b)` is symmetric.
//!   The far field is the mean of the near field over offsets.
//! - No two models share a normalisation by accident: [`Sggx`] shows one for
//!   S = I, [`BandFlakes`] one half when isotropic, fibres two radii broadside.
//! - A near field keeps light in the mean over offsets, not at each of them. Seen from
//!   25 degrees off the fibre's axis and more, a clear fibre returns 0.98 to 1.02 of
//!   the light at every offset for blurs of 6 degrees, 0.92 to 1.14 for 34, the widest;
//!   from 10 degrees, 0.96 to 1.09 and 0.90 to 1.43 (`fibre_tests` and
//!   `docs/hard_cases.md` have the table).
//! - Directions are drawn as fibres without absorption send them, so that weights are
//!   near one: their variance is 0.001 for blurs of 5 degrees, 0.01 for 34.
//! - Walks of the packed event move their starting points, so that a slab of them
//!   is reciprocal only up to 2.2 % (explicit fibres: 3.6 %), as `tests/packed_fibres.rs`
//!   states pair by pair.

mod axial_flake;
pub mod bvdf;
mod cone_table;
pub mod cylinder;
pub mod dielectric;
pub mod error;
mod far_parts;
pub mod fibre;
pub mod fibre_catalogue;
pub mod fibre_frame;
pub mod fitted;
pub mod flake;
pub mod heap_colour;
mod inclination_pair;
pub mod lobe;
mod lobe_table;
pub mod longitudinal;
mod measured;
pub mod near;
pub mod packed_fibre;
pub mod ply;
pub mod population;
pub mod proofs;
pub mod section;
pub mod sggx;
pub mod surface;
mod traced_section;
pub mod virtual_fibres;

pub use axial_flake::AxialFlake;
pub use bvdf::{Bvdf, BvdfBuilder};
pub use dielectric::{DielectricFibre, DielectricParameters};
pub use error::Error;
pub use far_parts::{FAR_LOBES, FAR_ROWS, FarParts};
pub use fibre::{FarField, Fibre, FibreModel, NearEvent, NearField};
pub use fibre_catalogue::{FibreKind, FibreTable};
pub use fibre_frame::{FibreAngles, FibreFrame};
pub use fitted::{FittedFibre, FittedParameters, FittedTable};
pub use flake::band::{BandFlakes, BandProfile};
pub use flake::catalogue::{FLAKE_FAMILIES, FlakeFamily};
pub use flake::{
    ClearFibre, DiffuseFlake, FlakeMixtures, FlakePopulation, FlakeScattering, GaussianBand,
    LaneEvent, MicroFlake, SineBand, SpecularFlakes, TransmittingFlakes,
};
pub use heap_colour::{absorption_for_colour, absorption_for_colour_of};
pub use inclination_pair::InclinationPair;
pub use lobe::{Lobe, LobeSample};
pub use measured::{MeasuredFibre, MeasuredLobe, MeasuredTable};
pub use packed_fibre::{PackedEvent, packing_fraction, void_multiplier};
pub use ply::{Ply, PlyCorrection, PlyEvent, PlyLobe, PlyParameters, PlyPlace};
pub use population::{FlakeMaterials, FlakeOptics, population_shape};
pub use section::{SECTIONS, Section};
pub use sggx::Sggx;
pub use surface::{Footprint, Passage, Shifted, Surface};
pub use virtual_fibres::{
    MetFibre, effective_cross_section, meet_fibre, population_sigma_t_per_mm, sigma_t_per_mm,
};

#[cfg(test)]
mod fibre_tests;
#[cfg(test)]
mod sggx_tests;
