//! What a scan is made with.

use crate::ScanError;
use glam::DVec3;

/// How grey values are freed of noise before anything else.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Denoise {
    /// Not at all.
    None,
    /// A Gaussian of this deviation, in voxels.
    Gaussian(f32),
    /// The median of 3 x 3 x 3 voxels.
    Median,
}

/// Deviation of the Gaussian that is the default: it halves white noise and widens an edge by
/// less than a voxel.
pub const DEFAULT_DENOISE: Denoise = Denoise::Gaussian(0.7);

/// Deviation of the Gaussian whose derivatives are the gradients, in fibre radii.
pub const GRADIENT_RADII: f32 = 0.35;

/// Deviation of the Gaussian that averages products of gradients, in fibre radii: a fibre's
/// whole outline takes part, and its neighbours hardly do.
pub const TENSOR_RADII: f32 = 0.9;

/// Fibres are at most so many voxels thick in radius; more is a mistaken unit.
const MAX_RADIUS_VOXELS: f64 = 100.0;

/// What a scan is made with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScanSettings {
    /// Edges of a voxel, mm.
    pub voxel_mm: DVec3,
    /// Noise filter.
    pub denoise: Denoise,
    /// Grey value between air and fibre; Otsu's if none.
    pub threshold: Option<f32>,
    /// Grey value of air; the most frequent below the threshold if none.
    pub air: Option<f32>,
    /// Grey value of a voxel full of fibre; the most frequent above the threshold if none.
    pub fibre: Option<f32>,
    /// Fibre radius, mm; measured if none.
    pub fibre_radius_mm: Option<f32>,
    /// See [`GRADIENT_RADII`].
    pub gradient_radii: f32,
    /// See [`TENSOR_RADII`].
    pub tensor_radii: f32,
}

impl ScanSettings {
    /// The defaults for voxels of these edges, mm.
    pub fn new(voxel_mm: DVec3) -> ScanSettings {
        ScanSettings {
            voxel_mm,
            denoise: DEFAULT_DENOISE,
            threshold: None,
            air: None,
            fibre: None,
            fibre_radius_mm: None,
            gradient_radii: GRADIENT_RADII,
            tensor_radii: TENSOR_RADII,
        }
    }

    /// Refuses settings that no scan can be made with.
    ///
    /// # Errors
    /// Names the setting.
    pub fn check(&self) -> Result<(), ScanError> {
        let fail = |why: String| Err(ScanError::Settings(why));
        let v = self.voxel_mm;
        if !(v.is_finite() && v.min_element() > 0.0 && v.max_element() <= 1e3) {
            return fail(format!(
                "voxels of {v} mm; expected edges above 0 up to 1000"
            ));
        }
        if v.max_element() > 8.0 * v.min_element() {
            return fail(format!(
                "voxels of {v} mm: edges that differ by more than a factor of 8 show no \
                 orientation"
            ));
        }
        if let Denoise::Gaussian(s) = self.denoise
            && !(0.0..=10.0).contains(&s)
        {
            return fail(format!("a noise filter of {s} voxels; expected 0 to 10"));
        }
        for (name, value) in [
            ("threshold", self.threshold),
            ("grey value of air", self.air),
            ("grey value of fibre", self.fibre),
        ] {
            if let Some(x) = value.filter(|x| !x.is_finite()) {
                return fail(format!("a {name} of {x}; expected a number"));
            }
        }
        let most_mm = MAX_RADIUS_VOXELS * v.max_element();
        if let Some(r) = self.fibre_radius_mm.map(f64::from)
            && !(r > 0.0 && r <= most_mm)
        {
            return fail(format!(
                "a fibre radius of {r} mm; expected above 0 up to {most_mm} mm, \
                 {MAX_RADIUS_VOXELS} voxels"
            ));
        }
        for (name, value) in [
            ("gradient", self.gradient_radii),
            ("tensor", self.tensor_radii),
        ] {
            if !(0.05..=10.0).contains(&value) {
                return fail(format!(
                    "a {name} scale of {value} fibre radii; expected 0.05 to 10"
                ));
            }
        }
        Ok(())
    }
}
