//! Geometries that are difficult to render.

use super::{SEED, SIZE_MM, VOXEL_MM};
use glam::Vec3;
use organza_basis::curve::{Segment, SegmentList};
use organza_basis::{Aabb, PathRng, warp};

/// Fibres in a box. Where it repeats, level rays have no end but in matter, and
/// white parallel fibres hold light that runs along them; one geometry does.
pub fn fibres(min_mm: Vec3, size_mm: Vec3, repeats: bool, segments: Vec<Segment>) -> SegmentList {
    SegmentList::new(Aabb::new(min_mm, min_mm + size_mm), repeats, segments)
}

/// `count` fibres of a radius about a mean direction, `strewn` 0 for parallel
/// ones; all within the heights of the tile.
pub fn strewn(min_mm: Vec3, count: u32, strewn: f32, radius_mm: f32) -> Vec<Segment> {
    let mut rng = PathRng::from_seed(SEED);
    let margin = Vec3::splat(radius_mm + 0.011);
    (0..count)
        .map(|_| {
            let place = Vec3::new(rng.unit(), rng.unit(), rng.unit());
            let mut centre = min_mm + margin + place * (SIZE_MM - 2.0 * margin);
            let axis = (Vec3::X + strewn * warp::uniform_sphere(rng.unit2())).normalize_or(Vec3::X);
            let mut half = 0.011;
            if strewn == 0.0 {
                // Through the whole tile.
                centre.x = min_mm.x + 0.5 * SIZE_MM.x;
                half = 0.5 * SIZE_MM.x - radius_mm;
            }
            Segment::straight(centre - half * axis, centre + half * axis, radius_mm)
        })
        .collect()
}

/// Every geometry that has its difficulty.
pub fn geometries() -> Vec<(&'static str, SegmentList)> {
    let at = |min_mm: Vec3, segments| fibres(min_mm, SIZE_MM, false, segments);
    let one_voxel = Vec3::splat(VOXEL_MM);
    let straight = |radius| {
        let ends = [Vec3::new(0.0, 0.0, 0.01), Vec3::new(0.02, 0.02, 0.01)];
        Segment::straight(ends[0], ends[1], radius)
    };
    let mut crowded = Vec::new();
    let mut rng = PathRng::from_seed(SEED);
    for _ in 0..10_000 {
        let centre = Vec3::new(0.05, 0.05, 0.05) + 0.004 * warp::uniform_sphere(rng.unit2());
        let axis = 0.004 * warp::uniform_sphere(rng.unit2());
        crowded.push(Segment::straight(centre - axis, centre + axis, 2e-4));
    }
    let mut without_length = strewn(Vec3::ZERO, 120, 0.4, 0.004);
    for i in 0..60 {
        let p = Vec3::new(0.002 * i as f32, 0.02 * (i % 6) as f32, 0.04);
        without_length.push(Segment::straight(p, p, 0.004));
    }
    let far_mm = Vec3::new(1e4, -1e4, 1e4);
    vec![
        (
            "parallel fibres, no spread",
            at(Vec3::ZERO, strewn(Vec3::ZERO, 60, 0.0, 0.004)),
        ),
        (
            "fibres all ways, large spread",
            at(Vec3::ZERO, strewn(Vec3::ZERO, 400, 50.0, 0.004)),
        ),
        (
            "a tile of one voxel",
            fibres(Vec3::ZERO, one_voxel, true, vec![straight(0.003)]),
        ),
        ("an empty tile", at(Vec3::ZERO, Vec::new())),
        ("a voxel of 10,000 segments", at(Vec3::ZERO, crowded)),
        (
            "fibres thicker than a voxel",
            at(Vec3::ZERO, strewn(Vec3::ZERO, 6, 0.0, 0.025)),
        ),
        ("segments without length", at(Vec3::ZERO, without_length)),
        (
            "ten metres from the origin",
            at(far_mm, strewn(far_mm, 200, 0.4, 0.004)),
        ),
    ]
}
