//! Explicit fibres as a ray meets them.

use crate::matter::collision::{AnySite, Collision, Met};
use crate::matter::ray_target::{Query, RayTarget};
use crate::matter::site::Site;
use crate::{ExplicitFibres, FibreHit, SiteInfo, Stats};
use glam::{Vec2, Vec3};
use organza_basis::{CellGrid, PathRng, Rgb};
use organza_scatter::{Lobe, LobeSample};

/// Where a fibre is hit.
pub(crate) struct ExplicitFibreSite<'a> {
    pub fibres: &'a ExplicitFibres,
    pub hit: FibreHit,
}

impl RayTarget for ExplicitFibres {
    fn cell_grid(&self) -> Option<&CellGrid> {
        Some(self.cell_grid())
    }

    fn cut_to(&mut self, min_mm: Vec2, max_mm: Vec2) -> Option<()> {
        let cell_grid = self.cell_grid_mut();
        *cell_grid = cell_grid.cut_to(min_mm, max_mm)?;
        Some(())
    }

    fn is_piecewise_constant(&self) -> bool {
        true
    }

    fn collide(&self, query: Query<'_>, _rng: &mut PathRng, stats: &mut Stats) -> Met<'_> {
        let (ray, limit) = (query.ray, query.reach_mm);
        if let Some(over) = query.over {
            let met = self.first_draped_hit(over, ray, limit, stats)?;
            let (fibres, hit) = (self, met.hit);
            let site = AnySite::ExplicitFibres(ExplicitFibreSite { fibres, hit });
            let (turn, stretch) = (met.world_from_cloth, met.stretch);
            return Some(Collision::stretched(met.distance_mm, site, turn, stretch));
        }
        let (t, hit) = self.first_hit(ray, limit, stats)?;
        let site = ExplicitFibreSite { fibres: self, hit };
        Some(Collision::new(t, AnySite::ExplicitFibres(site)))
    }

    fn pass(&self, query: Query<'_>, _rng: &mut PathRng, stats: &mut Stats) -> f32 {
        let (ray, reach) = (query.ray, query.reach_mm);
        f32::from(!match query.over {
            Some(over) => self.blocks_draped(over, ray, reach, stats),
            None => self.blocks(ray, reach, stats),
        })
    }

    fn can_be_draped(&self) -> bool {
        self.cell_grid().repeats()
    }

    fn walk_bytes(&self) -> u64 {
        self.walk_bytes()
    }
}

impl Site for ExplicitFibreSite<'_> {
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.fibres.near(&self.hit).eval(w_out, w_in)
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        self.fibres.near(&self.hit).sample(w_out, rng)
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        self.fibres.near(&self.hit).pdf(w_out, w_in)
    }

    fn exit_mm(&self, _w_out: Vec3, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        self.fibres.exit_mm(&self.hit, w_in, rng)
    }

    fn info(&self) -> Option<SiteInfo> {
        Some(self.fibres.info(&self.hit))
    }
}
