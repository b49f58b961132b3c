//! XML files of the program WINDOW with a BSDF on the Klems basis, schema BSDF-v1.4.
//!
//! Colour is written in the form that Radiance reads: `CIE-X`, `Visible` (Y) and `CIE-Z`,
//! scaled so that a neutral value is the same in all three. With solar radiation beside it, light
//! is `Visible` alone, since programs for glazings refuse the others.

use crate::{KlemsBasis, KlemsBsdf, KlemsMatrix};
use glam::{DMat3, DVec3};
use organza_basis::nearest_name;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// Why a file holds no usable BSDF.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KlemsFileError {
    /// The file is not XML, or elements are missing.
    #[error("{0}")]
    Syntax(String),
    /// The basis is none of the three.
    #[error("the angle basis `{0}` is unknown; expected LBNL/Klems Full, Half or Quarter{1}")]
    Basis(String, String),
    /// Rows and columns are exchanged, or the data is a tensor tree.
    #[error("the data is structured as `{0}`; expected `Columns`")]
    Structure(String),
    /// Wrong number of values.
    #[error("{name}: found {found} values; expected {expected}")]
    Count {
        /// Name of the matrix.
        name: String,
        /// Number of values in the file.
        found: usize,
        /// Number of values of the basis.
        expected: usize,
    },
    /// A value is not a number, or is negative.
    #[error("{name}: value {index}: expected a number of at least 0, found `{found}`")]
    Number {
        /// Name of the matrix.
        name: String,
        /// Index of the value, from 1.
        index: usize,
        /// The text of the file.
        found: String,
    },
    /// A matrix is missing.
    #[error("there is no `{0}` of visible light or colour")]
    Missing(&'static str),
}

#[derive(Serialize, Deserialize)]
struct WindowElement {
    #[serde(rename = "@xmlns", default)]
    namespace: String,
    #[serde(rename = "WindowElementType", default)]
    kind: String,
    #[serde(rename = "Optical")]
    optical: Optical,
}

#[derive(Serialize, Deserialize)]
struct Optical {
    #[serde(rename = "Layer")]
    layer: Layer,
}

#[derive(Serialize, Deserialize)]
struct Layer {
    #[serde(rename = "Material", default)]
    material: Material,
    #[serde(rename = "DataDefinition")]
    definition: DataDefinition,
    #[serde(rename = "WavelengthData")]
    data: Vec<WavelengthData>,
}

#[derive(Default, Serialize, Deserialize)]
#[serde(default)]
struct Material {
    #[serde(rename = "Name")]
    name: String,
    #[serde(rename = "Manufacturer")]
    manufacturer: String,
    #[serde(rename = "Thickness", skip_serializing_if = "Option::is_none")]
    thickness: Option<Thickness>,
    #[serde(rename = "DeviceType")]
    device: String,
    #[serde(
        rename = "ThermalConductivity",
        skip_serializing_if = "Option::is_none"
    )]
    conductivity: Option<f64>,
    #[serde(rename = "EmissivityFront", skip_serializing_if = "Option::is_none")]
    emissivity_front: Option<f64>,
    #[serde(rename = "EmissivityBack", skip_serializing_if = "Option::is_none")]
    emissivity_back: Option<f64>,
    #[serde(rename = "TIR", skip_serializing_if = "Option::is_none")]
    infrared_transmittance: Option<f64>,
    #[serde(rename = "PermeabilityFactor", skip_serializing_if = "Option::is_none")]
    permeability: Option<f64>,
}

#[derive(Serialize, Deserialize)]
struct Thickness {
    #[serde(rename = "@unit", default)]
    unit: String,
    #[serde(rename = "$text", default)]
    value: f64,
}

#[derive(Serialize, Deserialize)]
struct DataDefinition {
    #[serde(rename = "IncidentDataStructure")]
    structure: String,
    #[serde(rename = "AngleBasis", default)]
    bases: Vec<AngleBasis>,
}

#[derive(Serialize, Deserialize)]
struct AngleBasis {
    #[serde(rename = "AngleBasisName")]
    name: String,
    #[serde(rename = "AngleBasisBlock", default)]
    rings: Vec<AngleBasisBlock>,
}

#[derive(Serialize, Deserialize)]
struct AngleBasisBlock {
    #[serde(rename = "Theta")]
    theta_deg: f64,
    #[serde(rename = "nPhis")]
    count: u16,
    #[serde(rename = "ThetaBounds")]
    bounds: ThetaBounds,
}

#[derive(Serialize, Deserialize)]
struct ThetaBounds {
    #[serde(rename = "LowerTheta")]
    low_deg: f64,
    #[serde(rename = "UpperTheta")]
    high_deg: f64,
}

#[derive(Serialize, Deserialize)]
struct WavelengthData {
    #[serde(rename = "LayerNumber", default)]
    layer: String,
    #[serde(rename = "Wavelength")]
    wavelength: Wavelength,
    #[serde(rename = "SourceSpectrum", default)]
    source: String,
    #[serde(rename = "DetectorSpectrum", default)]
    detector: String,
    #[serde(rename = "WavelengthDataBlock")]
    blocks: Vec<WavelengthDataBlock>,
}

#[derive(Serialize, Deserialize)]
struct Wavelength {
    #[serde(rename = "@unit", default)]
    unit: String,
    #[serde(rename = "$text", default)]
    name: String,
}

#[derive(Serialize, Deserialize)]
struct WavelengthDataBlock {
    #[serde(rename = "WavelengthDataDirection")]
    direction: String,
    #[serde(rename = "ColumnAngleBasis")]
    columns: String,
    #[serde(rename = "RowAngleBasis")]
    rows: String,
    #[serde(rename = "ScatteringDataType", default)]
    kind: String,
    #[serde(rename = "ScatteringData")]
    values: String,
}

/// Names of the matrices, in the order of [`KlemsBsdf`].
const DIRECTIONS: [&str; 4] = [
    "Transmission Front",
    "Transmission Back",
    "Reflection Front",
    "Reflection Back",
];

/// Names of the measured bands.
const BANDS: [&str; 3] = ["CIE-X", "Visible", "CIE-Z"];

/// The place of light among them.
const VISIBLE: usize = 1;

/// The band of all of the sun's radiation, its spectrum and its detector.
const SOLAR: [&str; 3] = ["Solar", "prEN 410 Table 2 AM1_0.ssp", "None"];

/// Linear sRGB to XYZ over the XYZ of its white.
pub(crate) const XYZ_FROM_RGB: DMat3 = DMat3::from_cols(
    DVec3::new(0.433_887, 0.212_639, 0.017_750),
    DVec3::new(0.376_224, 0.715_169, 0.109_448),
    DVec3::new(0.189_889, 0.072_192, 0.872_802),
);

/// A cloth under all of the sun's radiation, and what WINDOW wants to know of it beside that.
#[derive(Clone, Copy, Debug)]
pub struct SolarKlems<'a> {
    /// Its matrices, all channels alike.
    pub bsdf: &'a KlemsBsdf,
    /// Thickness of the cloth.
    pub thickness_mm: f64,
    /// Share of light along the normal that meets nothing; the air and long waves pass there.
    pub openness: f64,
}

/// Emissivity of the fibres for long waves, and how they conduct heat, W/(m K): estimated, values
/// usual for polymers and cellulose. They are not measured here.
const EMISSIVITY: f64 = 0.9;
const CONDUCTIVITY: f64 = 0.15;

/// The text of a file. `name` is the name of the cloth. With `solar` it has the two bands that
/// WINDOW and pyWinCalc want, which refuse files with colours.
///
/// # Errors
/// A value that XML cannot hold.
pub fn write_klems(
    bsdf: &KlemsBsdf,
    solar: Option<SolarKlems<'_>>,
    name: &str,
) -> Result<String, KlemsFileError> {
    let failed = |e: &dyn std::fmt::Display| KlemsFileError::Syntax(e.to_string());
    let rings = bsdf.basis.rings();
    let block = |(k, &(low_deg, count)): (usize, &(f64, u16))| {
        let high_deg = rings.get(k + 1).map_or(90.0, |r| r.0);
        AngleBasisBlock {
            theta_deg: if k == 0 {
                0.0
            } else {
                0.5 * (low_deg + high_deg)
            },
            count,
            bounds: ThetaBounds { low_deg, high_deg },
        }
    };
    // One matrix for each set of data, as WINDOW writes them: pyWinCalc reads no more of a set.
    // Grey values are the same in X, Y and Z.
    let data_of = |[band, source, detector]: [&str; 3], bsdf: &KlemsBsdf, channel: usize| {
        let matrices = bsdf.transmission.iter().chain(&bsdf.reflection);
        let data = |(direction, matrix): (&&str, &KlemsMatrix)| WavelengthData {
            layer: "System".into(),
            wavelength: Wavelength {
                unit: "Integral".into(),
                name: band.into(),
            },
            source: source.into(),
            detector: detector.into(),
            blocks: vec![WavelengthDataBlock {
                direction: (*direction).into(),
                columns: bsdf.basis.name().into(),
                rows: bsdf.basis.name().into(),
                kind: if direction.starts_with('T') {
                    "BTDF"
                } else {
                    "BRDF"
                }
                .into(),
                values: numbers(matrix, channel, bsdf.basis.len()),
            }],
        };
        let all = DIRECTIONS.iter().zip(matrices).map(data);
        all.collect::<Vec<_>>()
    };
    let light = ["CIE Illuminant D65 1nm.ssp", "ASTM E308 1931 Y.dsp"];
    let channels = BANDS.iter().enumerate();
    let mut data: Vec<_> = channels
        .filter(|(channel, _)| solar.is_none() || *channel == VISIBLE)
        .flat_map(|(channel, band)| data_of([band, light[0], light[1]], bsdf, channel))
        .collect();
    if let Some(solar) = solar {
        data.extend(data_of(SOLAR, solar.bsdf, VISIBLE));
    }
    let emissivity = solar.map(|s| EMISSIVITY * (1.0 - s.openness));
    let file = WindowElement {
        namespace: "http://windows.lbl.gov".into(),
        kind: "System".into(),
        optical: Optical {
            layer: Layer {
                material: Material {
                    name: name.into(),
                    manufacturer: "organza".into(),
                    thickness: solar.map(|s| Thickness {
                        unit: "Millimeter".into(),
                        value: s.thickness_mm,
                    }),
                    device: "Other".into(),
                    conductivity: solar.map(|_| CONDUCTIVITY),
                    emissivity_front: emissivity,
                    emissivity_back: emissivity,
                    infrared_transmittance: solar.map(|s| s.openness),
                    permeability: solar.map(|s| s.openness),
                },
                definition: DataDefinition {
                    structure: "Columns".into(),
                    bases: vec![AngleBasis {
                        name: bsdf.basis.name().into(),
                        rings: rings.iter().enumerate().map(block).collect(),
                    }],
                },
                data,
            },
        },
    };
    let mut text = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let root = Some("WindowElement");
    let mut out = quick_xml::se::Serializer::with_root(&mut text, root).map_err(|e| failed(&e))?;
    out.indent(' ', 1);
    file.serialize(out).map_err(|e| failed(&e))?;
    text.push('\n');
    Ok(text)
}

fn numbers(matrix: &KlemsMatrix, band: usize, per_row: usize) -> String {
    let mut text = String::new();
    for (k, v) in matrix.values.iter().enumerate() {
        let xyz = (XYZ_FROM_RGB * DVec3::from(*v)).to_array();
        let value = xyz.get(band).copied().unwrap_or_default().max(0.0);
        let end = if (k + 1) % per_row == 0 { "\n" } else { " " };
        // Writing to a string cannot fail.
        let _ = write!(text, "{value:.6e},{end}");
    }
    text
}

/// Which light the matrices of a file are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KlemsBand {
    /// Light: the channels if the file has them, otherwise grey.
    Visible,
    /// All of the sun's radiation, grey.
    Solar,
}

/// Those matrices that a file has, light from the front first.
#[derive(Clone, Debug, PartialEq)]
pub struct KlemsParts {
    /// The basis of the patches.
    pub basis: KlemsBasis,
    /// Transmission of light from the front and from the back.
    pub transmission: [Option<KlemsMatrix>; 2],
    /// Reflection of light from the front and from the back.
    pub reflection: [Option<KlemsMatrix>; 2],
}

/// Reads a file. If transmission from the back is missing, it follows from that of the front by
/// reciprocity; reflection must be given for both sides.
///
/// # Errors
/// See [`KlemsFileError`].
pub fn read_klems(text: &str) -> Result<KlemsBsdf, KlemsFileError> {
    let parts = read_klems_parts(text, KlemsBand::Visible)?;
    let n = parts.basis.len();
    let turned = |m: &KlemsMatrix| KlemsMatrix {
        values: (0..n * n)
            .map(|k| {
                let value = m.values.get((k % n) * n + k / n);
                value.copied().unwrap_or_default()
            })
            .collect(),
        se: m.se.clone(),
    };
    let [front, back] = parts.transmission;
    let front = front.or_else(|| back.as_ref().map(turned));
    let front = front.ok_or(KlemsFileError::Missing("Transmission Front"))?;
    let back = back.unwrap_or_else(|| turned(&front));
    let [reflected, reflected_back] = parts.reflection;
    Ok(KlemsBsdf {
        basis: parts.basis,
        transmission: [front, back],
        reflection: [
            reflected.ok_or(KlemsFileError::Missing("Reflection Front"))?,
            reflected_back.ok_or(KlemsFileError::Missing("Reflection Back"))?,
        ],
    })
}

/// Reads what a file has of a band; nothing of a band that it does not have.
///
/// # Errors
/// See [`KlemsFileError`]; a file without any matrix of light.
pub fn read_klems_parts(text: &str, band: KlemsBand) -> Result<KlemsParts, KlemsFileError> {
    let file: WindowElement =
        quick_xml::de::from_str(text).map_err(|e| KlemsFileError::Syntax(e.to_string()))?;
    let layer = file.optical.layer;
    if layer.definition.structure.trim() != "Columns" {
        return Err(KlemsFileError::Structure(layer.definition.structure));
    }
    let names: &[&str] = match band {
        KlemsBand::Visible => &BANDS,
        KlemsBand::Solar => &SOLAR[..1],
    };
    let mut basis = None;
    let mut found: [[Option<Vec<f64>>; 4]; 3] = Default::default();
    for data in &layer.data {
        let name = data.wavelength.name.trim();
        let Some(channel) = names.iter().position(|b| b.eq_ignore_ascii_case(name)) else {
            continue;
        };
        for block in &data.blocks {
            let wanted = |d: &str| d.eq_ignore_ascii_case(block.direction.trim());
            let Some(which) = DIRECTIONS.iter().position(|d| wanted(d)) else {
                continue;
            };
            for name in [block.columns.trim(), block.rows.trim()] {
                let known = KlemsBasis::ALL.into_iter().find(|b| b.name() == name);
                let known = known.ok_or_else(|| {
                    let near = nearest_name(name, KlemsBasis::ALL.map(KlemsBasis::name));
                    let hint = near.map_or(String::new(), |n| format!("; `{n}` is near"));
                    KlemsFileError::Basis(name.into(), hint)
                })?;
                if *basis.get_or_insert(known) != known {
                    return Err(KlemsFileError::Basis(
                        name.into(),
                        ", one throughout the file".into(),
                    ));
                }
            }
            let expected = basis.map_or(0, |b: KlemsBasis| b.len() * b.len());
            let label = format!("{name}, {}", block.direction.trim());
            if let Some(slot) = found.get_mut(channel).and_then(|f| f.get_mut(which)) {
                *slot = Some(parse_numbers(&block.values, label, expected)?);
            }
        }
    }
    let basis = basis.ok_or(KlemsFileError::Missing("Reflection Front"))?;
    let combine = |which: usize| -> Option<KlemsMatrix> {
        let channel = |c: usize| found.get(c)?.get(which)?.as_ref();
        let colours = channel(0).zip(channel(2));
        let values: Vec<[f64; 3]> = match (colours, band) {
            (Some((x, z)), KlemsBand::Visible) => {
                let rgb_from_xyz = XYZ_FROM_RGB.inverse();
                let rgb = |((&x, &y), &z)| rgb_from_xyz * DVec3::new(x, y, z);
                let all = x.iter().zip(channel(VISIBLE)?).zip(z).map(rgb);
                // Rounding and colours outside sRGB would give negative values.
                all.map(|v| v.max(DVec3::ZERO).to_array()).collect()
            }
            (_, KlemsBand::Visible) => channel(VISIBLE)?.iter().map(|&y| [y; 3]).collect(),
            (_, KlemsBand::Solar) => channel(0)?.iter().map(|&y| [y; 3]).collect(),
        };
        let se = vec![[0.0; 3]; values.len()];
        Some(KlemsMatrix { values, se })
    };
    Ok(KlemsParts {
        basis,
        transmission: [combine(0), combine(1)],
        reflection: [combine(2), combine(3)],
    })
}

fn parse_numbers(text: &str, name: String, expected: usize) -> Result<Vec<f64>, KlemsFileError> {
    let mut list = Vec::with_capacity(expected);
    let separators = |c: char| c == ',' || c.is_whitespace();
    for field in text.split(separators).filter(|f| !f.is_empty()) {
        match field.parse::<f64>() {
            Ok(v) if v.is_finite() && v >= 0.0 => list.push(v),
            _ => {
                return Err(KlemsFileError::Number {
                    name,
                    index: list.len() + 1,
                    found: field.into(),
                });
            }
        }
    }
    if list.len() != expected {
        return Err(KlemsFileError::Count {
            name,
            found: list.len(),
            expected,
        });
    }
    Ok(list)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bsdf() -> KlemsBsdf {
        let n = KlemsBasis::Quarter.len();
        let matrix = |seed: usize| KlemsMatrix {
            values: (0..n * n)
                .map(|k| [3 * k, 2 * k, k].map(|x| (x + seed) as f64 * 1e-3))
                .collect(),
            se: vec![[0.0; 3]; n * n],
        };
        KlemsBsdf {
            basis: KlemsBasis::Quarter,
            transmission: [matrix(1), matrix(2)],
            reflection: [matrix(3), matrix(4)],
        }
    }

    #[test]
    fn files_are_read_as_they_were_written() {
        let text = write_klems(&bsdf(), None, "a <b> & c").unwrap();
        assert!(text.contains("a &lt;b&gt; &amp; c"));
        let (read, written) = (read_klems(&text).unwrap(), bsdf());
        let all = |b: &KlemsBsdf| -> Vec<f64> {
            let matrices = b.transmission.iter().chain(&b.reflection);
            let values = matrices.flat_map(|m| m.values.as_flattened());
            values.copied().collect()
        };
        for (a, b) in all(&read).into_iter().zip(all(&written)) {
            assert!((a - b).abs() <= 1e-5 * (b + 1e-3), "{a} {b}");
        }
        assert_eq!(all(&read).len(), 4 * 3 * 41 * 41);
        // Without channels, the result is grey. Without the transmission of the back,
        // reciprocity gives it.
        let grey = text
            .replace("CIE-", "unknown-")
            .replace("Transmission Back", "Other");
        let read = read_klems(&grey).unwrap();
        let n = read.basis.len();
        let front = &read.transmission[0].values;
        assert!(front.iter().all(|v| v[0] == v[1] && v[1] == v[2]));
        assert_eq!(read.transmission[1].values[3 * n + 5], front[5 * n + 3]);
    }

    /// A file with both bands has no colours, and the material's figures; light is read from it.
    #[test]
    fn both_bands_stand_in_one_file() {
        let mut sun = bsdf();
        for matrix in sun.transmission.iter_mut().chain(&mut sun.reflection) {
            matrix.values.iter_mut().for_each(|v| *v = [0.25; 3]);
        }
        let solar = SolarKlems {
            bsdf: &sun,
            thickness_mm: 0.5,
            openness: 0.1,
        };
        let text = write_klems(&bsdf(), Some(solar), "x").unwrap();
        let bands = text.split("<Wavelength unit=\"Integral\">").skip(1);
        let bands: Vec<_> = bands.collect();
        assert_eq!(bands.len(), 2 * 4, "no colours");
        for (place, band) in bands.iter().enumerate() {
            let is_solar = place >= 4;
            assert!(band.starts_with(if is_solar { "Solar<" } else { "Visible<" }));
            assert_eq!(band.contains("2.500000e-1, 2.500000e-1"), is_solar);
        }
        assert!(text.contains("<EmissivityBack>0.81</EmissivityBack>"));
        assert!(text.contains("<PermeabilityFactor>0.1</PermeabilityFactor>"));
        let read = read_klems(&text).unwrap();
        let [x, y, z] = read.reflection[0].values[5];
        assert!(x == y && y == z && x != 0.25);
    }

    /// The file gives the middle of every ring and its borders, which lie between middles.
    #[test]
    fn rings_have_their_middles() {
        let text = write_klems(&bsdf(), None, "x").unwrap();
        let middles = text.split("<Theta>").skip(1);
        let middles = middles.map(|rest| rest.split('<').next().unwrap().parse().unwrap());
        let middles: Vec<f64> = middles.collect();
        let rings = KlemsBasis::Quarter.rings();
        let highs = rings.iter().skip(1).map(|r| r.0).chain([90.0]);
        let expected = rings.iter().zip(highs).map(|(r, high)| 0.5 * (r.0 + high));
        assert_eq!(middles[0], 0.0);
        assert_eq!(middles[1..], expected.skip(1).collect::<Vec<_>>());
    }

    #[test]
    fn mistakes_are_reported() {
        let text = write_klems(&bsdf(), None, "x").unwrap();
        let say = |text: &str| read_klems(text).unwrap_err().to_string();
        assert!(say("<a/>").contains("Optical"));
        let words = say(&text.replacen("Klems Quarter</Col", "Klems Quarte</Col", 1));
        assert!(words.contains("`LBNL/Klems Quarter` is near"), "{words}");
        let words = say(&text.replacen("e-3,", "none,", 1));
        assert!(words.contains("none`"), "{words}");
        let words = say(&text.replacen(",\n", "\n", 1).replacen("e-3, ", "e-3", 1));
        assert!(words.contains("CIE-X, Transmission Front: "), "{words}");
        assert!(say(&text.replace("Columns<", "Rows<")).contains("expected `Columns`"));
    }
}
