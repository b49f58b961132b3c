//! Reflectance against values that were computed elsewhere.

use super::*;

/// Parameters, then theta_i, phi_i, theta_r, phi_r in degrees, then f_s in
/// mm^2. Midpoint sums of 400,000 terms over the thesis' equations 6.3-6.8,
/// 7.4-7.10, 8.1 as printed, with the half vector normalised (the fourth, which
/// ends in a jump, between its ends found by bisection); half as many
/// terms agree to 2e-9.
#[rustfmt::skip]
const VALUES: [([f64; 8], [f64; 4], f64); 9] = [
    ([-30.0, 12.0, 0.0, 1.0, 5.0, 0.01, 4.0, 0.0], [30.0, 40.0, 20.0, 200.0], 1.374703800e-02),
    ([-30.0, 38.0, 0.0, 1.0, 1.0, 0.01, 4.0, 0.0], [60.0, 10.0, 45.0, 150.0], 3.171516461e-03),
    ([30.0, 30.0, 0.0, 3.0, 2.0, 0.01, 4.0, 0.0], [0.0, 0.0, 60.0, 90.0], 7.749814951e-03),
    ([12.0, 25.0, -0.6, 0.4, 1.3, 0.05, 2.0, 0.0], [50.0, 300.0, 35.0, 80.0], 1.311989493e-02),
    ([60.0, 45.0, 1.5, 0.3, 0.9, 0.0, 7.0, 0.0], [25.0, 120.0, 70.0, 220.0], 6.281530686e-06),
    ([0.0, 22.0, -0.7, 1.0, 1.0, 0.015, 4.0, 0.5], [30.0, 100.0, 40.0, 290.0], 4.560813891e-03),
    ([0.0, 40.0, 2.0, 1.0, 9.0, 0.02, 7.3, 0.5], [20.0, 10.0, 65.0, 170.0], 3.424815625e-02),
    ([0.0, 50.0, -0.5, 2.0, 4.0, 0.02, 1.5, 0.5], [70.0, 60.0, 40.0, 200.0], 1.035264693e-01),
    ([0.0, 30.0, 0.0, 0.5, 2.0, 0.1, 0.0, 0.0], [80.0, 0.0, 75.0, 185.0], 9.632627709e-03),
];

#[test]
fn reflectance_is_that_of_the_printed_equations() {
    let rule = Rule::for_accuracy(1e-9);
    for (p, d, expected) in VALUES {
        let segment = YarnSegment::<f64>::new(&parameters(p)).unwrap();
        let pair = Pair::new(direction(d[0], d[1]), direction(d[2], d[3]));
        let got = segment.reflectance(&pair, &rule);
        assert!((got - expected).abs() < 1e-8 * expected, "{p:?}: {got:e}");
    }
}

#[test]
fn reflectance_matches_the_reference_table() {
    // 80 parameter sets and pairs of directions by adaptive quadrature straight from
    // the thesis' equations 6.3-6.8, 7.4-7.10 and 8.1, made apart from this program.
    let text = include_str!("../data/irawan_segment.csv");
    let rule = Rule::for_accuracy(1e-9);
    let mut largest = 0.0f64;
    let mut rows = csv::Reader::from_reader(text.as_bytes());
    let mut count = 0;
    for row in rows.records() {
        let row = row.unwrap();
        // The first column is the kind of yarn.
        let n: Vec<f64> = row.iter().skip(1).map(|x| x.parse().unwrap()).collect();
        count += 1;
        let p = SegmentParameters {
            twist_rad: n[0],
            u_max_rad: n[1],
            kappa: n[2],
            width_mm: n[3],
            length_mm: n[4],
            alpha: n[5],
            beta: n[6],
            smoothing: n[7],
            highlight_width: 0.5,
            fit: Fit::Refuse,
        };
        let segment = YarnSegment::<f64>::new(&p).unwrap();
        let pair = Pair::new(
            Direction::new(n[8], n[9], n[10]),
            Direction::new(n[11], n[12], n[13]),
        );
        let got = segment.reflectance(&pair, &rule);
        let expected = n[14];
        if expected == 0.0 {
            assert_eq!(got, 0.0, "{row:?}");
        } else {
            largest = largest.max((got / expected - 1.0).abs());
        }
    }
    println!("largest relative difference {largest:.1e}");
    assert!(largest < 4.0 * f64::from(f32::EPSILON));
    assert_eq!(count, 80);
}
