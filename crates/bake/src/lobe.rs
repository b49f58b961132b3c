//! The lobes that the material models share: microfacets, sheen, Fresnel factors.

use glam::{Vec2, Vec3};
use std::f32::consts::PI;

/// Cosines below this are raised to it, so that quotients stay finite.
pub const MIN_COSINE: f32 = 1e-4;

/// Anisotropic GGX microfacets [Heitz2014] without Fresnel factor: distribution times masking
/// and shadowing, over four times both cosines. Directions are in the frame whose x axis has
/// the width `alpha.0` and whose z axis is the normal; both have positive z. 1/sr.
pub fn ggx(alpha: (f32, f32), w_in: Vec3, w_out: Vec3) -> f32 {
    let Some(h) = (w_in + w_out).try_normalize() else {
        return 0.0;
    };
    let (x, y) = (h.x / alpha.0, h.y / alpha.1);
    let q = x * x + y * y + h.z * h.z;
    let d = 1.0 / (PI * alpha.0 * alpha.1 * q * q);
    // The masking of both directions is correlated by height.
    let length = |w: Vec3| (Vec3::new(alpha.0 * w.x, alpha.1 * w.y, w.z)).length();
    let (ci, co) = (w_in.z.max(MIN_COSINE), w_out.z.max(MIN_COSINE));
    0.5 * d / (co * length(w_in) + ci * length(w_out))
}

/// The sheen of [Estevez2017] with the smoothed denominator of [Neubelt2013]; `alpha` is its
/// width and the cosines are those of the half vector, the light and the eye. 1/sr.
pub fn sheen(alpha: f32, cos_half: f32, cos_in: f32, cos_out: f32) -> f32 {
    let power = 1.0 / alpha.max(5e-3);
    let sin = (1.0 - cos_half * cos_half).max(0.0).sqrt();
    let d = (2.0 + power) * sin.powf(power) / (2.0 * PI);
    d / (4.0 * (cos_in + cos_out - cos_in * cos_out)).max(MIN_COSINE)
}

/// The share of light that fuzz of a roughness of 0.01 to 1 reflects towards an eye of this cosine
/// [Zeltner2022], by the rational fit of MaterialX 1.39 [Smythe2024].
pub fn fuzz_albedo(cos: f32, roughness: f32) -> f32 {
    let (x, y) = (cos.clamp(0.0, 1.0), roughness.clamp(0.01, 1.0));
    let width = y * (0.020_660_7 + 1.584_91 * y) / (0.037_942_4 + y * (1.322_27 + y));
    let cubic = -0.193_854 + y * (-1.148_85 + y * (1.793_2 - 0.959_43 * y * y));
    let middle = y * cubic / (0.046_391 + y);
    let square = 0.000_654_023 + y * (-0.020_781_8 + 0.119_681 * y);
    let floor = y * square / (1.262_64 + y * (-1.920_21 + y));
    let z = (x - middle) / width;
    ((-0.5 * z * z).exp() / (width * (2.0 * PI).sqrt()) + floor).min(1.0)
}

/// The lobe of fuzz [Zeltner2022]: a cosine lobe that is transformed linearly [Heitz2016], whose
/// integral against the cosine of the light is [`fuzz_albedo`]. Light and eye cannot be exchanged.
/// 1/sr.
pub fn fuzz(roughness: f32, w_in: Vec3, w_out: Vec3) -> f32 {
    let (x, y) = (w_out.z.clamp(0.0, 1.0), roughness.clamp(0.01, 1.0));
    // The inverse of the map is scale * (x, y) + skew * z in the plane of the eye, and z.
    let scale = (2.581_26 * x + 0.813_703 * y) * y / (1.0 + 0.310_327 * x * x + 2.609_94 * x * y);
    let below = 0.000_025_405_3 + 1.712_28 * x - 1.715_06 * x * y + 1.341_74 * y * y;
    let skew = (1.0 - x).sqrt() * (y - 1.0) * y * y * y / below;
    let toward = w_out.truncate().normalize_or(Vec2::X);
    let flat = w_in.truncate();
    let along = scale * flat.dot(toward) + skew * w_in.z;
    let across = scale * flat.perp_dot(toward);
    let square = along * along + across * across + w_in.z * w_in.z;
    let shape = scale / square.max(MIN_COSINE * MIN_COSINE);
    fuzz_albedo(x, y) * shape * shape / PI
}

/// Schlick's approximation [Schlick1994] of the Fresnel reflectance, from its values at
/// normal and at grazing incidence.
pub fn schlick(f0: f32, f90: f32, cos: f32) -> f32 {
    f0 + (f90 - f0) * (1.0 - cos.clamp(0.0, 1.0)).powi(5)
}

/// The Fresnel reflectance of a dielectric of relative index `eta`, unpolarized.
pub fn dielectric(eta: f32, cos: f32) -> f32 {
    let c = cos.clamp(0.0, 1.0);
    let inside = eta * eta - 1.0 + c * c;
    if inside <= 0.0 {
        return 1.0;
    }
    let g = inside.sqrt();
    let a = (g - c) / (g + c);
    let b = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    0.5 * a * a * (1.0 + b * b)
}

/// Reflectance at normal incidence of a dielectric of relative index `eta`.
pub fn f0_of_index(eta: f32) -> f32 {
    ((eta - 1.0) / (eta + 1.0)).powi(2)
}

/// The index, at least one, that reflects `f0` at normal incidence.
pub fn index_of_f0(f0: f32) -> f32 {
    let root = f0.clamp(0.0, 0.9999).sqrt();
    (1.0 + root) / (1.0 - root)
}

#[cfg(test)]
mod tests {
    use super::*;
    use organza_basis::PathRng;

    fn direction(cos: f32, phi: f32) -> Vec3 {
        let sin = (1.0 - cos * cos).sqrt();
        Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
    }

    #[test]
    fn known_values() {
        // Along the normal D is 1 / (pi ax ay), and the masking is one.
        let z = Vec3::Z;
        assert!((ggx((0.5, 0.25), z, z) - 1.0 / (PI * 0.125 * 4.0)).abs() < 4.0 * f32::EPSILON);
        assert!((f0_of_index(1.5) - 0.04).abs() < 0.04 * f32::EPSILON);
        assert!((index_of_f0(0.04) - 1.5).abs() < 4.0 * f32::EPSILON);
        assert!((dielectric(1.5, 1.0) - 0.04).abs() < 4.0 * f32::EPSILON);
        // At Brewster's angle half of the reflectance of the s polarization.
        let brewster = 1.5f32.atan();
        let s = ((1.0 - 1.5 * 1.5) / (1.0 + 1.5 * 1.5f32)).powi(2);
        assert!((dielectric(1.5, brewster.cos()) - 0.5 * s).abs() < 4.0 * f32::EPSILON);
        assert!((dielectric(1.5, 0.0) - 1.0).abs() < 4.0 * f32::EPSILON);
        assert!((schlick(0.04, 1.0, 1.0) - 0.04).abs() < 0.04 * f32::EPSILON);
        // Sheen of width 1: D = 3 sin / (2 pi); half vector at 90 degrees, grazing light.
        assert!((sheen(1.0, 0.0, 0.5, 0.5) - 1.5 / PI / 3.0).abs() < 4.0 * f32::EPSILON);
    }

    /// The integral of the lobe is the albedo of the fit, but for what leaves below the horizon:
    /// nothing, since the map keeps z.
    #[test]
    fn fuzz_reflects_what_its_albedo_says() {
        for (roughness, cos) in [(0.2, 0.3), (0.5, 0.8), (0.8, 0.1), (1.0, 0.9)] {
            let out = direction(cos, 0.7);
            let integral = |scale: f32| {
                let (mut sum, n) = (0.0f64, 600);
                for i in 0..n {
                    for j in 0..n {
                        let z = (i as f32 + 0.5) / n as f32;
                        let w = direction(z, 2.0 * PI * (j as f32 + 0.5) / n as f32);
                        let value = scale * fuzz(roughness, w, out) * z;
                        sum += f64::from(value) * 2.0 * std::f64::consts::PI / f64::from(n * n);
                    }
                }
                sum
            };
            let albedo = f64::from(fuzz_albedo(cos, roughness));
            assert!((0.0..=1.0).contains(&albedo));
            let is_near = |found: f64| (found - albedo).abs() < 5e-3 * albedo;
            assert!(is_near(integral(1.0)), "{roughness} {cos}: {albedo}");
            // The twin: a lobe two per cent too strong.
            assert!(!is_near(integral(1.02)), "{roughness} {cos}");
        }
        // It grows towards grazing angles, and goes back towards the eye.
        assert!(fuzz_albedo(0.1, 0.4) > 2.0 * fuzz_albedo(0.8, 0.4));
        let (out, back) = (direction(0.3, 0.0), direction(0.3, PI));
        assert!(fuzz(0.4, out, out) > fuzz(0.4, back, out));
    }

    #[test]
    fn microfacets_are_reciprocal_and_their_distribution_is_normalized() {
        let mut rng = PathRng::from_seed(3);
        for _ in 0..200 {
            let w = |rng: &mut PathRng| {
                let u = rng.unit2();
                direction(0.02 + 0.98 * u.x, 6.3 * u.y)
            };
            let (a, b) = (w(&mut rng), w(&mut rng));
            let alpha = (0.1 + 0.9 * rng.unit(), 0.1 + 0.9 * rng.unit());
            let (f, g) = (ggx(alpha, a, b), ggx(alpha, b, a));
            assert!((f - g).abs() <= 4.0 * f32::EPSILON * f, "{f} {g}");
        }
        // The projected area of the distribution is one: with light along the eye,
        // D = 4 cos^2 f / G, where G is that of the direction with itself.
        for (alpha, wrong) in [((0.3, 0.6), false), ((0.8, 0.2), false), ((0.3, 0.6), true)] {
            let (mut sum, n) = (0.0f64, 400);
            for i in 0..n {
                for j in 0..n {
                    let cos = (i as f32 + 0.5) / n as f32;
                    let w = direction(cos, 2.0 * PI * (j as f32 + 0.5) / n as f32);
                    let length = Vec3::new(alpha.0 * w.x, alpha.1 * w.y, w.z).length();
                    let mut d = ggx(alpha, w, w) * 4.0 * cos * length;
                    // The twin: a distribution two per cent too strong.
                    if wrong {
                        d *= 1.02;
                    }
                    sum += f64::from(d * cos) * 2.0 * std::f64::consts::PI / f64::from(n * n);
                }
            }
            assert_eq!((sum - 1.0).abs() < 5e-3, !wrong, "{alpha:?}: {sum}");
        }
    }
}
