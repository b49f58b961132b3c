//! Occlusion of a fibre within its own cell, computed from explicit
//! fibres: the tables of [`organza_scatter::bvdf`] and how a walk uses them.

use crate::ExplicitFibres;
use glam::{Mat3, Vec3};
use organza_basis::{PathRng, Ray, warp};
use organza_scatter::{Bvdf, BvdfBuilder, Error, FibreFrame};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Edge of the cells, in voxels.
const CELL_VOXELS: f32 = 2.0;

/// Directions about the fibre and along it that a table resolves.
const DIRECTIONS: (usize, usize) = (8, 16);

/// Points counted per material, and directions looked to from each: some
/// hundred pairs for every entry of the table.
const POINTS: u64 = 16_384;
const LOOKS: usize = 24;

/// Tables of local visibility, one per material [Schroeder2011].
///
/// Light of the **first** event of a path is multiplied by the part of such
/// fibre points seen from the camera that the light reaches within their cell,
/// two voxels wide; its shadow ray then starts where it leaves the cell. Only
/// light found by shadow rays: what a walk meets, it has met already.
pub struct LocalVisibility {
    tables: Vec<Bvdf>,
    voxel_mm: Vec3,
}

/// Rows of the frame of the tables: x along the fibre, whose sense
/// means nothing, z out of the cloth.
fn from_world(axis: Vec3) -> Mat3 {
    // Any plane through no axis of a yarn will do to settle the sense.
    let x = axis * axis.dot(Vec3::new(0.72, 0.58, 0.38)).signum();
    let z = (Vec3::Z - x * x.z).try_normalize().unwrap_or(Vec3::Y);
    Mat3::from_cols(x, z.cross(x), z).transpose()
}

impl LocalVisibility {
    /// Counts the tables for cells of two voxels; `origin_mm` is a corner of one.
    ///
    /// # Errors
    /// None for the sizes used here; those of [`BvdfBuilder::new`].
    pub fn count(
        fibres: &ExplicitFibres,
        materials: usize,
        origin_mm: Vec3,
        voxel_mm: Vec3,
        seed: u64,
    ) -> Result<LocalVisibility, Error> {
        let tables = (0..materials).map(|material| {
            let mut builder = BvdfBuilder::new(DIRECTIONS.0, DIRECTIONS.1)?;
            let looks = |i| {
                let mut rng = PathRng::new(seed, material as u64, i);
                look_around(fibres, material, origin_mm, voxel_mm, &mut rng)
            };
            let points: Vec<_> = (0..POINTS).into_par_iter().filter_map(looks).collect();
            for point in &points {
                for (w_out, _) in point.iter().filter(|look| look.1) {
                    for (w_in, lit) in point {
                        builder.add(*w_in, *w_out, *lit);
                    }
                }
            }
            Ok(builder.build())
        });
        Ok(LocalVisibility {
            tables: tables.collect::<Result<_, Error>>()?,
            voxel_mm,
        })
    }

    /// Visibility of light from `w_in` at a fibre of a material and axis seen
    /// from `w_out`.
    pub fn at(&self, material: u16, axis: Vec3, w_in: Vec3, w_out: Vec3) -> f32 {
        let from_world = from_world(axis);
        let table = self.tables.get(usize::from(material));
        table.map_or(1.0, |t| t.at(from_world * w_in, from_world * w_out))
    }

    /// Distance from a point, in mm from a corner of a cell, along `w` to the
    /// face of its cell.
    pub fn to_face_mm(&self, p: Vec3, w: Vec3) -> f32 {
        to_face_mm(p, w, self.voxel_mm)
    }
}

fn to_face_mm(p: Vec3, w: Vec3, voxel_mm: Vec3) -> f32 {
    let edge = CELL_VOXELS * voxel_mm;
    let within = p - (p / edge).floor() * edge;
    let mut nearest = f32::INFINITY;
    for axis in 0..3 {
        let left = if w[axis] > 0.0 {
            edge[axis] - within[axis]
        } else {
            within[axis]
        };
        if w[axis] != 0.0 {
            nearest = nearest.min(left / w[axis].abs());
        }
    }
    nearest
}

/// A random point of a fibre of the material: directions in the frame of the
/// table, and whether the way to the face of its cell is free.
fn look_around(
    fibres: &ExplicitFibres,
    material: usize,
    origin_mm: Vec3,
    voxel_mm: Vec3,
    rng: &mut PathRng,
) -> Option<[(Vec3, bool); LOOKS]> {
    let (point, tangent, radius_mm) = fibres.random_point(material, rng)?;
    let from_world = from_world(tangent);
    // One place on the outline for all looks: light that returns finds its way.
    let aside = (2.0 * rng.unit() - 1.0).asin();
    Some(std::array::from_fn(|_| {
        let w = warp::uniform_sphere(rng.unit2());
        let normal = FibreFrame::new(tangent, w).across(PI + aside);
        let reach = to_face_mm(point - origin_mm, w, voxel_mm);
        let ray = Ray::new(point + radius_mm * normal, w);
        let free = !fibres.blocks(&ray, f64::from(reach), &mut crate::Stats::default());
        (from_world * w, free)
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_are_where_cells_end() {
        let voxel_mm = Vec3::new(0.01, 0.02, 0.03);
        let p = Vec3::new(0.025, -0.01, 0.2);
        assert!((to_face_mm(p, Vec3::X, voxel_mm) - 0.015).abs() < 4.0 * f32::EPSILON);
        assert!((to_face_mm(p, Vec3::NEG_X, voxel_mm) - 0.005).abs() < 4.0 * f32::EPSILON);
        assert!((to_face_mm(p, Vec3::NEG_Y, voxel_mm) - 0.03).abs() < 4.0 * f32::EPSILON);
        assert!((to_face_mm(p, Vec3::Z, voxel_mm) - 0.04).abs() < 4.0 * f32::EPSILON);
    }

    #[test]
    fn frames_do_not_know_the_sense_of_a_fibre() {
        for axis in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::new(0.6, -0.64, 0.48)] {
            let m = from_world(axis);
            assert_eq!(m, from_world(-axis));
            assert!((m.determinant() - 1.0).abs() < 4.0 * f32::EPSILON);
            assert!(((m * axis).x.abs() - 1.0).abs() < 4.0 * f32::EPSILON);
        }
    }
}
