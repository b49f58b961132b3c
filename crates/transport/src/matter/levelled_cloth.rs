//! A cloth in several representations: volumes from fine to coarse, and last a
//! sheet.

use crate::matter::collision::{AnySite, Collision, Met};
use crate::matter::draping::Draping;
use crate::matter::level_choice::{Detail, LevelSteps};
use crate::matter::ray_target::{Query, RayTarget};
use crate::matter::sheet::SheetSite;
use crate::{AnyMedium, PixelCone, Stats};
use glam::{DVec3, UVec3, Vec2, Vec3};
use organza_basis::{Aabb, CellGrid, Frame, PathRng, Ray};
use organza_mesh::Shell;
use organza_scatter::Surface;
use std::sync::Arc;

/// A cloth of which every path meets one representation, the one that suits the
/// width of its pixel: endless and flat, or over a mesh.
pub struct LevelledCloth {
    /// Finest first.
    volumes: Vec<AnyMedium>,
    sheet: Option<Box<dyn Surface>>,
    steps: LevelSteps,
    /// The box of one period, of which the sheet is the middle, or the box
    /// around a draping.
    cell_grid: CellGrid,
    draping: Option<Draping>,
}

impl LevelledCloth {
    /// An endless flat cloth. `volumes`, finest first, then `sheet`: one more
    /// than there are `steps` between them. `cell_grid` is the box of the cloth;
    /// the sheet lies half way up in it.
    ///
    /// `None` when the numbers do not match.
    pub fn new(
        volumes: Vec<AnyMedium>,
        sheet: Option<Box<dyn Surface>>,
        steps: LevelSteps,
        cell_grid: CellGrid,
    ) -> Option<LevelledCloth> {
        let count = volumes.len() + usize::from(sheet.is_some());
        (count == steps.count()).then_some(LevelledCloth {
            volumes,
            sheet,
            steps,
            cell_grid,
            draping: None,
        })
    }

    /// A cloth over a mesh; its volumes fill the shell and repeat without end.
    ///
    /// `None` when the numbers do not match, a volume is none that repeats, or
    /// there are volumes and no shell for them.
    pub fn draped(
        volumes: Vec<AnyMedium>,
        sheet: Option<Box<dyn Surface>>,
        steps: LevelSteps,
        draping: Draping,
    ) -> Option<LevelledCloth> {
        // A flat mesh has a box without volume.
        let (low, high) = draping.bounds_mm();
        let bounds = Aabb::new(low.as_vec3(), high.as_vec3());
        let farthest_mm = bounds.min.abs().max(bounds.max.abs()).max_element();
        let rounding_mm = f32::EPSILON * farthest_mm;
        let bounds = bounds.grown(1e-4 * bounds.size().length() + rounding_mm);
        let cell_grid = CellGrid::new(bounds, UVec3::ONE, false)?;
        let good = volumes.iter().all(|v| v.target().can_be_draped())
            && (volumes.is_empty() || draping.shell().is_some());
        let flat = LevelledCloth::new(volumes, sheet, steps, cell_grid)?;
        good.then_some(LevelledCloth {
            draping: Some(draping),
            ..flat
        })
    }

    /// The number of representations.
    pub(crate) fn representation_count(&self) -> usize {
        self.steps.count()
    }

    /// The volume that is the representation of this number, and the shell that it fills;
    /// `None` of the sheet.
    pub(crate) fn part(&self, level: usize) -> Option<(&AnyMedium, Option<&Arc<Shell>>)> {
        let volume = self.volumes.get(level)?;
        Some((volume, self.draping.as_ref().and_then(Draping::shell)))
    }

    /// The number of the representation that a path meets.
    pub(crate) fn level_of(&self, detail: Detail) -> usize {
        self.steps.choose(detail)
    }

    /// Width of a pixel where its ray comes to the cloth; `None` for a miss.
    pub(crate) fn footprint_mm(
        &self,
        cone: PixelCone,
        origin_mm: DVec3,
        direction: DVec3,
    ) -> Option<f64> {
        let to_box = self.cell_grid.distance_mm(origin_mm, direction);
        if !to_box.is_finite() {
            return None;
        }
        let beyond = match &self.draping {
            None => 0.0,
            Some(draping) => {
                let at_box = origin_mm + to_box * direction;
                draping.distance_mm((at_box, direction))?
            }
        };
        Some(cone.width_at_mm(to_box + beyond))
    }

    fn volume(&self, detail: Detail) -> Option<&AnyMedium> {
        self.volumes.get(self.steps.choose(detail))
    }

    fn sheet_z_mm(&self) -> f64 {
        f64::from(self.cell_grid.bounds_mm().centre().z)
    }

    fn sheet_distance_mm(&self, ray: &Ray) -> Option<f64> {
        let t = (self.sheet_z_mm() - ray.origin.z) / f64::from(ray.direction.z);
        // A ray in the plane of the sheet meets its edge at most: nothing.
        let reach_mm = self.cell_grid.reach_mm();
        let is_met = t > 0.0 && t.is_finite() && reach_mm.contains(ray.at(t).as_vec3());
        is_met.then_some(t)
    }
}

impl RayTarget for LevelledCloth {
    /// The box of one period, or around everything that is draped.
    fn cell_grid(&self) -> Option<&CellGrid> {
        Some(&self.cell_grid)
    }

    /// `None` of what lies over a mesh, too.
    fn cut_to(&mut self, min_mm: Vec2, max_mm: Vec2) -> Option<()> {
        if self.draping.is_some() {
            return None;
        }
        self.cell_grid = self.cell_grid.cut_to(min_mm, max_mm)?;
        self.volumes
            .iter_mut()
            .try_for_each(|v| v.cut_to(min_mm, max_mm))
    }

    fn is_piecewise_constant(&self) -> bool {
        self.volumes.iter().all(AnyMedium::is_piecewise_constant)
    }

    fn walk_bytes(&self) -> u64 {
        let volumes = self.volumes.iter().map(|v| v.target().walk_bytes());
        volumes.fold(0, u64::saturating_add)
    }

    fn collide(&self, query: Query<'_>, rng: &mut PathRng, stats: &mut Stats) -> Met<'_> {
        if let Some(volume) = self.volume(query.tracking.detail) {
            let over = self.draping.as_ref();
            return volume.target().collide(Query { over, ..query }, rng, stats);
        }
        let (ray, limit, tracking) = (query.ray, query.reach_mm, query.tracking);
        let sheet = self.sheet.as_deref()?;
        if let Some(draping) = &self.draping {
            return draping.collide_sheet(sheet, ray, limit, tracking, rng, stats);
        }
        let t = self.sheet_distance_mm(ray).filter(|&t| t < limit)?;
        stats.tentative += 1;
        let at = ray.at(t);
        let footprint = tracking.detail.footprint_at(at.truncate().as_vec2());
        if rng.unit() < sheet.gap(-ray.direction, footprint) {
            return None;
        }
        stats.collisions += 1;
        let site = SheetSite {
            surface: sheet,
            at: footprint,
            frame: Frame {
                s: Vec3::X,
                t: Vec3::Y,
                n: Vec3::Z,
            },
            face_normal: Vec3::Z,
            to_sheet_mm: Vec3::new(0.0, 0.0, (self.sheet_z_mm() - at.z) as f32),
            margin_mm: 1e-6 + 4.0 * f32::EPSILON * self.sheet_z_mm().abs() as f32,
        };
        Some(Collision::new(t, AnySite::Sheet(site)))
    }

    fn pass(&self, query: Query<'_>, rng: &mut PathRng, stats: &mut Stats) -> f32 {
        if let Some(volume) = self.volume(query.tracking.detail) {
            let over = self.draping.as_ref();
            return volume.target().pass(Query { over, ..query }, rng, stats);
        }
        let (ray, reach, tracking) = (query.ray, query.reach_mm, query.tracking);
        match (&self.sheet, &self.draping, self.sheet_distance_mm(ray)) {
            (Some(sheet), Some(draping), _) => {
                draping.pass_sheet(sheet.as_ref(), ray, reach, tracking, stats)
            }
            (Some(sheet), None, Some(t)) if t < reach => {
                stats.shadow_steps += 1;
                let at = ray.at(t).truncate().as_vec2();
                let at = tracking.detail.footprint_at(at);
                sheet.gap(-ray.direction, at)
            }
            _ => 1.0,
        }
    }
}
