//! Irregularity by the way a yarn was spun, and finishes of the cloth, by name. They set only
//! keys that a yarn can set itself; keys that it sets win.
//!
//! Unevenness: fibres that lie at random along a yarn give it a coefficient of variation of
//! `100 sqrt(1 + 4 v^2) / sqrt(n)` per cent, for `n` fibres in the cross-section whose radii have
//! the coefficient of variation `v` [Martindale1945]. Spinning adds to it: the index of
//! irregularity is the quotient. Hairiness: by far most ring-spun and rotor-spun cottons lie
//! between 3 and 10 on the scale of [Uster2013] (a range from outside its charts, which were
//! not available), and coarser yarn is hairier [Krupincova2013]; that it grows with the root of the count, as the surface does, is
//! estimated. Indices, the hairiness of each kind of yarn at 20 tex within these ranges, the
//! length and curl of hairs, and what finishes do are estimated.

use crate::spec::{EvennessSpec, FlatteningSpec, HairinessSpec, WanderSpec, YarnSpec};
use std::f64::consts::PI;

/// Ways of spinning.
pub const NAMES: [&str; 10] = [
    "ring-spun cotton",
    "combed cotton",
    "compact cotton",
    "open-end cotton",
    "worsted wool",
    "woollen",
    "flax",
    "spun silk",
    "raw silk",
    "filament",
];

/// Finishes of the cloth.
pub const FINISHES: [&str; 5] = ["mercerised", "singed", "calendered", "brushed", "raised"];

/// Count at which hairiness is tabulated.
const COUNT_TEX: f64 = 20.0;
/// How hairiness grows with the count (estimated).
const COUNT_POWER: f64 = 0.5;

/// What differs between ways of spinning.
struct Row {
    name: &'static str,
    /// Index of irregularity; `Err` is the coefficient of variation itself, per cent.
    irregularity: Result<f64, f64>,
    fibre_length_mm: f64,
    /// Coefficient of variation of the fibres' radii, per cent.
    fibre_radius_cv_percent: f64,
    /// Amplitude in ply radii, and length in mm.
    wander: Option<(f64, f64)>,
    /// Index H at 20 tex, mean length, reach and curl in mm, share that return.
    hairiness: Option<(f64, f64, f64, f64, f64)>,
}

#[rustfmt::skip] // a table
const ROWS: [Row; 10] = [
    Row { name: "ring-spun cotton", irregularity: Ok(1.3), fibre_length_mm: 28.0, fibre_radius_cv_percent: 18.0, wander: Some((0.12, 0.7)), hairiness: Some((5.5, 1.0, 0.35, 0.6, 0.4)) },
    Row { name: "combed cotton", irregularity: Ok(1.15), fibre_length_mm: 32.0, fibre_radius_cv_percent: 16.0, wander: Some((0.10, 0.8)), hairiness: Some((4.8, 1.0, 0.35, 0.6, 0.4)) },
    Row { name: "compact cotton", irregularity: Ok(1.15), fibre_length_mm: 32.0, fibre_radius_cv_percent: 16.0, wander: Some((0.08, 0.8)), hairiness: Some((3.6, 0.8, 0.25, 0.6, 0.4)) },
    Row { name: "open-end cotton", irregularity: Ok(1.4), fibre_length_mm: 26.0, fibre_radius_cv_percent: 20.0, wander: Some((0.20, 0.5)), hairiness: Some((4.2, 0.8, 0.3, 0.4, 0.6)) },
    Row { name: "worsted wool", irregularity: Ok(1.2), fibre_length_mm: 70.0, fibre_radius_cv_percent: 22.0, wander: Some((0.12, 1.0)), hairiness: Some((5.0, 1.5, 0.5, 1.0, 0.3)) },
    Row { name: "woollen", irregularity: Ok(2.2), fibre_length_mm: 45.0, fibre_radius_cv_percent: 24.0, wander: Some((0.22, 1.2)), hairiness: Some((4.5, 2.2, 0.9, 0.8, 0.4)) },
    Row { name: "flax", irregularity: Ok(2.0), fibre_length_mm: 60.0, fibre_radius_cv_percent: 22.0, wander: Some((0.14, 1.0)), hairiness: Some((2.8, 1.0, 0.3, 0.9, 0.2)) },
    Row { name: "spun silk", irregularity: Ok(1.3), fibre_length_mm: 60.0, fibre_radius_cv_percent: 10.0, wander: Some((0.10, 1.0)), hairiness: Some((4.0, 1.0, 0.35, 0.9, 0.4)) },
    Row { name: "raw silk", irregularity: Err(9.0), fibre_length_mm: 500.0, fibre_radius_cv_percent: 8.0, wander: Some((0.05, 2.0)), hairiness: None },
    Row { name: "filament", irregularity: Err(1.0), fibre_length_mm: 1000.0, fibre_radius_cv_percent: 2.0, wander: Some((0.04, 2.0)), hairiness: None },
];

/// Completes a yarn by the way it was spun. `base` has its material; `own` what it sets itself.
pub(crate) fn spin(spec: &mut YarnSpec, own: &YarnSpec, name: &str) {
    let Some(row) = ROWS.iter().find(|row| row.name == name) else {
        return;
    };
    let (tex, fibres) = count(spec);
    let cv_percent = own
        .fibre_radius_cv_percent
        .unwrap_or(row.fibre_radius_cv_percent);
    spec.fibre_radius_cv_percent = Some(cv_percent);
    spec.evenness = own.evenness.or(Some(EvennessSpec {
        mass_cv_percent: match row.irregularity {
            Ok(index) => (index * random_cv_percent(fibres, cv_percent)).min(MAX_CV_PERCENT),
            Err(cv_percent) => cv_percent,
        },
        fibre_length_mm: row.fibre_length_mm,
    }));
    spec.wander = own
        .wander
        .or(row.wander.map(|(amplitude, length_mm)| WanderSpec {
            amplitude,
            length_mm,
        }));
    if own.hairs.is_none() {
        spec.hairiness = own.hairiness.or(row.hairiness.map(
            |(at_count, length_mm, reach_mm, curl_mm, returning)| HairinessSpec {
                index: at_count * (tex / COUNT_TEX).powf(COUNT_POWER),
                length_mm,
                reach_mm,
                curl_mm,
                returning,
                lean: [0.0; 2],
                smooth: false,
            },
        ));
    }
}

/// The least even yarn of a preset: fine yarn of few fibres.
const MAX_CV_PERCENT: f64 = 30.0;

/// Variation of the mass of yarn whose fibres lie at random [Martindale1945].
fn random_cv_percent(fibres: f64, fibre_radius_cv_percent: f64) -> f64 {
    let diameter = 0.01 * fibre_radius_cv_percent;
    100.0 * ((1.0 + 4.0 * diameter * diameter) / fibres).sqrt()
}

/// Count of a yarn, and fibres in its cross-section.
fn count(spec: &YarnSpec) -> (f64, f64) {
    let radius_mm = 1e-3 * spec.fibre_radius_um.unwrap_or(8.0);
    let density = spec.fibre_density_g_per_cm3.unwrap_or(1.5);
    let fibre_tex = 1e3 * density * PI * radius_mm * radius_mm;
    let plies = f64::from(spec.plies.unwrap_or(1));
    match (spec.fibres_per_ply, spec.tex) {
        (Some(fibres), _) => {
            let fibres = plies * f64::from(fibres);
            (fibres * fibre_tex, fibres)
        }
        (None, tex) => {
            let tex = tex.unwrap_or(COUNT_TEX);
            (tex, (tex / fibre_tex).max(1.0))
        }
    }
}

/// What a finish makes of a yarn: factors on what it has.
struct Finish {
    name: &'static str,
    /// On index, length and reach of protruding fibres.
    hairiness: [f64; 3],
    /// How far they lean, towards larger y.
    lean: f64,
    /// On the spread of the fibres' radii and on how far they wander.
    fibres: f64,
    aspect: f64,
    flattening: Option<FlatteningSpec>,
}

const PLAIN: Finish = Finish {
    name: "",
    hairiness: [1.0; 3],
    lean: 0.0,
    fibres: 1.0,
    aspect: 1.0,
    flattening: None,
};

const FINISH_ROWS: [Finish; 5] = [
    // Cotton swells in lye and dries under tension: its fibres become round and straight.
    Finish {
        name: "mercerised",
        hairiness: [0.7, 1.0, 0.8],
        fibres: 0.6,
        ..PLAIN
    },
    Finish {
        name: "singed",
        hairiness: [0.35, 0.5, 0.5],
        ..PLAIN
    },
    Finish {
        name: "calendered",
        hairiness: [0.7, 1.0, 0.3],
        aspect: 1.5,
        flattening: Some(FlatteningSpec {
            crossing: 1.4,
            float: 1.0,
        }),
        ..PLAIN
    },
    Finish {
        name: "brushed",
        hairiness: [2.0, 1.5, 2.0],
        lean: 0.3,
        ..PLAIN
    },
    Finish {
        name: "raised",
        hairiness: [4.0, 2.0, 4.0],
        lean: 0.1,
        ..PLAIN
    },
];

/// Hairiness of a yarn that has straight hairs or none before it is brushed or raised.
const BEFORE_RAISING: HairinessSpec = HairinessSpec {
    index: 3.0,
    length_mm: 0.9,
    reach_mm: 0.3,
    curl_mm: 0.7,
    returning: 0.3,
    lean: [0.0; 2],
    smooth: false,
};

/// Changes a yarn as a finish does; keys that it sets itself stay. Returns the factor on the
/// number of straight hairs and loops.
pub(crate) fn finish(spec: &mut YarnSpec, own: &YarnSpec, name: &str) -> f64 {
    let Some(finish) = FINISH_ROWS.iter().find(|row| row.name == name) else {
        return 1.0;
    };
    let [index, length, reach] = finish.hairiness;
    if own.hairiness.is_none() && own.hairs.is_none() {
        let raised = (finish.lean > 0.0).then_some(BEFORE_RAISING);
        spec.hairiness = spec.hairiness.or(raised).map(|h| HairinessSpec {
            index: index * h.index,
            length_mm: length * h.length_mm,
            reach_mm: reach * h.reach_mm,
            lean: [0.0, h.lean[1].max(finish.lean)],
            ..h
        });
    }
    if own.fibre_radius_cv_percent.is_none() {
        let cv = spec.fibre_radius_cv_percent;
        spec.fibre_radius_cv_percent = cv.map(|cv| finish.fibres * cv);
    }
    if own.wander.is_none() {
        spec.wander = spec.wander.map(|w| WanderSpec {
            amplitude: finish.fibres * w.amplitude,
            ..w
        });
    }
    if own.aspect.is_none() {
        spec.aspect = spec.aspect.map(|a| finish.aspect * a);
    }
    spec.flattening = spec.flattening.or(finish.flattening);
    index.min(1.0)
}
