//! A plain weave in a formula, for tests: what stages should find is known.

use crate::{ScannedField, ScannedVoxel};
use glam::{DVec3, UVec3, Vec3};
use organza_basis::PathRng;

/// Elliptic yarns; weft along x and warp along y, both of one pitch.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weave {
    /// Distance of yarns, mm.
    pub pitch_mm: f64,
    /// Half height of yarns and amplitude of their waves, as shares of the pitch.
    pub height: f64,
    /// Relative deviation of the fill from voxel to voxel.
    pub roughness: f32,
    /// Deviation of the axes, rad.
    pub spread_rad: f32,
}

impl Default for Weave {
    fn default() -> Weave {
        Weave {
            pitch_mm: 0.1,
            height: 0.2,
            roughness: 0.2,
            spread_rad: 0.15,
        }
    }
}

/// What the weave has at a place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Thread {
    pub fill: f32,
    pub axis: DVec3,
    /// 0 weft, 1 warp.
    pub system: usize,
    /// Which of the system's, from the one whose middle is at half a pitch.
    pub number: i64,
}

impl Weave {
    /// The thread at a flat place.
    pub fn at(&self, p: DVec3) -> Option<Thread> {
        let wave = std::f64::consts::PI / self.pitch_mm;
        let amplitude = self.height * self.pitch_mm;
        let one = |system: usize| {
            let (along, across) = [(p.x, p.y), (p.y, p.x)][system];
            let number = (across / self.pitch_mm).floor();
            let off = across - (number + 0.5) * self.pitch_mm;
            let sign = if system == 0 { 1.0 } else { -1.0 };
            let phase = wave * along + std::f64::consts::PI * number;
            let height = sign * amplitude * phase.sin();
            let slope = sign * amplitude * wave * phase.cos();
            let radius = (off / (0.42 * self.pitch_mm)).hypot((p.z - height) / amplitude);
            let axis = match system {
                0 => DVec3::new(1.0, 0.0, slope),
                _ => DVec3::new(0.0, 1.0, slope),
            };
            let fill = (3.0 * (1.0 - radius)).clamp(0.0, 1.0) as f32;
            Thread {
                fill,
                axis: axis.normalize(),
                system,
                number: number as i64,
            }
        };
        let [weft, warp] = [one(0), one(1)];
        let most = if weft.fill >= warp.fill { weft } else { warp };
        (most.fill > 0.0).then_some(most)
    }

    /// A scan of the weave. `flat` says which flat place a place of the scan shows, from the
    /// middle of the box; axes turn with it.
    pub fn field(
        &self,
        dims: [u32; 3],
        voxel_mm: f64,
        flat: &dyn Fn(DVec3) -> DVec3,
    ) -> ScannedField {
        let dims = UVec3::from(dims);
        let mut field = ScannedField::empty(dims, DVec3::splat(voxel_mm), 0.004);
        let middle = 0.5 * dims.as_dvec3() * voxel_mm;
        let mut rng = PathRng::from_seed(5);
        for z in 0..dims.z {
            for y in 0..dims.y {
                for x in 0..dims.x {
                    let cell = UVec3::new(x, y, z);
                    let p = (cell.as_dvec3() + 0.5) * voxel_mm - middle;
                    let Some(thread) = self.at(flat(p)) else {
                        continue;
                    };
                    let step = 1e-4 * voxel_mm;
                    let slope = |e: DVec3| (flat(p + e * step) - flat(p - e * step)) / (2.0 * step);
                    let slopes =
                        glam::DMat3::from_cols(slope(DVec3::X), slope(DVec3::Y), slope(DVec3::Z));
                    let axis = (slopes.inverse() * thread.axis).normalize().as_vec3();
                    let [a, b] = [rng.normal2(), rng.normal2()];
                    let jitter = Vec3::new(a.x, a.y, b.x) * self.spread_rad;
                    field.set(
                        cell,
                        &ScannedVoxel {
                            fill: (thread.fill * (1.0 + self.roughness * b.y)).clamp(0.0, 1.0),
                            axis: (axis + jitter).normalize(),
                            mean_sin_sq: 0.02,
                            confidence: 0.9,
                            yarn: 0,
                        },
                    );
                }
            }
        }
        field
    }

    /// The same fibre in all directions: no weave.
    pub fn strewn(&self, dims: [u32; 3], voxel_mm: f64) -> ScannedField {
        let field = self.field(dims, voxel_mm, &|p| p);
        let mut strewn = field.clone();
        let mut rng = PathRng::from_seed(6);
        field.for_each_filled(|cell, v| {
            let axis = organza_basis::warp::uniform_sphere(rng.unit2());
            strewn.set(cell, &ScannedVoxel { axis, ..v });
        });
        strewn
    }
}
