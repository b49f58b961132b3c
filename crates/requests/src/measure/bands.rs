//! The bands in which a fabric is measured.

use super::Measure;
use super::layout::BothBands;
use anyhow::Result;
use organza_measure::SolarPatch;
use organza_scene::fabric_file::Fabric;
use organza_scene::optics::Band;
use organza_scene::patches::{AnyPatch, Matter, PatchOptions};
use organza_scene::representation::{Build, ShownAs};
use organza_work::{InputError, of_option};
use std::path::Path;

/// Bands of wavelengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum BandName {
    /// Light, in three channels
    Visible,
    /// Near infrared, by the fabric's [optics.YARN.nir]
    Nir,
    /// All of the sun's radiation, by [optics.YARN.solar], or else by light and near infrared
    Solar,
}

impl From<BandName> for Band {
    fn from(name: BandName) -> Band {
        match name {
            BandName::Visible => Band::Visible,
            BandName::Nir => Band::Nir,
            BandName::Solar => Band::Solar,
        }
    }
}

/// Refuses bands that the measurement has no place for.
pub fn check(request: &Measure) -> Result<()> {
    let both = [BandName::Visible, BandName::Solar];
    let whole = request.whole();
    let takes_both = whole.is_some_and(|whole| match whole.both_bands {
        BothBands::Never => false,
        BothBands::InFile => request.ending() == whole.ending.unwrap_or_default(),
        BothBands::Always => true,
    });
    if request.bands.len() == 1 || (takes_both && request.bands == both) {
        return Ok(());
    }
    let why = "expected one band; --layout klems in an .xml file and --layout en14501 take \
               visible,solar as well";
    Err(of_option("bands", why))
}

/// The bands of a measurement other than light alone.
pub fn beyond_light(args: &Measure) -> bool {
    args.bands != [BandName::Visible]
}

/// The fabric as each of the bands sees it.
///
/// # Errors
/// Names the file, and the yarn of which a band knows nothing.
pub fn patches(
    args: &Measure,
    fabric: &mut Fabric,
    shown: ShownAs,
    options: &PatchOptions<'_>,
) -> Result<Vec<AnyPatch>> {
    let path = &args.file;
    if beyond_light(args) && matches!(shown.representation.build, Build::Surface(_)) {
        return Err(of_option(
            "bands",
            format!(
                "model \"{}\" of {} has colours only; choose another with --model",
                shown.representation.name,
                path.display()
            ),
        ));
    }
    let matter = Matter::new(fabric, path, shown, options)?;
    let bands = args.bands.iter();
    bands
        .map(|&band| of_band(fabric, (&matter, path, options), band.into()))
        .collect()
}

fn of_band(
    fabric: &mut Fabric,
    (matter, path, options): (&Matter, &Path, &PatchOptions<'_>),
    band: Band,
) -> Result<AnyPatch> {
    let lacks = |yarn: &str, keys: &str| {
        InputError::after_option(
            "bands",
            format!(
                "{}: {keys} is missing; in a band beyond light every yarn needs its brightness, \
                 for example [optics.{yarn}.{}] colour = 0.6",
                band.name(),
                Band::Nir.name()
            ),
        )
        .in_file(path)
        .into()
    };
    let Err(yarn) = fabric.show_in(band) else {
        return Ok(matter.patch(fabric, path, options)?);
    };
    if band != Band::Solar {
        return Err(lacks(&yarn, &format!("optics.{yarn}.{}", band.name())));
    }
    let mut part = |band| match fabric.show_in(band) {
        Ok(()) => Ok(matter.patch(fabric, path, options)?),
        Err(yarn) => Err(lacks(
            &yarn,
            &format!("optics.{yarn}.solar, and optics.{yarn}.nir as well,"),
        )),
    };
    Ok(Box::new(SolarPatch {
        nir: part(Band::Nir)?,
        visible: part(Band::Visible)?,
        nir_share: Band::NIR_SHARE,
    }))
}
