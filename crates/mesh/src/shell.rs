//! Cloth of some thickness over a mesh: shell mapping \[Porumbescu2005].
//!
//! Every face of the mesh becomes a prism between its corners, moved down and up along their
//! normals. Every prism is divided into three tetrahedra, in which the map between world and
//! cloth is affine. In each of them a ray is a straight line on both sides of the map, so a
//! tracker for flat cloth can track draped cloth.

use crate::error::Error;
use crate::mesh::{Mesh, area_vector, unfolded_uv};
use crate::scene::distance_to_box;
use crate::shell_around::{Around, NOBODY, around_all};
use glam::{DMat3, DVec3, Mat3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb as BvhBox;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::{Ray as BvhRay, RayHit};
use organza_basis::Aabb;
use std::time::Duration;

/// Tetrahedra per prism.
const CUT: usize = 3;
/// Boxes are grown by this part of the shell's size, against the rounding of rays.
const BOX_ROUNDING: f32 = 1e-5;

/// A mesh thickened by a slab of cloth.
///
/// Places are in double precision throughout: a fibre is a few micrometres thick, and the
/// mesh may be metres across or metres away. Only the hierarchy of boxes is in single
/// precision, about the middle of the mesh.
pub struct Shell {
    /// [`CUT`] per face.
    tetrahedra: Vec<Tetrahedron>,
    around: Vec<Around>,
    /// Of boxes around prisms, counted from `middle_mm` and grown by the rounding of rays.
    hierarchy: CwBvh,
    middle_mm: DVec3,
    bounds_mm: (DVec3, DVec3),
    folds: Folds,
}

/// Counts of tetrahedra where the map of the shell is not one-to-one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Folds {
    /// Inverted tetrahedra, where the mesh bends more tightly than the thickness of the cloth
    /// allows. Matter overlaps there.
    pub inverted: usize,
    /// Tetrahedra without volume, left out.
    pub flat: usize,
}

/// The part of a ray inside one tetrahedron.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShellSpan {
    /// Distance along the ray at which it enters, mm.
    pub t0: f64,
    /// Distance at which it leaves; greater than `t0`.
    pub t1: f64,
    /// Coordinates in the cloth at `t0`: weft, warp and height, mm.
    pub cloth_mm: DVec3,
    /// Change of `cloth_mm` per mm along the ray.
    pub step: DVec3,
    /// Rotation nearest to the map: the orthogonal factor of its polar decomposition. It
    /// includes a reflection where the texture is mirrored.
    pub world_from_cloth: Mat3,
    /// The linear part of the map: mm of the world per mm of cloth.
    pub stretch: Mat3,
    /// The number of the tetrahedron, and whether no other fills any of its room.
    pub tetrahedron: u32,
    /// See `tetrahedron`.
    pub is_alone: bool,
}

/// A step of a ray through a tetrahedron.
#[derive(Clone, Copy, Debug)]
pub struct ShellStep {
    /// The part of the ray inside, if there is any.
    pub span: Option<ShellSpan>,
    /// Where it leaves, mm.
    pub end_mm: f64,
    /// The tetrahedron beyond; none where the shell ends or others lie in its room.
    pub beyond: Option<u32>,
}

#[derive(Clone, Copy)]
pub(crate) struct Tetrahedron {
    /// Weights of the second to fourth corner, from the world relative to the
    /// first; zero for a tetrahedron without volume.
    pub weights_from_world: DMat3,
    pub corner_mm: DVec3,
    pub cloth_from_world: DMat3,
    pub cloth_corner_mm: DVec3,
    pub world_from_cloth: Mat3,
    pub stretch: Mat3,
    /// Names of the corners: tetrahedra that share one have its name alike.
    pub corners: [u32; 4],
}

/// A point of the world and of the cloth, and its name.
type Corner = (DVec3, DVec3, u32);

impl Tetrahedron {
    fn new([a, b, c, d]: [Corner; 4]) -> Option<(Tetrahedron, f64)> {
        let edges = |of: fn(&Corner) -> DVec3| {
            DMat3::from_cols(of(&b) - of(&a), of(&c) - of(&a), of(&d) - of(&a))
        };
        let (world, cloth) = (edges(|c| c.0), edges(|c| c.1));
        let volume = |m: &DMat3| m.determinant().abs();
        // Below a millionth of the largest possible volume the shape is mostly rounding.
        let room = |m: &DMat3| m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
        let good = |m: &DMat3| volume(m) > 1e-6 * room(m);
        if !(good(&world) && good(&cloth)) {
            return None;
        }
        let weights = world.inverse();
        let map = world * cloth.inverse();
        let tetrahedron = Tetrahedron {
            weights_from_world: weights,
            corner_mm: a.0,
            cloth_from_world: cloth * weights,
            cloth_corner_mm: a.1,
            world_from_cloth: rotation_of(map)?.as_mat3(),
            stretch: map.as_mat3(),
            corners: [a.2, b.2, c.2, d.2],
        };
        Some((tetrahedron, map.determinant()))
    }

    const FLAT: Tetrahedron = Tetrahedron {
        weights_from_world: DMat3::ZERO,
        corner_mm: DVec3::ZERO,
        cloth_from_world: DMat3::ZERO,
        cloth_corner_mm: DVec3::ZERO,
        world_from_cloth: Mat3::IDENTITY,
        stretch: Mat3::IDENTITY,
        corners: [0; 4],
    };

    /// Whether it has a volume.
    pub fn is_solid(&self) -> bool {
        self.weights_from_world != DMat3::ZERO
    }

    /// Weights of the corners at a place relative to the first corner.
    fn weights(&self, from: DVec3) -> [f64; 4] {
        let w = self.weights_from_world * from;
        [1.0 - w.element_sum(), w.x, w.y, w.z]
    }

    /// How they change along a direction.
    fn slopes(&self, direction: DVec3) -> [f64; 4] {
        let slope = self.weights_from_world * direction;
        [-slope.element_sum(), slope.x, slope.y, slope.z]
    }

    /// Where a part of a ray between 0 and `limit` inside begins and ends.
    fn clip(&self, (origin, direction): (DVec3, DVec3), limit: f64) -> Option<(f64, f64)> {
        let slopes = self.slopes(direction);
        if slopes == [0.0; 4] {
            return None;
        }
        let (mut t0, mut t1) = (0.0f64, limit);
        for (w, slope) in self
            .weights(origin - self.corner_mm)
            .into_iter()
            .zip(slopes)
        {
            if slope > 0.0 {
                t0 = t0.max(-w / slope);
            } else if slope < 0.0 {
                t1 = t1.min(-w / slope);
            } else if w < 0.0 {
                return None;
            }
            if t0 >= t1 {
                return None;
            }
        }
        (t0 < t1).then_some((t0, t1))
    }
}

/// The orthogonal factor of a matrix, by Newton's iteration \[Higham1986].
fn rotation_of(map: DMat3) -> Option<DMat3> {
    let mut r = map;
    for _ in 0..64 {
        let next = 0.5 * (r + r.inverse().transpose());
        if !next.is_finite() {
            return None;
        }
        let change = (next - r)
            .to_cols_array()
            .iter()
            .map(|x| x * x)
            .sum::<f64>();
        r = next;
        if change < 1e-24 {
            break;
        }
    }
    Some(r)
}

impl Shell {
    /// The cloth between two heights over a mesh that lies half way between
    /// them; heights in mm along the normal, in the cloth's own coordinates.
    ///
    /// All corners at a point share one normal, the mean over the adjacent faces, and one
    /// [lean](Mesh::lean), so that
    /// prisms have no gaps between them. Faces whose texture has no area are unfolded from
    /// their first corner, with the weft along the first edge.
    ///
    /// # Errors When the upper height is not above the lower one, or no tetrahedron is left.
    pub fn new(mesh: &Mesh, low_mm: f32, high_mm: f32) -> Result<Shell, Error> {
        if !(low_mm < high_mm && low_mm.is_finite() && high_mm.is_finite()) {
            return Err(Error::Scale {
                key: "thickness",
                value: high_mm - low_mm,
            });
        }
        let (low, high) = (f64::from(low_mm), f64::from(high_mm));
        let half = 0.5 * (high - low);
        let normals = point_normals(mesh);
        let mut folds = Folds::default();
        let middle_mm = middle_mm(mesh);
        let mut around = Aabb::EMPTY;
        let mut tetrahedra = Vec::with_capacity(CUT * mesh.triangles().len());
        let mut boxes = Vec::with_capacity(mesh.triangles().len());
        for (triangle, ids) in mesh.triangles().iter().zip(mesh.corners()) {
            let uv = unfolded_uv(triangle);
            let face = area_vector(triangle);
            let side = |k: usize, up: bool| -> Corner {
                let own = triangle[k].normal;
                let n = normals[ids[k] as usize].unwrap_or(own) + mesh.lean_at(ids[k]);
                let n = n.as_dvec3();
                let (height, offset) = if up { (high, half) } else { (low, -half) };
                (
                    triangle[k].position_mm.as_dvec3() + offset * n,
                    uv[k].as_dvec2().extend(height),
                    2 * ids[k] + u32::from(up),
                )
            };
            // From the least to the greatest corner, so that both prisms at an edge divide
            // their common side along the same diagonal.
            let mut order = [0, 1, 2];
            order.sort_by_key(|&k| ids[k]);
            let [a, b, c] = order;
            let (bottom, top) = (|k| side(k, false), |k| side(k, true));
            let mirrored = (uv[1] - uv[0]).perp_dot(uv[2] - uv[0]) < 0.0;
            let outward = if face.dot(triangle[0].normal) < 0.0 {
                -1.0
            } else {
                1.0
            };
            for corners in [
                [bottom(a), bottom(b), bottom(c), top(c)],
                [bottom(a), bottom(b), top(b), top(c)],
                [bottom(a), top(a), top(b), top(c)],
            ] {
                match Tetrahedron::new(corners) {
                    Some((tetrahedron, determinant)) => {
                        let upright = (determinant * outward > 0.0) != mirrored;
                        folds.inverted += usize::from(!upright);
                        tetrahedra.push(tetrahedron);
                    }
                    None => {
                        folds.flat += 1;
                        tetrahedra.push(Tetrahedron::FLAT);
                    }
                }
            }
            let mut prism = Aabb::EMPTY;
            for k in 0..3 {
                prism = prism.with_point((bottom(k).0 - middle_mm).as_vec3());
                prism = prism.with_point((top(k).0 - middle_mm).as_vec3());
            }
            around = around.union(&prism);
            boxes.push(prism);
        }
        if folds.flat == tetrahedra.len() {
            return Err(Error::Empty {
                dropped: boxes.len(),
            });
        }
        // Boxes are intersected in single precision, so they are enlarged by its rounding
        // error.
        let margin = BOX_ROUNDING * around.size().length();
        let boxes: Vec<BvhBox> = boxes
            .iter()
            .map(|b| {
                let b = b.grown(margin);
                BvhBox::new(Vec3A::from(b.min), Vec3A::from(b.max))
            })
            .collect();
        let params = BvhBuildParams::medium_build();
        Ok(Shell {
            hierarchy: build_cwbvh(&boxes, params, &mut Duration::default()),
            around: around_all(&tetrahedra, middle_mm, margin),
            tetrahedra,
            middle_mm,
            bounds_mm: (
                middle_mm + around.min.as_dvec3() - f64::from(margin),
                middle_mm + around.max.as_dvec3() + f64::from(margin),
            ),
            folds,
        })
    }

    /// All tetrahedra, and what lies around each.
    pub(crate) fn all(&self) -> (&[Tetrahedron], &[Around]) {
        (&self.tetrahedra, &self.around)
    }

    /// How far boxes are grown against the rounding of single precision, mm.
    pub(crate) fn margin_mm(&self) -> f32 {
        let (low, high) = self.bounds_mm;
        BOX_ROUNDING * (high - low).as_vec3().length()
    }

    /// Memory of the shell of a mesh with this number of faces.
    pub fn memory_bytes(faces: usize) -> u64 {
        // The tetrahedra, and the hierarchy with its boxes during construction.
        let face = CUT * (size_of::<Tetrahedron>() + Around::BYTES) + 4 * size_of::<BvhBox>();
        face as u64 * faces as u64
    }

    /// A box around all tetrahedra: least and greatest corner, mm.
    pub fn bounds_mm(&self) -> (DVec3, DVec3) {
        self.bounds_mm
    }

    /// Counts of folds of the map, for a warning.
    pub fn folds(&self) -> Folds {
        self.folds
    }

    /// Visits the parts of a ray, an origin in mm and a unit direction, inside the shell
    /// before `limit_mm`, in no strict order, but near parts early. `visit` returns the
    /// distance up to which parts are still wanted.
    pub fn visit_spans(
        &self,
        ray: (DVec3, DVec3),
        limit_mm: f64,
        visit: impl FnMut(&ShellSpan) -> f64,
    ) {
        self.visit(ray, limit_mm, false, visit);
    }

    /// The same, where no part ends before `limit_mm` because a nearer one was found.
    pub fn visit_whole_spans(
        &self,
        ray: (DVec3, DVec3),
        limit_mm: f64,
        visit: impl FnMut(&ShellSpan) -> f64,
    ) {
        self.visit(ray, limit_mm, true, visit);
    }

    fn visit(
        &self,
        (origin, direction): (DVec3, DVec3),
        limit_mm: f64,
        whole: bool,
        mut visit: impl FnMut(&ShellSpan) -> f64,
    ) {
        if !(origin.is_finite() && direction.is_finite() && limit_mm > 0.0) {
            return;
        }
        // The hierarchy is looked into from where the ray comes to the shell, so that single
        // precision suffices for its boxes.
        let start_mm = distance_to_box(origin, direction, self.bounds_mm);
        if start_mm >= limit_mm {
            return;
        }
        let start = origin + start_mm * direction - self.middle_mm;
        let reach = |limit: f64| ((limit - start_mm) as f32).next_up();
        let bvh_ray = BvhRay::new(
            start.as_vec3a(),
            // The hierarchy loses rays with a component of minus zero.
            direction.as_vec3a() + 0.0,
            0.0,
            reach(limit_mm),
        );
        let mut limit = limit_mm;
        self.hierarchy
            .ray_traverse(bvh_ray, &mut RayHit::none(), |_, id| {
                let face = self.hierarchy.primitive_indices[id] as usize;
                for number in CUT * face..CUT * face + CUT {
                    let end = if whole { limit_mm } else { limit };
                    let ray = (origin, direction);
                    if let Some(ends) = self.tetrahedra[number].clip(ray, end) {
                        limit = limit.min(visit(&self.span(number as u32, ray, ends)));
                    }
                }
                reach(limit)
            });
    }

    /// The part of a ray in a tetrahedron between two distances.
    fn span(
        &self,
        tetrahedron: u32,
        (origin, direction): (DVec3, DVec3),
        (t0, t1): (f64, f64),
    ) -> ShellSpan {
        let t = &self.tetrahedra[tetrahedron as usize];
        let step = t.cloth_from_world * direction;
        let at_origin = t.cloth_from_world * (origin - t.corner_mm);
        ShellSpan {
            t0,
            t1,
            cloth_mm: t.cloth_corner_mm + at_origin + t0 * step,
            step,
            world_from_cloth: t.world_from_cloth,
            stretch: t.stretch,
            tetrahedron,
            is_alone: self.around[tetrahedron as usize].is_alone,
        }
    }

    /// A ray that is inside a tetrahedron, or on its way into it, at a distance.
    pub fn step(&self, tetrahedron: u32, ray: (DVec3, DVec3), from_mm: f64) -> ShellStep {
        let t = &self.tetrahedra[tetrahedron as usize];
        let weights = t.weights(ray.0 - t.corner_mm);
        let (mut end_mm, mut face) = (f64::INFINITY, 0);
        for (k, (w, slope)) in weights.into_iter().zip(t.slopes(ray.1)).enumerate() {
            if slope < 0.0 && -w / slope < end_mm {
                (end_mm, face) = (-w / slope, k);
            }
        }
        let end_mm = end_mm.max(from_mm);
        let is_inside = end_mm > from_mm && end_mm.is_finite();
        ShellStep {
            span: is_inside.then(|| self.span(tetrahedron, ray, (from_mm, end_mm))),
            end_mm,
            beyond: self.beyond(tetrahedron, face),
        }
    }

    /// The tetrahedron beyond a face, if it is alone in its room.
    fn beyond(&self, tetrahedron: u32, face: usize) -> Option<u32> {
        let next = self.around[tetrahedron as usize].neighbours[face];
        (next != NOBODY && self.around[next as usize].is_alone).then_some(next)
    }

    /// The tetrahedron at a place in mm, which lies near one: it, or another that is reached through
    /// few faces. None where tetrahedra share their room.
    pub fn tetrahedron_at(&self, near: u32, place_mm: DVec3) -> Option<u32> {
        const MOST: u32 = 8;
        let mut at = near;
        for _ in 0..MOST {
            let t = &self.tetrahedra[at as usize];
            let weights = t.weights(place_mm - t.corner_mm);
            let outside = (0..4).min_by(|a, b| weights[*a].total_cmp(&weights[*b]))?;
            if weights[outside] >= 0.0 {
                return self.around[at as usize].is_alone.then_some(at);
            }
            at = self.beyond(at, outside)?;
        }
        None
    }

    /// Distance along a ray, an origin in mm and a unit direction, to the shell; `None` for a
    /// miss.
    pub fn distance_mm(&self, ray: (DVec3, DVec3)) -> Option<f64> {
        let mut nearest = f64::INFINITY;
        self.visit_spans(ray, f64::INFINITY, |span| {
            nearest = nearest.min(span.t0);
            nearest
        });
        nearest.is_finite().then_some(nearest)
    }
}

/// The middle of the box around a mesh, mm.
fn middle_mm(mesh: &Mesh) -> DVec3 {
    let corners = mesh.triangles().iter().flatten();
    let bounds = corners.fold(Aabb::EMPTY, |b, v| b.with_point(v.position_mm));
    0.5 * (bounds.min.as_dvec3() + bounds.max.as_dvec3())
}

/// The mean normal at every point that faces share; `None` where normals cancel.
fn point_normals(mesh: &Mesh) -> Vec<Option<Vec3>> {
    let most = mesh.corners().iter().flatten().max().copied().unwrap_or(0);
    let mut sums = vec![Vec3::ZERO; most as usize + 1];
    for (triangle, ids) in mesh.triangles().iter().zip(mesh.corners()) {
        for (vertex, &id) in triangle.iter().zip(ids) {
            sums[id as usize] += vertex.normal;
        }
    }
    sums.into_iter().map(Vec3::try_normalize).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rotation_of_a_stretched_turn_is_the_turn() {
        for (angle, mirror) in [(0.3, 1.0), (2.0, 1.0), (-1.2, -1.0)] {
            let turn = DMat3::from_axis_angle(DVec3::new(0.6, 0.0, 0.8), angle)
                * DMat3::from_diagonal(DVec3::new(mirror, 1.0, 1.0));
            let stretch = DMat3::from_cols(
                DVec3::new(1.3, 0.2, 0.0),
                DVec3::new(0.2, 0.9, 0.1),
                DVec3::new(0.0, 0.1, 1.1),
            );
            let found = rotation_of(turn * stretch).unwrap();
            let off = (found - turn).to_cols_array().map(f64::abs);
            assert!(off.iter().all(|&x| x < 1e-12), "{angle}: {off:?}");
        }
    }
}
