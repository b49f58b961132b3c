//! The kinds of matter in a scene.

use crate::matter::collision::{AnySite, Collision, Located, each_volume};
use crate::matter::draping::{Draping, find, pass_through};
use crate::matter::level_choice::Tracking;
use crate::{
    ExplicitFibres, FlakeOctreeMedium, GridMedium, Integrator, LevelledCloth, Medium, Plane,
    SggxOctreeMedium, Stats, VirtualFibreMedium,
};
use glam::Vec2;
use organza_basis::CellGrid;
use organza_basis::{PathRng, Ray};
use organza_scatter::{FlakeFamily, FlakeOptics};
use organza_volume::Octree;
use std::sync::Arc;

/// The closed set of matter, resolved once per ray.
pub enum AnyMedium {
    /// Dense grids.
    Grid(GridMedium),
    /// An octree of fibres, seen as specular SGGX micro-flakes.
    SggxOctree(SggxOctreeMedium),
    /// An octree of fibres, seen as micro-flakes of any other family.
    FlakeOctree(FlakeOctreeMedium),
    /// An octree of fibres that scatter as virtual fibres.
    VirtualFibres(VirtualFibreMedium),
    /// Every fibre as a curve that rays intersect.
    ExplicitFibres(ExplicitFibres),
    /// A cloth in several representations, or over a mesh.
    Levelled(Box<LevelledCloth>),
    /// No medium but an opaque plane.
    Plane(Plane),
}

impl AnyMedium {
    /// A level of an octree as micro-flakes of a family; `None` when the level does
    /// not exist or a material has no optics.
    pub fn of_flakes(
        octree: impl Into<Arc<Octree>>,
        level: u8,
        optics: Vec<FlakeOptics>,
        family: FlakeFamily,
    ) -> Option<AnyMedium> {
        if family == FlakeFamily::SGGX_SPECULAR {
            return SggxOctreeMedium::new(octree, level, optics).map(AnyMedium::SggxOctree);
        }
        FlakeOctreeMedium::new(octree, level, optics, family).map(AnyMedium::FlakeOctree)
    }

    /// Where the medium is; `None` for a plane, which has no box.
    pub fn cell_grid(&self) -> Option<&CellGrid> {
        each_volume!(AnyMedium, self, (m) => Some(m.cell_grid()),
            AnyMedium::ExplicitFibres(m) => Some(m.cell_grid()),
            AnyMedium::Levelled(m) => Some(m.cell_grid()),
            AnyMedium::Plane(_) => None,
        )
    }

    /// Cuts a medium to a rectangle of the x-y plane ([`CellGrid::cut_to`]).
    /// `None` when nothing would be left, or it is a plane or over a mesh.
    pub fn cut_to(&mut self, min_mm: Vec2, max_mm: Vec2) -> Option<()> {
        let cell_grid = each_volume!(AnyMedium, self, (m) => m.cell_grid_mut(),
            AnyMedium::ExplicitFibres(m) => m.cell_grid_mut(),
            AnyMedium::Levelled(m) => return m.cut_to(min_mm, max_mm),
            AnyMedium::Plane(_) => return None,
        );
        *cell_grid = cell_grid.cut_to(min_mm, max_mm)?;
        Some(())
    }

    /// True when exact stepping is possible.
    pub fn is_piecewise_constant(&self) -> bool {
        each_volume!(AnyMedium, self, (m) => m.is_piecewise_constant(),
            AnyMedium::Levelled(m) => m.is_piecewise_constant(),
            // What is solid takes no stepping.
            AnyMedium::ExplicitFibres(_) | AnyMedium::Plane(_) => true,
        )
    }

    /// The first collision along a ray before `limit` mm.
    pub(crate) fn collide(
        &self,
        ray: &Ray,
        limit: f32,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let by = tracking.integrator;
        let (t, site) = each_volume!(AnyMedium, self,
            (m) => collide(m, ray, limit, by, rng, stats).map(|(t, s)| (t, m.located(s))),
            AnyMedium::ExplicitFibres(m) => m
                .first_hit(ray, limit, stats)
                .map(|(t, s)| (t, AnySite::ExplicitFibres(m, s))),
            AnyMedium::Levelled(m) => return m.collide(ray, limit, tracking, rng, stats),
            AnyMedium::Plane(p) => p.hit(ray, limit).map(|t| (t, AnySite::Plane(p, ray.at(t)))),
        )?;
        Some(Collision::new(t, site))
    }

    /// Estimates the transmittance from a point to `reach` mm along a ray.
    pub(crate) fn pass(
        &self,
        ray: &Ray,
        reach: f32,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        let by = tracking.integrator;
        each_volume!(AnyMedium, self, (m) => pass(m, ray, reach, by, rng, stats),
            AnyMedium::ExplicitFibres(m) => f32::from(!m.blocks(ray, reach, stats)),
            AnyMedium::Levelled(m) => m.pass(ray, reach, tracking, rng, stats),
            AnyMedium::Plane(p) => f32::from(p.hit(ray, reach).is_none()),
        )
    }

    /// Whether the medium can fill a shell: it repeats, and asks for nothing
    /// but what straight lines meet.
    pub(crate) fn can_be_draped(&self) -> bool {
        each_volume!(AnyMedium, self, (m) => m.cell_grid().repeats(),
            AnyMedium::ExplicitFibres(m) => m.cell_grid().repeats(),
            AnyMedium::Levelled(_) | AnyMedium::Plane(_) => false,
        )
    }

    /// [`AnyMedium::collide`] of a medium that fills a shell.
    pub(crate) fn collide_draped(
        &self,
        over: &Draping,
        ray: &Ray,
        limit: f32,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let by = tracking.integrator;
        each_volume!(AnyMedium, self,
            (m) => over
                .collide(m, ray, limit, by, rng, stats)
                .map(|(t, s, turn)| Collision::turned(t, m.located(s), turn)),
            AnyMedium::ExplicitFibres(m) => m.first_draped_hit(over, ray, limit, stats).map(|h| {
                let site = AnySite::ExplicitFibres(m, h.hit);
                Collision::stretched(h.distance_mm, site, h.world_from_cloth, h.stretch)
            }),
            AnyMedium::Levelled(_) | AnyMedium::Plane(_) => None,
        )
    }

    /// [`AnyMedium::pass`] of a medium that fills a shell.
    pub(crate) fn pass_draped(
        &self,
        over: &Draping,
        ray: &Ray,
        reach: f32,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        let by = tracking.integrator;
        each_volume!(AnyMedium, self, (m) => over.pass(m, ray, reach, by, rng, stats),
            AnyMedium::ExplicitFibres(m) => f32::from(!m.blocks_draped(over, ray, reach, stats)),
            AnyMedium::Levelled(_) | AnyMedium::Plane(_) => 1.0,
        )
    }
}

fn collide<M: Medium>(
    medium: &M,
    ray: &Ray,
    limit: f32,
    integrator: Integrator,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> Option<(f32, M::Site)> {
    let local = medium.cell_grid().clip(ray, limit)?;
    find(medium, &local, integrator, rng, stats).map(|(t, site)| (local.t_entry + t, site))
}

fn pass<M: Medium>(
    medium: &M,
    ray: &Ray,
    reach: f32,
    integrator: Integrator,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> f32 {
    let local = medium.cell_grid().clip(ray, reach);
    local.map_or(1.0, |local| {
        pass_through(medium, &local, integrator, rng, stats)
    })
}
