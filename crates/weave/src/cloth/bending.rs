//! Bending of cloth, estimated from its fibres.

use crate::yarn::Yarn;
use std::f64::consts::PI;

/// Standard acceleration of gravity, m/s2.
const GRAVITY_M_PER_S2: f64 = 9.806_65;

/// By how much cloth is stiffer than fibres that slide past each other freely: friction and set
/// (estimated). The fibres determine the stiffness of yarn, twist hardly matters `[Cooper1960]`;
/// weave and finish hinder them.
const HINDRANCE: f64 = 2.0;

/// Mean flexural rigidity of the fibres of a yarn, N mm2: Young's modulus times the second moment
/// of area of round fibres.
pub(super) fn fibre_rigidity_n_mm2(yarn: &Yarn) -> f64 {
    // Radii are root mean squares, of which normally distributed ones have a larger fourth power.
    let one = |modulus_gpa: f64, radius_mm: f64, cv: f64| {
        let square = cv * cv;
        let spread = (1.0 + 6.0 * square + 3.0 * square * square) / (1.0 + square).powi(2);
        1e3 * modulus_gpa * 0.25 * PI * radius_mm.powi(4) * spread
    };
    if !yarn.blends_materials {
        let (radius_mm, cv) = (yarn.fibre_radius_mm, yarn.fibre_radius_cv);
        return one(yarn.fibre_modulus_gpa, radius_mm, cv);
    }
    let parts = yarn.blend.iter();
    let parts =
        parts.map(|p| p.share * one(p.fibre_modulus_gpa, p.fibre_radius_mm, p.fibre_radius_cv));
    parts.sum()
}

/// Flexural rigidity of cloth per width, uN m, from that of its threads as free fibres, N mm2, on a
/// width in millimetres.
pub(super) fn rigidity_un_m(free_n_mm2: f64, width_mm: f64) -> f64 {
    1e3 * HINDRANCE * free_n_mm2 / width_mm
}

/// Bending length of the cantilever test `[ASTM2002]`, millimetres: the cube root of rigidity
/// over weight.
pub(super) fn bending_length_mm(rigidity_un_m: f64, g_per_m2: f64) -> f64 {
    1e3 * (1e-3 * rigidity_un_m / (GRAVITY_M_PER_S2 * g_per_m2)).cbrt()
}
