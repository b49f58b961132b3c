//! Matter over a mesh: sheets on its faces, media in the shell around it.

use crate::matter::collision::{AnySite, Collision};
use crate::matter::sheet::SheetSite;
use crate::matter::tracking;
use crate::{Integrator, Medium, Stats, Tracking};
use glam::{DVec3, Mat3, Vec3};
use organza_basis::{CellGrid, Frame, LocalRay, PathRng, Ray};
use organza_mesh::{DrapedMesh, MeshHit, Shell, ShellSpan};
use organza_scatter::Surface;
use std::sync::Arc;

/// A mesh that cloth lies on, with the shell that its thickness fills.
///
/// Inside the shell the cloth keeps its extinction per mm of the world and its
/// fibres turn with the rotation nearest to the map. So a stretched cloth stays
/// as opaque across as it is flat, at the price of fibre length that grows with
/// its area; the medium stays reciprocal, and majorants hold.
pub struct Draping {
    mesh: DrapedMesh,
    shell: Option<Arc<Shell>>,
}

impl Draping {
    /// A mesh, with a shell where media are to fill it.
    pub fn new(mesh: DrapedMesh, shell: Option<Shell>) -> Draping {
        let shell = shell.map(Arc::new);
        Draping { mesh, shell }
    }

    /// A box around all: least and greatest corner, mm.
    pub fn bounds_mm(&self) -> (DVec3, DVec3) {
        let mesh = self.mesh.bounds_mm();
        let (low, high) = (mesh.min.as_dvec3(), mesh.max.as_dvec3());
        match &self.shell {
            None => (low, high),
            Some(shell) => {
                let (least, greatest) = shell.bounds_mm();
                (low.min(least), high.max(greatest))
            }
        }
    }

    /// The shell for media, if there is one.
    pub(crate) fn shell(&self) -> Option<&Arc<Shell>> {
        self.shell.as_ref()
    }

    /// Distance along a ray to mesh or shell.
    pub(crate) fn distance_mm(&self, (origin_mm, direction): (DVec3, DVec3)) -> Option<f64> {
        match &self.shell {
            Some(shell) => shell.distance_mm((origin_mm, direction)),
            None => {
                let ray = Ray::new(origin_mm, direction.as_vec3());
                let hit = self.mesh.hit(&ray, 0.0, f64::INFINITY);
                hit.map(|h| h.distance_mm)
            }
        }
    }

    /// The first collision in a medium that fills the shell: what is found
    /// first in each of its parts is found independently, so the nearest is the
    /// first of all, whatever the order in which parts are visited.
    pub(crate) fn collide<M: Medium>(
        &self,
        medium: &M,
        ray: &Ray,
        limit: f64,
        integrator: Integrator,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<(f64, M::Site, Mat3)> {
        let mut nearest = None;
        let mut reach = limit;
        self.shell.as_ref()?.visit_spans(along(ray), limit, |span| {
            let turn = span.world_from_cloth;
            if let Some(local) = enter(medium.cell_grid(), span, ray) {
                let found = find(medium, &local, integrator, rng, stats);
                if let Some((t, site)) = found {
                    reach = local.t_entry + f64::from(t);
                    nearest = Some((reach, site, turn));
                }
            }
            reach
        });
        nearest
    }

    /// Estimates the transmittance through a medium that fills the shell, up to
    /// `reach` mm.
    pub(crate) fn pass<M: Medium>(
        &self,
        medium: &M,
        ray: &Ray,
        reach: f64,
        integrator: Integrator,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> f32 {
        let mut product = 1.0;
        let Some(shell) = &self.shell else {
            return product;
        };
        shell.visit_spans(along(ray), reach, |span| {
            if let Some(local) = enter(medium.cell_grid(), span, ray) {
                product *= pass_through(medium, &local, integrator, rng, stats);
            }
            if product > 0.0 { reach } else { 0.0 }
        });
        product
    }

    /// The first meeting with a sheet on the faces.
    pub(crate) fn collide_sheet<'a>(
        &self,
        sheet: &'a dyn Surface,
        ray: &Ray,
        limit: f64,
        tracking: Tracking,
        rng: &mut PathRng,
        stats: &mut Stats,
    ) -> Option<Collision<'a>> {
        let w_out = -ray.direction;
        let mut from = 0.0;
        loop {
            let hit = self.mesh.hit(ray, from, limit)?;
            let frame = frame_toward(&hit, w_out);
            stats.tentative += 1;
            let at = tracking.detail.footprint_at(hit.uv_mm);
            if rng.unit() < sheet.gap(frame.frame_from_world(w_out), at) {
                from = hit.distance_mm + f64::from(margin_mm(&self.mesh));
                continue;
            }
            stats.collisions += 1;
            let site = SheetSite {
                surface: sheet,
                at,
                frame,
                face_normal: hit.face_normal,
                to_sheet_mm: (hit.position_mm - ray.at(hit.distance_mm)).as_vec3(),
                margin_mm: margin_mm(&self.mesh),
            };
            return Some(Collision::new(hit.distance_mm, AnySite::Sheet(site)));
        }
    }

    /// Transmittance of the gaps in a sheet, up to `reach` mm.
    pub(crate) fn pass_sheet(
        &self,
        sheet: &dyn Surface,
        ray: &Ray,
        reach: f64,
        tracking: Tracking,
        stats: &mut Stats,
    ) -> f32 {
        let w_out = -ray.direction;
        let (mut product, mut from) = (1.0, 0.0);
        while product > 0.0
            && let Some(hit) = self.mesh.hit(ray, from, reach)
        {
            stats.shadow_steps += 1;
            let frame = frame_toward(&hit, w_out);
            let at = tracking.detail.footprint_at(hit.uv_mm);
            product *= sheet.gap(frame.frame_from_world(w_out), at);
            from = hit.distance_mm + f64::from(margin_mm(&self.mesh));
        }
        product
    }
}

/// The first collision along a stretch of a ray.
pub(crate) fn find<M: Medium>(
    medium: &M,
    ray: &LocalRay,
    integrator: Integrator,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> Option<(f32, M::Site)> {
    match integrator {
        Integrator::Woodcock => tracking::sample_collision(medium, ray, rng, stats),
        Integrator::Regular => tracking::sample_collision_exactly(medium, ray, rng, stats),
    }
}

/// Estimates the transmittance along a stretch of a ray.
pub(crate) fn pass_through<M: Medium>(
    medium: &M,
    ray: &LocalRay,
    integrator: Integrator,
    rng: &mut PathRng,
    stats: &mut Stats,
) -> f32 {
    match integrator {
        Integrator::Woodcock if medium.is_piecewise_constant() => {
            tracking::stopped_transmittance(medium, ray, rng, stats)
        }
        Integrator::Woodcock => tracking::transmittance(medium, ray, rng, stats),
        Integrator::Regular => tracking::exact_transmittance(medium, ray, stats),
    }
}

/// Room for rounding around a hit.
fn margin_mm(mesh: &DrapedMesh) -> f32 {
    1e-6 + 8.0 * mesh.rounding_mm()
}

/// A ray with its direction in double precision.
pub(crate) fn along(ray: &Ray) -> (DVec3, DVec3) {
    (ray.origin, ray.direction.as_dvec3())
}

/// The fabric's frame where a ray comes along `-w_out`: with the face's own
/// normal where the interpolated one looks the other way.
fn frame_toward(hit: &MeshHit, w_out: Vec3) -> Frame {
    let (smooth, face) = (hit.frame, hit.face_normal);
    if (smooth.n.dot(w_out) > 0.0) == (face.dot(w_out) > 0.0) {
        return smooth;
    }
    Frame::of_cloth([smooth.s, smooth.t], face)
}

/// A straight stretch of a ray through a shell, as one through a grid of cells;
/// `None` when it misses. The grid repeats in x and y whatever it does elsewhere.
/// `ray` is the one in the world.
fn enter(grid: &CellGrid, span: &ShellSpan, ray: &Ray) -> Option<LocalRay> {
    let bounds_mm = grid.bounds_mm();
    let (low, high) = (f64::from(bounds_mm.min.z), f64::from(bounds_mm.max.z));
    let (mut near, mut far) = (0.0f64, span.t1 - span.t0);
    let (z, slope) = (span.cloth_mm.z, span.step.z);
    if slope == 0.0 {
        if z < low || z > high {
            return None;
        }
    } else {
        let (a, b) = ((low - z) / slope, (high - z) / slope);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    if near >= far {
        return None;
    }
    let (dims, voxels_per_mm) = (grid.dims(), grid.voxels_per_mm());
    let entry = span.cloth_mm + near * span.step;
    let mut local = (entry - bounds_mm.min.as_dvec3()) * voxels_per_mm.as_dvec3();
    local.x = local.x.rem_euclid(f64::from(dims.x));
    local.y = local.y.rem_euclid(f64::from(dims.y));
    Some(LocalRay {
        origin: local.as_vec3(),
        step: span.step.as_vec3() * voxels_per_mm,
        direction: (span.world_from_cloth.transpose() * ray.direction).normalize(),
        t_entry: span.t0 + near,
        length: (far - near) as f32,
        left_yarn: ray.left_yarn,
    })
}
