//! Where light goes in every fabric, against the table of the pages.

use super::*;
use organza_basis::unwatched;

/// Shares of green light from 60 degrees along the weft.
struct Recorded {
    fabric: &'static str,
    model: &'static str,
    /// Reflected, transmitted by scattering, straight through.
    shares: [f64; 3],
}

/// The tables of `docs/trust.md`, whose standard errors are up to 0.002.
fn recorded() -> Vec<Recorded> {
    const MODELS: [&str; 4] = ["fibres", "packed", "plain", "microflake"];
    const TABLE: [(&str, [[f64; 3]; 4]); 10] = [
        (
            "organza",
            [
                [0.392, 0.396, 0.194],
                [0.389, 0.410, 0.184],
                [0.371, 0.393, 0.217],
                [0.473, 0.244, 0.216],
            ],
        ),
        (
            "denim",
            [
                [0.100, 0.020, 0.018],
                [0.094, 0.021, 0.018],
                [0.079, 0.031, 0.023],
                [0.092, 0.010, 0.024],
            ],
        ),
        (
            "linen",
            [
                [0.492, 0.296, 0.056],
                [0.487, 0.310, 0.054],
                [0.483, 0.297, 0.060],
                [0.488, 0.113, 0.058],
            ],
        ),
        (
            "jersey",
            [
                [0.346, 0.160, 0.001],
                [0.346, 0.169, 0.001],
                [0.343, 0.151, 0.003],
                [0.289, 0.029, 0.003],
            ],
        ),
        (
            "cotton_twill",
            [
                [0.118, 0.023, 0.027],
                [0.123, 0.024, 0.026],
                [0.119, 0.025, 0.033],
                [0.102, 0.003, 0.033],
            ],
        ),
        (
            "wool_gabardine",
            [
                [0.143, 0.034, 0.015],
                [0.147, 0.038, 0.015],
                [0.142, 0.038, 0.020],
                [0.124, 0.005, 0.021],
            ],
        ),
        (
            "wool_tweed",
            [
                [0.243, 0.094, 0.047],
                [0.245, 0.095, 0.048],
                [0.228, 0.101, 0.061],
                [0.224, 0.029, 0.060],
            ],
        ),
        (
            "polyester_lining",
            [
                [0.119, 0.094, 0.035],
                [0.120, 0.111, 0.034],
                [0.116, 0.084, 0.055],
                [0.098, 0.011, 0.055],
            ],
        ),
        (
            "charmeuse",
            [
                [0.077, 0.038, 0.002],
                [0.088, 0.043, 0.003],
                [0.086, 0.049, 0.013],
                [0.070, 0.007, 0.013],
            ],
        ),
        (
            "silk_shantung",
            [
                [0.089, 0.021, 0.061],
                [0.088, 0.026, 0.056],
                [0.080, 0.031, 0.067],
                [0.074, 0.005, 0.065],
            ],
        ),
    ];
    let fabrics = if is_full() { &TABLE[..] } else { &TABLE[..1] };
    let rows = fabrics.iter().flat_map(|(fabric, rows)| {
        let of_model = |(model, shares): (&'static str, &[f64; 3])| Recorded {
            fabric,
            model,
            shares: *shares,
        };
        let of_models = MODELS.into_iter().zip(rows).map(of_model);
        // Reduced, `packed_fabrics` compares packed fibres with explicit ones.
        of_models.filter(|row| is_full() || row.model != "packed")
    });
    rows.collect()
}

/// Light of every model of a fabric goes where the record says, within the noise of both;
/// each path's shares add to one. The twin are micro-flakes taken for fibres: they hardly
/// transmit by scattering.
#[test]
fn fabrics_reflect_and_transmit_what_is_on_record() {
    const RECORD_SE: f64 = 0.002;
    let effort = Effort {
        paths: if is_full() { 24_000 } else { 4000 },
        seed: SEED,
        target_error: None,
    };
    let light = [Angles {
        theta_deg: 60.0,
        phi_deg: 0.0,
    }];
    let is_near =
        |found: Estimate, share: f64| (found.0 - share).abs() < 4.0 * found.1.hypot(RECORD_SE);
    let mut twin_rejected = 0;
    let mut of_fibres = [0.0; 3];
    for row in recorded() {
        let path = folder().join(format!("{}.toml", row.fabric));
        let loader = Loader::new();
        let fabric = fabric_file::load(&path, &[], &loader).unwrap();
        let patch = cloth_patch(&fabric, &path, row.model, &loader);
        let measured = measure_albedos(&patch, &light, &effort, &unwatched).unwrap();
        let albedo = &measured.list[0];
        let green = |m: &Measured| (m.mean[1], m.se[1]);
        let found = [&albedo.reflected, &albedo.transmitted, &albedo.direct].map(green);
        println!(
            "{} {}: {found:.4?} for {:?}",
            row.fabric, row.model, row.shares
        );
        for (found, share) in found.into_iter().zip(row.shares) {
            assert!(
                is_near(found, share),
                "seed {SEED}, {} {}: {found:?} for {share}",
                row.fabric,
                row.model
            );
        }
        let sum = green(&albedo.sum);
        // Margin: four standard errors, and rounding.
        assert!((sum.0 - 1.0).abs() < 1e-6 + 4.0 * sum.1, "{sum:?}");
        match row.model {
            "fibres" => of_fibres = row.shares,
            "microflake" => twin_rejected += u32::from(!is_near(found[1], of_fibres[1])),
            _ => {}
        }
    }
    assert!(twin_rejected >= 1, "seed {SEED}: the twin passed");
}
