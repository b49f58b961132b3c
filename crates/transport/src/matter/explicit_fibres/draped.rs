//! Explicit fibres in the shell around a mesh.
//!
//! A ray is a straight line in every tetrahedron of the shell, in the world and in the
//! cloth, so fibres are met in the cloth's own places, where they are round. Light arrives
//! along the direction that the nearest rotation gives, as in draped media, so that every
//! event keeps its energy; the exit point takes the map itself to the world, because only
//! there it lies on the surface of the fibre. Where the map stretches, a fibre covers the
//! part of the cloth that it covers in flat cloth.

use super::{ExplicitFibres, FibreHit, Found};
use crate::Stats;
use crate::matter::draping::{Draping, along};
use glam::{DVec3, Mat3};
use organza_basis::Ray;
use organza_mesh::ShellSpan;

/// A stretch through a tetrahedron is looked at so much beyond its ends, in the rounding
/// of places and of distances in cells: what is met at a face belongs to one of its sides at least.
const FACE_ROUNDINGS: f64 = 16.0;

/// A hit in a shell, and the maps of its tetrahedron.
pub(crate) struct DrapedHit {
    /// Along the ray, mm of the world.
    pub distance_mm: f64,
    /// The hit, in the directions and places of the cloth.
    pub hit: FibreHit,
    /// Turns directions of the cloth to the world.
    pub world_from_cloth: Mat3,
    /// Takes differences of places of the cloth to the world.
    pub stretch: Mat3,
}

impl ExplicitFibres {
    /// The first fibre that a ray enters in a shell before `limit` mm.
    pub(crate) fn first_draped_hit(
        &self,
        over: &Draping,
        ray: &Ray,
        limit: f64,
        stats: &mut Stats,
    ) -> Option<DrapedHit> {
        let (reach, found, span) = self.nearest_draped(over, ray, limit, &mut stats.tentative)?;
        stats.collisions += 1;
        let light_direction = span.world_from_cloth.transpose() * ray.direction;
        let direction = span.step.normalize().as_vec3();
        Some(DrapedHit {
            distance_mm: reach,
            hit: self.describe(&found, direction, light_direction.normalize()),
            world_from_cloth: span.world_from_cloth,
            stretch: span.stretch,
        })
    }

    /// The first entry of a ray in a shell before `limit` mm, how far in the world, and the
    /// tetrahedron that it lies in.
    pub(crate) fn nearest_draped(
        &self,
        over: &Draping,
        ray: &Ray,
        limit: f64,
        tests: &mut u64,
    ) -> Option<(f64, Found, ShellSpan)> {
        let mut nearest = None;
        let mut reach = limit;
        over.shell()?.visit_spans(along(ray), limit, |span| {
            if let Some((t, found)) = self.in_span(span, ray.origin, false, tests)
                && t < reach
            {
                reach = t;
                nearest = Some((found, *span));
            }
            reach
        });
        nearest.map(|(found, span)| (reach, found, span))
    }

    /// True when a fibre in a shell stands in the ray's way before `reach` mm.
    pub(crate) fn blocks_draped(
        &self,
        over: &Draping,
        ray: &Ray,
        reach: f64,
        stats: &mut Stats,
    ) -> bool {
        let Some(shell) = over.shell() else {
            return false;
        };
        let mut is_blocked = false;
        shell.visit_spans(along(ray), reach, |span| {
            let found = self.in_span(span, ray.origin, true, &mut stats.shadow_steps);
            is_blocked |= found.is_some_and(|(t, _)| t < reach);
            if is_blocked { 0.0 } else { reach }
        });
        is_blocked
    }

    /// The nearest entry in a tetrahedron, or any, and its distance along the ray.
    fn in_span(
        &self,
        span: &ShellSpan,
        origin: DVec3,
        any: bool,
        tests: &mut u64,
    ) -> Option<(f64, Found)> {
        let cloth_per_world = span.step.length();
        let d = span.step / cloth_per_world;
        if !d.is_finite() {
            return None;
        }
        let (matter, length_mm) = (self.cells(), (span.t1 - span.t0) * cloth_per_world);
        let places_mm = (span.cloth_mm.abs() + origin.abs()).max_element() + span.t1;
        let rounding_mm = f64::from(f32::EPSILON) * length_mm + f64::EPSILON * places_mm;
        let slack_mm = FACE_ROUNDINGS * rounding_mm;
        let back_mm = if span.t0 > 0.0 { slack_mm } else { 0.0 };
        // A ray that starts among fibres has left its own.
        let from_mm = (matter.start_mm() - span.t0 * cloth_per_world + back_mm).max(0.0);
        let ends = (from_mm, back_mm + length_mm + slack_mm);
        let found = Found::between(matter, (span.cloth_mm - back_mm * d, d), ends, any, tests)?;
        let t = span.t0 + (found.distance_mm - back_mm) / cloth_per_world;
        Some((t.max(0.0), found))
    }
}
