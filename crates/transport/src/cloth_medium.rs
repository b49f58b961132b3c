//! A medium from an octree of fibres: every population of fibres in a voxel
//! scatters as SGGX micro-flakes.

use crate::lattice::{CellSpan, Lattice, LocalRay};
use crate::{Medium, SiteInfo};
use glam::Vec3;
use organza_basis::{FibreComponent, Mixture, PathRng, Rgb, spread};
use organza_scatter::{AxialFlake, LobeSample, MicroFlake};
use organza_volume::Octree;
use std::ops::ControlFlow;

/// Levels between a voxel and the node whose majorant a span uses: 4 voxels
/// along an edge, because the density of cloth varies inside yarns.
const NODE_LEVELS: u8 = 2;

/// How the fibres of one material scatter as micro-flakes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FlakeOptics {
    /// Single-scattering albedo, each channel in `[0, 1]`.
    pub albedo: Rgb,
    /// Ratio of end-on to broadside extinction of a straight bundle, from the
    /// roughness of single fibres; a voxel's spread adds to it.
    pub end_on_ratio: f32,
}

/// Broadside area and end-on ratio of SGGX flakes against spread, tabulated:
/// the quadrature behind them has no place at a look-up.
struct FlakeTable {
    rows: Vec<(f32, f32)>,
}

impl FlakeTable {
    /// Rows in `s / (1 + s)`, which takes every spread into `[0, 1)`; linear
    /// interpolation between 512 of them is exact to 1e-4, below what a
    /// voxel's quantised spread is.
    const ROWS: usize = 512;

    fn new() -> FlakeTable {
        let rows = (0..=Self::ROWS)
            .map(|i| {
                let u = (i as f32 / Self::ROWS as f32).min(1.0 - 1e-6);
                let (across, along) = spread::sggx_across_along(u / (1.0 - u));
                (across.sqrt(), (along / across).sqrt())
            })
            .collect();
        FlakeTable { rows }
    }

    fn look_up(&self, spread_rad: f32) -> (f32, f32) {
        let u = spread_rad / (1.0 + spread_rad) * Self::ROWS as f32;
        let i = (u as usize).min(Self::ROWS - 1);
        let (a, b, f) = (self.rows[i], self.rows[i + 1], u - i as f32);
        (a.0 + f * (b.0 - a.0), a.1 + f * (b.1 - a.1))
    }
}

/// Fibres of an octree level as specular SGGX flakes.
pub struct ClothMedium {
    octree: Octree,
    level: u8,
    optics: Vec<FlakeOptics>,
    flakes: FlakeTable,
    lattice: Lattice,
}

impl ClothMedium {
    /// The cloth at a level of detail (0 the finest). `optics` is indexed by
    /// the octree's materials.
    ///
    /// `None` when the level does not exist or a material has no optics.
    pub fn new(octree: Octree, level: u8, optics: Vec<FlakeOptics>) -> Option<ClothMedium> {
        if level >= octree.level_count() || optics.len() < octree.material_count() {
            return None;
        }
        let lattice = Lattice::new(octree.bounds_mm(), octree.dims(level), octree.repeats())?;
        Some(ClothMedium {
            octree,
            level,
            optics,
            flakes: FlakeTable::new(),
            lattice,
        })
    }

    pub(crate) fn lattice_mut(&mut self) -> &mut Lattice {
        &mut self.lattice
    }

    /// The octree.
    pub fn octree(&self) -> &Octree {
        &self.octree
    }

    /// Extinction of one population toward `w`, without building its flake:
    /// `sqrt(e^2 + (1 - e^2) sin^2)` times the broadside value.
    fn extinction(&self, c: &FibreComponent, w: Vec3) -> f32 {
        let (broadside, end_on) = self.flake_shape(c);
        let along = c.axis.dot(w);
        let sin_sq = (1.0 - along * along).max(0.0);
        let area = (end_on * end_on * (1.0 - sin_sq) + sin_sq).sqrt();
        c.broadside_per_mm() * broadside * area
    }

    fn flake_shape(&self, c: &FibreComponent) -> (f32, f32) {
        let (broadside, end_on) = self.flakes.look_up(c.spread_rad);
        let floor = self.optics[usize::from(c.material)].end_on_ratio;
        (broadside, end_on.max(floor))
    }

    fn flake(&self, c: &FibreComponent) -> AxialFlake {
        AxialFlake::new(c.axis, self.flake_shape(c).1)
    }

    /// Albedo times phase, and phase, of the mixture: each population weighs
    /// as much as it extinguishes toward `w_out`.
    fn mix(&self, site: &Mixture, w_out: Vec3, w_in: Vec3) -> (Rgb, f32) {
        let (mut value, mut pdf, mut total) = (Rgb::BLACK, 0.0, 0.0);
        for c in site.as_slice() {
            let sigma = self.extinction(c, w_out);
            let phase = sigma * self.flake(c).eval(w_out, w_in);
            value += self.optics[usize::from(c.material)].albedo * phase;
            pdf += phase;
            total += sigma;
        }
        if total > 0.0 {
            (value / total, pdf / total)
        } else {
            (Rgb::BLACK, 0.0)
        }
    }
}

impl Medium for ClothMedium {
    type Site = Mixture;

    fn lattice(&self) -> &Lattice {
        &self.lattice
    }

    fn for_each_span<B>(
        &self,
        ray: &LocalRay,
        mut visit: impl FnMut(&CellSpan, f32) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let top = self.octree.level_count() - 1;
        let node_level = (self.level + NODE_LEVELS).min(top);
        let edge = 1 << (node_level - self.level);
        for span in self.lattice.cells(ray, edge) {
            let majorant = self.octree.majorant_per_mm(node_level, span.cell);
            if majorant > 0.0 {
                visit(&span, majorant)?;
            }
        }
        ControlFlow::Continue(())
    }

    fn for_each_voxel<B>(
        &self,
        ray: &LocalRay,
        mut visit: impl FnMut(f32, f32, Mixture) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        for span in self.lattice.cells(ray, 1) {
            let site = self.octree.mixture(self.level, span.cell);
            if !site.is_empty() {
                visit(span.t0, span.t1, site)?;
            }
        }
        ControlFlow::Continue(())
    }

    fn is_piecewise_constant(&self) -> bool {
        true
    }

    fn site(&self, p: Vec3) -> Mixture {
        self.octree.mixture(self.level, self.lattice.cell(p))
    }

    fn sigma_t(&self, site: &Mixture, w: Vec3) -> f32 {
        site.as_slice().iter().map(|c| self.extinction(c, w)).sum()
    }

    fn eval(&self, site: &Mixture, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.mix(site, w_out, w_in).0
    }

    fn sample(&self, site: &Mixture, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        // A population is met in proportion to its extinction toward the walk.
        let mut left = rng.unit() * self.sigma_t(site, w_out);
        let (last, before) = site.as_slice().split_last()?;
        let chosen = before
            .iter()
            .find(|c| {
                left -= self.extinction(c, w_out);
                left < 0.0
            })
            .unwrap_or(last);
        let w_in = self.flake(chosen).sample(w_out, rng);
        let (value, pdf) = self.mix(site, w_out, w_in);
        (pdf > 0.0).then(|| LobeSample {
            w_in,
            weight: value / pdf,
            pdf,
        })
    }

    fn pdf(&self, site: &Mixture, w_out: Vec3, w_in: Vec3) -> f32 {
        self.mix(site, w_out, w_in).1
    }

    fn info(&self, site: &Mixture) -> SiteInfo {
        let densest = site
            .as_slice()
            .iter()
            .max_by(|a, b| a.broadside_per_mm().total_cmp(&b.broadside_per_mm()));
        densest.map_or(SiteInfo::default(), |c| SiteInfo {
            axis: c.axis,
            yarn: Some(c.yarn),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_flake_table_is_the_quadrature() {
        let table = FlakeTable::new();
        for i in 0..400 {
            let s = 0.0123 * i as f32;
            let (across, along) = spread::sggx_across_along(s);
            let (broadside, end_on) = table.look_up(s);
            assert!((broadside - across.sqrt()).abs() < 1e-4, "{s}");
            assert!((end_on - (along / across).sqrt()).abs() < 1e-4, "{s}");
        }
    }
}
