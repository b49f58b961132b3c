//! A field seen in other coordinates.

use crate::{ScannedField, ScannedVoxel};
use glam::{DMat3, DVec3, UVec3, Vec3};
use organza_basis::Sym3;
use rayon::prelude::*;

/// Voxels with less fibre than this are left empty: interpolation makes a faint halo.
const LEAST_FILL: f32 = 0.004;

/// Most yarns that meet between eight voxels.
const YARNS: usize = 8;

/// Where the points of a new field lie in an old one.
pub(crate) trait Mapping: Sync {
    /// The point of the old field, mm, and its derivatives by the new coordinates.
    fn map(&self, p_mm: DVec3) -> (DVec3, DMat3);
}

/// A new field of `dims` voxels whose least corner is `min_mm`, filled with what a field has
/// where `mapping` says. Densities are interpolated; axes turn with the derivatives of the
/// mapping.
pub(crate) fn resampled(
    field: &ScannedField,
    (dims, min_mm, voxel_mm): (UVec3, DVec3, DVec3),
    mapping: &dyn Mapping,
) -> ScannedField {
    let mut new = ScannedField::empty(dims, voxel_mm, field.fibre_radius_mm);
    new.min_mm = min_mm;
    new.density_scale = field.density_scale;
    new.yarns.clone_from(&field.yarns);
    for z in 0..dims.z {
        let rows: Vec<Vec<(UVec3, ScannedVoxel)>> = (0..dims.y)
            .into_par_iter()
            .map(|y| {
                let mut row = Vec::new();
                for x in 0..dims.x {
                    let cell = UVec3::new(x, y, z);
                    let p = min_mm + (cell.as_dvec3() + 0.5) * voxel_mm;
                    let (there, slopes) = mapping.map(p);
                    if let Some(voxel) = sample(field, there, &slopes) {
                        row.push((cell, voxel));
                    }
                }
                row
            })
            .collect();
        for (cell, voxel) in rows.into_iter().flatten() {
            new.set(cell, &voxel);
        }
    }
    new
}

/// What the field holds at a point, as an observer of the new coordinates sees it.
fn sample(field: &ScannedField, p_mm: DVec3, slopes: &DMat3) -> Option<ScannedVoxel> {
    let q = (p_mm - field.min_mm) / field.voxel_mm - 0.5;
    let base = q.floor();
    let share = (q - base).as_vec3();
    let dims = field.dims().as_ivec3();
    let mut tensor = Sym3::from_array([0.0; 6]);
    let (mut fill, mut confidence) = (0.0, 0.0);
    let mut yarns = [(0u16, 0.0f32); YARNS];
    for corner in 0..8 {
        let step = glam::IVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
        let cell = base.as_ivec3() + step;
        if cell.cmplt(glam::IVec3::ZERO).any() || cell.cmpge(dims).any() {
            continue;
        }
        let v = field.voxel(cell.as_uvec3());
        let weight = Vec3::select(step.cmpeq(glam::IVec3::ZERO), 1.0 - share, share);
        let own = weight.element_product() * v.fill;
        if own <= 0.0 {
            continue;
        }
        let along = 1.0 - v.mean_sin_sq;
        tensor = tensor.plus(Sym3::axial(v.axis, 0.5 * v.mean_sin_sq, along).scaled(own));
        fill += own;
        confidence += own * v.confidence;
        let slot = yarns
            .iter_mut()
            .find(|(yarn, weight)| *weight == 0.0 || *yarn == v.yarn);
        if let Some(slot) = slot {
            *slot = (v.yarn, slot.1 + own);
        }
    }
    if fill < LEAST_FILL {
        return None;
    }
    let [(along, axis), ..] = tensor.scaled(1.0 / fill).eigen();
    let seen = slopes.inverse() * axis.as_dvec3();
    let most = yarns.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    Some(ScannedVoxel {
        fill: fill.min(1.0),
        axis: seen.as_vec3().normalize_or(Vec3::Z),
        mean_sin_sq: (1.0 - along).clamp(0.0, 0.5),
        confidence: confidence / fill,
        yarn: most.map_or(0, |m| m.0),
    })
}
