//! Corrections of a ply: directions of fibres against their moment, and shares of light.

use super::*;
use organza_basis::Moments;

fn spread(spread_rad: f32) -> PlyCorrection {
    PlyCorrection {
        spread_rad,
        ..PlyCorrection::default()
    }
}

#[test]
fn fibres_are_drawn_with_the_spread_that_the_extinction_has() {
    let mut rng = PathRng::from_seed(96);
    let fibre = Vec3::new(0.6, 0.0, 0.8);
    for w in [fibre, Vec3::Z, Vec3::Y] {
        let correction = spread(0.15);
        let square: Moments = (0..60_000)
            .map(|_| correction.drawn(fibre, &mut rng))
            .map(|d| f64::from(d.cross(w).length_squared()))
            .collect();
        let se = (square.variance() / square.count as f64).sqrt();
        let expected = |c: &PlyCorrection| f64::from(c.sine(fibre, w).powi(2));
        let off = (square.mean - expected(&correction)) / se;
        // A Gaussian of angles is a heat kernel to the fourth power of the spread.
        let slack = 0.15f64.powi(4) / se;
        // Margin: counted in standard errors.
        assert!(off.abs() < 4.0 + slack, "seed 96, {w}: {square:?}");
        // Known bad: a spread a quarter too small.
        let twin = (square.mean - expected(&spread(0.11))) / se;
        assert!(twin.abs() > 4.0 + slack, "seed 96, {w}: the twin passed");
    }
}

#[test]
fn fibres_out_of_line_are_met_as_often_as_they_are_wide() {
    // Straight along the mean direction, the met ones lean by more than the drawn ones.
    let correction = spread(0.1);
    let mut rng = PathRng::from_seed(97);
    let lean = |is_met: bool, rng: &mut PathRng| -> f64 {
        let all: Moments = (0..20_000)
            .map(|_| match is_met {
                true => correction.met(Vec3::Z, Vec3::Z, rng),
                false => correction.drawn(Vec3::Z, rng),
            })
            .map(|d| f64::from(d.cross(Vec3::Z).length()))
            .collect();
        all.mean
    };
    let (met, drawn) = (lean(true, &mut rng), lean(false, &mut rng));
    // Means of a Rayleigh law weighted by its value, 2 / sqrt(pi/2), and without weight.
    let pi = std::f64::consts::PI;
    let expected = [2.0 / (0.5 * pi).sqrt(), (0.5 * pi).sqrt()].map(|x| 0.1 * x);
    assert!((met / expected[0] - 1.0).abs() < 0.03, "seed 97: {met}");
    assert!((drawn / expected[1] - 1.0).abs() < 0.03, "seed 97: {drawn}");
}

#[test]
fn nothing_changes_by_default() {
    let none = PlyCorrection::default();
    let (fibre, w) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.0, 0.28, 0.96));
    assert_eq!(none.sine(fibre, w), fibre.cross(w).length());
    let (mut rng, mut same) = (PathRng::from_seed(1), PathRng::from_seed(1));
    assert_eq!(none.met(fibre, w, &mut rng), fibre);
    assert_eq!(rng.bits(), same.bits());
    let mut sent = Sent::even(Rgb::new(0.01, 0.02, 0.03));
    none.apply(Rgb::splat(0.1), &mut sent);
    assert_eq!(sent.total(), Sent::even(Rgb::new(0.01, 0.02, 0.03)).total());
}

#[test]
fn corrections_share_out_light_and_make_none() {
    let sent = |correction: PlyCorrection| {
        let mut sent = Sent::even(Rgb::new(0.01, 0.02, 0.03));
        correction.apply(Rgb::splat(0.2), &mut sent);
        (sent.total().0, sent.through().0)
    };
    let none = PlyCorrection::default();
    let (all, _) = sent(none);
    // Half leaves on each side: odds of one.
    let (total, through) = sent(PlyCorrection {
        through_odds: 4.0,
        ..none
    });
    let off = (total - all).abs().max_element();
    assert!(off < 2.0 * f32::EPSILON, "{total} {all}");
    assert!((through / total - 0.8).abs().max_element() < 4.0 * f32::EPSILON);
    let absorbing = |a: f32| PlyCorrection {
        absorption: Rgb::splat(a),
        ..none
    };
    let (clear, _) = sent(absorbing(0.0));
    assert!((clear - 0.8).abs().max_element() < 1e-6, "{clear}");
    let (dark, _) = sent(absorbing(2.0));
    // Twice the absorption: the square of what remains of 0.8.
    assert!((dark - all * all / 0.8).abs().max_element() < 4.0 * f32::EPSILON);
}

#[test]
fn corrections_out_of_range_are_refused() {
    let none = PlyCorrection::default();
    assert!(none.is_valid());
    let (extinction, through_odds) = (0.0, f32::NAN);
    let (absorption, spread_rad) = (Rgb::new(0.0, -1.0, 0.0), f32::INFINITY);
    for wrong in [
        PlyCorrection { extinction, ..none },
        PlyCorrection {
            through_odds,
            ..none
        },
        PlyCorrection { absorption, ..none },
        PlyCorrection { spread_rad, ..none },
    ] {
        assert!(!wrong.is_valid(), "{wrong:?}");
    }
}
