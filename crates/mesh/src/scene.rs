//! Intersection of rays with a mesh.

use crate::mesh::{Mesh, Vertex, area_vector, stretch};
use glam::{DVec3, Vec2, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb as BvhBox;
use obvhs::cwbvh::CwBvh;
use obvhs::cwbvh::builder::build_cwbvh;
use obvhs::ray::{Ray as BvhRay, RayHit};
use organza_basis::{Aabb, Frame, Ray};
use std::time::Duration;

/// A mesh with a hierarchy of boxes over its faces.
///
/// Rays meet faces in single precision about the middle of the mesh, from where they come to
/// its box.
pub struct DrapedMesh {
    mesh: Mesh,
    hierarchy: CwBvh,
    bounds_mm: Aabb,
    middle_mm: Vec3,
}

/// The intersection of a ray with the cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshHit {
    /// Distance along the ray, mm.
    pub distance_mm: f64,
    /// The point.
    pub position_mm: DVec3,
    /// Its place in the fabric plane, mm.
    pub uv_mm: Vec2,
    /// The fabric's frame: s along the weft, t along the component of the warp that is
    /// perpendicular to it, n the interpolated normal. Left-handed where the texture is mirrored.
    pub frame: Frame,
    /// Unit normal of the face itself, on the side of `frame.n`.
    pub face_normal: Vec3,
    /// World mm per mm of cloth along weft and warp.
    pub stretch: [Vec3; 2],
    /// Index of the face in [`Mesh::triangles`].
    pub triangle: usize,
}

/// A ray rotated to run along z, for a test without cracks between neighbouring faces
/// [Woop2013].
struct Sheared {
    origin: Vec3,
    axes: [usize; 3],
    shear: Vec3,
}

impl Sheared {
    fn new(origin: Vec3, d: Vec3) -> Sheared {
        let z = d.abs().max_position();
        let (mut x, mut y) = ((z + 1) % 3, (z + 2) % 3);
        // The winding must not depend on the direction of the ray.
        if d[z] < 0.0 {
            (x, y) = (y, x);
        }
        Sheared {
            origin,
            axes: [x, y, z],
            shear: Vec3::new(d[x] / d[z], d[y] / d[z], 1.0 / d[z]),
        }
    }

    /// Distance and weights of the corners; `None` for a miss.
    fn meet(&self, corners: [Vec3; 3]) -> Option<(f32, [f32; 3])> {
        let [x, y, z] = self.axes;
        let p = corners.map(|c| {
            let c = c - self.origin;
            let depth = c[z];
            Vec3::new(
                c[x] - self.shear.x * depth,
                c[y] - self.shear.y * depth,
                self.shear.z * depth,
            )
        });
        let edge = |a: Vec3, b: Vec3| {
            let value = a.x * b.y - a.y * b.x;
            if value != 0.0 {
                return value;
            }
            // Exactly on an edge in single precision: decide in double.
            (f64::from(a.x) * f64::from(b.y) - f64::from(a.y) * f64::from(b.x)) as f32
        };
        let w = [edge(p[1], p[2]), edge(p[2], p[0]), edge(p[0], p[1])];
        if w.iter().any(|&w| w < 0.0) && w.iter().any(|&w| w > 0.0) {
            return None;
        }
        let sum = w[0] + w[1] + w[2];
        if sum == 0.0 {
            return None;
        }
        let w = w.map(|w| w / sum);
        Some((w[0] * p[0].z + w[1] * p[1].z + w[2] * p[2].z, w))
    }
}

impl DrapedMesh {
    /// Builds the hierarchy.
    pub fn new(mesh: Mesh) -> DrapedMesh {
        let mut bounds_mm = Aabb::EMPTY;
        for vertex in mesh.triangles().iter().flatten() {
            bounds_mm = bounds_mm.with_point(vertex.position_mm);
        }
        // Boxes are intersected in single precision, which may miss by some rounding errors a
        // face that its own test hits.
        let margin = Vec3A::splat(1e-5 * bounds_mm.size().length());
        let middle_mm = bounds_mm.centre();
        let boxes: Vec<BvhBox> = mesh
            .triangles()
            .iter()
            .map(|t| {
                let corners = t.map(|v| Vec3A::from(v.position_mm - middle_mm));
                let tight = BvhBox::from_points(&corners);
                BvhBox::new(tight.min - margin, tight.max + margin)
            })
            .collect();
        let hierarchy = build_cwbvh(
            &boxes,
            BvhBuildParams::medium_build(),
            &mut Duration::default(),
        );
        DrapedMesh {
            mesh,
            hierarchy,
            bounds_mm,
            middle_mm,
        }
    }

    /// The faces.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// A box around all faces.
    pub fn bounds_mm(&self) -> Aabb {
        self.bounds_mm
    }

    /// The nearest hit at a distance in `[min_mm, max_mm]`.
    pub fn hit(&self, ray: &Ray, min_mm: f64, max_mm: f64) -> Option<MeshHit> {
        let (triangle, t, weights) = self.nearest(ray, min_mm, max_mm)?;
        Some(self.describe(triangle, t, weights))
    }

    /// About the rounding of distances and places of hits, mm.
    pub fn rounding_mm(&self) -> f32 {
        f32::EPSILON * self.bounds_mm.size().max_element()
    }

    fn nearest(&self, ray: &Ray, min_mm: f64, max_mm: f64) -> Option<(usize, f64, [f32; 3])> {
        if !(ray.origin.is_finite() && ray.direction.is_finite() && min_mm <= max_mm)
            || ray.direction == Vec3::ZERO
        {
            return None;
        }
        let corners = (self.bounds_mm.min.as_dvec3(), self.bounds_mm.max.as_dvec3());
        let to_box_mm = distance_to_box(ray.origin, ray.direction.as_dvec3(), corners);
        // A face in a side of the box may lie a rounding beyond it.
        let size_mm = f64::from(self.bounds_mm.size().length());
        let start_mm = if to_box_mm.is_finite() {
            (to_box_mm - 1e-3 * size_mm).max(0.0)
        } else {
            0.0
        };
        let start = (ray.at(start_mm) - self.middle_mm.as_dvec3()).as_vec3();
        let (min, max) = ((min_mm - start_mm) as f32, (max_mm - start_mm) as f32);
        if max < 0.0 {
            return None;
        }
        let sheared = Sheared::new(start, ray.direction);
        // The hierarchy loses rays with a component of minus zero.
        let direction = ray.direction + 0.0;
        let bvh_ray = BvhRay::new(start.into(), direction.into(), min.max(0.0), max);
        let mut nearest: Option<(usize, f32, [f32; 3])> = None;
        let mut hit = RayHit::none();
        self.hierarchy
            .ray_traverse(bvh_ray, &mut hit, |bvh_ray, id| {
                let index = self.hierarchy.primitive_indices[id] as usize;
                let corners = self.mesh.triangles()[index].map(|v| v.position_mm - self.middle_mm);
                match sheared.meet(corners) {
                    Some((t, weights)) if t >= bvh_ray.tmin && t <= bvh_ray.tmax => {
                        if nearest.is_none_or(|n| t < n.1) {
                            nearest = Some((index, t, weights));
                        }
                        t
                    }
                    _ => f32::INFINITY,
                }
            });
        nearest.map(|(index, t, weights)| (index, start_mm + f64::from(t), weights))
    }

    fn describe(&self, triangle: usize, t: f64, w: [f32; 3]) -> MeshHit {
        let face = &self.mesh.triangles()[triangle];
        let blend =
            |f: fn(&Vertex) -> Vec3| w[0] * f(&face[0]) + w[1] * f(&face[1]) + w[2] * f(&face[2]);
        let mut face_normal = area_vector(face).normalize();
        // Opposed corner normals may cancel.
        let normal = blend(|v| v.normal).try_normalize().unwrap_or(face_normal);
        if face_normal.dot(normal) < 0.0 {
            face_normal = -face_normal;
        }
        let first_edge = face[1].position_mm - face[0].position_mm;
        let stretch = stretch(face).unwrap_or_else(|| {
            let s = first_edge.normalize();
            [s, face_normal.cross(s)]
        });
        let frame = Frame::of_cloth(stretch, normal);
        MeshHit {
            distance_mm: t,
            // Computed from the corners instead of along the ray, so that the error does not
            // grow with distance.
            position_mm: self.middle_mm.as_dvec3()
                + face.iter().zip(w).fold(DVec3::ZERO, |sum, (v, w)| {
                    sum + f64::from(w) * (v.position_mm - self.middle_mm).as_dvec3()
                }),
            uv_mm: w[0] * face[0].uv_mm + w[1] * face[1].uv_mm + w[2] * face[2].uv_mm,
            frame,
            face_normal,
            stretch,
            triangle,
        }
    }
}

/// Distance along a ray to a box; zero from inside, infinite for a miss.
pub(crate) fn distance_to_box(origin: DVec3, direction: DVec3, (low, high): (DVec3, DVec3)) -> f64 {
    if origin.cmpge(low).all() && origin.cmple(high).all() {
        return 0.0;
    }
    let (mut near, mut far) = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        let (o, d) = (origin[axis], direction[axis]);
        if d == 0.0 {
            if o < low[axis] || o > high[axis] {
                return f64::INFINITY;
            }
            continue;
        }
        let (a, b) = ((low[axis] - o) / d, (high[axis] - o) / d);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    if near <= far { near } else { f64::INFINITY }
}
