//! A shell as plain tables, for engines that follow rays without pointers.

use crate::shell::{Shell, Tetrahedron};
use glam::{DVec3, Mat3, Vec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb as BvhBox;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::builder::build_bvh2;
use std::collections::HashMap;
use std::time::Duration;

/// No tetrahedron lies there.
pub const NOBODY: u32 = u32::MAX;

/// Tetrahedra that overlap by less than this part of their size only touch.
const TOUCH: f64 = 1e-5;

/// Corners of the face opposite to each corner.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

/// Tetrahedra and the boxes around them. Places of the world are counted from a point that
/// the caller names.
#[derive(Clone, Debug, Default)]
pub struct ShellTables {
    /// In the order of the boxes that hold them.
    pub tetrahedra: Vec<ShellTetrahedron>,
    /// A tree of boxes from the root on: the first child of a box follows it.
    pub boxes: Vec<ShellBox>,
}

/// A tetrahedron in which the map between world and cloth is affine.
#[derive(Clone, Copy, Debug)]
pub struct ShellTetrahedron {
    /// Its first corner in the world, mm from the point.
    pub corner_mm: Vec3,
    /// Weights of its second to fourth corner, from the world relative to the first, 1/mm.
    pub weights_from_world: Mat3,
    /// Its first corner in the cloth, mm.
    pub cloth_corner_mm: DVec3,
    /// Places of the cloth per place of the world.
    pub cloth_from_world: Mat3,
    /// Turns directions of the cloth to the world: orthogonal.
    pub world_from_cloth: Mat3,
    /// Takes differences of places of the cloth to the world.
    pub stretch: Mat3,
    /// The tetrahedra beyond the faces opposite to its corners; [`NOBODY`] where none is.
    pub neighbours: [u32; 4],
    /// Whether no other tetrahedron fills any of its room.
    pub is_alone: bool,
}

/// A box around tetrahedra.
#[derive(Clone, Copy, Debug)]
pub struct ShellBox {
    /// Least and greatest corner in the world, mm from the point.
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

impl Shell {
    /// The shell as tables, with places of the world counted from a point.
    pub fn tables(&self, point_mm: DVec3) -> ShellTables {
        let solid: Vec<Tetrahedron> = self.solid().copied().collect();
        let corners: Vec<[DVec3; 4]> = solid
            .iter()
            .map(|t| corners_of(t).map(|c| c - point_mm))
            .collect();
        let margin = self.margin_mm();
        let around: Vec<BvhBox> = corners
            .iter()
            .map(|c| {
                let all = c.map(|c| c.as_vec3());
                let low = all.into_iter().fold(all[0], Vec3::min) - margin;
                let high = all.into_iter().fold(all[0], Vec3::max) + margin;
                BvhBox::new(Vec3A::from(low), Vec3A::from(high))
            })
            .collect();
        let tree = build_bvh2(
            &around,
            BvhBuildParams::medium_build(),
            &mut Duration::default(),
        );
        let (mut boxes, mut order) = (Vec::new(), Vec::with_capacity(solid.len()));
        add_boxes(&tree, 0, &mut boxes, &mut order);
        let mut place = vec![NOBODY; solid.len()];
        for (at, &old) in order.iter().enumerate() {
            place[old as usize] = at as u32;
        }
        let neighbours = neighbours(&solid);
        let others = Others {
            boxes: &boxes,
            order: &order,
            corners: &corners,
        };
        let tetrahedra = order.iter().map(|&old| {
            let t = &solid[old as usize];
            ShellTetrahedron {
                corner_mm: (t.corner_mm - point_mm).as_vec3(),
                weights_from_world: t.weights_from_world.as_mat3(),
                cloth_corner_mm: t.cloth_corner_mm,
                cloth_from_world: t.cloth_from_world.as_mat3(),
                world_from_cloth: t.world_from_cloth,
                stretch: t.stretch,
                neighbours: neighbours[old as usize]
                    .map(|n| place.get(n as usize).copied().unwrap_or(NOBODY)),
                is_alone: others.is_alone(old),
            }
        });
        ShellTables {
            tetrahedra: tetrahedra.collect(),
            boxes,
        }
    }
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
fn neighbours(solid: &[Tetrahedron]) -> Vec<[u32; 4]> {
    let mut all = vec![[NOBODY; 4]; solid.len()];
    let mut open: HashMap<[u32; 3], (usize, usize)> = HashMap::new();
    for (i, t) in solid.iter().enumerate() {
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
    boxes: &'a [ShellBox],
    order: &'a [u32],
    corners: &'a [[DVec3; 4]],
}

impl Others<'_> {
    fn is_alone(&self, own: u32) -> bool {
        let a = &self.corners[own as usize];
        let low = a.iter().fold(a[0], |l, c| l.min(*c)).as_vec3();
        let high = a.iter().fold(a[0], |h, c| h.max(*c)).as_vec3();
        let mut at = 0;
        while let Some(here) = self.boxes.get(at) {
            if here.min_mm.cmpgt(high).any() || here.max_mm.cmplt(low).any() {
                at = here.skip as usize;
                continue;
            }
            let held = &self.order[here.first as usize..][..here.count as usize];
            for &other in held {
                if other != own && overlap(a, &self.corners[other as usize]) {
                    return false;
                }
            }
            at += 1;
        }
        true
    }
}

/// Whether two tetrahedra have room in common: no direction separates them, of the normals of
/// their faces and the cross products of their edges \[Gottschalk1996].
fn overlap(a: &[DVec3; 4], b: &[DVec3; 4]) -> bool {
    let touch = TOUCH
        * edges(a)
            .chain(edges(b))
            .map(DVec3::length)
            .fold(0.0, f64::max);
    let normals = |t: &[DVec3; 4]| FACES.map(|[i, j, k]| (t[j] - t[i]).cross(t[k] - t[i]));
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
    if normals(a).into_iter().chain(normals(b)).any(separates) {
        return false;
    }
    !edges(a).any(|u| edges(b).any(|v| separates(u.cross(v))))
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
            assert_eq!(overlap(&own, &tetrahedron(at)), shares, "{at}");
        }
        // On the other side of a face, and folded back over it.
        let [a, b, c, d] = own;
        assert!(!overlap(&own, &[a, b, c, -d]));
        assert!(overlap(&own, &[a, b, c, 0.5 * d]));
    }
}
