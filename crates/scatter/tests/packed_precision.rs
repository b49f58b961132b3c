//! Collisions with packed fibres in single precision against the same formulas in double
//! precision: where the fibre's axis lies, and at which offset its surface is met.

use glam::{DVec3, Vec3};
use organza_basis::{PathRng, warp};
use organza_scatter::PackedEvent;

const SEED: u64 = 0x9ac;
const RADIUS_MM: f32 = 0.006;
/// Half the spacing of numbers just below one: what one rounding may change, relatively.
const ROUNDING: f64 = 0.5 * f32::EPSILON as f64;

/// Sideways and forward unit vectors of light that comes from `w_out`.
fn frame(tangent: Vec3, w_out: Vec3) -> [DVec3; 2] {
    let tangent = tangent.as_dvec3().normalize();
    let side = w_out.as_dvec3().cross(tangent).normalize();
    [side, side.cross(tangent)]
}

/// The axis as seen from the collision, in radii.
fn to_axis(side: DVec3, forward: DVec3, offset: f32) -> DVec3 {
    let h = f64::from(offset);
    forward * (1.0 - h * h).max(0.0).sqrt() - side * h
}

/// How far from the axis in double precision that in single precision may lie, in radii, for
/// light at an angle of this sine to the fibre.
///
/// A component of a cross product of unit vectors has three roundings of at most
/// [`ROUNDING`] each, so the whole vector errs by 3 sqrt(3) of them, and its direction by as
/// many over its length, the sine. The side is corrected by the tangent, crossed with it and
/// normalised: at most 16 more. The tangent and the direction are unit vectors to two
/// roundings, which turns no side. The square of the offset errs by one rounding, its
/// complement under a root by less than the root of that. The place is rounded twice.
fn bound_radii(sine: f64, offset: f32, place_mm: Vec3) -> f64 {
    let directions = ROUNDING * (3.0 * 3f64.sqrt() / sine + 16.0);
    let left = 1.0 - f64::from(offset).powi(2);
    let depth = (left + ROUNDING).sqrt() - (left - ROUNDING).max(0.0).sqrt();
    let place = 2.0 * ROUNDING * f64::from(place_mm.length() + 2.0 * RADIUS_MM);
    directions + depth + place / f64::from(RADIUS_MM)
}

struct Case {
    tangent: Vec3,
    w_out: Vec3,
    place_mm: Vec3,
    sine: f64,
}

/// Light at even angles to a fibre, and at 0.1 to 1e-4 radians, on cloth at the origin and as
/// far away as hard cases are.
fn cases() -> Vec<Case> {
    let mut rng = PathRng::from_seed(SEED);
    (0..4000)
        .map(|i| {
            let tangent = warp::uniform_sphere(rng.unit2());
            let side = tangent.any_orthonormal_vector();
            let angle_rad = [1e-1f32, 1e-2, 1e-3, 1e-4][i % 4];
            let w_out = match i % 8 {
                0..4 => warp::uniform_sphere(rng.unit2()),
                _ => (tangent + angle_rad * side).normalize(),
            };
            let scale_mm = [0.0, 1.0, 100.0, 1e4][rng.below(4) as usize];
            let place_mm = scale_mm * warp::uniform_sphere(rng.unit2());
            let exact = tangent.as_dvec3().normalize();
            let sine = w_out.as_dvec3().normalize().cross(exact).length();
            Case {
                tangent,
                w_out,
                place_mm,
                sine,
            }
        })
        .filter(|case| case.sine > 5e-5)
        .collect()
}

/// The greatest error over what is allowed, of axes whose sides are turned by so much.
fn worst_share(turned_rad: f64) -> f64 {
    let mut rng = PathRng::from_seed(SEED + 1);
    let mut worst = 0.0f64;
    for (i, case) in cases().iter().enumerate() {
        let Case {
            tangent,
            w_out,
            place_mm,
            sine,
        } = *case;
        let mut event = PackedEvent::draw(place_mm, w_out, tangent, RADIUS_MM, &mut rng);
        // Along the circumference and at the middle too.
        event.offset = [event.offset, 1.0, -1.0, 1.0 - f32::EPSILON, 0.0][i % 5];
        let [side, forward] = frame(tangent, w_out);
        let (sin, cos) = turned_rad.sin_cos();
        let [side, forward] = [side * cos + forward * sin, forward * cos - side * sin];
        let radius = f64::from(RADIUS_MM);
        let exact = place_mm.as_dvec3() + radius * to_axis(side, forward, event.offset);
        let error = (event.axis_mm().as_dvec3() - exact).length() / radius;
        worst = worst.max(error / bound_radii(sine, event.offset, place_mm));
    }
    worst
}

#[test]
fn axes_of_packed_fibres_follow_double_precision() {
    let worst = worst_share(0.0);
    println!("axes: {worst:.2} of the bound");
    // 0.45 was seen; the margin is that roundings seldom all point the same way.
    assert!(worst <= 1.0, "seed {SEED:#x}: {worst} of the bound");
    // Known bad: fibres seen from a hundredth of a degree aside.
    let twin = worst_share(0.01f64.to_radians());
    assert!(twin > 1.0, "seed {SEED:#x}: the twin passed, {twin}");
}

#[test]
fn offsets_of_normals_follow_double_precision() {
    let (mut worst, mut twin) = (0.0f64, 0.0f64);
    let mut rng = PathRng::from_seed(SEED + 2);
    for case in cases() {
        let Case {
            tangent,
            w_out,
            place_mm,
            sine,
        } = case;
        let [side, forward] = frame(tangent, w_out);
        let h = 2.0 * f64::from(rng.unit()) - 1.0;
        let normal = -to_axis(side, forward, h as f32).as_vec3();
        let event = PackedEvent::from_normal(place_mm, w_out, tangent, RADIUS_MM, normal);
        let exact = normal.as_dvec3().normalize().dot(side);
        // The place does not enter, and neither does the depth.
        let bound = bound_radii(sine, 0.0, Vec3::ZERO);
        let found = f64::from(event.offset);
        worst = worst.max((found - exact).abs() / bound);
        twin = twin.max((found + exact).abs() / bound);
    }
    println!("offsets: {worst:.2} of the bound");
    // 0.11 was seen; the margin is that of a bound for both directions and the depth.
    assert!(worst <= 1.0, "seed {SEED:#x}: {worst} of the bound");
    // Known bad: the other side.
    assert!(twin > 1.0, "seed {SEED:#x}: the twin passed, {twin}");
}
