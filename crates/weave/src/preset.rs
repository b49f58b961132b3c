//! Yarns by material.
//!
//! Structure (twist angles, cross-section, migration, hairs, loops) follows the procedural
//! fits of micro-CT scans in `[Zhao2016]` where there is one; fibre size and
//! density follow `[MortonHearle2008]`. Moduli are its initial tensile moduli (cotton `Uppers`,
//! Botany wool, degummed silk, polyester of medium tenacity, viscose staple, flax), in N/tex, times
//! the density. Packing, twist direction, tex, aspect
//! and stiffness are typical values of woven yarns, estimated except where
//! the preset's source says otherwise.

use crate::spec::{CrossSectionSpec, MigrationSpec, TwistDirection, TwistSpec, YarnKind, YarnSpec};

/// A yarn that a name selects.
#[derive(Clone, Debug)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// The source of its numbers.
    pub source: &'static str,
    /// All its values.
    pub spec: YarnSpec,
}

/// Names of all presets.
pub const NAMES: [&str; 6] = ["cotton", "wool", "silk", "polyester", "rayon", "linen"];

/// The values in which presets differ.
struct Row {
    name: &'static str,
    source: &'static str,
    kind: YarnKind,
    tex: f64,
    fibre_radius_um: f64,
    fibre_density_g_per_cm3: f64,
    fibre_modulus_gpa: f64,
    fibre_volume_fraction: f64,
    twist_angle_deg: f64,
    aspect: f64,
    epsilon: f64,
    beta: f64,
    /// Swings per turn and least fraction of the radius.
    migration: (f64, f64),
    /// Hairs and loops on a length of one ply radius.
    fuzz: (f64, f64),
}

const ROWS: [Row; 6] = [
    Row {
        name: "cotton",
        source: "scan cotton1 [Zhao2016]; diameter 12-20 um, 1.52 g/cm3 [MortonHearle2008]; \
                 packing from 1.1 cm3/g [Peirce1937]; tex and aspect estimated",
        kind: YarnKind::Staple,
        tex: 30.0,
        fibre_radius_um: 8.0,
        fibre_density_g_per_cm3: 1.52,
        fibre_modulus_gpa: 7.6,
        fibre_volume_fraction: 0.6,
        twist_angle_deg: 21.0,
        aspect: 1.2,
        epsilon: 0.0,
        beta: 0.201,
        migration: (1.0, 0.85),
        fuzz: (0.69, 0.43),
    },
    Row {
        name: "wool",
        source: "no published fit: cross-section, migration, twist, packing, hairs estimated; \
                 diameter 17-42 um, 1.31 g/cm3 [MortonHearle2008]",
        kind: YarnKind::Staple,
        tex: 50.0,
        fibre_radius_um: 12.0,
        fibre_density_g_per_cm3: 1.31,
        fibre_modulus_gpa: 3.0,
        fibre_volume_fraction: 0.45,
        twist_angle_deg: 18.0,
        aspect: 1.2,
        epsilon: 0.1,
        beta: 0.4,
        migration: (1.5, 0.8),
        fuzz: (0.9, 0.6),
    },
    Row {
        name: "silk",
        source: "filament, so without migration and hairs of the spun scans of [Zhao2016]; diameter \
                 15 um, 1.34 g/cm3 [MortonHearle2008]; packing, twist, aspect estimated",
        kind: YarnKind::Filament,
        tex: 7.0,
        fibre_radius_um: 7.5,
        fibre_density_g_per_cm3: 1.34,
        fibre_modulus_gpa: 9.8,
        fibre_volume_fraction: 0.65,
        twist_angle_deg: 3.0,
        aspect: 2.0,
        epsilon: 0.4,
        beta: 0.5,
        migration: (0.0, 1.0),
        fuzz: (0.0, 0.0),
    },
    Row {
        name: "polyester",
        source: "cross-section of scan polyester1 [Zhao2016]; diameter 13 um, 1.39 g/cm3 \
                 [MortonHearle2008]; filament form, packing, twist, aspect estimated",
        kind: YarnKind::Filament,
        tex: 8.0,
        fibre_radius_um: 6.5,
        fibre_density_g_per_cm3: 1.39,
        fibre_modulus_gpa: 14.7,
        fibre_volume_fraction: 0.6,
        twist_angle_deg: 4.0,
        aspect: 1.8,
        epsilon: 0.339,
        beta: 0.423,
        migration: (0.0, 1.0),
        fuzz: (0.0, 0.0),
    },
    Row {
        name: "rayon",
        source: "scan rayon1 [Zhao2016]; 1.49 g/cm3 [MortonHearle2008]; fibre radius, packing, \
                 tex, aspect estimated",
        kind: YarnKind::Staple,
        tex: 20.0,
        fibre_radius_um: 6.0,
        fibre_density_g_per_cm3: 1.49,
        fibre_modulus_gpa: 9.7,
        fibre_volume_fraction: 0.53,
        twist_angle_deg: 21.0,
        aspect: 1.2,
        epsilon: 0.141,
        beta: 0.691,
        migration: (1.9, 0.85),
        fuzz: (2.3, 2.8),
    },
    Row {
        name: "linen",
        source: "no published fit: cross-section, migration, twist, packing, hairs estimated; \
                 1.53 g/cm3 [MortonHearle2008]",
        kind: YarnKind::Staple,
        tex: 40.0,
        fibre_radius_um: 9.0,
        fibre_density_g_per_cm3: 1.53,
        fibre_modulus_gpa: 27.5,
        fibre_volume_fraction: 0.6,
        twist_angle_deg: 15.0,
        aspect: 1.3,
        epsilon: 0.1,
        beta: 0.3,
        migration: (1.0, 0.9),
        fuzz: (0.5, 0.3),
    },
];

/// Mean and deviation, in ply radii, of scan cotton1 `[Zhao2016]`, whose other
/// scans differ by less than their own uncertainty: hairs' start, rise, run,
/// turn and the top of loops.
pub(crate) const HAIR_START: [f64; 2] = [0.90, 0.25];
pub(crate) const HAIR_RISE: [f64; 2] = [0.74, 0.42];
pub(crate) const HAIR_RUN: [f64; 2] = [0.1, 2.8];
pub(crate) const HAIR_TURN_RAD: [f64; 2] = [0.39, 0.34];
pub(crate) const LOOP_PEAK: [f64; 2] = [1.09, 0.23];

/// Hairs and loops of a preset on a ply of the given radius, per millimetre.
pub(crate) fn fuzz_per_mm(name: &str, ply_radius_mm: f64) -> (f64, f64) {
    ROWS.iter()
        .find(|r| r.name == name)
        .map_or((0.0, 0.0), |r| {
            (r.fuzz.0 / ply_radius_mm, r.fuzz.1 / ply_radius_mm)
        })
}

/// The preset of that name.
pub fn preset(name: &str) -> Option<Preset> {
    let row = ROWS.iter().find(|r| r.name == name)?;
    let twist = |direction, angle_deg| TwistSpec {
        direction,
        turns_per_m: None,
        angle_deg: Some(angle_deg),
    };
    Some(Preset {
        name: row.name,
        source: row.source,
        spec: YarnSpec {
            preset: None,
            kind: Some(row.kind),
            tex: Some(row.tex),
            plies: Some(1),
            fibres_per_ply: None,
            fibre_radius_um: Some(row.fibre_radius_um),
            fibre_density_g_per_cm3: Some(row.fibre_density_g_per_cm3),
            fibre_modulus_gpa: Some(row.fibre_modulus_gpa),
            fibre_volume_fraction: Some(row.fibre_volume_fraction),
            ply_radius_mm: None,
            twist: Some(twist(TwistDirection::Z, row.twist_angle_deg)),
            ply_twist: Some(twist(TwistDirection::S, 25.0)),
            aspect: Some(row.aspect),
            stiffness: Some(1.0),
            cross_section: Some(CrossSectionSpec {
                epsilon: row.epsilon,
                beta: row.beta,
            }),
            migration: (row.migration.0 > 0.0).then_some(MigrationSpec {
                min_fraction: row.migration.1,
                max_fraction: 1.0,
                cycles_per_turn: row.migration.0,
            }),
            ..YarnSpec::default()
        },
    })
}
