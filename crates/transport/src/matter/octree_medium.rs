//! A medium from one level of an octree of fibres, whatever scatters there.

use crate::matter::majorants::BlockMajorants;
use crate::matter::majorants::octree_majorants::for_each_octree_span;
use crate::{Medium, SiteInfo};
use glam::{UVec3, Vec3};
use organza_basis::{CellGrid, CellSpan, LocalRay, PathRng, Rgb};
use organza_scatter::LobeSample;
use organza_volume::Octree;
use std::ops::ControlFlow;
use std::sync::Arc;

/// One level of an octree, and the grid that a tracker walks over it.
pub struct OctreeLevel {
    /// The octree.
    pub octree: Arc<Octree>,
    /// Level of detail, 0 the finest.
    pub level: u8,
    /// The level of the cells that paths walk in: that of [`Octree::outline_level`] where
    /// coarse cells keep the outline of their matter, else `level`.
    pub outline: u8,
    /// The cells of the level of outlines, with a margin where matter reaches beyond its
    /// voxels.
    pub cell_grid: CellGrid,
}

/// What scatters light at the sites of an octree. Methods with a body are those of
/// most; see [`Medium`] for what each of them means.
pub trait Scatterer: Sync {
    /// What one look-up gives.
    type Site: Copy + Send;

    /// What lies in a cell of the grid.
    fn site(&self, level: &OctreeLevel, cell: UVec3) -> Self::Site;

    /// Whether there is nothing.
    fn is_empty(&self, site: &Self::Site) -> bool;

    /// Majorants of its own; without them those of the octree hold.
    fn block_majorants(&self) -> Option<&BlockMajorants> {
        None
    }

    /// See [`Medium::is_piecewise_constant`].
    fn is_piecewise_constant(&self) -> bool {
        true
    }

    /// See [`Medium::majorant_at`].
    fn majorant_at(&self, _p: Vec3) -> f32 {
        f32::INFINITY
    }

    /// See [`Medium::meet`].
    fn meet(
        &self,
        level: &OctreeLevel,
        p: Vec3,
        _ray: &LocalRay,
        _rng: &mut PathRng,
    ) -> Self::Site {
        self.site(level, level.cell_grid.cell(p))
    }

    /// See [`Medium::draw_event`].
    fn draw_event(&self, site: Self::Site, _w_out: Vec3, _rng: &mut PathRng) -> Self::Site {
        site
    }

    /// See [`Medium::exit_mm`].
    fn exit_mm(&self, _site: &Self::Site, _w_out: Vec3, _w_in: Vec3, _rng: &mut PathRng) -> Vec3 {
        Vec3::ZERO
    }

    /// See [`Medium::sigma_t`].
    fn sigma_t(&self, site: &Self::Site, w: Vec3) -> f32;

    /// See [`Medium::eval`].
    fn eval(&self, site: &Self::Site, w_out: Vec3, w_in: Vec3) -> Rgb;

    /// See [`Medium::sample`].
    fn sample(&self, site: &Self::Site, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample>;

    /// See [`Medium::pdf`].
    fn pdf(&self, site: &Self::Site, w_out: Vec3, w_in: Vec3) -> f32;

    /// See [`Medium::local_visibility`].
    fn local_visibility(
        &self,
        _level: &OctreeLevel,
        _site: &Self::Site,
        _at_mm: Vec3,
        _w_out: Vec3,
        _w_in: Vec3,
    ) -> Option<(f32, f32)> {
        None
    }

    /// See [`Medium::info`].
    fn info(&self, site: &Self::Site) -> SiteInfo;
}

/// Fibres of an octree level, scattering as `P` does.
pub struct OctreeMedium<P> {
    pub(crate) level: OctreeLevel,
    pub(crate) scatterer: P,
}

impl<P> OctreeMedium<P> {
    /// The octree.
    pub fn octree(&self) -> &Octree {
        &self.level.octree
    }

    /// The level of detail, 0 the finest.
    pub fn level(&self) -> u8 {
        self.level.level
    }

    pub(crate) fn cell_grid_mut(&mut self) -> &mut CellGrid {
        &mut self.level.cell_grid
    }
}

impl<P: Scatterer> Medium for OctreeMedium<P> {
    type Site = P::Site;

    fn cell_grid(&self) -> &CellGrid {
        &self.level.cell_grid
    }

    fn for_each_span<B>(
        &self,
        ray: &LocalRay,
        visit: impl FnMut(&CellSpan, f32) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let OctreeLevel {
            octree,
            level,
            outline,
            cell_grid,
        } = &self.level;
        match self.scatterer.block_majorants() {
            Some(majorants) => majorants.for_each_span(cell_grid, ray, visit),
            None => for_each_octree_span(octree, (*level, *outline), cell_grid, ray, visit),
        }
    }

    fn for_each_voxel<B>(
        &self,
        ray: &LocalRay,
        mut visit: impl FnMut(f32, f32, P::Site) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let cell_grid = &self.level.cell_grid;
        let mut visit_cell = |from: f32, span: &CellSpan| {
            let site = self.scatterer.site(&self.level, span.cell);
            if self.scatterer.is_empty(&site) {
                return ControlFlow::Continue(());
            }
            visit(from + span.t0, from + span.t1, site)
        };
        if self.scatterer.block_majorants().is_some() {
            for span in cell_grid.cells(ray, 1) {
                visit_cell(0.0, &span)?;
            }
            return ControlFlow::Continue(());
        }
        // Node by node, so that a stretch of air costs one step.
        self.for_each_span(ray, |node, _| {
            let within = LocalRay {
                origin: node.point(ray, node.t0),
                length: node.t1 - node.t0,
                ..*ray
            };
            for span in cell_grid.cells(&within, 1) {
                visit_cell(node.t0, &span)?;
            }
            ControlFlow::Continue(())
        })
    }

    fn is_piecewise_constant(&self) -> bool {
        self.scatterer.is_piecewise_constant()
    }

    fn site(&self, p: Vec3) -> P::Site {
        let cell = self.level.cell_grid.cell(p);
        self.scatterer.site(&self.level, cell)
    }

    fn majorant_at(&self, p: Vec3) -> f32 {
        self.scatterer.majorant_at(p)
    }

    fn meet(&self, p: Vec3, ray: &LocalRay, rng: &mut PathRng) -> P::Site {
        self.scatterer.meet(&self.level, p, ray, rng)
    }

    fn draw_event(&self, site: P::Site, w_out: Vec3, rng: &mut PathRng) -> P::Site {
        self.scatterer.draw_event(site, w_out, rng)
    }

    fn exit_mm(&self, site: &P::Site, w_out: Vec3, w_in: Vec3, rng: &mut PathRng) -> Vec3 {
        self.scatterer.exit_mm(site, w_out, w_in, rng)
    }

    fn sigma_t(&self, site: &P::Site, w: Vec3) -> f32 {
        self.scatterer.sigma_t(site, w)
    }

    fn eval(&self, site: &P::Site, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.scatterer.eval(site, w_out, w_in)
    }

    fn sample(&self, site: &P::Site, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        self.scatterer.sample(site, w_out, rng)
    }

    fn pdf(&self, site: &P::Site, w_out: Vec3, w_in: Vec3) -> f32 {
        self.scatterer.pdf(site, w_out, w_in)
    }

    fn local_visibility(
        &self,
        site: &P::Site,
        at_mm: Vec3,
        w_out: Vec3,
        w_in: Vec3,
    ) -> Option<(f32, f32)> {
        let level = &self.level;
        self.scatterer
            .local_visibility(level, site, at_mm, w_out, w_in)
    }

    fn info(&self, site: &P::Site) -> SiteInfo {
        self.scatterer.info(site)
    }
}
