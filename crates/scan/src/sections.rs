//! The radius of fibres, from their cross-sections.
//!
//! At random places inside fibres, rays run to the outline in planes of many directions. The
//! plane of the least section gives a rough radius. Within it gradients tell the fibre's axis, and
//! the rays run once more across it, through means along it: what noise hides between fibres
//! that touch is visible there. No scale has to be known before, so that the scales of the
//! orientation can follow from the radius.
//!
//! Where neighbours touch, the outline does not fall to air, and is none of this fibre alone.
//! Radius and slope are those of the free rest of the outline, beyond which there is air.

use crate::rays::{FibreSection, Rays, median};
use crate::window::Window;
use glam::{DVec3, Vec3};
use organza_basis::{Frame, PathRng};
use rayon::prelude::*;
use std::f32::consts::PI;

/// Places that are looked at in a window.
const PLACES: u32 = 400;
/// Random places of the whole volume that may be tried for each.
const TRIES: u32 = 64;
/// Directions of planes, on a half sphere.
const PLANES: usize = 60;
/// Longest ray, in chords of the first look.
const LONGEST_CHORDS: f32 = 4.0;
/// Fewest sections that are sorted out from all.
const LEAST_SORTED: usize = 24;

/// Frames whose normals cover the half sphere evenly.
fn planes() -> Vec<Frame> {
    let golden = PI * (3.0 - 5f32.sqrt());
    let normal = |k: usize| {
        let z = (k as f32 + 0.5) / PLANES as f32;
        let (sin, cos) = (golden * k as f32).sin_cos();
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * cos, r * sin, z)
    };
    (0..PLANES).map(|k| Frame::from_normal(normal(k))).collect()
}

/// Round sections at random places of a window where the grey value exceeds the threshold, and
/// the number of such places that were tried. Blur has moved outlines inward by `shrunk_mm`; noise
/// reaches as many of the least edges of a voxel as `noise_reach`.
pub(crate) fn sections(
    window: &Window,
    threshold: f32,
    air: f32,
    voxel_mm: DVec3,
    shrunk_mm: f32,
    noise_reach: f32,
    seed: u64,
) -> (Vec<FibreSection>, usize) {
    let mut rays = Rays::new(window, threshold, air, voxel_mm, shrunk_mm, noise_reach);
    let planes = planes();
    let size = Vec3::new(
        (window.nx - 1) as f32,
        (window.ny - 1) as f32,
        (window.count() - 1) as f32,
    );
    let places: Vec<Vec3> = (0..PLACES)
        .into_par_iter()
        .filter_map(|i| {
            let mut rng = PathRng::new(seed, 0, u64::from(i));
            (0..TRIES).find_map(|_| {
                let u = Vec3::new(rng.unit(), rng.unit(), rng.unit());
                let p = u * size + Vec3::Z * window.first as f32;
                window.at(p).filter(|v| *v >= threshold).map(|_| p)
            })
        })
        .collect();
    let chord_mm = median(
        places
            .par_iter()
            .map(|p| rays.chord_mm(*p))
            .collect::<Vec<_>>()
            .into_iter(),
    );
    if chord_mm.is_finite() {
        rays.limit(LONGEST_CHORDS * chord_mm);
    }
    let found = places.par_iter().map(|p| rays.section(*p, &planes));
    let found: Vec<Option<FibreSection>> = found.collect();
    (found.into_iter().flatten().collect(), places.len())
}

/// The sections that belong to single fibres: those with free outlines, if there are enough; of
/// them the rounder half, because fibres that are not told apart are not round; and of these the
/// half whose radii are closest to each other.
pub(crate) fn single_fibres(found: &[FibreSection]) -> Vec<FibreSection> {
    let mut free: Vec<FibreSection> = found.iter().copied().filter(|s| s.is_free).collect();
    if free.len() < LEAST_SORTED {
        return found.to_vec();
    }
    free.sort_by(|a, b| a.unroundness.total_cmp(&b.unroundness));
    free.truncate(free.len() / 2);
    free.sort_by(|a, b| a.radius_mm.total_cmp(&b.radius_mm));
    let count = free.len().div_ceil(2);
    let ratio = |half: &&[FibreSection]| half[count - 1].radius_mm / half[0].radius_mm;
    let halves = free.windows(count);
    let closest = halves.min_by(|a, b| ratio(a).total_cmp(&ratio(b)));
    closest.map_or_else(Vec::new, <[FibreSection]>::to_vec)
}
