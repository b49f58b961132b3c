//! A checked mesh.

use crate::error::Error;
use glam::{Vec2, Vec3};

/// One corner of a face.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vertex {
    /// Position, mm.
    pub position_mm: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// Place in the fabric plane, mm: x along the weft, y along the warp.
    pub uv_mm: Vec2,
}

/// Defects of the faces that were repaired.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Repairs {
    /// Faces without area, left out.
    pub dropped_faces: usize,
    /// Corner normals that were missing or zero; they were computed from the adjacent faces.
    pub computed_normals: usize,
    /// Faces whose texture coordinates have no area; their weft runs along the
    /// first edge.
    pub collapsed_uv: usize,
    /// Faces whose texture is mirrored. The weave is drawn mirrored there.
    pub mirrored_uv: usize,
}

/// Triangles with normals and places in the fabric plane at their corners.
#[derive(Clone, Debug)]
pub struct Mesh {
    triangles: Vec<[Vertex; 3]>,
    corners: Vec<[u32; 3]>,
    repairs: Repairs,
    /// How far cloth leans at every shared corner; none where it stands upright everywhere.
    leans: Vec<Vec3>,
}

/// Smallest area of a face relative to the square of its longest edge; below it the normal is
/// mostly rounding.
const FLAT: f32 = 1e-6;

impl Mesh {
    /// A mesh of triangles. Normals that are zero are computed. `normals_at` names the shared
    /// corner that a computed normal is averaged over: three numbers per triangle.
    ///
    /// # Errors
    /// When no face is left.
    pub fn new(triangles: Vec<[Vertex; 3]>, corners: &[[u32; 3]]) -> Result<Mesh, Error> {
        let mut repairs = Repairs::default();
        let mut kept = Vec::with_capacity(triangles.len());
        let mut ids = Vec::with_capacity(triangles.len());
        let most = corners.iter().flatten().copied().max().unwrap_or(0);
        // Faces are weighted by area, the length of the cross product.
        let mut sums = vec![Vec3::ZERO; most as usize + 1];
        for (k, t) in triangles.into_iter().enumerate() {
            let cross = area_vector(&t);
            let edge = longest_edge(&t);
            if !(cross.length() > FLAT * edge * edge) {
                repairs.dropped_faces += 1;
                continue;
            }
            let id = corners.get(k).copied().unwrap_or_default();
            for i in id {
                sums[i as usize] += cross;
            }
            kept.push(t);
            ids.push(id);
        }
        if kept.is_empty() {
            return Err(Error::Empty {
                dropped: repairs.dropped_faces,
            });
        }
        for (t, id) in kept.iter_mut().zip(&ids) {
            let face = area_vector(t).normalize();
            for (vertex, &corner) in t.iter_mut().zip(id) {
                vertex.normal = match vertex.normal.try_normalize() {
                    Some(n) => n,
                    None => {
                        repairs.computed_normals += 1;
                        sums[corner as usize].try_normalize().unwrap_or(face)
                    }
                };
            }
            let [a, b, c] = t.map(|v| v.uv_mm);
            let (e, f) = (b - a, c - a);
            let twice = e.perp_dot(f);
            if twice.abs() <= FLAT * e.length_squared().max(f.length_squared()) {
                repairs.collapsed_uv += 1;
            } else if twice < 0.0 {
                repairs.mirrored_uv += 1;
            }
        }
        Ok(Mesh {
            triangles: kept,
            corners: ids,
            repairs,
            leans: Vec::new(),
        })
    }

    /// Lets what stands on the mesh lean: `tangent_at` gives, at a place of the fabric plane in mm, how
    /// far along weft and warp a point moves for every mm of its height.
    pub fn lean(&mut self, tangent_at: impl Fn(Vec2) -> Vec2) {
        let most = self.corners.iter().flatten().max().copied().unwrap_or(0);
        let mut sums = vec![(Vec3::ZERO, 0.0f32); most as usize + 1];
        for (triangle, ids) in self.triangles.iter().zip(&self.corners) {
            let Some(along) = stretch(triangle) else {
                continue;
            };
            let [weft, warp] = along.map(Vec3::normalize_or_zero);
            for (vertex, &id) in triangle.iter().zip(ids) {
                let tangent = tangent_at(vertex.uv_mm);
                let (sum, count) = &mut sums[id as usize];
                *sum += tangent.x * weft + tangent.y * warp;
                *count += 1.0;
            }
        }
        let mean = |(sum, count): &(Vec3, f32)| *sum / count.max(1.0);
        self.leans = sums.iter().map(mean).collect();
    }

    /// What is added to the normal at a shared corner.
    pub(crate) fn lean_at(&self, corner: u32) -> Vec3 {
        self.leans.get(corner as usize).copied().unwrap_or_default()
    }

    /// The faces.
    pub fn triangles(&self) -> &[[Vertex; 3]] {
        &self.triangles
    }

    /// For every face the points that its corners share with other faces.
    pub fn corners(&self) -> &[[u32; 3]] {
        &self.corners
    }

    /// The repaired defects, for a warning.
    pub fn repairs(&self) -> Repairs {
        self.repairs
    }
}

/// Places of a face's corners in the fabric plane; where these have no area, those of the face
/// unfolded from its first corner, with the weft along the first edge.
pub(crate) fn unfolded_uv(t: &[Vertex; 3]) -> [Vec2; 3] {
    let uv = t.map(|v| v.uv_mm);
    if stretch(t).is_some() {
        return uv;
    }
    let (p, q) = (
        t[1].position_mm - t[0].position_mm,
        t[2].position_mm - t[0].position_mm,
    );
    let weft = p.normalize();
    let across = (q - weft * q.dot(weft)).length();
    [
        uv[0],
        uv[0] + Vec2::new(p.length(), 0.0),
        uv[0] + Vec2::new(q.dot(weft), across),
    ]
}

/// Normal of a face, with twice its area as length.
pub(crate) fn area_vector(t: &[Vertex; 3]) -> Vec3 {
    (t[1].position_mm - t[0].position_mm).cross(t[2].position_mm - t[0].position_mm)
}

fn longest_edge(t: &[Vertex; 3]) -> f32 {
    let edge = |i: usize, j: usize| t[i].position_mm.distance(t[j].position_mm);
    edge(0, 1).max(edge(1, 2)).max(edge(2, 0))
}

/// Derivatives of the position by the place in the fabric plane, world mm per
/// mm of cloth along weft and warp; `None` when the texture has no area.
pub(crate) fn stretch(t: &[Vertex; 3]) -> Option<[Vec3; 2]> {
    let (p, q) = (
        t[1].position_mm - t[0].position_mm,
        t[2].position_mm - t[0].position_mm,
    );
    let (e, f) = (t[1].uv_mm - t[0].uv_mm, t[2].uv_mm - t[0].uv_mm);
    let twice = e.perp_dot(f);
    if twice.abs() <= FLAT * e.length_squared().max(f.length_squared()) {
        return None;
    }
    Some([(p * f.y - q * e.y) / twice, (q * e.x - p * f.x) / twice])
}
