//! The scattering model of a fibre, from the `[optics.YARN]` of its yarn.

use crate::optics::{OpticsTable, UNDYED};
use organza_basis::Rgb;
use organza_scatter::longitudinal::MAX_BLUR_DEG;
use organza_scatter::{
    ClearFibre, DielectricFibre, DielectricParameters, Fibre, Section, absorption_for_colour_of,
};
use organza_weave::Material;

/// Mean index of cotton, flax, silk and wool, which lie within 0.02 of it
/// [MortonHearle2008].
const IOR: f32 = 1.55;

/// Estimated: the width of the highlight of a staple fibre, as for its flakes.
const LONGITUDINAL_DEG: f32 = 6.0;

/// Estimated: fibres are not round, which turns light about them.
const AZIMUTHAL_DEG: f32 = 15.0;

/// Checks the keys of `[optics.YARN]` that describe fibres.
///
/// # Errors
/// The key at fault, as `.key: what was expected`.
pub fn check(t: &OpticsTable) -> Result<(), String> {
    if let (Some(_), Some(_)) = (&t.fitted, &t.model) {
        return Err(".model: does not go with `fitted`".into());
    }
    if let Some((own, model)) = t.own_model() {
        if let Some((key, _)) = t.dielectric_keys().iter().find(|k| k.1) {
            return Err(format!(
                ".{key}: does not go with `{own}`, which has its own"
            ));
        }
        let made = model.build().map(|_| ());
        return made.map_err(|why| format!(".{own}{why}"));
    }
    if t.colour.is_some() && t.absorption_per_mm.is_some() {
        return Err(".colour: does not go with `absorption_per_mm`".into());
    }
    for (key, value, most) in [
        ("longitudinal_deg", t.longitudinal_deg, MAX_BLUR_DEG),
        ("azimuthal_deg", t.azimuthal_deg, 90.0),
    ] {
        if let Some(v) = value.filter(|v| !(0.0..=most).contains(v)) {
            return Err(format!(
                ".{key}: expected a number from 0 to {most}, found {v}"
            ));
        }
    }
    if let Some(v) = t.ior.filter(|v| !(1.0..=3.0).contains(v)) {
        return Err(format!(".ior: expected a number from 1 to 3, found {v}"));
    }
    section(t).map_err(|why| format!(".section: {why}"))?;
    for (key, values, most) in [
        ("colour", t.colour, 1.0),
        ("absorption_per_mm", t.absorption_per_mm, 1e5),
    ] {
        let outside = |v: &[f32; 3]| !v.iter().all(|v| (0.0..=most).contains(v));
        if let Some(v) = values.filter(outside) {
            return Err(format!(
                ".{key}: expected three numbers from 0 to {most}, found {v:?}"
            ));
        }
    }
    Ok(())
}

/// The scattering model of the fibres of a material.
///
/// # Errors
/// What is wrong with its parameters.
pub fn of_optics(t: &OpticsTable, material: &Material) -> Result<Fibre, String> {
    if let Some((own, model)) = t.own_model() {
        return model.build().map_err(|why| format!("{own}{why}"));
    }
    let section = section(t).map_err(|why| format!("section: {why}"))?;
    let parameters = parameters(t, material, section);
    let fibre = DielectricFibre::with_section(parameters, section).map_err(|e| e.to_string())?;
    Ok(Fibre::from(fibre))
}

/// What the fibres of a material are made of; none of fitted and measured ones, which have no body.
///
/// # Errors
/// What is wrong with their section.
pub fn dielectric(
    t: &OpticsTable,
    material: &Material,
) -> Result<Option<DielectricParameters>, String> {
    let section = section(t).map_err(|why| format!("section: {why}"))?;
    Ok(t.own_model()
        .is_none()
        .then(|| parameters(t, material, section)))
}

fn parameters(
    t: &OpticsTable,
    material: &Material,
    section: Option<Section>,
) -> DielectricParameters {
    let ior = t.ior.unwrap_or(IOR);
    DielectricParameters {
        ior,
        absorption_radii: absorption_radii(t, material, ior, section),
        longitudinal_rad: t.longitudinal_deg.unwrap_or(LONGITUDINAL_DEG).to_radians(),
        azimuthal_rad: t.azimuthal_deg.unwrap_or(AZIMUTHAL_DEG).to_radians(),
    }
}

/// The fibre of a material as a round one without blur, for flakes that transmit. Of fitted and
/// measured fibres only the albedo of the flakes is known.
///
/// # Errors
/// What is wrong with its parameters.
pub fn clear_fibre(t: &OpticsTable, material: &Material) -> Result<ClearFibre, String> {
    if t.own_model().is_some() {
        return Ok(ClearFibre::of_albedo(t.flakes(material.colour).albedo));
    }
    let ior = t.ior.unwrap_or(IOR);
    let section = section(t).map_err(|why| format!("section: {why}"))?;
    Ok(ClearFibre {
        ior,
        absorption_radii: absorption_radii(t, material, ior, section),
        albedo: Rgb::WHITE,
    })
}

/// Absorption times the fibre's radius: given, or such that a thick heap has the colour.
fn absorption_radii(
    t: &OpticsTable,
    material: &Material,
    ior: f32,
    section: Option<Section>,
) -> Rgb {
    match t.absorption_per_mm {
        Some(a) => Rgb::from(a) * material.fibre_radius_mm,
        None => {
            let thread = material.colour.unwrap_or(UNDYED);
            absorption_for_colour_of(section, ior, t.colour.map_or(thread, Rgb::from))
        }
    }
}

/// The section of the fibres; none of round ones.
fn section(t: &OpticsTable) -> Result<Option<Section>, String> {
    match t.section.as_deref() {
        None | Some("round") => Ok(None),
        Some(name) => Section::from_name(name).map(Some),
    }
}
