//! What a scanned volume records about itself, and what `organza scan` prints about it.

use super::ScanJob;
use anyhow::{Context, Result};
use organza_scan::input::Slices;
use organza_scan::{Denoise, ScanSettings, ScannedField, Survey};
use organza_volume::ovox::{SCAN_FILE, SourceFile};
use toml::{Table, Value};

/// Numbers with so few digits that they read well, and more than were measured.
fn rounded(x: f64) -> f64 {
    format!("{x:.6e}").parse().unwrap_or(x)
}

fn number(x: impl Into<f64>) -> Value {
    Value::Float(rounded(x.into()))
}

fn list(values: &[f32]) -> Value {
    Value::Array(values.iter().map(|v| number(*v)).collect())
}

/// What was found, in lines.
pub fn lines(slices: &dyn Slices, settings: &ScanSettings, survey: &Survey) -> Vec<String> {
    let shape = slices.shape();
    let levels = &survey.levels;
    let how = match settings.threshold {
        Some(_) => "as given".to_owned(),
        None => format!("Otsu's is {:.4}", levels.first_threshold),
    };
    let radius = match settings.fibre_radius_mm {
        Some(r) => format!("fibre radius {:.4} um, as given", 1e3 * r),
        None => format!(
            "fibre radius {:.4} um, quartiles {:.4} um apart in {} sections",
            1e3 * survey.fibre_radius_mm,
            2e3 * survey.radius_deviation_mm,
            survey.sections
        ),
    };
    vec![
        format!(
            "{} x {} x {} voxels of {}",
            shape.dims.x,
            shape.dims.y,
            shape.dims.z,
            shape.sample.name()
        ),
        format!(
            "threshold {:.4} ({how}), air {:.4}, fibre {:.4}",
            levels.threshold, levels.air, levels.fibre
        ),
        format!("{radius}; blur {:.4} um", 1e3 * survey.blur_mm),
    ]
}

/// The warning about a radius that may be that of a bundle.
pub fn warning(settings: &ScanSettings, survey: &Survey) -> Option<String> {
    let is_measured = settings.fibre_radius_mm.is_none();
    (is_measured && survey.shows_bundles()).then(|| {
        format!(
            "the fibre radius of {:.4} um may be that of bundles: grey values inside the sections \
             vary by {:.1} % along whole fibres, as gaps between thinner fibres do; look at a \
             slice and give --fibre-radius-um",
            1e3 * survey.fibre_radius_mm,
            100.0 * survey.inner_deviation
        )
    })
}

/// The file that the volume keeps.
pub fn files(
    args: &ScanJob,
    name: &str,
    settings: &ScanSettings,
    survey: &Survey,
    field: &ScannedField,
) -> Result<Vec<SourceFile>> {
    let levels = &survey.levels;
    let mut scan = Table::new();
    let mut put = |key: &str, value: Value| {
        scan.insert(key.to_owned(), value);
    };
    put("input", Value::String(name.to_owned()));
    let voxel = (settings.voxel_mm * 1e3).to_array();
    put("voxel_um", Value::Array(voxel.map(number).to_vec()));
    let size = field.dims().to_array();
    let size = size.map(|n| Value::Integer(n.into()));
    put("size", Value::Array(size.to_vec()));
    let filter = match settings.denoise {
        Denoise::None => Value::String("none".into()),
        Denoise::Median => Value::String("median".into()),
        Denoise::Gaussian(sigma) => number(sigma),
    };
    put("denoise", filter);
    put("threshold", number(levels.threshold));
    put("first_threshold", number(levels.first_threshold));
    put("air", number(levels.air));
    put("fibre", number(levels.fibre));
    put("fibre_radius_um", number(1e3 * survey.fibre_radius_mm));
    put(
        "fibre_radius_deviation_um",
        number(1e3 * survey.radius_deviation_mm),
    );
    put("blur_um", number(1e3 * survey.blur_mm));
    put("inner_deviation", number(survey.inner_deviation));
    let mut filled = (0u64, 0.0, 0.0);
    field.for_each_filled(|_, v| {
        filled.0 += 1;
        filled.1 += f64::from(v.fill);
        filled.2 += f64::from(v.confidence);
    });
    let all = field.dims().as_u64vec3().element_product() as f64;
    put("fibre_volume_fraction", number(filled.1 / all));
    put(
        "mean_confidence",
        number(filled.2 / (filled.0 as f64).max(1.0)),
    );
    let mut optics = Table::new();
    if let Some(albedo) = args.albedo {
        optics.insert("albedo".into(), list(&albedo));
    }
    optics.insert("end_on_ratio".into(), number(args.end_on_ratio));
    let material = |name: &str| {
        let mut material = Table::new();
        material.insert("name".into(), Value::String(name.to_owned()));
        if let Some(colour) = args.colour {
            material.insert("colour".into(), list(&colour));
        }
        Value::Table(material)
    };
    let mut file = Table::new();
    file.insert("scan".into(), Value::Table(scan));
    let names = (0..field.material_count()).map(|m| {
        let yarn = field.yarns.iter().find(|y| usize::from(y.material) == m);
        material(yarn.map_or("fibre", |y| &y.name))
    });
    file.insert("material".into(), Value::Array(names.collect()));
    let mut every = Table::new();
    every.insert("*".into(), Value::Table(optics));
    file.insert("optics".into(), Value::Table(every));
    let text = toml::to_string(&file).context("the record of the scan failed")?;
    Ok(vec![SourceFile {
        name: SCAN_FILE.into(),
        bytes: text.into_bytes(),
    }])
}
