//! The `[surface]` section of a fabric file.

use crate::error::Error;
use crate::parameters::{WovenParameters, YarnParameters};
use crate::segment::{Fit, SegmentParameters};
use crate::shadowing::Shadowing;
use crate::transmission::Transmission;
use crate::weave::Weave;
use crate::woven_surface::WovenSurface;
use organza_basis::{Rgb, nearest_name};
use serde::{Deserialize, Serialize};

/// Names of the fabrics of the thesis, which come with the model.
///
/// The weft of cotton twill as published does not satisfy the model (`2 sin 36 degrees > 1`;
/// without this check it would be black). Its 36 degrees are kept, and [`Fit::Narrow`] reduces
/// the radius of the tube to 0.85.
pub const PRESETS: [(&str, &str); 6] = [
    ("denim", include_str!("../presets/denim.toml")),
    ("cotton-twill", include_str!("../presets/cotton-twill.toml")),
    (
        "wool-gabardine",
        include_str!("../presets/wool-gabardine.toml"),
    ),
    (
        "polyester-lining",
        include_str!("../presets/polyester-lining.toml"),
    ),
    (
        "silk-charmeuse",
        include_str!("../presets/silk-charmeuse.toml"),
    ),
    (
        "silk-shantung",
        include_str!("../presets/silk-shantung.toml"),
    ),
];

/// A surface as files describe it. A key may be omitted when a preset supplies it; a given key
/// replaces that of the preset.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceSpec {
    /// Fabric to start from, one of [`PRESETS`].
    pub preset: Option<String>,
    /// Relative error aimed at in the mean over staple yarn; 0.001 unless given.
    pub accuracy: Option<f64>,
    /// Seed of the noise; 0 by default.
    pub seed: Option<u64>,
    /// Draft and dimensions.
    pub weave: Option<Weave>,
    /// The warp.
    pub warp: SurfaceYarnSpec,
    /// The weft.
    pub weft: SurfaceYarnSpec,
    /// Irregularity; none by default.
    pub noise: Option<NoiseSpec>,
    /// Shadowing between warp and weft; none by default.
    pub shadowing: Option<ShadowingSpec>,
    /// Gaps and transmitted light; opaque by default.
    pub transmission: Option<TransmissionSpec>,
}

/// One system of yarn.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SurfaceYarnSpec {
    /// Twist of the fibres against the yarn, degrees; 0 is filament yarn.
    pub psi_deg: Option<f64>,
    /// Steepest inclination of the yarn, degrees.
    pub u_max_deg: Option<f64>,
    /// Spine curvature, over -1.
    pub kappa: Option<f64>,
    /// Uniform scattering.
    pub alpha: Option<f64>,
    /// Forward scattering; backward when negative.
    pub beta: Option<f64>,
    /// Filament smoothing, 0 to 1.
    pub smoothing: Option<f64>,
    /// Width of the highlight as a share of the segment, over 0 to 1.
    pub highlight_width: Option<f64>,
    /// The treatment of a segment that is too short for its width.
    pub fit: Option<Fit>,
    /// Diffuse albedo, linear RGB.
    pub diffuse: Option<Rgb>,
    /// Diffuse albedo of the yarn's round surface, linear RGB; black unless
    /// given.
    pub round: Option<Rgb>,
    /// Specular albedo, linear RGB.
    pub specular: Option<Rgb>,
    /// Noise of u_max along this yarn, degrees.
    pub u_max_noise_own_deg: Option<f64>,
    /// Noise of u_max along the crossing yarns, degrees.
    pub u_max_noise_cross_deg: Option<f64>,
}

/// Irregularity of the yarn.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseSpec {
    /// Side of the rectangles of equal brightness, mm; 0 for none.
    #[serde(default)]
    pub grain_mm: f64,
    /// Distance over which tension changes along a yarn, mm.
    #[serde(default = "one")]
    pub period_mm: f64,
}

fn one() -> f64 {
    1.0
}

/// Shadowing and masking between warp and weft.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShadowingSpec {
    /// Height of the warp's crowns over the weft's, mm; may be negative.
    pub warp_above_weft_mm: f64,
}

/// Gaps and transmitted light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TransmissionSpec {
    /// Diameter over spacing of the warp yarns, 0 to 1.
    #[serde(default = "one")]
    pub warp_cover: f64,
    /// Diameter over spacing of the weft yarns, 0 to 1.
    #[serde(default = "one")]
    pub weft_cover: f64,
    /// Share of the light that the yarns transmit in all directions, linear RGB.
    #[serde(default)]
    pub diffuse: Rgb,
    /// Share of the light that they transmit in a lobe about the straight direction, linear
    /// RGB.
    #[serde(default)]
    pub forward: Rgb,
    /// Concentration of that lobe, 0 to 1000.
    #[serde(default = "one")]
    pub concentration: f64,
}

impl SurfaceYarnSpec {
    fn over(self, base: SurfaceYarnSpec) -> SurfaceYarnSpec {
        SurfaceYarnSpec {
            psi_deg: self.psi_deg.or(base.psi_deg),
            u_max_deg: self.u_max_deg.or(base.u_max_deg),
            kappa: self.kappa.or(base.kappa),
            alpha: self.alpha.or(base.alpha),
            beta: self.beta.or(base.beta),
            smoothing: self.smoothing.or(base.smoothing),
            highlight_width: self.highlight_width.or(base.highlight_width),
            fit: self.fit.or(base.fit),
            diffuse: self.diffuse.or(base.diffuse),
            round: self.round.or(base.round),
            specular: self.specular.or(base.specular),
            u_max_noise_own_deg: self.u_max_noise_own_deg.or(base.u_max_noise_own_deg),
            u_max_noise_cross_deg: self.u_max_noise_cross_deg.or(base.u_max_noise_cross_deg),
        }
    }

    fn parameters(&self, yarn: &str) -> Result<YarnParameters, Error> {
        let missing = |key: &str| Error::Missing {
            key: format!("{yarn}.{key}"),
        };
        let need = |key: &str, value: Option<f64>| value.ok_or_else(|| missing(key));
        let noise = |key: &str, value: Option<f64>| {
            let degrees = value.unwrap_or(0.0);
            Error::check(&format!("{yarn}.{key}"), degrees, 0.0, 45.0)?;
            Ok(degrees.to_radians() as f32)
        };
        Ok(YarnParameters {
            segment: SegmentParameters {
                twist_rad: need("psi_deg", self.psi_deg)?.to_radians(),
                u_max_rad: need("u_max_deg", self.u_max_deg)?.to_radians(),
                kappa: self.kappa.unwrap_or(0.0),
                width_mm: 1.0,
                length_mm: 1.0,
                alpha: need("alpha", self.alpha)?,
                beta: need("beta", self.beta)?,
                smoothing: self.smoothing.unwrap_or(0.0),
                highlight_width: self.highlight_width.unwrap_or(0.5),
                fit: self.fit.unwrap_or_default(),
            },
            diffuse: self.diffuse.ok_or_else(|| missing("diffuse"))?,
            round: self.round.unwrap_or(Rgb::BLACK),
            specular: self.specular.ok_or_else(|| missing("specular"))?,
            u_noise_own_rad: noise("u_max_noise_own_deg", self.u_max_noise_own_deg)?,
            u_noise_cross_rad: noise("u_max_noise_cross_deg", self.u_max_noise_cross_deg)?,
        })
    }
}

impl TransmissionSpec {
    fn build(&self) -> Result<Transmission, Error> {
        for (key, value) in [
            ("warp_cover", self.warp_cover),
            ("weft_cover", self.weft_cover),
        ] {
            Error::check(&format!("transmission.{key}"), value, 0.0, 1.0)?;
        }
        for (key, colour) in [("diffuse", self.diffuse), ("forward", self.forward)] {
            for channel in colour.0.to_array() {
                Error::check(&format!("transmission.{key}"), channel.into(), 0.0, 1.0)?;
            }
        }
        Error::check(
            "transmission.concentration",
            self.concentration,
            0.0,
            1000.0,
        )?;
        Ok(Transmission::new(
            self.warp_cover as f32,
            self.weft_cover as f32,
            self.diffuse,
            self.forward,
            self.concentration as f32,
        ))
    }
}

impl SurfaceSpec {
    /// Reads the TOML of one surface: the contents of a `[surface]` section.
    ///
    /// # Errors With the line, the column and the key at fault.
    pub fn from_toml(text: &str) -> Result<SurfaceSpec, Error> {
        toml::from_str(text).map_err(|e| Error::Syntax(e.to_string()))
    }

    /// A fabric of the thesis by name.
    ///
    /// # Errors When there is none, with the nearest valid name.
    pub fn preset(name: &str) -> Result<SurfaceSpec, Error> {
        let names = PRESETS.map(|(n, _)| n);
        match PRESETS.iter().find(|(n, _)| *n == name) {
            Some((_, text)) => SurfaceSpec::from_toml(text),
            None => Err(Error::Name {
                key: "preset",
                name: name.into(),
                expected: names.join(", "),
                nearest: nearest_name(name, &names).map(String::from),
            }),
        }
    }

    /// The same with the values of the preset for omitted keys.
    ///
    /// # Errors
    /// When the preset has no such name.
    pub fn resolved(self) -> Result<SurfaceSpec, Error> {
        let base = match &self.preset {
            Some(name) => SurfaceSpec::preset(name)?,
            None => SurfaceSpec::default(),
        };
        Ok(SurfaceSpec {
            preset: self.preset,
            accuracy: self.accuracy.or(base.accuracy),
            seed: self.seed.or(base.seed),
            weave: self.weave.or(base.weave),
            warp: self.warp.over(base.warp),
            weft: self.weft.over(base.weft),
            noise: self.noise.or(base.noise),
            shadowing: self.shadowing.or(base.shadowing),
            transmission: self.transmission.or(base.transmission),
        })
    }

    /// The parameters that it describes. A fabric whose draft is given elsewhere sets
    /// [`weave`](Self::weave) first.
    ///
    /// # Errors
    /// Names the first key that is missing or out of range.
    pub fn parameters(self) -> Result<WovenParameters, Error> {
        let spec = self.resolved()?;
        let noise = spec.noise.unwrap_or(NoiseSpec {
            grain_mm: 0.0,
            period_mm: 1.0,
        });
        if let Some(s) = &spec.shadowing {
            let height = s.warp_above_weft_mm;
            Error::check("shadowing.warp_above_weft_mm", height, -1e3, 1e3)?;
        }
        Ok(WovenParameters {
            weave: spec.weave.ok_or_else(|| Error::Missing {
                key: "weave".into(),
            })?,
            warp: spec.warp.parameters("warp")?,
            weft: spec.weft.parameters("weft")?,
            seed: spec.seed.unwrap_or(0),
            grain_mm: noise.grain_mm as f32,
            noise_period_mm: noise.period_mm as f32,
            shadowing: spec.shadowing.map(|s| Shadowing {
                warp_above_weft_mm: s.warp_above_weft_mm as f32,
            }),
            transmission: spec.transmission.map(|t| t.build()).transpose()?,
            accuracy: spec.accuracy.unwrap_or(1e-3),
        })
    }

    /// The model that it describes.
    ///
    /// # Errors
    /// As [`parameters`](Self::parameters) and [`WovenSurface::new`].
    pub fn build(self) -> Result<WovenSurface, Error> {
        WovenSurface::new(&self.parameters()?)
    }
}
