//! Which tetrahedra of a shell lie side by side, and which share their room with others.

use crate::shell::Tetrahedron;
use glam::{DVec3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb as BvhBox;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use rayon::prelude::*;
use std::collections::HashMap;
use std::time::Duration;

/// No tetrahedron lies there.
pub const NOBODY: u32 = u32::MAX;

/// Tetrahedra that overlap by less than this part of their size only touch.
const TOUCH: f64 = 1e-5;

/// Corners of the face opposite to each corner.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

/// What lies around a tetrahedron.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Around {
    /// The tetrahedra beyond the faces opposite to its corners; [`NOBODY`] where none is.
    pub neighbours: [u32; 4],
    /// Whether no other tetrahedron fills any of its room.
    pub is_alone: bool,
}

impl Around {
    /// Memory for one tetrahedron while it is looked around: with shapes, names of faces and boxes.
    pub const BYTES: usize = size_of::<Around>()
        + size_of::<Shape>()
        + 4 * (size_of::<([u32; 3], (usize, usize))>()
            + size_of::<ShellBox>()
            + size_of::<BvhBox>());
}

/// A box around tetrahedra.
#[derive(Clone, Copy, Debug)]
pub struct ShellBox {
    /// Least and greatest corner in the world, mm from a point.
    pub min_mm: Vec3,
    /// See `min_mm`.
    pub max_mm: Vec3,
    /// The next box for a ray that misses this one.
    pub skip: u32,
    /// The first of the tetrahedra that it holds itself, and their number.
    pub first: u32,
    /// See `first`.
    pub count: u32,
}

/// Boxes around the tetrahedra that have a volume.
pub(crate) struct Boxes {
    /// A tree from the root on: the first child of a box follows it.
    pub boxes: Vec<ShellBox>,
    /// The numbers of the tetrahedra in the order of the boxes that hold them.
    pub order: Vec<u32>,
}

impl Boxes {
    /// With places of the world counted from a point, grown by a margin.
    pub fn new(tetrahedra: &[Tetrahedron], point_mm: DVec3, margin_mm: f32) -> Boxes {
        let solid = |t: &(u32, &Tetrahedron)| t.1.is_solid();
        let solid: Vec<_> = (0..).zip(tetrahedra).filter(solid).collect();
        let around = solid.iter().map(|(_, t)| {
            let all = corners_of(t).map(|c| (c - point_mm).as_vec3());
            let low = all.into_iter().fold(all[0], Vec3::min) - margin_mm;
            let high = all.into_iter().fold(all[0], Vec3::max) + margin_mm;
            BvhBox::new(Vec3A::from(low), Vec3A::from(high))
        });
        let tree = build_bvh2(
            &around.collect::<Vec<_>>(),
            BvhBuildParams::medium_build(),
            &mut Duration::default(),
        );
        let (mut boxes, mut order) = (Vec::new(), Vec::with_capacity(solid.len()));
        add_boxes(&tree, 0, &mut boxes, &mut order);
        for number in &mut order {
            *number = solid[*number as usize].0;
        }
        Boxes { boxes, order }
    }
}

/// What lies around every tetrahedron, which are in double precision about a point.
pub(crate) fn around_all(
    tetrahedra: &[Tetrahedron],
    point_mm: DVec3,
    margin_mm: f32,
) -> Vec<Around> {
    let boxes = Boxes::new(tetrahedra, point_mm, margin_mm);
    let shapes = tetrahedra.par_iter().map(|t| match t.is_solid() {
        true => Shape::new(corners_of(t).map(|c| c - point_mm)),
        false => Shape::new([DVec3::ZERO; 4]),
    });
    let others = Others {
        boxes: &boxes,
        shapes: &shapes.collect::<Vec<_>>(),
    };
    let neighbours = neighbours(tetrahedra);
    let all = neighbours.par_iter().zip(tetrahedra).enumerate();
    let all = all.map(|(own, (neighbours, t))| Around {
        neighbours: *neighbours,
        is_alone: t.is_solid() && others.is_alone(own as u32),
    });
    all.collect()
}

fn corners_of(t: &Tetrahedron) -> [DVec3; 4] {
    let edges = t.weights_from_world.inverse();
    let [b, c, d] = [edges.x_axis, edges.y_axis, edges.z_axis].map(|e| t.corner_mm + e);
    [t.corner_mm, b, c, d]
}

/// The box of a node and all below, and the tetrahedra in their order.
fn add_boxes(tree: &Bvh2, node: usize, boxes: &mut Vec<ShellBox>, order: &mut Vec<u32>) {
    let Some(own) = tree.nodes.get(node) else {
        return;
    };
    let (at, first) = (boxes.len(), own.first_index as usize);
    let count = own.prim_count;
    boxes.push(ShellBox {
        min_mm: own.aabb().min.into(),
        max_mm: own.aabb().max.into(),
        skip: 0,
        first: order.len() as u32,
        count,
    });
    if own.is_leaf() {
        order.extend_from_slice(&tree.primitive_indices[first..first + count as usize]);
    } else {
        add_boxes(tree, first, boxes, order);
        add_boxes(tree, first + 1, boxes, order);
    }
    boxes[at].skip = boxes.len() as u32;
}

/// Who lies beyond the faces of each: two tetrahedra that share all corners of a face.
fn neighbours(tetrahedra: &[Tetrahedron]) -> Vec<[u32; 4]> {
    let mut all = vec![[NOBODY; 4]; tetrahedra.len()];
    let mut open: HashMap<[u32; 3], (usize, usize)> = HashMap::new();
    for (i, t) in tetrahedra.iter().enumerate().filter(|(_, t)| t.is_solid()) {
        for (k, face) in FACES.iter().enumerate() {
            let mut name = face.map(|c| t.corners[c]);
            name.sort_unstable();
            // A third at the same face finds it open again: such places are not alone.
            match open.remove(&name) {
                Some((j, other)) => {
                    all[i][k] = j as u32;
                    all[j][other] = i as u32;
                }
                None => {
                    open.insert(name, (i, k));
                }
            }
        }
    }
    all
}

/// All tetrahedra, to look for those that overlap.
struct Others<'a> {
    boxes: &'a Boxes,
    shapes: &'a [Shape],
}

impl Others<'_> {
    fn is_alone(&self, own: u32) -> bool {
        let a = &self.shapes[own as usize];
        let (low, high) = (a.low.as_vec3(), a.high.as_vec3());
        let mut at = 0;
        while let Some(here) = self.boxes.boxes.get(at) {
            if here.min_mm.cmpgt(high).any() || here.max_mm.cmplt(low).any() {
                at = here.skip as usize;
                continue;
            }
            let held = &self.boxes.order[here.first as usize..][..here.count as usize];
            for &other in held {
                if other != own && a.overlaps(&self.shapes[other as usize]) {
                    return false;
                }
            }
            at += 1;
        }
        true
    }
}

/// A tetrahedron by itself.
struct Shape {
    corners: [DVec3; 4],
    low: DVec3,
    high: DVec3,
    /// Unit normals of its faces, outward, and their distances from zero.
    faces: [(DVec3, f64); 4],
    longest: f64,
}

impl Shape {
    fn new(corners: [DVec3; 4]) -> Shape {
        let faces = [0, 1, 2, 3].map(|k| {
            let [a, b, c] = FACES[k].map(|i| corners[i]);
            let normal = (b - a).cross(c - a).normalize_or_zero();
            let outward = match normal.dot(corners[k] - a) > 0.0 {
                true => -normal,
                false => normal,
            };
            (outward, outward.dot(a))
        });
        Shape {
            low: corners[1..].iter().fold(corners[0], |l, c| l.min(*c)),
            high: corners[1..].iter().fold(corners[0], |h, c| h.max(*c)),
            faces,
            longest: edges(&corners).map(DVec3::length).fold(0.0, f64::max),
            corners,
        }
    }

    /// Whether two tetrahedra have room in common: no direction separates them, of the normals of
    /// their faces and the cross products of their edges \[Gottschalk1996].
    fn overlaps(&self, other: &Shape) -> bool {
        let touch = TOUCH * self.longest.max(other.longest);
        let (a, b) = (&self.corners, &other.corners);
        let is_beyond = |(normal, at): &(DVec3, f64), corners: &[DVec3; 4]| {
            let mut above = corners.iter().map(|c| normal.dot(*c) - at);
            *normal != DVec3::ZERO && above.all(|above| above >= -touch)
        };
        if self.low.cmpgt(other.high).any()
            || other.low.cmpgt(self.high).any()
            || self.faces.iter().any(|face| is_beyond(face, b))
            || other.faces.iter().any(|face| is_beyond(face, a))
        {
            return false;
        }
        let separates = |axis: DVec3| {
            let Some(axis) = axis.try_normalize() else {
                return false;
            };
            let [(a_low, a_high), (b_low, b_high)] = [a, b].map(|t| {
                let along = t.map(|c| c.dot(axis));
                let low = along.into_iter().fold(f64::INFINITY, f64::min);
                (low, along.into_iter().fold(f64::NEG_INFINITY, f64::max))
            });
            a_high.min(b_high) - a_low.max(b_low) <= touch
        };
        !edges(a).any(|u| edges(b).any(|v| separates(u.cross(v))))
    }
}

fn edges(t: &[DVec3; 4]) -> impl Iterator<Item = DVec3> {
    [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
        .into_iter()
        .map(|(i, j)| t[j] - t[i])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron(at: DVec3) -> [DVec3; 4] {
        [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z].map(|c| c + at)
    }

    fn overlap(a: [DVec3; 4], b: [DVec3; 4]) -> bool {
        Shape::new(a).overlaps(&Shape::new(b))
    }

    #[test]
    fn tetrahedra_overlap_where_they_share_room() {
        let own = tetrahedron(DVec3::ZERO);
        for (at, shares) in [
            (DVec3::new(0.1, 0.1, 0.1), true),
            (DVec3::new(0.4, 0.4, 0.1), true),
            (DVec3::new(0.4, 0.4, 0.3), false),
            (DVec3::X, false),
            (DVec3::new(-0.3, 0.1, 0.0), true),
        ] {
            assert_eq!(overlap(own, tetrahedron(at)), shares, "{at}");
        }
        // On the other side of a face, and folded back over it.
        let [a, b, c, d] = own;
        assert!(!overlap(own, [a, b, c, -d]));
        assert!(overlap(own, [a, b, c, 0.5 * d]));
    }
}
