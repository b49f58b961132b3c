//! Means along a fibre in the plane across it, each found once: rays from all middles meet there.

use glam::Vec3;
use organza_basis::Frame;
use std::cell::RefCell;

/// Nodes along each axis of the plane, and their distance in voxels.
const NODES: usize = 64;
const SPACING: f32 = 0.5;

/// A mean that has not been found yet; those beyond the window are infinite.
const UNKNOWN: f32 = f32::NAN;

/// Means at the nodes of a plane, found where they are wanted, and linear between nodes.
pub(crate) struct PlaneMeans<F: Fn(Vec3) -> Option<f32>> {
    mean: F,
    origin: Vec3,
    /// Steps from node to node, voxels.
    steps: [Vec3; 2],
    /// What a place less the origin is multiplied with, for its distance in nodes.
    per_step: [Vec3; 2],
    found: RefCell<Vec<f32>>,
}

impl<F: Fn(Vec3) -> Option<f32>> PlaneMeans<F> {
    /// The plane through a place; `voxel_mm` is the least edge of a voxel.
    pub fn new(origin: Vec3, plane: &Frame, per_mm: Vec3, voxel_mm: f32, mean: F) -> Self {
        let spacing_mm = SPACING * voxel_mm;
        PlaneMeans {
            mean,
            origin,
            steps: [plane.s, plane.t].map(|d| d * per_mm * spacing_mm),
            per_step: [plane.s, plane.t].map(|d| d / (per_mm * spacing_mm)),
            found: RefCell::new(vec![UNKNOWN; NODES * NODES]),
        }
    }

    /// The mean at a place of the plane; `None` where it leaves the window.
    pub fn at(&self, p: Vec3) -> Option<f32> {
        let half = (NODES / 2) as f32;
        let [u, v] = self.per_step.map(|d| (p - self.origin).dot(d) + half);
        let most = (NODES - 1) as f32;
        if !(u >= 0.0 && v >= 0.0 && u < most && v < most) {
            return (self.mean)(p);
        }
        let (i, j) = (u as usize, v as usize);
        let (fu, fv) = (u - i as f32, v - j as f32);
        let row = |j: usize| {
            let (a, b) = (self.node(i, j), self.node(i + 1, j));
            a + fu * (b - a)
        };
        let (a, b) = (row(j), row(j + 1));
        let mean = a + fv * (b - a);
        // Beside a node beyond the window.
        if mean.is_finite() {
            Some(mean)
        } else {
            (self.mean)(p)
        }
    }

    fn node(&self, i: usize, j: usize) -> f32 {
        let at = i + NODES * j;
        let known = self.found.borrow()[at];
        if !known.is_nan() {
            return known;
        }
        let half = (NODES / 2) as f32;
        let [s, t] = self.steps;
        let p = self.origin + (i as f32 - half) * s + (j as f32 - half) * t;
        let mean = (self.mean)(p).unwrap_or(f32::INFINITY);
        self.found.borrow_mut()[at] = mean;
        mean
    }
}
