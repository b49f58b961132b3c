//! A ray through packed fibres.

use super::fibre_volume::FibreVolume;
use glam::{DVec3, Vec2, Vec3};

/// The place of no population.
pub const NOWHERE: u32 = u32::MAX;

/// In the place of a population: the ray is still on its way.
pub const UNDER_WAY: u32 = u32::MAX - 1;

/// Where a ray is, where it goes, and what it has met.
#[derive(Clone, Copy, Debug)]
pub struct VolumeRay {
    /// In voxels, within the first period.
    pub at: [f32; 3],
    /// Periods in x and y that it is on.
    pub period: [f32; 2],
    /// Unit direction in the world.
    pub direction: [f32; 3],
    /// Way since its start, mm.
    pub gone_mm: f32,
    /// Where it ends, mm from its start.
    pub end_mm: f32,
    /// Where across its width a fibre was met, in `[-1, 1]`.
    pub offset: f32,
    /// The yarn that it leaves, or [`NO_YARN`](super::fibre_volume::NO_YARN).
    pub left_yarn: u32,
    /// Its random numbers: [`LaneRng::words`](organza_lanes::math::LaneRng::words).
    pub rng: [u32; 3],
    /// The population that was met, or [`NOWHERE`] or [`UNDER_WAY`].
    pub place: u32,
}

/// How a ray begins.
#[derive(Clone, Copy, Debug)]
pub struct Departure {
    /// Unit direction.
    pub direction: Vec3,
    /// Where the ray ends, mm from its start.
    pub end_mm: f32,
    pub left_yarn: u32,
    pub rng: [u32; 3],
}

impl VolumeRay {
    /// Nowhere.
    pub fn none() -> VolumeRay {
        VolumeRay {
            at: [0.0; 3],
            period: [0.0; 2],
            direction: [0.0, 0.0, 1.0],
            gone_mm: 0.0,
            end_mm: 0.0,
            offset: 0.0,
            left_yarn: 0,
            rng: [0; 3],
            place: NOWHERE,
        }
    }

    pub fn at(&self) -> Vec3 {
        Vec3::from_array(self.at)
    }

    pub fn period(&self) -> Vec2 {
        Vec2::from_array(self.period)
    }
}

impl FibreVolume {
    /// A ray from a point of the world; `None` when it misses the volume.
    pub fn ray_from_world(&self, from_mm: DVec3, departure: &Departure) -> Option<VolumeRay> {
        let grid = &self.cell_grid;
        let (bounds, dims) = (grid.bounds_mm(), grid.dims().as_dvec3());
        let mut at = (from_mm - bounds.min.as_dvec3()) * grid.voxels_per_mm().as_dvec3();
        let mut period = Vec2::ZERO;
        if grid.repeats() {
            let periods = (at / dims).floor().truncate();
            period = periods.as_vec2();
            at -= (periods * dims.truncate()).extend(0.0);
        }
        self.ray(at.as_vec3(), period, departure)
    }

    /// A ray from a point in voxels, which may lie beyond the first period by less than one;
    /// `None` when it misses the volume.
    #[inline]
    pub fn ray(&self, from: Vec3, period: Vec2, departure: &Departure) -> Option<VolumeRay> {
        let grid = &self.cell_grid;
        let size = grid.dims().as_vec3();
        let step = departure.direction * grid.voxels_per_mm();
        let (mut at, mut period) = (from, period);
        let mut gone_mm = 0.0f32;
        let first = if grid.repeats() { 2 } else { 0 };
        for axis in first..3 {
            let face = if at[axis] < 0.0 {
                0.0
            } else if at[axis] >= size[axis] {
                size[axis]
            } else {
                continue;
            };
            let way = (face - at[axis]) / step[axis];
            if !(way >= 0.0 && way < departure.end_mm) {
                return None;
            }
            gone_mm = gone_mm.max(way);
        }
        if gone_mm > 0.0 {
            at += gone_mm * step;
            for axis in first..3 {
                // Rounding may leave it a hair before the face; farther off it misses.
                let most = size[axis] * (1.0 - f32::EPSILON);
                let inside = at[axis].clamp(0.0, most);
                if (inside - at[axis]).abs() > 1e-3 {
                    return None;
                }
                at[axis] = inside;
            }
        }
        if grid.repeats() {
            for axis in 0..2 {
                let whole = (at[axis] / size[axis]).floor();
                period[axis] += whole;
                at[axis] =
                    (at[axis] - whole * size[axis]).clamp(0.0, size[axis] * (1.0 - f32::EPSILON));
            }
        }
        Some(VolumeRay {
            at: at.to_array(),
            period: period.to_array(),
            direction: departure.direction.to_array(),
            gone_mm,
            end_mm: departure.end_mm.min(gone_mm + grid.most_mm() as f32),
            offset: 0.0,
            left_yarn: departure.left_yarn,
            rng: departure.rng,
            place: NOWHERE,
        })
    }
}
