//! Yarns of fibres that hardly overlap.

use glam::{Vec2, Vec3, Vec3Swizzles};
use organza_basis::curve::{Segment, SegmentList};
use organza_basis::{Aabb, PathRng, warp};
use std::f32::consts::TAU;

pub const RADIUS_MM: f32 = 0.008;

/// A yarn along x, side by side with its copies. Lengths in fibre radii.
#[derive(Clone, Copy)]
pub struct Yarn {
    pub packing: f32,
    /// Angle of the outermost fibres to the yarn; of the plies, where there are
    /// some.
    pub twist_deg: f32,
    pub plies: u32,
    /// Root mean square angle by which fibres wander.
    pub wander_deg: f32,
}

pub const STRAIGHT: Yarn = Yarn {
    packing: 0.4,
    twist_deg: 0.0,
    plies: 1,
    wander_deg: 0.0,
};

/// Of a yarn; a ply of two is as thick as two thirds of it.
const YARN_RADII: f32 = 12.0;

impl Yarn {
    fn ply_radii(&self) -> f32 {
        match self.plies {
            1 => YARN_RADII,
            _ => 8.0,
        }
    }

    fn reach_radii(&self) -> f32 {
        match self.plies {
            1 => YARN_RADII + 1.0,
            _ => 17.0,
        }
    }

    pub fn segments(&self, seed: u64) -> SegmentList {
        let mut rng = PathRng::new(seed, 5, 0);
        let (ply, reach) = (self.ply_radii(), self.reach_radii());
        let tan = self.twist_deg.to_radians().tan();
        let period = if tan > 0.0 {
            TAU * (ply - 1.0) / tan
        } else {
            120.0
        };
        let steps = (period / 2.0).ceil() as i32;
        let mut segments = Vec::new();
        for p in 0..self.plies {
            for (k, at) in discs(self.packing, ply, &mut rng).into_iter().enumerate() {
                let phases = Vec2::new(rng.unit(), rng.unit()) * TAU;
                let place = |i: i32| {
                    let u = TAU * i as f32 / steps as f32;
                    // Fibres go once about their ply, plies once about the yarn,
                    // the other way round; waves are three a period.
                    let turn = if self.twist_deg > 0.0 { u } else { 0.0 };
                    let own = Vec2::from_angle(turn).rotate(at);
                    let side = if self.plies > 1 {
                        let angle = -turn + TAU * p as f32 / self.plies as f32;
                        ply * Vec2::from_angle(angle)
                    } else {
                        Vec2::ZERO
                    };
                    let amplitude = self.wander_deg.to_radians() * period / (3.0 * TAU);
                    let wave = phases + Vec2::splat(3.0 * u);
                    let wander = amplitude * Vec2::new(wave.x.sin(), wave.y.sin());
                    let x = period * i as f32 / steps as f32;
                    RADIUS_MM * (Vec2::splat(reach) + own + side + wander).extend(x).zxy()
                };
                let tangent = |i: i32| (place(i + 1) - place(i - 1)).normalize();
                segments.extend((0..steps).map(|i| Segment {
                    start_tangent: tangent(i),
                    end_tangent: tangent(i + 1),
                    fibre: (1000 * p) + k as u32,
                    ..Segment::straight(place(i), place(i + 1), RADIUS_MM)
                }));
            }
        }
        let size = RADIUS_MM * Vec3::new(period, 2.0 * reach, 2.0 * reach);
        SegmentList::new(Aabb::new(Vec3::ZERO, size), true, segments)
    }
}

/// Centres of discs of radius one that do not overlap, in a disc.
fn discs(packing: f32, radius: f32, rng: &mut PathRng) -> Vec<Vec2> {
    let count = (packing * radius * radius).round() as usize;
    let mut placed: Vec<Vec2> = Vec::new();
    let mut tries = 0;
    while placed.len() < count && tries < 2_000_000 {
        tries += 1;
        let at = (radius - 1.0) * warp::concentric_disk(rng.unit2());
        if placed.iter().all(|p| p.distance_squared(at) >= 4.0) {
            placed.push(at);
        }
    }
    placed
}
