//! The other way round: from a place in the cloth to the place over the mesh where it lies.

use crate::mesh::stretch;
use crate::{Mesh, Vertex};
use glam::{DVec2, DVec3, UVec2, Vec2};
use std::collections::HashMap;

/// Faces that hang together in the fabric plane. A chart that overlaps itself there shows one of
/// its faces at such a place.
pub struct Chart {
    faces: Vec<[Vertex; 3]>,
    low_mm: Vec2,
    high_mm: Vec2,
    /// Squares of the fabric plane, with the faces that reach into each: `faces_at` from
    /// `starts[k]` to `starts[k + 1]`.
    squares: UVec2,
    starts: Vec<u32>,
    faces_at: Vec<u32>,
}

/// So far outside a face, in shares of it, a place still counts as inside: rounding opens no gaps
/// between faces.
const SLACK: f64 = 1e-6;

/// Squares that a face reaches into, at most in the mean.
const MOST_ENTRIES: u64 = 64;

impl Chart {
    /// Memory that the charts of a mesh take for each of its faces, at most: the face, its place in
    /// a square's list [`MOST_ENTRIES`] times, and three corners of the table that finds neighbours.
    pub const BYTES_PER_FACE: u64 = 640;

    /// The charts of a mesh. Faces without area in the fabric plane are in none.
    pub fn all(mesh: &Mesh) -> Vec<Chart> {
        let mut parts: Vec<usize> = (0..mesh.triangles().len()).collect();
        fn root(parts: &mut [usize], mut k: usize) -> usize {
            while parts[k] != k {
                parts[k] = parts[parts[k]];
                k = parts[k];
            }
            k
        }
        // Faces hang together where they share a corner, and its place in the fabric plane.
        let mut first: HashMap<(u32, [u32; 2]), usize> = HashMap::new();
        for (k, (face, corners)) in mesh.triangles().iter().zip(mesh.corners()).enumerate() {
            if stretch(face).is_none() {
                continue;
            }
            for (vertex, corner) in face.iter().zip(corners) {
                let key = (*corner, vertex.uv_mm.to_array().map(f32::to_bits));
                let other = *first.entry(key).or_insert(k);
                let (a, b) = (root(&mut parts, k), root(&mut parts, other));
                parts[a.max(b)] = a.min(b);
            }
        }
        let mut order: Vec<usize> = Vec::new();
        let mut charts: HashMap<usize, Vec<[Vertex; 3]>> = HashMap::new();
        for (k, face) in mesh.triangles().iter().enumerate() {
            if stretch(face).is_some() {
                let part = root(&mut parts, k);
                let faces = charts.entry(part).or_insert_with(|| {
                    order.push(part);
                    Vec::new()
                });
                faces.push(*face);
            }
        }
        let made = order.iter().filter_map(|part| charts.remove(part));
        made.map(Chart::new).collect()
    }

    fn new(faces: Vec<[Vertex; 3]>) -> Chart {
        let corners = || faces.iter().flatten().map(|v| v.uv_mm);
        let low_mm = corners().fold(Vec2::INFINITY, Vec2::min);
        let high_mm = corners().fold(Vec2::NEG_INFINITY, Vec2::max);
        let size = (high_mm - low_mm).max(Vec2::splat(f32::MIN_POSITIVE));
        // About a square for a face.
        let side = (size.x * size.y / faces.len() as f32).sqrt();
        let squares = (size / side).ceil().clamp(Vec2::ONE, Vec2::splat(4096.0));
        let mut chart = Chart {
            low_mm,
            high_mm,
            squares: squares.as_uvec2(),
            starts: Vec::new(),
            faces_at: Vec::new(),
            faces,
        };
        let reach = |chart: &Chart, face: &[Vertex; 3]| {
            let [a, b, c] = face.map(|v| v.uv_mm);
            (chart.square(a.min(b).min(c)), chart.square(a.max(b).max(c)))
        };
        // Faces that reach far take coarser squares.
        let entries = |chart: &Chart| -> u64 {
            let of = |face| {
                let (low, high) = reach(chart, face);
                (high - low + UVec2::ONE).as_u64vec2().element_product()
            };
            chart.faces.iter().map(of).sum()
        };
        while entries(&chart) > MOST_ENTRIES * chart.faces.len() as u64 {
            chart.squares = (chart.squares / 2).max(UVec2::ONE);
        }
        let squares_of = |chart: &Chart, face: &[Vertex; 3]| {
            let ((low, high), across) = (reach(chart, face), chart.squares.x);
            (low.y..=high.y).flat_map(move |y| (low.x..=high.x).map(move |x| y * across + x))
        };
        // Where the list of each square ends, then, filled from there, where it starts.
        let count = chart.squares.element_product() as usize;
        let mut starts = vec![0u32; count + 1];
        for face in &chart.faces {
            squares_of(&chart, face).for_each(|k| starts[k as usize] += 1);
        }
        let mut sum = 0;
        for start in &mut starts {
            sum += *start;
            *start = sum;
        }
        let mut faces_at = vec![0; sum as usize];
        for (k, face) in chart.faces.iter().enumerate() {
            for square in squares_of(&chart, face) {
                starts[square as usize] -= 1;
                faces_at[starts[square as usize] as usize] = k as u32;
            }
        }
        (chart.starts, chart.faces_at) = (starts, faces_at);
        chart
    }

    /// A box around it in the fabric plane: least and greatest corner, mm.
    pub fn bounds_mm(&self) -> (Vec2, Vec2) {
        (self.low_mm, self.high_mm)
    }

    fn square(&self, uv_mm: Vec2) -> UVec2 {
        let share = (uv_mm - self.low_mm) / (self.high_mm - self.low_mm);
        let at = (share * self.squares.as_vec2()).max(Vec2::ZERO).as_uvec2();
        at.min(self.squares - UVec2::ONE)
    }

    /// The place over the mesh, mm, of one in the cloth, whose z is its height over the mesh
    /// along the normals of the corners; `None` outside of the chart. `face` is where the place before lay, and
    /// where this one does.
    pub fn lift_mm(&self, cloth_mm: DVec3, face: &mut usize) -> Option<DVec3> {
        let uv = cloth_mm.truncate();
        let weights = |k: usize| -> Option<[f64; 3]> {
            let [a, b, c] = self.faces.get(k)?.map(|v| v.uv_mm.as_dvec2());
            let (e, f, p): (DVec2, DVec2, DVec2) = (b - a, c - a, uv - a);
            let twice = e.perp_dot(f);
            let (v, w) = (p.perp_dot(f) / twice, e.perp_dot(p) / twice);
            let weights = [1.0 - v - w, v, w];
            weights.iter().all(|&w| w >= -SLACK).then_some(weights)
        };
        let found = weights(*face).or_else(|| {
            let outside = |p: DVec2| {
                let (low, high) = (self.low_mm.as_dvec2(), self.high_mm.as_dvec2());
                p.cmplt(low).any() || p.cmpgt(high).any()
            };
            if outside(uv) {
                return None;
            }
            let square = self.square(uv.as_vec2());
            let at = (square.y * self.squares.x + square.x) as usize;
            let (start, end) = (self.starts[at] as usize, self.starts[at + 1] as usize);
            self.faces_at[start..end].iter().find_map(|&k| {
                let weights = weights(k as usize)?;
                *face = k as usize;
                Some(weights)
            })
        })?;
        let corners = &self.faces[*face];
        Some(corners.iter().zip(found).fold(DVec3::ZERO, |sum, (v, w)| {
            let lifted = v.position_mm.as_dvec3() + cloth_mm.z * v.normal.as_dvec3();
            sum + w * lifted
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Placement, read_obj};
    use organza_basis::Budget;

    fn charts(obj: &str) -> Vec<Chart> {
        let placement = Placement {
            mm_per_unit: 1.0,
            mm_per_uv: 1.0,
        };
        Chart::all(&read_obj(obj.as_bytes(), placement, &mut Budget::new(1 << 20)).unwrap())
    }

    /// A square that stands upright, one of whose halves lies apart in the fabric plane.
    #[test]
    fn places_are_lifted_to_the_faces_of_their_chart() {
        let square = "v 10 0 0\nv 12 0 0\nv 12 0 2\nv 10 0 2\n";
        let whole =
            format!("{square}vt 0 0\nvt 2 0\nvt 2 2\nvt 0 2\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n");
        let one = charts(&whole);
        assert_eq!(one.len(), 1);
        let (mut face, place) = (0, DVec3::new(0.5, 1.5, 0.1));
        // The normal is -y.
        let found = one[0].lift_mm(place, &mut face).unwrap();
        assert!(
            (found - DVec3::new(10.5, -0.1, 1.5)).length() < 1e-6,
            "{found}"
        );
        assert_eq!(one[0].lift_mm(DVec3::new(2.1, 1.0, 0.0), &mut face), None);
        let apart = format!(
            "{square}vt 0 0\nvt 2 0\nvt 2 2\nvt 5 0\nvt 7 2\nvt 5 2\nf 1/1 2/2 3/3\nf 1/4 3/5 4/6\n"
        );
        let two = charts(&apart);
        assert_eq!(two.len(), 2);
        let place = DVec3::new(5.5, 1.5, 0.1);
        assert_eq!(two[0].lift_mm(place, &mut 0), None);
        let found = two[1].lift_mm(place, &mut 0).unwrap();
        assert!(
            (found - DVec3::new(10.5, -0.1, 1.5)).length() < 1e-6,
            "{found}"
        );
    }
}
