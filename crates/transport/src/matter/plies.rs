//! Plies: every ply of a cloth as a chain of cylinders full of fibres.
//!
//! A ply is to the tracer a thick fibre: pieces that meet in ellipses, in the cells of
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
use super::explicit_fibres::{Found, PlyEntry};
use crate::matter::collision::{AnySite, Collision, Met};
use crate::matter::draping::Draping;
use crate::matter::ray_target::{Query, RayTarget};
use crate::matter::site::Site;
use crate::{ExplicitFibres, ExplicitFibresError, SiteInfo, Stats};
use glam::{Mat3, Vec2, Vec3};
use organza_basis::{CellGrid, PathRng, Ray, Rgb, SegmentSource, Stopped, Watch};
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
    /// When there are none, one is not possible, memory does not suffice, or `progress` broke.
    pub fn new(
        source: &dyn SegmentSource,
        parameters: &[Option<PlyParameters>],
        fibres: Vec<Fibre>,
        max_memory_bytes: Option<u64>,
        progress: Watch<'_, f32>,
    ) -> Result<Plies, PliesError> {
        let at_first = &|share| progress(0.5 * share);
        let curves = ExplicitFibres::new(source, fibres, max_memory_bytes, at_first)?;
        let plies = walked(parameters, curves.fibres())?;
        Stopped::check(progress(1.0)).map_err(ExplicitFibresError::from)?;
        Ok(Plies { curves, plies })
    }

    /// The same plies with fibres of other scattering and other parameters, but for the radius:
    /// they share the cells.
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

    fn of(&self, entry: &PlyEntry) -> Option<(&Ply, PlyPlace)> {
        let ply = self.plies.get(usize::from(entry.material))?.as_ref()?;
        let place = PlyPlace {
            axis: entry.tangent,
            out_mm: entry.out_mm,
            radius_mm: entry.radius_mm,
        };
        Some((ply, place))
    }

    /// The nearest entry of a ray before `limit` mm, flat or in a shell.
    fn nearest(
        &self,
        over: Option<&Draping>,
        ray: &Ray,
        limit: f64,
        tests: &mut u64,
    ) -> Option<Meeting> {
        let Some(over) = over else {
            let found = self.curves.walk(ray, limit, false, tests)?;
            return Some(Meeting {
                distance_mm: found.distance_mm,
                entry: found.entry(&self.curves),
                found,
                along: ray.direction,
                light: ray.direction,
                own_per_mm: 1.0,
                maps: None,
            });
        };
        let (distance_mm, found, span) = self.curves.nearest_draped(over, ray, limit, tests)?;
        let own_per_mm = span.step.length();
        Some(Meeting {
            distance_mm,
            entry: found.entry(&self.curves),
            found,
            along: (span.step / own_per_mm).as_vec3(),
            light: (span.world_from_cloth.transpose() * ray.direction).normalize(),
            own_per_mm,
            maps: Some((span.world_from_cloth, span.stretch)),
        })
    }
}

/// An entry of a ray into a curve, flat or in a shell.
struct Meeting {
    /// Along the ray, mm.
    distance_mm: f64,
    found: Found,
    entry: PlyEntry,
    /// The directions of the ray through the places of the cloth, and of its light.
    along: Vec3,
    light: Vec3,
    /// Millimetres of the cloth for one along the ray.
    own_per_mm: f64,
    /// Turns directions of a shell to the world, and takes differences of places there.
    maps: Option<(Mat3, Mat3)>,
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

    fn collide(&self, query: Query<'_>, rng: &mut PathRng, stats: &mut Stats) -> Met<'_> {
        let (ray, limit, over) = (query.ray, query.reach_mm, query.over);
        let mut gone = 0.0f64;
        for _ in 0..MAX_PASSED {
            let from = Ray::new(ray.at(gone), ray.direction);
            let met = self.nearest(over, &from, limit - gone, &mut stats.tentative)?;
            gone += met.distance_mm;
            let (at, site) = match self.of(&met.entry) {
                None => {
                    let hit = self.curves.describe(&met.found, met.along, met.light);
                    let fibres = &self.curves;
                    (
                        gone,
                        AnySite::ExplicitFibres(ExplicitFibreSite { fibres, hit }),
                    )
                }
                Some((ply, place)) => {
                    let Some(inside) = ply.first_fibre(&place, met.along, rng) else {
                        gone += f64::from(STEP_RADII * met.entry.radius_mm) / met.own_per_mm;
                        continue;
                    };
                    let at = gone + f64::from(inside) / met.own_per_mm;
                    if at > limit {
                        return None;
                    }
                    let site = PlySite {
                        ply,
                        event: ply.event(&place, inside, met.along, -met.light, rng),
                        axis: met.entry.tangent,
                        yarn: met.entry.yarn,
                    };
                    (at, AnySite::Ply(site))
                }
            };
            stats.collisions += 1;
            return Some(match met.maps {
                None => Collision::new(at, site),
                Some((turn, stretch)) => Collision::stretched(at, site, turn, stretch),
            });
        }
        None
    }

    fn pass(&self, query: Query<'_>, _rng: &mut PathRng, stats: &mut Stats) -> f32 {
        let (ray, reach, over) = (query.ray, query.reach_mm, query.over);
        let (mut gone, mut left) = (0.0f64, 1.0);
        for _ in 0..MAX_PASSED {
            let from = Ray::new(ray.at(gone), ray.direction);
            let tests = &mut stats.shadow_steps;
            let Some(met) = self.nearest(over, &from, reach - gone, tests) else {
                return left;
            };
            let Some((ply, place)) = self.of(&met.entry) else {
                return 0.0;
            };
            left *= ply.transmittance(&place, met.along);
            if left < DARK {
                return 0.0;
            }
            let step = f64::from(STEP_RADII * met.entry.radius_mm) / met.own_per_mm;
            gone += met.distance_mm + step;
        }
        0.0
    }

    fn can_be_draped(&self) -> bool {
        self.curves.cell_grid().repeats()
    }

    fn walk_bytes(&self) -> u64 {
        self.curves.walk_bytes()
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
        Some(SiteInfo::new(self.axis, Some(self.yarn)))
    }
}
