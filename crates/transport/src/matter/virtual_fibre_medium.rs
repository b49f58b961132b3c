//! Fibres of an octree that scatter as fibres: virtual scattering
//! [Schroeder2011].
//!
//! A collision is with a population in proportion to what it blocks, and with a
//! fibre of it in proportion to its visible cross-section. See [`VirtualFibreEvent`] for
//! what happens there.

mod event;
mod extinction;
mod site;

pub use event::VirtualFibreEvent;
pub use site::VirtualFibreSite;

use crate::matter::majorants::fibres_in_reach::{Densest, FibresInReach, broadside_per_mm};
use crate::matter::majorants::{BlockMajorants, VoxelMajorants, blocks_of};
use crate::matter::octree_medium::{OctreeLevel, OctreeMedium, Scatterer};
use crate::matter::packing::{PackingFactors, greatest_radius_mm};
use crate::matter::voxel_fibres::VoxelFibres;
use crate::{LocalVisibility, SiteInfo};
use glam::{IVec3, UVec3, Vec3};
use organza_basis::cell_grid::cell_below;
use organza_basis::{Aabb, CellGrid, FibrePopulation, LocalRay, PathRng, Rgb};
use organza_scatter::{Fibre, FibreFrame, Lobe, LobeSample, PackedEvent, meet_fibre};
use organza_volume::Octree;
use rayon::iter::ParallelIterator;
use site::Met;
use std::ops::Range;
use std::sync::Arc;

/// Voxels along the edge of a node with a majorant of its own, unless fibres are
/// thick: density varies inside yarns.
const NODE_VOXELS: u32 = 4;

/// Fibres of an octree level, met one by one. The cell grid is the octree's box, and
/// beside it the reach of fibres with their axes inside.
pub type VirtualFibreMedium = OctreeMedium<VirtualFibres>;

/// The fibres in the voxels of an octree level.
pub struct VirtualFibres {
    fibres: Vec<Fibre>,
    event: VirtualFibreEvent,
    /// By material; empty for the plain event, which does not ask.
    factors: Vec<PackingFactors>,
    /// Packed fibres with their density times the larger of their factors, which bounds
    /// the extinction of every ray.
    voxels: Box<VoxelFibres>,
    /// Voxels of the cell grid before the octree's first.
    pad: IVec3,
    voxels_per_mm: Vec3,
    node_edge: u32,
    densest: Vec<Densest>,
    /// Of blocks of voxels and of single voxels, and what is within reach; none of a cloth of
    /// blocks, where those of the octree hold.
    majorants: Option<(BlockMajorants, VoxelMajorants)>,
    local: Option<Box<LocalVisibility>>,
}

impl VirtualFibreMedium {
    /// The cloth at a level of detail (0 the finest). `fibres` is indexed by the
    /// octree's materials. Media of several levels may share one octree.
    ///
    /// `None` when the level does not exist, a material has no fibre, or packed fibres would
    /// reach from block to block.
    pub fn new(
        octree: impl Into<Arc<Octree>>,
        level: u8,
        fibres: Vec<Fibre>,
        event: VirtualFibreEvent,
    ) -> Option<VirtualFibreMedium> {
        let factors = PackingFactors::of_octree;
        VirtualFibreMedium::with_factors(octree.into(), level, fibres, event, factors)
    }

    /// The same with other packing factors, by material, than those of the octree.
    pub(crate) fn with_factors(
        octree: Arc<Octree>,
        level: u8,
        fibres: Vec<Fibre>,
        event: VirtualFibreEvent,
        factors: impl FnOnce(&Octree, u8) -> Vec<PackingFactors>,
    ) -> Option<VirtualFibreMedium> {
        if level >= octree.level_count() || fibres.len() < octree.material_count() {
            return None;
        }
        let is_of_blocks = octree.blocks().is_some();
        if is_of_blocks && event == VirtualFibreEvent::Packed {
            return None;
        }
        let outline = octree.outline_level(level);
        let voxel_mm = octree.voxel_mm(outline);
        let (factors, reach) = match event {
            VirtualFibreEvent::Plain => (Vec::new(), IVec3::ZERO),
            VirtualFibreEvent::Packed => {
                let radius_mm = greatest_radius_mm(&octree, level);
                // A thousandth more than the radius is room for rounding.
                let reach = (radius_mm / voxel_mm + 1e-3).ceil().as_ivec3();
                (factors(&octree, level), reach)
            }
        };
        let upright = IVec3::new(0, 0, reach.z);
        let pad = if octree.repeats() { upright } else { reach };
        let margin_mm = pad.as_vec3() * voxel_mm;
        let inner = octree.bounds_mm();
        let cell_grid = CellGrid::new(
            Aabb::new(inner.min - margin_mm, inner.max + margin_mm),
            octree.dims(outline) + 2 * pad.as_uvec3(),
            octree.repeats(),
        )?;
        let voxels = Box::new(VoxelFibres::new(&octree, level, |c| {
            let factors = factors.get(usize::from(c.material));
            factors.map_or(1.0, PackingFactors::largest)
        }));
        // At least twice the reach: bounds then cost no more than eight look-ups a voxel.
        let node_edge = NODE_VOXELS.max(2 * reach.max_element() as u32);
        let around = |node: UVec3| FibresInReach {
            voxels: &voxels,
            dims: cell_grid.dims().as_ivec3(),
            pad,
            reach,
            low: (node * node_edge).as_ivec3(),
            edge: node_edge as i32,
        };
        let (majorants, densest) = if is_of_blocks {
            (None, Vec::new())
        } else {
            let of_voxels = VoxelMajorants::new(cell_grid, reach, |cell| {
                broadside_per_mm(voxels.of(cell.as_ivec3() - pad))
            });
            let nodes = blocks_of(&cell_grid, node_edge);
            let (bounds_per_mm, densest) = nodes.map(|node| around(node).bound()).unzip();
            let of_nodes = BlockMajorants::of(&cell_grid, node_edge, bounds_per_mm);
            (Some((of_nodes, of_voxels)), densest)
        };
        let scatterer = VirtualFibres {
            fibres,
            event,
            factors,
            voxels,
            pad,
            voxels_per_mm: 1.0 / voxel_mm,
            node_edge,
            densest,
            majorants,
            local: None,
        };
        let level = OctreeLevel {
            octree,
            level,
            outline,
            cell_grid,
        };
        Some(OctreeMedium { level, scatterer })
    }

    /// The same with tables of local visibility, counted for its voxels.
    pub fn with_local_visibility(mut self, local: LocalVisibility) -> VirtualFibreMedium {
        self.scatterer.local = Some(Box::new(local));
        self
    }

    /// What a collision is.
    pub fn event(&self) -> VirtualFibreEvent {
        self.scatterer.event
    }

    /// Whether there are tables of local visibility.
    pub fn has_local_visibility(&self) -> bool {
        self.scatterer.local.is_some()
    }

    /// The fibres, by material.
    pub fn fibres(&self) -> &[Fibre] {
        &self.scatterer.fibres
    }

    /// The populations of a cell of its [grid](crate::Medium::cell_grid).
    pub fn populations_of(&self, cell: UVec3) -> &[FibrePopulation] {
        let VirtualFibres { voxels, pad, .. } = &self.scatterer;
        voxels.of(cell.as_ivec3() - *pad)
    }

    /// The factors on the extinction of each material's fibres; empty for the plain
    /// event, which has none.
    pub fn packing_factors(&self) -> &[PackingFactors] {
        &self.scatterer.factors
    }

    /// The densest population in a block of cells and around it.
    pub(crate) fn densest_around(&self, cell: UVec3) -> Densest {
        *self.scatterer.densest_of(&self.level.cell_grid, cell)
    }

    /// Radius of the thinnest fibres in mm; infinite where there are none.
    pub(crate) fn thinnest_mm(&self) -> f32 {
        let radii = self.scatterer.voxels.radii_mm();
        radii.fold(f32::INFINITY, f32::min)
    }

    /// Calls `visit` with the populations of a site and the extinction that a ray
    /// along `w` finds in each, per mm.
    pub(crate) fn for_each_extinction(
        &self,
        site: &VirtualFibreSite,
        w: Vec3,
        mut visit: impl FnMut(&FibrePopulation, f32),
    ) {
        for c in self.scatterer.populations(site) {
            visit(c, self.scatterer.extinction_per_mm(c, site, w));
        }
    }
}

impl VirtualFibres {
    /// Places of the populations at a local point.
    fn places(&self, p: Vec3) -> Range<u32> {
        self.voxels.places(cell_below(p) - self.pad)
    }

    /// Populations of a site.
    fn populations(&self, site: &VirtualFibreSite) -> &[FibrePopulation] {
        let [start, end] = site.places;
        self.voxels.at(&(start..end))
    }

    /// Axis and radius of the fibre that a ray may meet at `p`.
    fn expected(&self, grid: &CellGrid, p: Vec3, rng: &mut PathRng) -> (Vec3, f32) {
        let here = self.voxels.at(&self.places(p));
        let Some((last, before)) = here.split_last() else {
            let densest = self.densest_of(grid, grid.cell(p));
            return (densest.axis, densest.radius_mm);
        };
        let chosen = if before.is_empty() {
            last
        } else {
            let mut left = rng.unit() * broadside_per_mm(here);
            let found = before.iter().find(|c| {
                left -= c.broadside_per_mm();
                left < 0.0
            });
            found.unwrap_or(last)
        };
        (chosen.axis, chosen.radius_mm)
    }

    /// The densest population in the node of a cell and around it.
    fn densest_of(&self, grid: &CellGrid, cell: UVec3) -> &Densest {
        let (node, dims) = (cell / self.node_edge, grid.cell_dims(self.node_edge));
        let place = node.x + dims.x * (node.y + dims.y * node.z);
        &self.densest[place as usize]
    }

    /// The fibre of a population.
    fn fibre(&self, met: &Met) -> &Fibre {
        &self.fibres[usize::from(met.population.material)]
    }

    /// What `with` makes of the lobe of the fibre that was drawn; `none` where none was.
    fn with_lobe<T>(
        &self,
        site: &VirtualFibreSite,
        none: T,
        with: impl FnOnce(&dyn Lobe) -> T,
    ) -> T {
        let Some(met) = &site.met else {
            return none;
        };
        match met.near {
            None => with(&self.fibre(met).far_field(met.tangent)),
            Some(near) => with(&self.fibre(met).near_field_of(near)),
        }
    }
}

/// `eval`, `sample` and `pdf` are those of the fibre that [`Scatterer::draw_event`] drew:
/// without it there is none to scatter light.
impl Scatterer for VirtualFibres {
    type Site = VirtualFibreSite;

    fn site(&self, _: &OctreeLevel, cell: UVec3) -> VirtualFibreSite {
        VirtualFibreSite::new(self.voxels.places(cell.as_ivec3() - self.pad), 0.0, None)
    }

    fn is_empty(&self, site: &VirtualFibreSite) -> bool {
        let [start, end] = site.places;
        start == end
    }

    fn block_majorants(&self) -> Option<&BlockMajorants> {
        self.majorants.as_ref().map(|(blocks, _)| blocks)
    }

    fn is_piecewise_constant(&self) -> bool {
        self.event == VirtualFibreEvent::Plain
    }

    fn majorant_at(&self, p: Vec3) -> f32 {
        let of_voxels = self.majorants.as_ref();
        of_voxels.map_or(f32::INFINITY, |(_, voxels)| voxels.at(p))
    }

    fn meet(
        &self,
        level: &OctreeLevel,
        p: Vec3,
        ray: &LocalRay,
        rng: &mut PathRng,
    ) -> VirtualFibreSite {
        let grid = &level.cell_grid;
        if self.event == VirtualFibreEvent::Plain {
            return self.site(level, grid.cell(p));
        }
        let (axis, radius_mm) = self.expected(grid, p, rng);
        let event = PackedEvent::draw(Vec3::ZERO, -ray.direction, axis, radius_mm, rng);
        let at_axis = p + event.axis_mm() * self.voxels_per_mm;
        VirtualFibreSite::new(self.places(at_axis), event.offset, ray.left_yarn)
    }

    fn draw_event(
        &self,
        site: VirtualFibreSite,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> VirtualFibreSite {
        let populations = self.populations(&site);
        let met = match self.event {
            VirtualFibreEvent::Plain => meet_fibre(populations, w_out, rng),
            VirtualFibreEvent::Packed => meet_fibre(&self.seen(&site), w_out, rng),
        };
        let Some(met) = met else {
            return site;
        };
        let mut met = Met {
            population: populations[met.population],
            tangent: met.tangent,
            near: None,
        };
        if self.event == VirtualFibreEvent::Packed {
            let frame = FibreFrame::new(met.tangent, w_out);
            let near = self.fibre(&met).near_field(frame, site.offset);
            met.near = Some(*near.event());
        }
        VirtualFibreSite {
            met: Some(met),
            ..site
        }
    }

    fn exit_mm(
        &self,
        site: &VirtualFibreSite,
        _w_out: Vec3,
        w_in: Vec3,
        rng: &mut PathRng,
    ) -> Vec3 {
        let Some(Met {
            population,
            near: Some(near),
            ..
        }) = &site.met
        else {
            return Vec3::ZERO;
        };
        let fibre = &self.fibres[usize::from(population.material)];
        let near = fibre.near_field_of(*near);
        near.exit_mm(population.radius_mm, w_in, rng)
    }

    fn sigma_t(&self, site: &VirtualFibreSite, w: Vec3) -> f32 {
        let of = |c: &FibrePopulation| self.extinction_per_mm(c, site, w);
        self.populations(site).iter().map(of).sum()
    }

    fn eval(&self, site: &VirtualFibreSite, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.with_lobe(site, Rgb::BLACK, |lobe| lobe.eval(w_out, w_in))
    }

    fn sample(
        &self,
        site: &VirtualFibreSite,
        w_out: Vec3,
        rng: &mut PathRng,
    ) -> Option<LobeSample> {
        self.with_lobe(site, None, |lobe| lobe.sample(w_out, rng))
    }

    fn pdf(&self, site: &VirtualFibreSite, w_out: Vec3, w_in: Vec3) -> f32 {
        self.with_lobe(site, 0.0, |lobe| lobe.pdf(w_out, w_in))
    }

    fn local_visibility(
        &self,
        level: &OctreeLevel,
        site: &VirtualFibreSite,
        at_mm: Vec3,
        w_out: Vec3,
        w_in: Vec3,
    ) -> Option<(f32, f32)> {
        let (local, met) = (self.local.as_ref()?, site.met.as_ref()?);
        let bounds_mm = level.octree.bounds_mm();
        let mut p = at_mm - bounds_mm.min;
        if level.octree.repeats() {
            let period = bounds_mm.size();
            p.x = p.x.rem_euclid(period.x);
            p.y = p.y.rem_euclid(period.y);
        }
        let visible = local.at(met.population.material, met.tangent, w_in, w_out);
        Some((visible, local.to_face_mm(p, w_in)))
    }

    fn info(&self, site: &VirtualFibreSite) -> SiteInfo {
        site.met.map_or(SiteInfo::default(), |met| {
            SiteInfo::new(met.population.axis, Some(met.population.yarn))
        })
    }
}
