//! The parameters of a woven surface.

use crate::error::Error;
use crate::segment::SegmentParameters;
use crate::shadowing::Shadowing;
use crate::transmission::Transmission;
use crate::weave::Weave;
use organza_basis::Rgb;

/// One system of yarn.
#[derive(Clone, Debug, PartialEq)]
pub struct YarnParameters {
    /// Shape and scattering; the weave gives width and length.
    pub segment: SegmentParameters,
    /// Diffuse albedo of the flat sheet of the thesis.
    pub diffuse: Rgb,
    /// Diffuse albedo of the surface of round yarns.
    pub round: Rgb,
    /// Specular albedo: the bihemispherical albedo that the highlights of the
    /// front would have if both yarns had this colour. Warp and weft keep the
    /// proportion of their scattering functions.
    pub specular: Rgb,
    /// Amplitude of the noise of u_max along this yarn, radians.
    pub u_noise_own_rad: f32,
    /// Amplitude of the noise of u_max along the yarns that cross it, radians.
    pub u_noise_cross_rad: f32,
}

/// All parameters of a cloth.
#[derive(Clone, Debug)]
pub struct WovenParameters {
    /// Draft and dimensions.
    pub weave: Weave,
    /// The warp.
    pub warp: YarnParameters,
    /// The weft.
    pub weft: YarnParameters,
    /// Seed of the noise.
    pub seed: u64,
    /// Side of the rectangles of equal brightness within a segment, mm; zero
    /// for even yarn.
    pub grain_mm: f32,
    /// Distance over which yarn tension changes, mm; positive.
    pub noise_period_mm: f32,
    /// Height difference of warp and weft; no shadowing if none.
    pub shadowing: Option<Shadowing>,
    /// Gaps and transmitted light; opaque if none.
    pub transmission: Option<Transmission>,
    /// Relative error aimed at in the integral over staple yarn.
    pub accuracy: f64,
}

impl WovenParameters {
    /// Checks the ranges of noise, accuracy and albedos. Shapes of segments are checked where they
    /// are made.
    ///
    /// # Errors
    /// Names the first key that is out of range.
    pub(crate) fn check(&self) -> Result<(), Error> {
        Error::check("noise.grain_mm", self.grain_mm.into(), 0.0, 1e6)?;
        Error::check("noise.period_mm", self.noise_period_mm.into(), 1e-6, 1e6)?;
        Error::check("accuracy", self.accuracy, 1e-10, 0.1)?;
        for (name, y) in [("warp", &self.warp), ("weft", &self.weft)] {
            for (key, c) in [
                ("diffuse", y.diffuse),
                ("round", y.round),
                ("specular", y.specular),
            ] {
                for channel in c.0.to_array() {
                    Error::check(&format!("{name}.{key}"), channel.into(), 0.0, 1.0)?;
                }
            }
        }
        Ok(())
    }
}
