//! The BSDF between the patches of the Klems basis [Klems1994], as daylighting
//! programs use it: rings of equal patches over each hemisphere, four matrices.
//!
//! The patch from which a ray arrives and the patch that it reaches unscattered, straight or
//! mirrored, have the same number. The front is the face of the cloth.

use crate::parts::measure_parts;
use crate::{
    Angles, Exit, MeasureError, Measured, Pair, PairValue, PatchResponse, PathNames, PathRun,
};
use glam::Vec3;
use organza_basis::{PathRng, Stopped, Watch};
use organza_transport::Stats;
use std::f64::consts::TAU;

/// The three bases of WINDOW.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KlemsBasis {
    /// 145 patches.
    Full,
    /// 73 patches.
    Half,
    /// 41 patches.
    Quarter,
}

/// A ring of patches: its lower edge and the number of patches.
type Ring = (f64, u16);

const FULL: [Ring; 9] = [
    (0.0, 1),
    (5.0, 8),
    (15.0, 16),
    (25.0, 20),
    (35.0, 24),
    (45.0, 24),
    (55.0, 24),
    (65.0, 16),
    (75.0, 12),
];
const HALF: [Ring; 7] = [
    (0.0, 1),
    (6.5, 8),
    (19.5, 12),
    (32.5, 16),
    (46.5, 20),
    (61.5, 12),
    (76.5, 4),
];
const QUARTER: [Ring; 5] = [(0.0, 1), (9.0, 8), (27.0, 12), (46.0, 12), (66.0, 8)];

/// A patch of directions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KlemsPatch {
    /// Polar angles at its edges, degrees.
    pub theta_deg: [f64; 2],
    /// Azimuth of its middle in the basis, degrees.
    pub phi_deg: f64,
    /// Its extent in azimuth, degrees.
    pub width_deg: f64,
}

impl KlemsPatch {
    /// Solid angle times cosine, integrated: its share of a hemisphere is this
    /// over pi.
    pub fn projected_sr(&self) -> f64 {
        let [low, high] = self.theta_deg.map(|t| t.to_radians().sin().powi(2));
        0.5 * self.width_deg.to_radians() * (high - low)
    }

    /// Polar angle of its middle.
    fn middle_deg(&self) -> f64 {
        if self.theta_deg[0] == 0.0 && self.width_deg == 360.0 {
            0.0
        } else {
            0.5 * (self.theta_deg[0] + self.theta_deg[1])
        }
    }
}

impl KlemsPatch {
    /// Its middle as angles of the cloth's frame.
    fn angles(&self, front: bool, role: Role) -> Angles {
        let sin = self.middle_deg().to_radians().sin();
        let w = direction(sin, self.phi_deg, front, role);
        let w = w.as_dvec3();
        Angles::new(
            w.z.clamp(-1.0, 1.0).acos().to_degrees(),
            w.y.atan2(w.x).to_degrees(),
        )
    }
}

/// Whether a direction is that of arriving or of leaving light. The two have opposite azimuths,
/// so that unscattered light lies on the diagonal.
#[derive(Clone, Copy, PartialEq)]
enum Role {
    From,
    To,
}

impl KlemsBasis {
    /// All of them.
    pub const ALL: [KlemsBasis; 3] = [KlemsBasis::Full, KlemsBasis::Half, KlemsBasis::Quarter];

    /// Its name in files.
    pub fn name(self) -> &'static str {
        match self {
            KlemsBasis::Full => "LBNL/Klems Full",
            KlemsBasis::Half => "LBNL/Klems Half",
            KlemsBasis::Quarter => "LBNL/Klems Quarter",
        }
    }

    /// Lower edges of the rings with their numbers of patches.
    pub fn rings(self) -> &'static [(f64, u16)] {
        match self {
            KlemsBasis::Full => &FULL,
            KlemsBasis::Half => &HALF,
            KlemsBasis::Quarter => &QUARTER,
        }
    }

    /// Number of patches of a hemisphere.
    pub fn len(self) -> usize {
        self.rings().iter().map(|r| usize::from(r.1)).sum()
    }

    /// No basis is empty.
    pub fn is_empty(self) -> bool {
        false
    }

    /// The patches, ring by ring.
    pub fn patches(self) -> Vec<KlemsPatch> {
        let rings = self.rings();
        let mut list = Vec::with_capacity(self.len());
        for (k, &(low, count)) in rings.iter().enumerate() {
            let high = rings.get(k + 1).map_or(90.0, |r| r.0);
            let width_deg = 360.0 / f64::from(count);
            list.extend((0..count).map(|p| KlemsPatch {
                theta_deg: [low, high],
                phi_deg: f64::from(p) * width_deg,
                width_deg,
            }));
        }
        list
    }

    /// The total share of the light from a patch that a matrix transmits or reflects.
    pub fn hemispherical(self, matrix: &KlemsMatrix, from: usize) -> [f64; 3] {
        let n = self.len();
        let mut sum = [0.0; 3];
        for (to, patch) in self.patches().iter().enumerate() {
            if let Some(value) = matrix.values.get(to * n + from) {
                for (s, v) in sum.iter_mut().zip(value) {
                    *s += v * patch.projected_sr();
                }
            }
        }
        sum
    }

    /// The share of evenly diffuse light that a matrix transmits or reflects.
    pub fn diffuse(self, matrix: &KlemsMatrix) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for (from, patch) in self.patches().iter().enumerate() {
            let share = patch.projected_sr() / std::f64::consts::PI;
            let through = self.hemispherical(matrix, from);
            for (s, v) in sum.iter_mut().zip(through) {
                *s += v * share;
            }
        }
        sum
    }

    /// The share of light along the normal that a matrix of transmission lets through unscattered:
    /// what its first entry has beyond the mean of the ring around it.
    pub fn straight(self, matrix: &KlemsMatrix) -> [f64; 3] {
        let (n, around) = (self.len(), usize::from(self.rings()[1].1));
        let value = |to: usize| matrix.values.get(to * n).copied().unwrap_or_default();
        let patch_sr = self.patches()[0].projected_sr();
        std::array::from_fn(|c| {
            let ring: f64 = (1..=around).map(|to| value(to)[c]).sum();
            (patch_sr * (value(0)[c] - ring / around as f64)).max(0.0)
        })
    }

    /// Square of the sine of the polar angle up to which light counts as along the normal.
    pub fn beam_sin_squared(self) -> f64 {
        self.patches()[0].theta_deg[1].to_radians().sin().powi(2)
    }

    /// The patch that contains a direction of leaving light.
    fn index(self, w: Vec3) -> usize {
        let theta = f64::from(w.z.abs().min(1.0)).acos().to_degrees();
        let turns = f64::from(w.y).atan2(f64::from(-w.x)) / TAU;
        let mut first = 0;
        let rings = self.rings();
        for (k, &(_, count)) in rings.iter().enumerate() {
            if rings.get(k + 1).is_none_or(|next| theta < next.0) {
                let count = i64::from(count);
                let around = (turns * count as f64).round() as i64;
                return first + around.rem_euclid(count) as usize;
            }
            first += usize::from(count);
        }
        first
    }
}

/// A direction of the cloth's frame from basis angles.
fn direction(sin: f64, phi_deg: f64, front: bool, role: Role) -> Vec3 {
    let (y, x) = phi_deg.to_radians().sin_cos();
    let sign = if role == Role::From { 1.0 } else { -1.0 };
    let z = (1.0 - sin * sin).max(1e-12).sqrt();
    let z = if front { z } else { -z };
    glam::DVec3::new(sign * sin * x, -sign * sin * y, z).as_vec3()
}

/// One matrix: a row per patch through which light leaves, a column per patch from which it
/// arrives.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KlemsMatrix {
    /// Means over the patches, 1/sr.
    pub values: Vec<[f64; 3]>,
    /// Their standard errors; zeros where a file has none.
    pub se: Vec<[f64; 3]>,
}

/// The four matrices; light from the front first.
#[derive(Clone, Debug, PartialEq)]
pub struct KlemsBsdf {
    /// The basis of the patches.
    pub basis: KlemsBasis,
    /// Transmission of light from the front and from the back; unscattered
    /// light is in the diagonal.
    pub transmission: [KlemsMatrix; 2],
    /// Reflection of light from the front and from the back.
    pub reflection: [KlemsMatrix; 2],
}

impl KlemsBsdf {
    /// The total share of the light from a patch that a matrix transmits or reflects.
    pub fn hemispherical(&self, matrix: &KlemsMatrix, from: usize) -> [f64; 3] {
        self.basis.hemispherical(matrix, from)
    }

    /// The middle of the patch from which light arrives.
    pub fn incident(&self, from: usize, front: bool) -> Angles {
        let patches = self.basis.patches();
        let patch = patches.get(from).or(patches.first()).copied();
        patch.map_or(Angles::NORMAL, |p| p.angles(front, Role::From))
    }

    /// Every entry as the BSDF between the middles of its patches. Transmission on the diagonal
    /// is left out, because it contains unscattered light.
    pub fn pairs(&self) -> Vec<PairValue> {
        let patches = self.basis.patches();
        let mut list = Vec::new();
        for (matrices, crosses) in [(&self.reflection, false), (&self.transmission, true)] {
            for (matrix, front) in matrices.iter().zip([true, false]) {
                let entries = matrix.values.iter().zip(&matrix.se).enumerate();
                for (index, (&mean, &se)) in entries {
                    let (to, from) = (index / patches.len(), index % patches.len());
                    let (Some(out), Some(source)) = (patches.get(to), patches.get(from)) else {
                        continue;
                    };
                    if !(crosses && to == from) {
                        list.push(PairValue {
                            pair: Pair::new(
                                source.angles(front, Role::From),
                                out.angles(front != crosses, Role::To),
                            ),
                            bsdf: Measured { mean, se },
                            paths: 0,
                        });
                    }
                }
            }
        }
        list
    }
}

/// Streams of random numbers that belong to Klems patches.
const KLEMS_STREAMS: u64 = 1 << 60;

/// Measures all four matrices with `paths` paths of light from every patch and
/// side. Each path serves all exitant directions at once.
///
/// # Errors
/// See [`MeasureError`].
pub fn measure_klems(
    patch: &impl PatchResponse,
    basis: KlemsBasis,
    paths: u64,
    seed: u64,
    watch: Watch<'_>,
) -> Result<(KlemsBsdf, Stats), MeasureError> {
    if paths < 2 {
        return Err(MeasureError::TooFewPaths(paths));
    }
    let patches = basis.patches();
    let n = patches.len();
    let column = |k: usize| {
        let (front, from) = (k < n, k % n);
        let source = patches.get(from).copied().unwrap_or(patches[0]);
        let [low, high] = source.theta_deg.map(|t| t.to_radians().sin().powi(2));
        // Sums and sums of squares: reflection, then transmission.
        let mut sums = vec![[[0.0f64; 2]; 3]; 2 * n];
        let mut stats = Stats::default();
        let names = PathNames::new(seed, KLEMS_STREAMS + k as u64, 0..paths);
        let draw = |rng: &mut PathRng| {
            let u = rng.unit2().as_dvec2();
            let sin = (low + u.x * (high - low)).sqrt();
            let phi = source.phi_deg + (u.y - 0.5) * source.width_deg;
            direction(sin, phi, front, Role::From)
        };
        let mut rejected = 0;
        let mut found = |exit: Exit| {
            let Some((to, weight)) = exit.finite(&mut rejected) else {
                return;
            };
            let crosses = (to.z > 0.0) != front;
            let slot = basis.index(to) + if crosses { n } else { 0 };
            if let Some(slot) = sums.get_mut(slot) {
                for (s, v) in slot.iter_mut().zip(weight.0.to_array()) {
                    s[0] += f64::from(v);
                    s[1] += f64::from(v).powi(2);
                }
            }
        };
        patch.each_exit(&draw, PathRun::new(&names, &mut stats, &mut found));
        stats.rejected += rejected;
        Stopped::check(watch(paths))?;
        Ok((sums, stats))
    };
    let (columns, stats) = measure_parts(2 * n, column)?;
    let count = paths as f64;
    let matrix = |front: bool, crosses: bool| {
        let mut m = KlemsMatrix::default();
        for (to, patch) in patches.iter().enumerate() {
            let scale = 1.0 / patch.projected_sr();
            for from in 0..n {
                let column = if front { from } else { from + n };
                let slot = if crosses { to + n } else { to };
                let sums = columns[column][slot];
                let mean = sums.map(|s| s[0] / count);
                m.values.push(mean.map(|x| x * scale));
                m.se.push(std::array::from_fn(|c| {
                    let variance = (sums[c][1] / count - mean[c] * mean[c]).max(0.0);
                    scale * (variance / (count - 1.0)).sqrt()
                }));
            }
        }
        m
    };
    Ok((
        KlemsBsdf {
            basis,
            transmission: [matrix(true, true), matrix(false, true)],
            reflection: [matrix(true, false), matrix(false, false)],
        },
        stats,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::{Rgb, unwatched};
    use std::f64::consts::PI;

    #[test]
    fn patches_tile_the_hemisphere() {
        for (basis, count) in KlemsBasis::ALL.into_iter().zip([145, 73, 41]) {
            let patches = basis.patches();
            assert_eq!((basis.len(), patches.len()), (count, count));
            let total: f64 = patches.iter().map(KlemsPatch::projected_sr).sum();
            assert!((total - PI).abs() < 32.0 * f64::EPSILON);
            for (k, p) in patches.iter().enumerate() {
                let sin = p.middle_deg().to_radians().sin();
                let w = direction(sin, p.phi_deg, true, Role::To);
                assert_eq!(basis.index(w), k);
            }
        }
    }

    /// A half-silvered, tinted mirror.
    struct Mirror;

    impl PatchResponse for Mirror {
        fn estimate_bsdf(&self, _: Vec3, _: Vec3, _: &mut PathRng, _: &mut Stats) -> Rgb {
            Rgb::BLACK
        }
        fn estimate_exit(&self, w: Vec3, rng: &mut PathRng, _: &mut Stats) -> Exit {
            let straight = rng.unit() < 0.25;
            let mirrored = Vec3::new(-w.x, -w.y, w.z);
            let to = if straight { -w } else { mirrored };
            Exit {
                escape: Some((to, Rgb::new(1.0, 0.5, 0.0))),
                is_straight: straight,
                absorbed: Rgb::BLACK,
            }
        }
    }

    #[test]
    fn unscattered_light_is_on_the_diagonal() {
        let (bsdf, _) = measure_klems(&Mirror, KlemsBasis::Quarter, 400, 7, &unwatched).unwrap();
        let n = 41;
        for (matrices, share) in [(&bsdf.reflection, 0.75), (&bsdf.transmission, 0.25)] {
            for matrix in matrices {
                for (index, value) in matrix.values.iter().enumerate() {
                    assert!(value[0] == 0.0 || index / n == index % n, "{index}");
                }
                let shares = bsdf.hemispherical(matrix, 17);
                let is_near = (shares[0] - share).abs() < 0.1;
                assert!(is_near && shares[2] == 0.0, "{shares:?}");
                assert!((shares[1] - 0.5 * shares[0]).abs() < 4.0 * f64::EPSILON);
            }
        }
        assert_eq!(bsdf.pairs().len(), 2 * n * n + 2 * (n * n - n));
    }
}
