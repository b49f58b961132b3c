//! What the walk asks of any matter, once for a ray.

use crate::matter::collision::{AnySite, Collision};
use crate::matter::draping::{Draping, find, pass_through};
use crate::matter::level_choice::Tracking;
use crate::matter::site::MediumSite;
use crate::{Medium, Stats};
use glam::Vec2;
use organza_basis::{CellGrid, PathRng, Ray};

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

    /// The first collision along a ray before `limit` mm.
    fn collide(
        &self,
        ray: &Ray,
        limit: f64,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>>;

    /// Estimates the transmittance from a point to `reach` mm along a ray.
    fn pass(
        &self,
        ray: &Ray,
        reach: f64,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32;

    /// Whether it can fill a shell: it repeats, and asks for nothing but what straight
    /// lines meet.
    fn can_be_draped(&self) -> bool {
        false
    }

    /// Peak bytes of what the general walk builds when it first meets the matter.
    fn walk_bytes(&self) -> u64 {
        0
    }

    /// [`RayTarget::collide`] of what fills a shell.
    fn collide_draped(
        &self,
        _over: &Draping,
        _ray: &Ray,
        _limit: f64,
        _tracking: Tracking,
        _rng: &mut PathRng,
        _stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        None
    }

    /// [`RayTarget::pass`] of what fills a shell.
    fn pass_draped(
        &self,
        _over: &Draping,
        _ray: &Ray,
        _reach: f64,
        _tracking: Tracking,
        _rng: &mut PathRng,
        _stats: &mut Stats,
    ) -> f32 {
        1.0
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

    fn collide(
        &self,
        ray: &Ray,
        limit: f64,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let local = Medium::cell_grid(self).clip(ray, limit)?;
        let (t, site) = find(self, &local, tracking.integrator, rng, stats)?;
        let t = local.t_entry + f64::from(t);
        Some(Collision::new(t, located(self, site)))
    }

    fn pass(
        &self,
        ray: &Ray,
        reach: f64,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        let local = Medium::cell_grid(self).clip(ray, reach);
        local.map_or(1.0, |local| {
            pass_through(self, &local, tracking.integrator, rng, stats)
        })
    }

    fn can_be_draped(&self) -> bool {
        Medium::cell_grid(self).repeats()
    }

    fn collide_draped(
        &self,
        over: &Draping,
        ray: &Ray,
        limit: f64,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'_>> {
        let found = over.collide(self, ray, limit, tracking.integrator, rng, stats);
        found.map(|(t, site, turn)| Collision::turned(t, located(self, site), turn))
    }

    fn pass_draped(
        &self,
        over: &Draping,
        ray: &Ray,
        reach: f64,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        over.pass(self, ray, reach, tracking.integrator, rng, stats)
    }
}
