//! Fibres entangled in a ball: neps in yarns, pills on worn cloth.
//!
//! Every fibre of a clump is a smooth random curve, as of [`crate::random_curve`], that turns back
//! before it would leave an ellipsoid of its own, smaller than that of the clump and anywhere in
//! it: clumps of few fibres are lumpy. Some of the ends stand out.

use crate::random_curve::RandomCurve;
use crate::strand::unit;
use glam::DVec3;
use organza_basis::PathRng;
use std::f64::consts::PI;

/// Share of the ellipsoid that is fibre (estimated). Sixteen fibres, the typical number in a nep
/// of cotton [ITC2007], of 28 mm and a radius of 6 um fill as much of a ball of 0.8 mm.
pub(crate) const FILL: f64 = 0.2;
/// The largest standard deviation of sizes, relative to their mean: beyond it so many sizes are
/// raised to [`LEAST`] that clumps hold more fibre than mean and deviation say.
pub(crate) const MAX_DEVIATION: f64 = 0.5;
/// The smallest clump, relative to the mean.
pub(crate) const LEAST: f64 = 0.2;
/// Radius to which fibres curl, root mean square, relative to the shortest half axis.
const CURL: f64 = 0.55;
/// Share of its own extent beyond which a fibre turns back, and how sharply, relative to its curl.
const TURNS: f64 = 0.85;
const LEAD: f64 = 3.0;
/// Least and largest extent of a fibre, as a share of the ellipsoid's (estimated).
const EXTENTS: [f64; 2] = [0.5, 0.9];
/// Share of the fibres with an end that stands out, and how far it goes, in radii of curl
/// (estimated).
const STRAYING: f64 = 0.5;
const STRAY_CURLS: f64 = 4.0;
/// How far beyond the ellipsoid ends may lie, as a share of its extent.
pub(crate) const STRAY_EXTENT: f64 = 1.5;
/// The longest step, relative to the curl: where fibres turn back, longer ones show kinks.
const MAX_STEP: f64 = 0.15;
/// Largest distance of a chord from the curve, as a share of the fibre's radius.
const CHORD_ERROR: f64 = 0.15;
/// Length of fibre walked over that wanted, before a fibre that gets nowhere ends.
const MAX_DETOUR: f64 = 4.0;

/// The ellipsoid in which fibres are entangled.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clump {
    pub middle_mm: DVec3,
    /// Half axes, at right angles to each other.
    pub half_axes_mm: [DVec3; 3],
}

impl Clump {
    /// Length of all its fibres.
    pub fn fibre_mm(&self, fibre_radius_mm: f64) -> f64 {
        let axes: f64 = self.half_axes_mm.iter().map(|a| a.length()).product();
        FILL * 4.0 / 3.0 * axes / (fibre_radius_mm * fibre_radius_mm)
    }

    /// Distance from the middle as a share of the ellipsoid's extent in this direction.
    pub fn extent(&self, at_mm: DVec3) -> f64 {
        self.share(at_mm).length()
    }

    /// The place in the ball of radius 1.
    fn share(&self, at_mm: DVec3) -> DVec3 {
        let from = at_mm - self.middle_mm;
        DVec3::from(self.half_axes_mm.map(|a| from.dot(a) / a.length_squared()))
    }

    /// A random place, evenly distributed over the part of the ellipsoid within an extent.
    fn place(&self, extent: f64, rng: &mut PathRng) -> DVec3 {
        let radius = extent * unit(rng).cbrt();
        let share = radius * direction(rng);
        let [a, b, c] = self.half_axes_mm;
        self.middle_mm + share.x * a + share.y * b + share.z * c
    }

    /// Length of the steps of a fibre.
    pub fn step_mm(&self, fibre_radius_mm: f64) -> f64 {
        let curl = self.curl_mm();
        (8.0 * CHORD_ERROR * fibre_radius_mm * curl)
            .sqrt()
            .clamp(0.05 * curl, MAX_STEP * curl)
    }

    fn curl_mm(&self) -> f64 {
        let axes = self.half_axes_mm.iter().map(|a| a.length());
        CURL * axes.fold(f64::INFINITY, f64::min)
    }

    /// The part of the ellipsoid in which one fibre is wound.
    fn own(&self, rng: &mut PathRng) -> Clump {
        let extent = EXTENTS[0] + (EXTENTS[1] - EXTENTS[0]) * unit(rng);
        Clump {
            middle_mm: self.place(1.0 - extent, rng),
            half_axes_mm: self.half_axes_mm.map(|a| extent * a),
        }
    }

    /// Winds a fibre of a length in the ellipsoid, on from the end of `curve`, which lies inside or
    /// is empty. The fibre may end outside, within [`STRAY_EXTENT`].
    pub fn wind(
        &self,
        curve: &mut Vec<DVec3>,
        length_mm: f64,
        fibre_radius_mm: f64,
        rng: &mut PathRng,
    ) {
        let own = self.own(rng);
        let mut heading = match curve[..] {
            [.., before, last] => (last - before).normalize_or(DVec3::X),
            _ => direction(rng),
        };
        let mut at = match curve.last() {
            Some(last) => *last,
            None => {
                let first = own.place(1.0, rng);
                curve.push(first);
                first
            }
        };
        let (curl, step) = (self.curl_mm(), self.step_mm(fibre_radius_mm));
        let stray_mm = match unit(rng) < STRAYING {
            true => (STRAY_CURLS * curl * unit(rng)).min(0.5 * length_mm),
            false => 0.0,
        };
        let mut random = RandomCurve::new(curl, step);
        let mut wound_mm = 0.0;
        let most = (MAX_DETOUR * length_mm / step).ceil() as usize;
        for _ in 0..most {
            if wound_mm >= length_mm {
                break;
            }
            let mut bend = random.bend(rng);
            let is_held = wound_mm < length_mm - stray_mm;
            let share = own.share(at);
            let beyond = match is_held {
                true => ((share.length() - TURNS) / (1.0 - TURNS)).clamp(0.0, 1.0),
                false => 0.0,
            };
            let axes = own.half_axes_mm.map(|a| a / a.length_squared());
            let outward = share.x * axes[0] + share.y * axes[1] + share.z * axes[2];
            bend -= LEAD / curl * beyond * outward.normalize_or_zero();
            heading = random.turned(heading, bend);
            let mut next = at + step * heading;
            // What began outside of its own part comes nearer.
            let limit = share.length().max(1.0);
            let out = own.extent(next);
            if is_held && out > limit {
                next = own.middle_mm + (next - own.middle_mm) * (limit / out);
            }
            let limit = if is_held { 1.0 } else { STRAY_EXTENT };
            let out = self.extent(next);
            if out > limit {
                next = self.middle_mm + (next - self.middle_mm) * (limit / out);
            }
            heading = (next - at).normalize_or(heading);
            wound_mm += at.distance(next);
            at = next;
            curve.push(at);
        }
    }
}

/// A random direction.
fn direction(rng: &mut PathRng) -> DVec3 {
    let up = 2.0 * unit(rng) - 1.0;
    let (sin, cos) = (2.0 * PI * unit(rng)).sin_cos();
    let level = (1.0 - up * up).max(0.0).sqrt();
    DVec3::new(level * cos, level * sin, up)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SEED: u64 = 11;

    fn clump() -> Clump {
        Clump {
            middle_mm: DVec3::new(1.0, 2.0, 3.0),
            half_axes_mm: [0.7 * DVec3::X, 0.5 * DVec3::Y, 0.4 * DVec3::Z],
        }
    }

    /// Points of many fibres.
    fn fibres(clump: &Clump) -> Vec<Vec<DVec3>> {
        (0..200)
            .map(|i| {
                let mut curve = Vec::new();
                clump.wind(&mut curve, 10.0, 0.01, &mut PathRng::new(SEED, 0, i));
                curve
            })
            .collect()
    }

    #[test]
    fn fibres_stay_inside_and_are_as_long_as_asked_and_smooth() {
        let clump = clump();
        let (mut strays, mut points, mut kinks) = (0, 0, 0);
        for curve in fibres(&clump) {
            let length: f64 = curve.windows(2).map(|p| p[0].distance(p[1])).sum();
            let step = clump.step_mm(0.01);
            assert!((10.0..10.0 + step).contains(&length), "{length}");
            let out = curve.iter().filter(|at| clump.extent(**at) > 1.0 + 1e-9);
            strays += out.count();
            points += curve.len();
            for at in &curve {
                assert!(clump.extent(*at) < STRAY_EXTENT + 1e-9, "seed {SEED}: {at}");
            }
            let turn = |p: &[DVec3]| (p[1] - p[0]).angle_between(p[2] - p[1]);
            kinks += curve.windows(3).filter(|p| turn(p) > 0.8).count();
        }
        // Only where a fibre runs straight into the outline.
        let share = kinks as f64 / points as f64;
        assert!(share < 0.02, "seed {SEED}: {share} of kinks");
        // Of 10 mm, half of the fibres has ends of up to 0.9 mm, partly outside.
        let share = strays as f64 / points as f64;
        assert!((1e-3..0.02).contains(&share), "seed {SEED}: {share}");
    }

    /// Fibre fills the ball, neither its rim nor its middle alone, and less towards the outline.
    #[test]
    fn fibres_fill_the_ball_evenly() {
        let clump = clump();
        let mut shells = [0.0; 5];
        for at in fibres(&clump).iter().flatten() {
            let volume = clump.extent(*at).powi(3);
            shells[((5.0 * volume) as usize).min(4)] += 1.0;
        }
        let all: f64 = shells.iter().sum();
        let shares = shells.map(|s| s / all);
        let falls = shares.windows(2).all(|s| s[1] < 1.1 * s[0]);
        assert!(falls, "seed {SEED}: {shares:?}");
        assert!(
            shares[0] < 0.5 && shares[4] > 0.01,
            "seed {SEED}: {shares:?}"
        );
    }
}
