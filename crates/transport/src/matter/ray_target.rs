//! What the walk asks of any matter, once for a ray.

use crate::matter::collision::{AnySite, Collision, Met};
use crate::matter::draping::{Draping, find, pass_through};
use crate::matter::level_choice::Tracking;
use crate::matter::site::MediumSite;
use crate::{Medium, Stats};
use glam::Vec2;
use organza_basis::{CellGrid, PathRng, Ray};

/// A ray, how far it is followed, and how.
#[derive(Clone, Copy)]
pub(crate) struct Query<'a> {
    pub ray: &'a Ray,
    pub reach_mm: f64,
    pub tracking: Tracking,
    /// What the matter is laid over, if it is not flat.
    pub over: Option<&'a Draping>,
}

/// Matter that a ray can meet: media, explicit fibres, planes and cloths of several of
/// them.
pub(crate) trait RayTarget: Sync {
    /// Where it is; `None` for what has no box.
    fn cell_grid(&self) -> Option<&CellGrid>;

    /// Cuts it to a rectangle of the x-y plane ([`CellGrid::cut_to`]); `None` when nothing
    /// would be left, or it cannot be cut.
    fn cut_to(&mut self, min_mm: Vec2, max_mm: Vec2) -> Option<()>;

    /// True when exact stepping is possible, or nothing is stepped through.
    fn is_piecewise_constant(&self) -> bool;

    /// The first collision that a query finds.
    fn collide(&self, query: Query<'_>, rng: &mut PathRng, stats: &mut Stats) -> Met<'_>;

    /// Estimates the transmittance along a query.
    fn pass(&self, query: Query<'_>, rng: &mut PathRng, stats: &mut Stats) -> f32;

    /// Whether it can fill a shell: it repeats, and asks for nothing but what straight
    /// lines meet.
    fn can_be_draped(&self) -> bool {
        false
    }

    /// Peak bytes of what the general walk builds when it first meets the matter.
    fn walk_bytes(&self) -> u64 {
        0
    }
}

/// A medium with its own variant of [`AnySite`].
pub(crate) trait SceneMedium: Medium {
    /// Its grid, to be cut.
    fn cell_grid_mut(&mut self) -> &mut CellGrid;

    /// One of its sites among those of all matter.
    fn any_site(site: MediumSite<'_, Self>) -> AnySite<'_>
    where
        Self: Sized;
}

fn located<M: SceneMedium>(medium: &M, site: M::Site) -> AnySite<'_> {
    M::any_site(MediumSite { medium, site })
}

impl<M: SceneMedium> RayTarget for M {
    fn cell_grid(&self) -> Option<&CellGrid> {
        Some(Medium::cell_grid(self))
    }

    fn cut_to(&mut self, min_mm: Vec2, max_mm: Vec2) -> Option<()> {
        let cell_grid = self.cell_grid_mut();
        *cell_grid = cell_grid.cut_to(min_mm, max_mm)?;
        Some(())
    }

    fn is_piecewise_constant(&self) -> bool {
        Medium::is_piecewise_constant(self)
    }

    fn collide(&self, query: Query<'_>, rng: &mut PathRng, stats: &mut Stats) -> Met<'_> {
        let (ray, integrator) = (query.ray, query.tracking.integrator);
        if let Some(over) = query.over {
            let found = over.collide(self, ray, query.reach_mm, integrator, rng, stats);
            return found.map(|(t, site, turn)| Collision::turned(t, located(self, site), turn));
        }
        let local = Medium::cell_grid(self).clip(ray, query.reach_mm)?;
        let (t, site) = find(self, &local, integrator, rng, stats)?;
        let t = local.t_entry + f64::from(t);
        Some(Collision::new(t, located(self, site)))
    }

    fn pass(&self, query: Query<'_>, rng: &mut PathRng, stats: &mut Stats) -> f32 {
        let (ray, integrator) = (query.ray, query.tracking.integrator);
        if let Some(over) = query.over {
            return over.pass(self, ray, query.reach_mm, integrator, rng, stats);
        }
        let local = Medium::cell_grid(self).clip(ray, query.reach_mm);
        local.map_or(1.0, |local| {
            pass_through(self, &local, integrator, rng, stats)
        })
    }

    fn can_be_draped(&self) -> bool {
        Medium::cell_grid(self).repeats()
    }
}
