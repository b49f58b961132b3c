//! Bending rigidity of cloth, from its fibres.

use super::*;
use crate::cloth::bending::bending_length_mm;

fn warp(yarn: &str) -> SystemFigures {
    let fabric = fabric_of("plain", &format!("tex = 30\n{yarn}"));
    build(&fabric).figures().warp.unwrap()
}

fn rigidity_un_m(yarn: &str) -> f64 {
    warp(yarn).bending_rigidity_un_m.unwrap()
}

#[test]
fn rigidity_follows_from_modulus_mass_and_radius_of_the_fibres() {
    let cotton = warp("preset = \"cotton\"");
    // Fibres of radius r have the second moment of area r^2 / 4 for each of their area, which is
    // that of tex over density: 1e3 E (tex / 1e3 rho) r^2 / 4 N mm2 a thread, 2 threads a mm.
    let straight = 2.0 * 1e3 * 2.0 * 7.6 * cotton.tex / 1.52 * 0.008f64.powi(2) / 4.0;
    let found = cotton.bending_rigidity_un_m.unwrap();
    // Twist and crimp lengthen fibres by less than 15 %, which counts in number and in length.
    let longer = straight / found;
    assert!((1.0..1.32).contains(&longer), "{found} {straight}");
    // A beam of the whole yarn in place of its fibres would be stiffer by orders of magnitude.
    let beam = straight * (cotton.height_mm / 0.016).powi(2);
    assert!(!(1.0..1.32).contains(&(beam / found)));

    let stiffer = rigidity_un_m("preset = \"cotton\"\nfibre_modulus_gpa = 15.2");
    assert!((stiffer / found - 2.0).abs() < 1e-9);
    let thicker = rigidity_un_m("preset = \"cotton\"\nfibre_radius_um = 16");
    assert!(
        (thicker / found / 4.0 - 1.0).abs() < 0.05,
        "{thicker} {found}"
    );
    let uneven = rigidity_un_m("preset = \"cotton\"\nfibre_radius_cv_percent = 20");
    assert!((uneven / found - 1.2448 / 1.0816).abs() < 1e-6, "{uneven}");
    let blend = |parts: &str| rigidity_un_m(&format!("preset = \"cotton\"\nblend = [{parts}]"));
    let alike = blend("{ share = 1, fibre = \"cotton\" }, { share = 2 }");
    assert!((alike / found - 1.0).abs() < 1e-9);
    let mixed = blend("{ mass_share = 1, fibre = \"linen\" }, { mass_share = 1 }");
    let linen = blend("{ share = 1, fibre = \"linen\" }");
    assert!(found < mixed && mixed < linen, "{found} {mixed} {linen}");
}

/// A worsted of 168 g/m2 with a bending length of 15.0 mm has 5.56 uN m on the FAST system.
#[test]
fn the_bending_length_is_that_of_a_measured_worsted() {
    assert!((bending_length_mm(5.56, 168.0) - 15.0).abs() < 0.01);
}

#[test]
fn a_modulus_out_of_range_is_refused_and_knits_have_no_figure() {
    let error = refusal(&fabric_of("plain", "fibre_modulus_gpa = 0"));
    let wanted = "yarn.cotton.fibre_modulus_gpa: expected a number from 0.001 to 1000, found 0";
    assert_eq!(error, wanted);
    let text = "[draft]\nknit = \"stockinette\"\nwales_per_cm = 12\n[weft]\nyarn = \"cotton\"\n\
                per_cm = 16\n[yarn.cotton]\ntex = 20\n";
    let knit = build(&parsed(text)).figures();
    assert_eq!(knit.weft.unwrap().bending_rigidity_un_m, None);
}
