//! Segments of tests.

use glam::Vec3;
use organza_basis::Aabb;
use organza_basis::curve::{Segment, SegmentList};
use std::f32::consts::TAU;

/// A repeating tile of 0.2 x 0.2 mm with 24 straight fibres each way, in three layers. The
/// far ends are moved aside by up to `2 * bend_mm`; the fibres along y are of `material_y`,
/// those along x of material 0.
pub fn little_weave(bend_mm: f32, material_y: u16) -> SegmentList {
    let mut segments = Vec::new();
    for i in 0..24 {
        let at = (i as f32 + 0.5) / 24.0 * 0.2;
        let z = 0.05 + 0.015 * (i % 3) as f32;
        let bend = bend_mm * ((i * 7 % 5) as f32 - 2.0);
        let along_x = [Vec3::new(0.0, at, z), Vec3::new(0.2, at + bend, z + 0.02)];
        let along_y = [Vec3::new(at, 0.0, z + 0.01), Vec3::new(at - bend, 0.2, z)];
        segments.push(Segment::straight(along_x[0], along_x[1], 0.004));
        segments.push(Segment {
            material: material_y,
            ..Segment::straight(along_y[0], along_y[1], 0.006)
        });
    }
    let bounds_mm = Aabb::new(Vec3::ZERO, Vec3::new(0.2, 0.2, 0.12));
    SegmentList::new(bounds_mm, true, segments)
}

/// A repeating tile of 0.3 x 0.3 mm, 0.2 mm thick, with three twisted yarns each way. Yarns
/// along x are of material 0, those along y of material 1.
pub fn twisted_weave() -> SegmentList {
    let (period, steps) = (0.3f32, 16);
    let mut segments = Vec::new();
    for fibre in 0..48u32 {
        let (r, phase) = (0.006 * (fibre as f32 / 2.0).sqrt(), 2.4 * fibre as f32);
        let (across, warp) = (0.05 + 0.1 * (fibre % 3) as f32, fibre % 2 == 1);
        let place = |i: i32| {
            let along = period * i as f32 / steps as f32;
            let (sin, cos) = (phase + TAU * along / period).sin_cos();
            let z = if warp { 0.06 } else { 0.14 };
            let p = Vec3::new(along, across + r * cos, z + r * sin);
            if warp { Vec3::new(p.y, p.x, p.z) } else { p }
        };
        for i in 0..steps {
            let tangent = |i: i32| (place(i + 1) - place(i - 1)).normalize();
            segments.push(Segment {
                start_tangent: tangent(i),
                end_tangent: tangent(i + 1),
                fibre,
                yarn: fibre % 6,
                material: (fibre % 2) as u16,
                ..Segment::straight(place(i), place(i + 1), 0.005)
            });
        }
    }
    let bounds_mm = Aabb::new(Vec3::ZERO, Vec3::new(period, period, 0.2));
    SegmentList::new(bounds_mm, true, segments)
}
