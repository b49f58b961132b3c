//! Depths of walks in a ply against a closed form.

use super::*;
use crate::PlyCorrection;
use organza_basis::Moments;

#[test]
fn depths_of_first_events_follow_beer_in_a_ply_without_twist() {
    let parameters = PlyParameters {
        radius_mm: 0.06,
        fibre_radius_mm: 0.006,
        fibres: 55.0,
        twist_rad_per_mm: 0.0,
        correction: PlyCorrection::default(),
    };
    let fibre = Fibre::from(
        crate::DielectricFibre::new(crate::DielectricParameters {
            ior: 1.55,
            absorption_radii: Rgb::WHITE,
            longitudinal_rad: 0.12,
            azimuthal_rad: 0.3,
        })
        .unwrap(),
    );
    let walker = Walker {
        parameters: &parameters,
        fibre: &fibre,
    };
    let mut rng = PathRng::from_seed(94);
    for (theta_deg, h) in [(0.0f32, 0.9f64), (60.0, 0.995), (-75.0, 0.98)] {
        let inclined: [f32; 2] = theta_deg.to_radians().sin_cos().into();
        let depths: Moments = (0..20_000)
            .map(|_| walker.begin(inclined, h as f32, &mut rng).unwrap().1.into())
            .collect();
        // Fibres along the ply, 2 r n / (1 - packing) broadside: the inclination shortens
        // them as it lengthens the chord. Of an exponential law that ends at the chord, the
        // mean is 1 - d / (e^d - 1).
        let packing = 55.0 * 0.006f64.powi(2) / 0.06f64.powi(2);
        let broadside = 2.0 * packing / (std::f64::consts::PI * 0.006) / (1.0 - packing);
        let chord = broadside * 2.0 * 0.06 * (1.0 - h * h).sqrt();
        let expected = 1.0 - chord / chord.exp_m1();
        let se = (depths.variance() / depths.count as f64).sqrt();
        let off = (depths.mean - expected) / se;
        let case = format!("seed 94, {theta_deg} degrees, offset {h}");
        // Margin: counted in standard errors.
        assert!(off.abs() < 4.0, "{case}: {} {expected}", depths.mean);
        // Known bad: depths that are not shortened.
        let twin = (depths.mean / f64::from(inclined[1]) - expected) / se;
        assert!(theta_deg == 0.0 || twin > 4.0, "{case}: the twin passed");
    }
}
