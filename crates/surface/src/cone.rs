//! Sampling the highlight at a point of the texture: its fibres are known, so
//! light is drawn from the cones on which they reflect.

use crate::around_cone::{AroundCone, EVEN_SHARE};
use crate::filament::Ring;
use crate::real::{Direction, Real};
use crate::segment::{Pair, YarnSegment};
use crate::staple::Inclination;
use organza_basis::PathRng;
use std::f32::consts::{FRAC_PI_2, PI};

pub(crate) type Vector = Direction<f32>;

fn combine(a: f32, p: Vector, b: f32, q: Vector, c: f32, r: Vector) -> Vector {
    Direction::new(
        a * p.x + b * q.x + c * r.x,
        a * p.y + b * q.y + c * r.y,
        a * p.z + b * q.z + c * r.z,
    )
}

/// The fibres at a place whose highlight may cover it and that face a direction: v runs over
/// `low..high` at one u in staple yarn, u at one v in filament yarn. There are none when `high`
/// is not above `low`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fibres {
    low: f32,
    high: f32,
    /// Sine and cosine of the angle that is fixed.
    sin: f32,
    cos: f32,
    /// Shares of the draws in each half of the fibres.
    halves: [f32; 2],
    around: [AroundCone; 2],
    /// About the light that the highlight returns, without gain and colour.
    albedo: f32,
}

impl Fibres {
    /// About the light that the highlight returns to the direction, without gain and colour.
    pub(crate) fn albedo(&self) -> f32 {
        self.albedo
    }

    /// The half that an angle lies in.
    #[inline]
    fn half(&self, angle: f32) -> usize {
        usize::from(angle >= 0.5 * (self.low + self.high))
    }

    /// Draws an angle, and the half that it lies in.
    #[inline]
    fn draw(&self, even: f32) -> (f32, usize) {
        let half = usize::from(even >= self.halves[0]);
        let before = if half == 0 { 0.0 } else { self.halves[0] };
        let within = ((even - before) / self.halves[half]).smaller(1.0);
        let angle = self.low + (self.high - self.low) * 0.5 * (half as f32 + within);
        (angle, half)
    }

    /// Density of an angle and of the sine around its cone.
    #[inline]
    fn density(&self, angle: f32, sin: f32) -> f32 {
        let half = self.half(angle);
        2.0 * self.halves[half] / (self.high - self.low) * self.around[half].density(sin)
    }
}

impl YarnSegment<f32> {
    /// The fibres at a place that face `w_out`.
    #[inline]
    pub(crate) fn fibres(&self, w_out: Vector, across_mm: f32, along_mm: f32) -> Fibres {
        // n.w_out is a cosine of the angle from `middle`, less a constant.
        let (band, (sin, cos), middle, reach) = if self.is_filament() {
            let (sin_v, cos_v) = self.v_band.angle(across_mm).sin_cos_acute();
            let constant =
                w_out.x * sin_v / (cos_v * (w_out.y * w_out.y + w_out.z * w_out.z).sqrt());
            let reach = arc_cosine((-constant).clamp(-1.0, 1.0));
            (
                self.u_band.angles(along_mm),
                (sin_v, cos_v),
                azimuth(w_out.y, w_out.z),
                reach,
            )
        } else {
            let (sin_u, cos_u) = self.u_band.angle(along_mm).sin_cos_acute();
            let out = w_out.y * sin_u + w_out.z * cos_u;
            (
                self.v_band.angles(across_mm),
                (sin_u, cos_u),
                azimuth(w_out.x, out),
                FRAC_PI_2,
            )
        };
        let mut fibres = Fibres {
            low: band.0.larger(middle - reach),
            high: band.1.smaller(middle + reach),
            sin,
            cos,
            halves: [0.5; 2],
            around: [AroundCone::EVEN; 2],
            albedo: 0.0,
        };
        if fibres.low < fibres.high {
            self.follow_highlight(&mut fibres, w_out);
        }
        fibres
    }

    /// Has the draws follow the light of the highlight, estimated at the middle of each half.
    #[inline]
    fn follow_highlight(&self, fibres: &mut Fibres, w_out: Vector) {
        let width = fibres.high - fibres.low;
        let mut albedos = [0.0; 2];
        for (half, albedo) in albedos.iter_mut().enumerate() {
            let angle = fibres.low + width * (0.25 + 0.5 * half as f32);
            let cone = self.cone(fibres, angle, w_out);
            if !(cone.cos_out > 0.0) {
                continue;
            }
            let (around, light) = AroundCone::new(&cone, w_out, &self.phase);
            fibres.around[half] = around;
            *albedo = light * cone.cos_out * cone.radius * cone.strength * 0.5 * width;
        }
        fibres.albedo = albedos[0] + albedos[1];
        if fibres.albedo > 0.0 {
            let first = albedos[0] / fibres.albedo;
            let first = 0.5 * EVEN_SHARE + (1.0 - EVEN_SHARE) * first;
            fibres.halves = [first, 1.0 - first];
        }
    }

    /// The cone of the fibre at an angle.
    #[inline]
    fn cone(&self, fibres: &Fibres, angle: f32, w_out: Vector) -> Cone {
        let (drawn, fixed) = (angle.sin_cos_acute(), (fibres.sin, fibres.cos));
        if self.is_filament() {
            Cone::new(self, drawn, fixed, w_out)
        } else {
            Cone::new(self, fixed, drawn, w_out)
        }
    }

    /// Draws `w_in` for a highlight that is seen from `w_out`, by choosing one of its fibres;
    /// `None` when there are none or the chosen fibre faces away. It may lie below the horizon.
    #[inline]
    pub(crate) fn sample_cone(
        &self,
        w_out: Vector,
        fibres: &Fibres,
        rng: &mut PathRng,
    ) -> Option<Vector> {
        let (angle, half) = fibres.draw(rng.unit());
        let cone = self.cone(fibres, angle, w_out);
        // Otherwise the highlight of the pair may lie at the other solution for v.
        if !(fibres.low < fibres.high && cone.cos_out > 0.0) {
            return None;
        }
        Some(cone.direction(fibres.around[half].draw(rng.unit())))
    }

    /// Density of [`sample_cone`](Self::sample_cone), 1/sr; both directions
    /// above the horizon.
    #[inline]
    pub(crate) fn cone_pdf(&self, pair: &Pair<f32>, fibres: &Fibres) -> f32 {
        let (angle, u, v, n_i, n_r, width) = if self.is_filament() {
            let ring = Ring::new(pair);
            let toward =
                |w: Vector| w.x * fibres.sin + (w.y * ring.sin_u + w.z * ring.cos_u) * fibres.cos;
            let (n_i, n_r) = (toward(pair.w_in), toward(pair.w_out));
            let (u, v) = ((ring.sin_u, ring.cos_u), (fibres.sin, fibres.cos));
            (ring.u, u, v, n_i, n_r, ring.inv_p)
        } else {
            let (sin_u, cos_u) = (fibres.sin, fibres.cos);
            let m = self.mirror(pair, &Inclination::new(pair, sin_u, cos_u));
            // The other solution is not a sample.
            let angle = if m.cos_v > 0.0 { m.angle() } else { f32::NAN };
            // Where no fibre mirrors, the cosines of the two normals cancel.
            let width = 1.0 / ((m.n_i + m.n_r) * self.sin_psi.abs());
            let (u, v) = ((sin_u, cos_u), (m.sin_v, m.cos_v));
            (angle, u, v, m.n_i, m.n_r, width)
        };
        if angle > fibres.low && angle < fibres.high && n_i.smaller(n_r) > 0.0 {
            let cone = Cone::new(self, u, v, pair.w_out);
            let radius = radius(pair.w_in.dot(cone.fibre));
            let sin = pair.w_in.dot(cone.side) / radius;
            n_i * width * fibres.density(angle, sin) / radius
        } else {
            0.0
        }
    }
}

/// The directions that one fibre mirrors to `w_out`.
pub(crate) struct Cone {
    pub fibre: Vector,
    /// Of the yarn, and beside the fibre in its surface.
    pub normal: Vector,
    pub side: Vector,
    /// Sine of the inclination to the fibre's cross-section, and its cosine: the radius.
    pub sin_theta: f32,
    pub radius: f32,
    /// Cosine of `w_out` to the normal.
    pub cos_out: f32,
    /// What light that arrives within the cone is multiplied by, besides the phase function
    /// and the cosines.
    strength: f32,
}

impl Cone {
    /// The cone of the fibre at sines and cosines of u and v.
    #[inline]
    fn new(
        yarn: &YarnSegment<f32>,
        (sin_u, cos_u): (f32, f32),
        (sin_v, cos_v): (f32, f32),
        w_out: Vector,
    ) -> Cone {
        let normal = Direction::new(sin_v, sin_u * cos_v, cos_u * cos_v);
        let (sin_p, cos_p) = (yarn.sin_psi, yarn.cos_psi);
        let fibre = Direction::new(
            -cos_v * sin_p,
            cos_u * cos_p + sin_u * sin_v * sin_p,
            -sin_u * cos_p + cos_u * sin_v * sin_p,
        );
        let side = Direction::new(
            fibre.y * normal.z - fibre.z * normal.y,
            fibre.z * normal.x - fibre.x * normal.z,
            fibre.x * normal.y - fibre.y * normal.x,
        );
        let sin_theta = -w_out.dot(fibre);
        let spread = if yarn.is_filament() {
            yarn.fade(2.0 * (sin_u / (1.0 + cos_u)).atan_unit())
        } else {
            sin_p.abs()
        };
        let spine_mm = yarn.spine.radius_mm(sin_u, cos_u);
        let strength = spread * (spine_mm + yarn.radius_mm * cos_v) * yarn.texture_factor;
        Cone {
            strength,
            fibre,
            normal,
            side,
            sin_theta,
            radius: (1.0 - sin_theta * sin_theta).larger(0.0).sqrt(),
            cos_out: w_out.dot(normal),
        }
    }

    /// The direction at the sine and cosine of the angle from the normal around the fibre.
    #[inline]
    fn direction(&self, (sin, cos): (f32, f32)) -> Vector {
        combine(
            self.sin_theta,
            self.fibre,
            self.radius * cos,
            self.normal,
            self.radius * sin,
            self.side,
        )
    }
}

/// Angle from z towards x, by the tangent of its half.
#[inline(always)]
fn azimuth(x: f32, z: f32) -> f32 {
    let r = (x * x + z * z).sqrt();
    let half = (x / (r + z.abs())).atan_unit();
    if z >= 0.0 {
        2.0 * half
    } else {
        PI.copysign(x) - 2.0 * half
    }
}

/// Arc cosine, by the tangent of its half.
#[inline(always)]
fn arc_cosine(x: f32) -> f32 {
    let sin = (1.0 - x * x).larger(0.0).sqrt();
    let angle = 2.0 * (sin / (1.0 + x.abs())).atan_unit();
    if x < 0.0 { PI - angle } else { angle }
}

/// Radius of the cone whose sine of inclination is given.
fn radius(sin_theta: f32) -> f32 {
    (1.0 - sin_theta * sin_theta).max(1e-12).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::segment::{Fit, SegmentParameters};
    use organza_basis::{Moments, warp};

    #[test]
    fn the_density_is_that_of_the_draws() {
        let mut rng = PathRng::from_seed(71);
        for case in 0..48 {
            let p = SegmentParameters {
                twist_rad: [0.0, -0.5, 0.5, 1.2][case % 4],
                u_max_rad: 0.6,
                kappa: 0.0,
                width_mm: 0.5,
                length_mm: 1.0,
                alpha: 0.01,
                beta: 4.0,
                smoothing: 0.5,
                highlight_width: 0.5,
                fit: Fit::Refuse,
            };
            let segment = YarnSegment::<f32>::new(&p).unwrap();
            let (x, y) = (0.5 * rng.unit() - 0.25, rng.unit() - 0.5);
            let w = warp::cosine_hemisphere(rng.unit2());
            let w_out = Direction::new(w.x, w.y, w.z);
            let fibres = segment.fibres(w_out, x, y);
            let (mut drawn, mut expected) = ([Moments::default(); 4], [Moments::default(); 4]);
            let quarter = |w: Direction<f32>| usize::from(w.x > 0.0) + 2 * usize::from(w.y > 0.0);
            let density = |w_in: Direction<f32>| {
                if w_in.z > 0.0 {
                    segment.cone_pdf(&Pair::new(w_in, w_out), &fibres)
                } else {
                    0.0
                }
            };
            for _ in 0..20_000 {
                let w_in = segment.sample_cone(w_out, &fibres, &mut rng);
                let w_in = w_in.unwrap_or(Direction::new(0.0, 0.0, -1.0));
                let counts = density(w_in) > 0.0;
                let w = warp::uniform_sphere(rng.unit2());
                let even = Direction::new(w.x, w.y, w.z.abs());
                for q in 0..4 {
                    drawn[q].add(f64::from(u8::from(counts && quarter(w_in) == q)));
                    let is_there = quarter(even) == q;
                    let d = if is_there { density(even) } else { 0.0 };
                    expected[q].add(f64::from(d * std::f32::consts::TAU));
                }
            }
            for (d, e) in drawn.iter().zip(&expected) {
                let sigma = d.standard_error().hypot(e.standard_error());
                let off = (d.mean - e.mean).abs();
                assert!(off < 4.5 * sigma + 1e-3, "seed 71, {case}");
            }
        }
    }
}
