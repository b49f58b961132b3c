//! Fibres that scatter as fibres: from a yarn's optics to the model.

use crate::fabric_file::{OpticsTable, UNDYED};
use organza_basis::Rgb;
use organza_scatter::fitted::PRESETS;
use organza_scatter::{
    DielectricFibre, DielectricParameters, Fibre, FittedFibre, FittedParameters,
    absorption_for_colour,
};
use organza_volume::Octree;
use organza_weave::Material;

/// Mean index of cotton, flax, silk and wool, which lie within 0.02 of it
/// [MortonHearle2008].
const IOR: f32 = 1.55;

/// Estimated: the width of the highlight of a staple fibre, as for its flakes.
const LONGITUDINAL_DEG: f32 = 6.0;

/// Estimated: fibres are not round, which turns light about them.
const AZIMUTHAL_DEG: f32 = 15.0;

/// Edge of the voxels, in fibre radii, that suits packed fibres best: finer ones
/// count chance clusters twice, coarser ones blur the outline of yarns.
const PACKED_VOXEL_RADII: f32 = 2.0;

/// Checks the keys of `[optics.YARN]` that describe fibres.
///
/// # Errors
/// The key at fault, as `.key: what was expected`.
pub fn check(t: &OpticsTable) -> Result<(), String> {
    if let Some(name) = &t.fitted {
        let others = [
            ("ior", t.ior.is_some()),
            ("colour", t.colour.is_some()),
            ("absorption_per_mm", t.absorption_per_mm.is_some()),
            ("longitudinal_deg", t.longitudinal_deg.is_some()),
            ("azimuthal_deg", t.azimuthal_deg.is_some()),
        ];
        if let Some((key, _)) = others.iter().find(|o| o.1) {
            return Err(format!(
                ".{key}: does not go with `fitted`, which has its own"
            ));
        }
        return match FittedParameters::preset(name) {
            Ok(_) => Ok(()),
            Err(near) => Err(format!(
                ".fitted: no fibre is named `{name}`; expected one of {}{}",
                PRESETS.join(", "),
                near.map_or(String::new(), |n| format!("; did you mean `{n}`?"))
            )),
        };
    }
    if t.colour.is_some() && t.absorption_per_mm.is_some() {
        return Err(".colour: does not go with `absorption_per_mm`".into());
    }
    for (key, value, most) in [
        ("longitudinal_deg", t.longitudinal_deg, 34.0),
        ("azimuthal_deg", t.azimuthal_deg, 90.0),
    ] {
        if value.is_some_and(|v| !(0.0..=most).contains(&v)) {
            return Err(format!(".{key}: expected a number from 0 to {most}"));
        }
    }
    if t.ior.is_some_and(|v| !(1.0..=3.0).contains(&v)) {
        return Err(".ior: expected a number from 1 to 3".into());
    }
    let colours = t.colour.iter().flatten();
    if !colours.clone().all(|c| (0.0..=1.0).contains(c)) {
        return Err(".colour: expected three numbers from 0 to 1".into());
    }
    let mut absorptions = t.absorption_per_mm.iter().flatten();
    if !absorptions.all(|a| (0.0..=1e5).contains(a)) {
        return Err(".absorption_per_mm: expected three numbers from 0 to 100000".into());
    }
    Ok(())
}

/// The fibre of a material.
///
/// # Errors
/// What is wrong with its parameters.
pub fn fibre(t: &OpticsTable, material: &Material) -> Result<Fibre, String> {
    if let Some(name) = &t.fitted {
        let parameters =
            FittedParameters::preset(name).map_err(|_| format!("no fibre is named `{name}`"))?;
        let fibre = FittedFibre::new(parameters).map_err(|e| e.to_string())?;
        return Ok(Fibre::Fitted(fibre));
    }
    let ior = t.ior.unwrap_or(IOR);
    let absorption_radii = match t.absorption_per_mm {
        Some(a) => Rgb::from(a) * material.fibre_radius_mm,
        None => {
            let thread = material.colour.unwrap_or(UNDYED);
            absorption_for_colour(ior, t.colour.map_or(thread, Rgb::from))
        }
    };
    let parameters = DielectricParameters {
        ior,
        absorption_radii,
        longitudinal_rad: t.longitudinal_deg.unwrap_or(LONGITUDINAL_DEG).to_radians(),
        azimuthal_rad: t.azimuthal_deg.unwrap_or(AZIMUTHAL_DEG).to_radians(),
    };
    let fibre = DielectricFibre::new(parameters).map_err(|e| e.to_string())?;
    Ok(Fibre::Dielectric(fibre))
}

/// The level of detail that suits packed fibres of a cloth's materials.
pub fn level_for_packed(octree: &Octree, materials: &[Material]) -> u8 {
    let radii: f32 = materials.iter().map(|m| m.fibre_radius_mm).sum();
    let wanted_mm = PACKED_VOXEL_RADII * radii / materials.len().max(1) as f32;
    let off = |l: &u8| (octree.voxel_mm(*l).max_element() / wanted_mm).ln().abs();
    (0..octree.level_count())
        .min_by(|a, b| off(a).total_cmp(&off(b)))
        .unwrap_or(0)
}
