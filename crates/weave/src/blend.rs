//! Fibres of several colours and materials in one yarn.
//!
//! Shares are given by number or by mass, as labels give them. A yarn of several materials is
//! described to everything that sees it as a whole by the mean fibre: the radius of the mean
//! area, and the density of the mean mass. Its single fibres have their own.

use crate::Error;
use crate::error::did_you_mean;
use crate::preset;
use crate::spec::BlendSpec;
use organza_basis::{PathRng, Rgb};

/// The largest number of parts of a blend.
const MAX_PARTS: usize = 64;

/// The fibres of one colour and material in a yarn.
#[derive(Clone, Debug, PartialEq)]
pub struct FibrePart {
    /// Name of the material, which tables of optics may refer to.
    pub fibre: Option<String>,
    /// Linear colour; the thread's own without it.
    pub colour: Option<Rgb>,
    /// Share of all fibres of the yarn by number; all shares sum to 1.
    pub share: f64,
    /// Root mean square of the radii, millimetres.
    pub fibre_radius_mm: f64,
    /// Density of the fibre substance.
    pub fibre_density_g_per_cm3: f64,
    /// Young's modulus along the fibres.
    pub fibre_modulus_gpa: f64,
    /// Coefficient of variation of the radii.
    pub fibre_radius_cv: f64,
}

impl FibrePart {
    /// Area of all its fibres in the cross-section, up to a factor that all parts share.
    fn area(&self) -> f64 {
        self.share * self.fibre_radius_mm * self.fibre_radius_mm
    }

    fn mass(&self) -> f64 {
        self.area() * self.fibre_density_g_per_cm3
    }
}

/// A material whose fibres are known beside those of the presets of yarns.
struct Known {
    name: &'static str,
    fibre_radius_um: f64,
    fibre_density_g_per_cm3: f64,
    fibre_modulus_gpa: f64,
}

/// Densities and moduli of nylon and acrylic: [MortonHearle2008]; those of elastane and all radii,
/// of 3.3 dtex for clothing and of 44 dtex for elastane, are estimated.
const KNOWN: [Known; 3] = [
    Known {
        name: "nylon",
        fibre_radius_um: 9.6,
        fibre_density_g_per_cm3: 1.14,
        fibre_modulus_gpa: 3.4,
    },
    Known {
        name: "acrylic",
        fibre_radius_um: 9.4,
        fibre_density_g_per_cm3: 1.19,
        fibre_modulus_gpa: 7.4,
    },
    Known {
        name: "elastane",
        fibre_radius_um: 34.0,
        fibre_density_g_per_cm3: 1.21,
        fibre_modulus_gpa: 0.01,
    },
];
/// Materials whose fibres are spun through nozzles, and the largest coefficient of variation of
/// their radii, estimated as that of the way of spinning `filament`.
const NOZZLE_SPUN: [&str; 4] = ["nylon", "acrylic", "elastane", "polyester"];
const NOZZLE_CV: f64 = 0.02;

/// Names of the materials that parts of a blend can have.
pub fn names() -> Vec<&'static str> {
    let known = KNOWN.iter().map(|k| k.name);
    preset::NAMES.into_iter().chain(known).collect()
}

/// The fibres of a material.
fn material(name: &str) -> Option<Known> {
    let known = KNOWN.into_iter().find(|k| k.name == name);
    known.or_else(|| {
        let preset = preset::preset(name)?;
        Some(Known {
            name: preset.name,
            fibre_radius_um: preset.spec.fibre_radius_um?,
            fibre_density_g_per_cm3: preset.spec.fibre_density_g_per_cm3?,
            fibre_modulus_gpa: preset.spec.fibre_modulus_gpa?,
        })
    })
}

/// What the fibres of a part are where it does not say so itself: those of the yarn.
pub(crate) struct OwnFibres {
    pub radius_mm: f64,
    pub density_g_per_cm3: f64,
    pub modulus_gpa: f64,
    pub radius_cv: f64,
}

/// The parts of a blend. `key` gives the name of a key of the yarn.
///
/// # Errors
/// A value out of range, a material that is not known, or shares by number beside such by mass.
pub(crate) fn parts(
    specs: &[BlendSpec],
    own: &OwnFibres,
    key: &dyn Fn(&str) -> String,
) -> Result<Vec<FibrePart>, Error> {
    if specs.len() > MAX_PARTS {
        let message = format!("expected at most {MAX_PARTS} parts, found {}", specs.len());
        return Err(Error::spec(key("blend"), message));
    }
    let mut parts = Vec::with_capacity(specs.len());
    for (i, spec) in specs.iter().enumerate() {
        let key = |name: &str| key(&format!("blend[{i}].{name}"));
        parts.push(part(spec, specs[0].mass_share.is_some(), own, &key)?);
    }
    let sum: f64 = parts.iter().map(|p| p.share).sum();
    parts.iter_mut().for_each(|p| p.share /= sum);
    Ok(parts)
}

fn part(
    spec: &BlendSpec,
    by_mass: bool,
    own: &OwnFibres,
    key: &dyn Fn(&str) -> String,
) -> Result<FibrePart, Error> {
    let number = |name: &str, v: f64, from: f64, to: f64| {
        if v >= from && v <= to {
            return Ok(v);
        }
        let message = format!("expected a number from {from} to {to}, found {v}");
        Err(Error::spec(key(name), message))
    };
    let known = spec.fibre.as_deref().map(|name| (name, material(name)));
    if let Some((name, None)) = known
        && (spec.fibre_radius_um.is_none() || spec.fibre_density_g_per_cm3.is_none())
    {
        let message = format!(
            "no fibre is named \"{name}\"{}; there are {}, and others need fibre_radius_um and \
             fibre_density_g_per_cm3",
            did_you_mean(name, names()),
            names().join(", ")
        );
        return Err(Error::spec(key("fibre"), message));
    }
    let material = known.and_then(|k| k.1);
    let radius_um = spec
        .fibre_radius_um
        .or(material.as_ref().map(|m| m.fibre_radius_um))
        .unwrap_or(1e3 * own.radius_mm);
    let density = spec
        .fibre_density_g_per_cm3
        .or(material.as_ref().map(|m| m.fibre_density_g_per_cm3))
        .unwrap_or(own.density_g_per_cm3);
    // The radius of the yarn itself is not rounded by the way to micrometres and back.
    let is_own = spec.fibre_radius_um.is_none() && material.is_none();
    let radius_mm = match is_own {
        true => own.radius_mm,
        false => 1e-3 * number("fibre_radius_um", radius_um, 0.1, 1e4)?,
    };
    let is_from_nozzle = spec
        .fibre
        .as_deref()
        .is_some_and(|f| NOZZLE_SPUN.contains(&f));
    let cv = match spec.fibre_radius_cv_percent {
        Some(percent) => 0.01 * number("fibre_radius_cv_percent", percent, 0.0, 50.0)?,
        None if is_from_nozzle => own.radius_cv.min(NOZZLE_CV),
        None => own.radius_cv,
    };
    let density = number("fibre_density_g_per_cm3", density, 0.1, 30.0)?;
    if let Some(colour) = spec.colour {
        for channel in <[f32; 3]>::from(colour) {
            number("colour", f64::from(channel), 0.0, 1.0)?;
        }
    }
    let share = match (spec.share, spec.mass_share) {
        (Some(share), None) if !by_mass => number("share", share, 1e-6, 1e6)?,
        (None, Some(share)) if by_mass => {
            number("mass_share", share, 1e-6, 1e6)? / (density * radius_mm * radius_mm)
        }
        (None, None) => {
            return Err(Error::spec(
                key("share"),
                "is missing: give share or mass_share",
            ));
        }
        _ => {
            let message = "give share in all parts or mass_share in all parts, not both";
            return Err(Error::spec(key("mass_share"), message));
        }
    };
    Ok(FibrePart {
        fibre: spec.fibre.clone(),
        colour: spec.colour,
        share,
        fibre_radius_mm: radius_mm,
        fibre_density_g_per_cm3: density,
        fibre_modulus_gpa: material.map_or(own.modulus_gpa, |m| m.fibre_modulus_gpa),
        fibre_radius_cv: cv,
    })
}

/// Whether the parts differ by more than colour from the fibres of the yarn and have to be told
/// apart.
pub(crate) fn are_materials(parts: &[FibrePart], own: &OwnFibres) -> bool {
    parts.iter().any(|p| {
        p.fibre.is_some()
            || (
                p.fibre_radius_mm,
                p.fibre_density_g_per_cm3,
                p.fibre_radius_cv,
            ) != (own.radius_mm, own.density_g_per_cm3, own.radius_cv)
    })
}

/// Radius of the mean area of the fibres, millimetres, and their density.
pub(crate) fn mean_fibre(parts: &[FibrePart]) -> (f64, f64) {
    let area: f64 = parts.iter().map(FibrePart::area).sum();
    let mass: f64 = parts.iter().map(FibrePart::mass).sum();
    (area.sqrt(), mass / area)
}

/// Shares of the parts by mass; they sum to 1.
pub fn mass_shares(parts: &[FibrePart]) -> Vec<f64> {
    let sum: f64 = parts.iter().map(FibrePart::mass).sum();
    parts.iter().map(|p| p.mass() / sum).collect()
}

/// The part at the share `u` of all fibres by number.
pub(crate) fn part_at(parts: &[FibrePart], u: f64) -> usize {
    let mut up_to = 0.0;
    let found = parts.iter().position(|p| {
        up_to += p.share;
        u < up_to
    });
    found.unwrap_or(parts.len() - 1)
}

/// The parts of so many fibres, in random order: each part has its share of them, rounded up or
/// down at random so that its mean is right.
pub(crate) fn spread(parts: &[FibrePart], count: usize, rng: &mut PathRng) -> Vec<usize> {
    let first = f64::from(rng.unit());
    let place = |i: usize| part_at(parts, (i as f64 + first) / count as f64);
    let mut all: Vec<usize> = (0..count).map(place).collect();
    for i in (1..count).rev() {
        all.swap(i, rng.below(i as u32 + 1) as usize);
    }
    all
}
