//! Fibres that are not round: their lobes against those of the round fibre, and what they
//! keep of the light.

use super::*;
use crate::{Section, absorption_for_colour_of};
use organza_testing::sized;
use std::sync::LazyLock;

const ALL: [Section; 5] = [
    Section::Bean,
    Section::Trilobal,
    Section::Triangle,
    Section::Ribbon,
    Section::Ellipse(3.0),
];

fn parameters(absorption: Rgb) -> DielectricParameters {
    DielectricParameters {
        ior: 1.55,
        absorption_radii: absorption,
        longitudinal_rad: 6f32.to_radians(),
        azimuthal_rad: 15f32.to_radians(),
    }
}

fn of(section: Section, absorption: Rgb) -> Fibre {
    let fibre = DielectricFibre::with_section(parameters(absorption), Some(section));
    Fibre::from(fibre.unwrap())
}

/// Coloured fibres of the first sections; tracing one takes longer than most tests of it.
static COLOURED: LazyLock<Vec<Fibre>> = LazyLock::new(|| {
    let first = ALL.into_iter().take(sized(2, 3));
    first.map(|s| of(s, Rgb::new(0.05, 0.3, 2.0))).collect()
});

/// The distance of two far fields over all azimuths, as a share of the greatest value.
fn apart(a: &Fibre, b: &Fibre, lobe: usize, cos: f32) -> f32 {
    let (a, b) = (a.far_parts(), b.far_parts());
    let (mut most, mut apart) = (0.0f32, 0.0f32);
    for i in 0..=180 {
        let azimuth = (i as f32).to_radians();
        let [x, y] = [&a, &b].map(|parts| parts.azimuthal(lobe, cos, azimuth).0);
        most = most.max(y.max_element());
        apart = apart.max((x - y).abs().max_element());
    }
    apart / most
}

/// The tracer, given a circle, against the closed forms of the round fibre.
#[test]
fn a_traced_circle_scatters_as_the_round_fibre_does() {
    let absorption = Rgb::new(0.02, 0.2, 1.0);
    let traced = of(Section::Ellipse(1.0), absorption);
    let round = DielectricFibre::new(parameters(absorption)).unwrap();
    let round = Fibre::from(round);
    let flat = of(Section::Ellipse(1.3), absorption);
    for cos in [0.3, 0.7, 1.0] {
        for lobe in [0, 1] {
            let off = apart(&traced, &round, lobe, cos);
            assert!(off < 0.02, "lobe {lobe}, cosine {cos}: {off}");
        }
        // The twin is a little flat.
        assert!(apart(&flat, &round, 1, cos) > 0.04, "cosine {cos}");
    }
}

#[test]
fn fields_of_sections_are_proved() {
    for ((section, fibre), w_out) in ALL.into_iter().zip(COLOURED.iter()).zip(oblique()) {
        let name = section.to_string();
        prove_lobe(&name, &fibre.far_field(TANGENT), TANGENT, w_out, 20);
        let near = fibre.near_field(FibreFrame::new(TANGENT, w_out), 0.4);
        prove_lobe(&name, &near, TANGENT, w_out, 20);
    }
}

#[test]
fn sections_are_reciprocal() {
    let mut rng = PathRng::from_seed(71);
    for (section, fibre) in ALL.into_iter().zip(COLOURED.iter()).take(2) {
        let name = format!("seed 71, {section}");
        assert_reciprocal(&name, fibre, 500, &mut rng);
    }
}

/// Fibres of any section that absorb nothing lose nothing, seen from any side.
#[test]
fn clear_sections_keep_all_light() {
    for section in ALL.into_iter().step_by(sized(4, 1)) {
        let fibre = of(section, Rgb::BLACK);
        assert_clear(&section.to_string(), &fibre, &[0.0, 40.0, 80.0, 89.0]);
    }
    // The twin absorbs a little.
    let dim = albedo(&of(Section::Trilobal, Rgb::splat(0.003)), 0.0);
    assert!(dim < 1.0 - 2e-3, "{dim}");
}

#[test]
fn colours_of_heaps_know_the_section() {
    let colour = Rgb::new(0.7, 0.4, 0.1);
    let of = |section| absorption_for_colour_of(section, 1.55, colour).0;
    let round = of(None);
    let circle = of(Some(Section::Ellipse(1.0)));
    let off = (circle / round - 1.0).abs().max_element();
    assert!(off < 0.05, "{circle} {round}");
    // A thin fibre needs a stronger dye.
    let flat = of(Some(Section::Ellipse(10.0)));
    assert!(flat.z > 1.1 * round.z, "{flat} {round}");
}

/// The figures of docs/fabrics.md.
#[test]
fn sections_have_the_documented_areas() {
    for (section, share) in [
        (Section::Bean, 0.787),
        (Section::Trilobal, 0.828),
        (Section::Triangle, 0.969),
        (Section::Ribbon, 0.558),
    ] {
        let own = section.area_share();
        assert!((own - share).abs() < 5e-3, "{section}: {own}");
    }
}
