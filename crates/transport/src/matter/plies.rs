//! Plies: every ply of a cloth as a chain of cylinders full of fibres.
//!
//! A ply is to the tracer a thick fibre: pieces that meet in ellipses, in the hierarchy of
//! [`ExplicitFibres`](super::ExplicitFibres), endless where the tile repeats, and over meshes
//! too. Where a ray enters one, it passes or meets one of the fibres inside, which scatters
//! as [`Ply`] says [Montazeri2020]. Hairs are single fibres, met at their surface.
//!
//! What starts in a ply leaves it freely: its event has counted the way out. Where plies
//! overlap, a ray that starts in both leaves both, and one that comes from outside meets the
//! fibres of both.

#[cfg(test)]
mod tests;

use super::explicit_fibre_site::ExplicitFibreSite;
use super::explicit_fibres::{Entry, Found};
use crate::matter::collision::{AnySite, Collision};
use crate::matter::draping::Draping;
use crate::matter::level_choice::Tracking;
use crate::matter::ray_target::RayTarget;
use crate::matter::site::Site;
use crate::{ExplicitFibres, ExplicitFibresError, SiteInfo, Stats};
use glam::{Vec2, Vec3};
use organza_basis::{CellGrid, PathRng, Ray, Rgb, SegmentSource};
use organza_scatter::{Fibre, Lobe, LobeSample, Ply, PlyEvent, PlyParameters, PlyPlace};
use rayon::prelude::*;

/// Why plies cannot be traced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PliesError {
    /// As of fibres, which plies are to the tracer.
    #[error("{0}")]
    Curves(#[from] ExplicitFibresError),
    /// A material whose plies cannot be.
    #[error("material {0} has plies without fibres or radius")]
    Ply(usize),
}

/// The plies of one tile, alone or repeated without end.
pub struct Plies {
    curves: ExplicitFibres,
    /// By material; curves of a material without are single fibres.
    plies: Vec<Option<Ply>>,
}

/// Plies that a ray may pass before it counts as one that meets none.
const MAX_PASSED: u32 = 65_536;

/// A ray that passed the surface of a ply goes on so far behind it, in radii of the ply.
const STEP_RADII: f32 = 1e-3;

/// Light below this share is none.
const DARK: f32 = 1e-6;

impl Plies {
    /// The plies of a source; what they are made of and their fibres are indexed by its
    /// materials. `progress` is called with the share of the work done.
    ///
    /// # Errors
    /// When there are none, one is not possible, or memory does not suffice.
    pub fn new(
        source: &dyn SegmentSource,
        parameters: &[Option<PlyParameters>],
        fibres: Vec<Fibre>,
        max_memory_bytes: Option<u64>,
        progress: &(dyn Fn(f32) + Sync),
    ) -> Result<Plies, PliesError> {
        let at_first = &|share| progress(0.5 * share);
        let curves = ExplicitFibres::new(source, fibres, max_memory_bytes, at_first)?;
        let plies = walked(parameters, curves.fibres())?;
        progress(1.0);
        Ok(Plies { curves, plies })
    }

    /// The same plies with fibres of other scattering and other parameters, but for the radius:
    /// they share the hierarchy.
    ///
    /// # Errors
    /// When one has no scattering, or is not possible.
    pub fn with_scattering(
        &self,
        parameters: &[Option<PlyParameters>],
        fibres: Vec<Fibre>,
    ) -> Result<Plies, PliesError> {
        let curves = self.curves.with_scattering(fibres)?;
        let plies = walked(parameters, curves.fibres())?;
        Ok(Plies { curves, plies })
    }

    /// Where the plies are.
    pub fn cell_grid(&self) -> &CellGrid {
        self.curves.cell_grid()
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        let tables = self.plies.iter().flatten().map(Ply::memory_bytes);
        self.curves.memory_bytes() + tables.sum::<u64>()
    }

    fn of(&self, entry: &Entry) -> Option<(&Ply, PlyPlace)> {
        let ply = self.plies.get(usize::from(entry.material))?.as_ref()?;
        let place = PlyPlace {
            axis: entry.tangent,
            out_mm: entry.out_mm,
            radius_mm: entry.radius_mm,
        };
        Some((ply, place))
    }

    /// A single fibre that is met by a ray along `way`, with light that travels along
    /// `light`.
    fn single(&self, found: &Found, way: Vec3, light: Vec3) -> AnySite<'_> {
        AnySite::ExplicitFibres(ExplicitFibreSite {
            fibres: &self.curves,
            hit: self.curves.describe(found, way, light),
        })
    }
}

/// The site of a fibre met `t_mm` after a ray along `way` entered a ply, with light that
/// travels along `light`.
fn entry_site<'a>(
    ply: &'a Ply,
    place: &PlyPlace,
    entry: &Entry,
    t_mm: f32,
    [way, light]: [Vec3; 2],
    rng: &mut PathRng,
) -> AnySite<'a> {
    AnySite::Ply(PlySite {
        ply,
        event: ply.event(place, t_mm, way, -light, rng),
        axis: entry.tangent,
        yarn: entry.yarn,
    })
}

fn walked(
    parameters: &[Option<PlyParameters>],
    fibres: &[Fibre],
) -> Result<Vec<Option<Ply>>, PliesError> {
    let of_material = |(i, p): (usize, &Option<PlyParameters>)| match (p, fibres.get(i)) {
        (Some(p), Some(fibre)) => {
            let ply = Ply::new(*p, fibre.clone());
            ply.map(Some).ok_or(PliesError::Ply(i))
        }
        _ => Ok(None),
    };
    parameters.par_iter().enumerate().map(of_material).collect()
}

impl RayTarget for Plies {
    fn cell_grid(&self) -> Option<&CellGrid> {
        Some(self.curves.cell_grid())
    }

    fn cut_to(&mut self, min_mm: Vec2, max_mm: Vec2) -> Option<()> {
        self.curves.cut_to(min_mm, max_mm)
    }

    fn is_piecewise_constant(&self) -> bool {
        true
    }

    fn collide(
        &self,
        ray: &Ray,
        limit: f64,
        _tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let mut gone = 0.0f64;
        for _ in 0..MAX_PASSED {
            let from = Ray::new(ray.at(gone), ray.direction);
            let found = self
                .curves
                .walk(&from, limit - gone, false, &mut stats.tentative)?;
            let entry = found.entry(&self.curves);
            gone += found.distance_mm;
            let Some((ply, place)) = self.of(&entry) else {
                let site = self.single(&found, ray.direction, ray.direction);
                stats.collisions += 1;
                return Some(Collision::new(gone, site));
            };
            if let Some(t) = ply.first_fibre(&place, ray.direction, rng) {
                if gone + f64::from(t) > limit {
                    return None;
                }
                stats.collisions += 1;
                let d = ray.direction;
                let site = entry_site(ply, &place, &entry, t, [d, d], rng);
                return Some(Collision::new(gone + f64::from(t), site));
            }
            gone += f64::from(STEP_RADII * entry.radius_mm);
        }
        None
    }

    fn pass(
        &self,
        ray: &Ray,
        reach: f64,
        _tracking: Tracking,
        _rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        let (mut gone, mut left) = (0.0f64, 1.0);
        for _ in 0..MAX_PASSED {
            let from = Ray::new(ray.at(gone), ray.direction);
            let tests = &mut stats.shadow_steps;
            let Some(found) = self.curves.walk(&from, reach - gone, false, tests) else {
                return left;
            };
            let entry = found.entry(&self.curves);
            let Some((ply, place)) = self.of(&entry) else {
                return 0.0;
            };
            left *= ply.transmittance(&place, ray.direction);
            if left < DARK {
                return 0.0;
            }
            gone += found.distance_mm + f64::from(STEP_RADII * entry.radius_mm);
        }
        0.0
    }

    fn can_be_draped(&self) -> bool {
        self.curves.cell_grid().repeats()
    }

    fn hierarchy_bytes(&self) -> u64 {
        self.curves.hierarchy_bytes()
    }

    fn collide_draped(
        &self,
        over: &Draping,
        ray: &Ray,
        limit: f64,
        _tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let mut gone = 0.0f64;
        for _ in 0..MAX_PASSED {
            let from = Ray::new(ray.at(gone), ray.direction);
            let (t, found, span) = self
                .curves
                .nearest_draped(over, &from, limit - gone, stats)?;
            let entry = found.entry(&self.curves);
            let cloth_per_world = span.step.length();
            let way = (span.step / cloth_per_world).as_vec3();
            gone += t;
            let light = (span.world_from_cloth.transpose() * ray.direction).normalize();
            let (turn, stretch) = (span.world_from_cloth, span.stretch);
            let Some((ply, place)) = self.of(&entry) else {
                let site = self.single(&found, way, light);
                stats.collisions += 1;
                return Some(Collision::stretched(gone, site, turn, stretch));
            };
            if let Some(inside) = ply.first_fibre(&place, way, rng) {
                let at = gone + f64::from(inside) / cloth_per_world;
                if at > limit {
                    return None;
                }
                stats.collisions += 1;
                let site = entry_site(ply, &place, &entry, inside, [way, light], rng);
                return Some(Collision::stretched(at, site, turn, stretch));
            }
            gone += f64::from(STEP_RADII * entry.radius_mm) / cloth_per_world;
        }
        None
    }

    fn pass_draped(
        &self,
        over: &Draping,
        ray: &Ray,
        reach: f64,
        _tracking: Tracking,
        _rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        let (mut gone, mut left) = (0.0f64, 1.0);
        for _ in 0..MAX_PASSED {
            let from = Ray::new(ray.at(gone), ray.direction);
            let Some((t, found, span)) =
                self.curves.nearest_draped(over, &from, reach - gone, stats)
            else {
                return left;
            };
            let entry = found.entry(&self.curves);
            let cloth_per_world = span.step.length();
            let Some((ply, place)) = self.of(&entry) else {
                return 0.0;
            };
            let way = (span.step / cloth_per_world).as_vec3();
            left *= ply.transmittance(&place, way);
            if left < DARK {
                return 0.0;
            }
            gone += t + f64::from(STEP_RADII * entry.radius_mm) / cloth_per_world;
        }
        0.0
    }
}

/// Where light met a fibre of a ply.
pub(crate) struct PlySite<'a> {
    ply: &'a Ply,
    event: PlyEvent,
    axis: Vec3,
    yarn: u32,
}

impl Site for PlySite<'_> {
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.ply.lobe(&self.event).eval(w_out, w_in)
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        self.ply.lobe(&self.event).sample(w_out, rng)
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        self.ply.lobe(&self.event).pdf(w_out, w_in)
    }

    fn exit_mm(&self, w_out: Vec3, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        self.ply.lobe(&self.event).exit_mm(w_out, w_in, rng)
    }

    fn info(&self) -> Option<SiteInfo> {
        Some(SiteInfo {
            axis: self.axis,
            yarn: Some(self.yarn),
        })
    }
}
