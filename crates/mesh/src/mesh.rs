//! A checked mesh.

use crate::error::Error;
use glam::{Vec2, Vec3};
use std::collections::HashMap;

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

/// Edges shorter than this share of their place in the fabric plane are rounded too coarsely to be
/// divided.
const COARSE: f32 = 4.0 * f32::EPSILON;

/// Nearer to a corner than this share of an edge, a [cut](Mesh::cut) passes through the corner.
const CORNER: f32 = 1e-4;

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
        let leans = self.means_at_corners(|face, vertex| {
            let [weft, warp] = stretch(face)?.map(Vec3::normalize_or_zero);
            let tangent = tangent_at(vertex.uv_mm);
            Some(tangent.x * weft + tangent.y * warp)
        });
        self.add_leans(&leans);
    }

    /// Moves points in the plane of the cloth: `shift_mm_at` gives, at a place of the fabric plane in
    /// mm, how far they go along weft and warp. Faces with a corner where it gives none are left out.
    ///
    /// # Errors
    /// When no face is left.
    pub fn shift(&mut self, shift_mm_at: impl Fn(Vec2) -> Option<Vec2>) -> Result<(), Error> {
        let shifts = self.means_at_corners(|face, vertex| {
            let [weft, warp] = stretch(face)?;
            let shift_mm = shift_mm_at(vertex.uv_mm)?;
            Some(shift_mm.x * weft + shift_mm.y * warp)
        });
        for (triangle, ids) in self.triangles.iter_mut().zip(&self.corners) {
            for (vertex, &id) in triangle.iter_mut().zip(ids) {
                vertex.position_mm += shifts[id as usize];
            }
        }
        let is_kept = |t: &[Vertex; 3]| t.iter().all(|v| shift_mm_at(v.uv_mm).is_some());
        let mut kept = self.triangles.iter().map(is_kept);
        self.corners.retain(|_| kept.next().unwrap_or(false));
        let before = self.triangles.len();
        self.triangles.retain(is_kept);
        match self.triangles.is_empty() {
            true => Err(Error::Empty { dropped: before }),
            false => Ok(()),
        }
    }

    /// Flattens what lies on the mesh, towards the mesh: `share_at` gives, at a place of the fabric
    /// plane in mm, the share of its thickness that it loses, at most nine tenths. To be called
    /// after [`Mesh::press`].
    pub fn flatten(&mut self, share_at: impl Fn(Vec2) -> f32) {
        let lost = self.means_at_corners(|_, vertex| {
            Some(share_at(vertex.uv_mm).clamp(0.0, 0.9) * vertex.normal)
        });
        self.leans.resize(lost.len(), Vec3::ZERO);
        for (lean, lost) in self.leans.iter_mut().zip(&lost) {
            *lean = *lean * (1.0 - lost.length()) - *lost;
        }
    }

    /// Presses a sheet that lies half way through the mesh from above: `depth_mm_at` gives, at a place
    /// of the fabric plane in mm, how far its upper side sinks; its lower side stays. It keeps at
    /// least a tenth of its thickness.
    pub fn press(&mut self, thickness_mm: f32, depth_mm_at: impl Fn(Vec2) -> f32) {
        let sunk = self.means_at_corners(|_, vertex| {
            let depth_mm = depth_mm_at(vertex.uv_mm).clamp(0.0, 0.9 * thickness_mm);
            Some(depth_mm * vertex.normal)
        });
        for (triangle, ids) in self.triangles.iter_mut().zip(&self.corners) {
            for (vertex, &id) in triangle.iter_mut().zip(ids) {
                vertex.position_mm -= 0.5 * sunk[id as usize];
            }
        }
        let leans: Vec<Vec3> = sunk.iter().map(|s| -*s / thickness_mm).collect();
        self.add_leans(&leans);
    }

    /// The mean of what the corners of faces have at every point that they share.
    fn means_at_corners(&self, own: impl Fn(&[Vertex; 3], &Vertex) -> Option<Vec3>) -> Vec<Vec3> {
        let mut sums = vec![(Vec3::ZERO, 0.0f32); self.points()];
        for (triangle, ids) in self.triangles.iter().zip(&self.corners) {
            for (vertex, &id) in triangle.iter().zip(ids) {
                if let Some(own) = own(triangle, vertex) {
                    let (sum, count) = &mut sums[id as usize];
                    *sum += own;
                    *count += 1.0;
                }
            }
        }
        let mean = |(sum, count): &(Vec3, f32)| *sum / count.max(1.0);
        sums.iter().map(mean).collect()
    }

    fn add_leans(&mut self, more: &[Vec3]) {
        self.leans.resize(more.len(), Vec3::ZERO);
        for (lean, more) in self.leans.iter_mut().zip(more) {
            *lean += *more;
        }
    }

    /// One more than the greatest number of a shared corner.
    fn points(&self) -> usize {
        let most = self.corners.iter().flatten().max().copied().unwrap_or(0);
        most as usize + 1
    }

    /// Divides faces until every edge is at most as long, in mm of the fabric plane, as
    /// `longest_mm_at` says of its middle. Neighbours divide their common edge alike, so no gaps
    /// open. Edges as short as single precision is coarse stay whole. To be called before what moves
    /// points: [`Mesh::shift`], [`Mesh::press`], [`Mesh::flatten`] and [`Mesh::lean`].
    ///
    /// # Errors
    /// More than `most_faces` would be needed.
    pub fn refine(
        &mut self,
        longest_mm_at: impl Fn(Vec2) -> f32,
        most_faces: usize,
    ) -> Result<(), Error> {
        let is_long = |[a, b]: [Vec2; 2]| {
            let middle = 0.5 * (a + b);
            let coarse_mm = COARSE * middle.abs().max_element();
            (a.distance(b) > longest_mm_at(middle).max(coarse_mm)).then_some(0.5)
        };
        while self.divide(is_long, most_faces)? {}
        Ok(())
    }

    /// Divides faces along parallel lines of the fabric plane: where `place_at`, which is linear in
    /// the place in mm, has one of the values `lines`, which are sorted. To be called before
    /// [`Mesh::refine`].
    ///
    /// # Errors
    /// More than `most_faces` would be needed.
    pub fn cut(
        &mut self,
        place_at: impl Fn(Vec2) -> f32,
        lines: &[f32],
        most_faces: usize,
    ) -> Result<(), Error> {
        let crossing = |ends: [Vec2; 2]| {
            let [a, b] = ends.map(&place_at);
            let (low, high) = (a.min(b), a.max(b));
            // Nearer to an end, the line passes through it.
            let near = (CORNER * (high - low)).max(COARSE * low.abs().max(high.abs()));
            let first = lines.partition_point(|line| *line <= low + near);
            let end = lines.partition_point(|line| *line < high - near);
            // Half of the others lie on either side, so that few rounds divide an edge at all.
            (first < end).then(|| (lines[(first + end) / 2] - a) / (b - a))
        };
        while self.divide(crossing, most_faces)? {}
        Ok(())
    }

    /// Tears the mesh into parts and moves each by itself: `part_at` numbers the part of a face by its
    /// middle in the fabric plane, and `moved_mm_at` gives, for a part and a place in mm, how far a
    /// point goes along weft, warp and normal. Normals turn with the faces. Parts may overlap.
    pub fn tear(
        &mut self,
        part_at: impl Fn(Vec2) -> usize,
        moved_mm_at: impl Fn(usize, Vec2) -> Vec3,
    ) {
        let mut own: HashMap<(usize, u32), u32> = HashMap::new();
        let mut leans = Vec::new();
        for (triangle, ids) in self.triangles.iter().zip(&mut self.corners) {
            let part = part_at(middle_mm(triangle));
            for id in ids {
                let lean = self.leans.get(*id as usize).copied().unwrap_or_default();
                let new = own.len() as u32;
                *id = *own.entry((part, *id)).or_insert_with(|| {
                    leans.push(lean);
                    new
                });
            }
        }
        self.leans = leans;
        let moved = self.means_at_corners(|face, vertex| {
            let [weft, warp] = stretch(face)?;
            let by_mm = moved_mm_at(part_at(middle_mm(face)), vertex.uv_mm);
            Some(by_mm.x * weft + by_mm.y * warp + by_mm.z * vertex.normal)
        });
        for (triangle, ids) in self.triangles.iter_mut().zip(&self.corners) {
            for (vertex, &id) in triangle.iter_mut().zip(ids) {
                vertex.position_mm += moved[id as usize];
            }
        }
        let turned = self.means_at_corners(|face, vertex| {
            let up = area_vector(face);
            Some(up * up.dot(vertex.normal).signum())
        });
        for (triangle, ids) in self.triangles.iter_mut().zip(&self.corners) {
            for (vertex, &id) in triangle.iter_mut().zip(ids) {
                vertex.normal = turned[id as usize].normalize_or(vertex.normal);
            }
        }
    }

    /// The faces whose middle in the fabric plane is inside, as a mesh of their own; what is left is
    /// this one. Either may have no face.
    pub fn take(&mut self, is_inside: impl Fn(Vec2) -> bool) -> Mesh {
        let all = self.triangles.drain(..).zip(self.corners.drain(..));
        let (taken, left): (Vec<_>, Vec<_>) = all.partition(|(t, _)| is_inside(middle_mm(t)));
        (self.triangles, self.corners) = left.into_iter().unzip();
        let (triangles, corners) = taken.into_iter().unzip();
        Mesh {
            triangles,
            corners,
            repairs: self.repairs,
            leans: self.leans.clone(),
        }
    }

    /// Divides every edge once where `share_at` says, of its ends in the fabric plane, how far along
    /// it, if at all. Whether any was.
    fn divide(
        &mut self,
        share_at: impl Fn([Vec2; 2]) -> Option<f32>,
        most_faces: usize,
    ) -> Result<bool, Error> {
        // The new point of an edge, and how far along the edge it lies.
        let mut middles: HashMap<(u32, u32), (u32, f32)> = HashMap::new();
        let mut points = self.points() as u32;
        for (triangle, ids) in self.triangles.iter().zip(&self.corners) {
            for ends in EDGES {
                let [a, b] = in_order(ids, ends);
                if let Some(share) = share_at([triangle[a].uv_mm, triangle[b].uv_mm]) {
                    middles.entry((ids[a], ids[b])).or_insert_with(|| {
                        points += 1;
                        (points - 1, share)
                    });
                }
            }
        }
        if middles.is_empty() {
            return Ok(false);
        }
        let divided = |ids: &[u32; 3]| {
            EDGES.map(|ends| middles.get(&in_order(ids, ends).map(|i| ids[i]).into()))
        };
        let more = |ids: &[u32; 3]| divided(ids).iter().flatten().count();
        let faces = self.triangles.len() + self.corners.iter().map(more).sum::<usize>();
        if faces > most_faces {
            return Err(Error::TooLarge {
                faces,
                limit: most_faces,
            });
        }
        let mut triangles = Vec::with_capacity(faces);
        let mut corners = Vec::with_capacity(faces);
        for (triangle, ids) in self.triangles.iter().zip(&self.corners) {
            let middles = divided(ids);
            for face in parts(middles.map(|m| m.is_some())) {
                let middle = |i: usize| middles[i - 3].copied().unwrap_or_default();
                triangles.push(face.map(|i| match i {
                    0..3 => triangle[i],
                    _ => {
                        let [a, b] = in_order(ids, EDGES[i - 3]);
                        between(&triangle[a], &triangle[b], middle(i).1)
                    }
                }));
                corners.push(face.map(|i| match i {
                    0..3 => ids[i],
                    _ => middle(i).0,
                }));
            }
        }
        (self.triangles, self.corners) = (triangles, corners);
        if !self.leans.is_empty() {
            self.leans.resize(points as usize, Vec3::ZERO);
            for (&(a, b), &(new, share)) in &middles {
                let [a, b] = [a, b].map(|end| self.leans[end as usize]);
                self.leans[new as usize] = a.lerp(b, share);
            }
        }
        Ok(true)
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

/// The edges of a face: from a corner to the next.
const EDGES: [(usize, usize); 3] = [(0, 1), (1, 2), (2, 0)];

/// The ends of an edge, the same for both faces that share it.
fn in_order(ids: &[u32; 3], (a, b): (usize, usize)) -> [usize; 2] {
    if ids[a] <= ids[b] { [a, b] } else { [b, a] }
}

/// The middle of a face in the fabric plane.
fn middle_mm(t: &[Vertex; 3]) -> Vec2 {
    t.iter().map(|v| v.uv_mm).sum::<Vec2>() / 3.0
}

/// The corner at a share of the way from one to another.
fn between(a: &Vertex, b: &Vertex, share: f32) -> Vertex {
    let own = 1.0 - share;
    Vertex {
        position_mm: own * a.position_mm + share * b.position_mm,
        normal: (own * a.normal + share * b.normal).normalize_or(a.normal),
        uv_mm: own * a.uv_mm + share * b.uv_mm,
    }
}

/// The faces that a face becomes when some of its edges are divided: 0 to 2 are its corners, 3 to
/// 5 the middles of its edges.
fn parts(divided: [bool; 3]) -> Vec<[usize; 3]> {
    let turn = |by: usize, faces: &[[usize; 3]]| -> Vec<[usize; 3]> {
        let turned = |i: usize| i / 3 * 3 + (i % 3 + by) % 3;
        faces.iter().map(|f| f.map(turned)).collect()
    };
    // Where edge `by` alone is divided, or all but the one before it.
    match divided {
        [false, false, false] => turn(0, &[[0, 1, 2]]),
        [true, true, true] => turn(0, &[[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]]),
        [true, false, false] => turn(0, &[[0, 3, 2], [3, 1, 2]]),
        [false, true, false] => turn(1, &[[0, 3, 2], [3, 1, 2]]),
        [false, false, true] => turn(2, &[[0, 3, 2], [3, 1, 2]]),
        [true, true, false] => turn(0, &[[3, 1, 4], [0, 3, 4], [0, 4, 2]]),
        [false, true, true] => turn(1, &[[3, 1, 4], [0, 3, 4], [0, 4, 2]]),
        [true, false, true] => turn(2, &[[3, 1, 4], [0, 3, 4], [0, 4, 2]]),
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
