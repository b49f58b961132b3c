//! Scattering of one visible segment of yarn: a curved cylinder of fibres
//! \[Irawan2008] (chapters 6-8).
//!
//! Directions are in the segment's frame (x across, y along, z out). The surface of the yarn is
//! parametrised by u, the inclination of the spine, and v, the angle around it. Light leaves a
//! fibre on the cone of its inclination. For two directions this makes v a function of u
//! (staple yarn, whose fibres are twisted) or fixes u (filament yarn, whose fibres run along
//! the spine).

use crate::band::Band;
use crate::error::Error;
use crate::filament::Ring;
use crate::phase::CircularPhase;
use crate::quadrature::Rule;
use crate::real::{Direction, Real};
use crate::spine::Spine;

/// The treatment of a segment that is too short for its width and inclination.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fit {
    /// Return an error.
    #[default]
    Refuse,
    /// Keep the inclination and take the thickest tube that fits, a bead
    /// whose spine has no length: the thesis' own rule (the largest torus
    /// segment whose projection fits the rectangle) with the radius freed.
    Narrow,
}

/// Largest parameters whose values single precision holds at every inclination.
const MAX_KAPPA: f64 = 1e3;
const MAX_ALPHA: f64 = 1e6;
const MAX_BETA: f64 = 1e6;

/// Shape and scattering of one segment of yarn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SegmentParameters {
    /// Twist psi of the fibres, radians in (-pi/2, pi/2); zero for filament yarn.
    pub twist_rad: f64,
    /// Inclination u_max of the spine at its ends, radians in (0, pi/2).
    pub u_max_rad: f64,
    /// Spine curvature kappa, over -1: below zero the crown is the sharpest
    /// part, above zero the ends are.
    pub kappa: f64,
    /// Width w of the visible rectangle, mm.
    pub width_mm: f64,
    /// Length l of the visible rectangle, mm.
    pub length_mm: f64,
    /// Uniform scattering alpha, not negative.
    pub alpha: f64,
    /// Forward scattering beta; backward when negative.
    pub beta: f64,
    /// Filament smoothing delta in `[0, 1]`: the share of u_max over which the highlight fades
    /// out. Staple yarn ignores it.
    pub smoothing: f64,
    /// Width of the drawn highlight as a share of the rectangle, in (0, 1]:
    /// across the yarn for staple, along it for filament.
    pub highlight_width: f64,
    /// The treatment of a segment that is too short.
    pub fit: Fit,
}

/// A pair of directions with the values that every integrand needs.
#[derive(Clone, Copy, Debug)]
pub struct Pair<T> {
    pub(crate) w_in: Direction<T>,
    pub(crate) w_out: Direction<T>,
    pub(crate) s: Direction<T>,
    pub(crate) s2: T,
}

impl<T: Real> Pair<T> {
    /// Two unit directions.
    pub fn new(w_in: Direction<T>, w_out: Direction<T>) -> Self {
        let s = Direction::new(w_in.x + w_out.x, w_in.y + w_out.y, w_in.z + w_out.z);
        Pair {
            w_in,
            w_out,
            s,
            s2: s.dot(s),
        }
    }

    /// The two directions.
    pub fn directions(&self) -> (Direction<T>, Direction<T>) {
        (self.w_in, self.w_out)
    }
}

/// The model of one segment, ready to evaluate.
#[derive(Clone, Copy, Debug)]
pub struct YarnSegment<T> {
    pub(crate) sin_psi: T,
    pub(crate) cos_psi: T,
    pub(crate) cot_psi: T,
    pub(crate) tan_half_u_max: T,
    pub(crate) radius_mm: T,
    pub(crate) width_mm: T,
    pub(crate) length_mm: T,
    /// The fading of the filament's highlight: a linear function of |u|.
    pub(crate) fade_slope: T,
    pub(crate) fade_start: T,
    pub(crate) u_band: Band<T>,
    pub(crate) v_band: Band<T>,
    /// The part of the geometry factor of staple yarn that all places share, mm.
    pub(crate) staple_factor: T,
    /// The part of the texture's value that all places share.
    pub(crate) texture_factor: T,
    pub(crate) spine: Spine<T>,
    pub(crate) phase: CircularPhase<T>,
}

impl<T: Real> YarnSegment<T> {
    /// Checks the parameters and derives tube and spine.
    ///
    /// # Errors Names the parameter that is out of range, or reports that the yarn does not fit
    /// its rectangle.
    pub fn new(p: &SegmentParameters) -> Result<Self, Error> {
        let right = std::f64::consts::FRAC_PI_2;
        let open = |key, rad: f64, low: f64| {
            if rad > low && rad < right {
                return Ok(());
            }
            Err(Error::Range {
                key: String::from(key),
                value: rad.to_degrees(),
                expected: format!("an angle between {} and 90 degrees", low.to_degrees()),
            })
        };
        open("psi_deg", p.twist_rad, -right)?;
        open("u_max_deg", p.u_max_rad, 0.0)?;
        Error::check("kappa", p.kappa, -1.0, MAX_KAPPA)?;
        Error::check("alpha", p.alpha, 0.0, MAX_ALPHA)?;
        Error::check("beta", p.beta, -MAX_BETA, MAX_BETA)?;
        Error::check("smoothing", p.smoothing, 0.0, 1.0)?;
        Error::check("highlight_width", p.highlight_width, 1e-6, 1.0)?;
        for (key, value) in [("width_mm", p.width_mm), ("length_mm", p.length_mm)] {
            Error::check(key, value, 1e-9, 1e9)?;
        }
        let sin = p.u_max_rad.sin();
        let mut radius_mm = 0.5 * p.width_mm;
        let mut half_spine_mm = 0.5 * p.length_mm - radius_mm * sin;
        if half_spine_mm <= 0.0 {
            if p.fit == Fit::Refuse {
                return Err(Error::DoesNotFit {
                    key: "u_max_deg".into(),
                    width_mm: p.width_mm,
                    length_mm: p.length_mm,
                    u_max_deg: p.u_max_rad.to_degrees(),
                    largest_deg: (p.length_mm / p.width_mm).asin().to_degrees(),
                });
            }
            radius_mm = 0.5 * p.length_mm / sin;
            half_spine_mm = 0.0;
        }
        let sin_psi = p.twist_rad.sin();
        let staple_factor = radius_mm / sin_psi.abs();
        let along = Band::new(p.length_mm, p.highlight_width, p.u_max_rad);
        let around = Band::new(p.width_mm, p.highlight_width, right);
        // Per area of the rectangle; the band is as wide as the highlight.
        let area = p.highlight_width * p.width_mm * p.length_mm;
        let texture_factor = if sin_psi == 0.0 {
            radius_mm * std::f64::consts::PI / area
        } else {
            staple_factor * 2.0 * p.u_max_rad / area
        };
        let (fade_slope, fade_start) = if p.smoothing > 0.0 {
            (1.0 / (p.u_max_rad * p.smoothing), 1.0 - 1.0 / p.smoothing)
        } else {
            (0.0, 0.0)
        };
        Ok(YarnSegment {
            sin_psi: T::of(sin_psi),
            cos_psi: T::of(p.twist_rad.cos()),
            // Not used where it would be infinite.
            cot_psi: T::of(p.twist_rad.tan().recip()),
            tan_half_u_max: T::of((0.5 * p.u_max_rad).tan()),
            radius_mm: T::of(radius_mm),
            width_mm: T::of(p.width_mm),
            length_mm: T::of(p.length_mm),
            fade_slope: T::of(fade_slope),
            fade_start: T::of(fade_start),
            u_band: along,
            v_band: around,
            staple_factor: T::of(staple_factor),
            texture_factor: T::of(texture_factor),
            spine: Spine::new(half_spine_mm, p.u_max_rad, p.kappa)?,
            phase: CircularPhase::new(p.alpha, p.beta),
        })
    }

    /// True for untwisted yarn.
    pub fn is_filament(&self) -> bool {
        self.sin_psi == T::zero()
    }

    /// Area of the visible rectangle, mm^2.
    pub fn area_mm2(&self) -> T {
        self.width_mm * self.length_mm
    }

    /// Radius of the tube, mm: half the width unless it was narrowed to fit.
    pub fn tube_radius_mm(&self) -> T {
        self.radius_mm
    }

    /// The scattering function f_s of the whole segment, mm^2 (equation 8.1), without `k_s` and
    /// the albedo.
    ///
    /// Zero unless both directions are above the cloth. `rule` holds the nodes
    /// that staple yarn is integrated with; filament yarn has a closed form.
    pub fn reflectance(&self, pair: &Pair<T>, rule: &Rule<T>) -> T {
        if !(pair.w_in.z > T::zero() && pair.w_out.z > T::zero()) {
            return T::zero();
        }
        let lobe = if self.is_filament() {
            let ring = Ring::new(pair);
            self.filament_reflectance(&ring, ring.attenuation_integrals(pair))
        } else {
            self.staple_reflectance(pair, rule)
        };
        lobe * self.phase.eval(pair.w_in.dot(pair.w_out))
    }

    /// The scattering function spread over the rectangle, dimensionless: its mean over the
    /// rectangle is [`reflectance`](Self::reflectance) over the area, which is equation 8.4
    /// with the symbols of 8.5 corrected.
    ///
    /// `x` and `y` are mm from the middle of the rectangle, across and along.
    #[inline]
    pub fn texture(&self, pair: &Pair<T>, x: T, y: T) -> T {
        if !(pair.w_in.z > T::zero() && pair.w_out.z > T::zero()) {
            return T::zero();
        }
        let drawn = if self.is_filament() {
            self.filament_texture(pair, x, y)
        } else {
            self.staple_texture(pair, x, y)
        };
        if drawn > T::zero() {
            drawn * self.phase.eval(pair.w_in.dot(pair.w_out))
        } else {
            T::zero()
        }
    }
}
