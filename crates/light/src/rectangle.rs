//! `kind = "rectangle"`: a rectangle that emits light. A panel, a window, or, long and
//! narrow, a tube.

use crate::catalogue::{LightError, LightKind, LoadPicture, brightness};
use crate::light::{KernelLight, Light, LightSample, LightSearch, LightSource};
use crate::mitsuba::{self, MitsubaLight};
use crate::spherical_rectangle::{Face, SphericalRectangle};
use glam::{DVec3, Vec3};
use organza_basis::{PathRng, Ray, Rgb};
use serde::Deserialize;

/// A rectangle in space with the same radiance everywhere and in all
/// directions. It is a source and no matter: light passes through it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RectangleLight {
    corner_mm: Vec3,
    u_mm: Vec3,
    v_mm: Vec3,
    /// Unit, the side that shines.
    normal: Vec3,
    area_mm2: f32,
    radiance: Rgb,
    two_sided: bool,
    search: LightSearch,
    face: Face,
}

/// Edges that span no rectangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum RectangleError {
    /// Without area, or not finite.
    #[error("the edges span no area")]
    NoArea,
    /// A parallelogram.
    #[error("the edges are not perpendicular")]
    Skew,
}

impl RectangleLight {
    /// A light from one corner and the two edges that start there. It shines
    /// to the side of `u_mm x v_mm`, or to both.
    ///
    /// # Errors
    /// Edges without area or not perpendicular (to a thousandth).
    pub fn new(
        corner_mm: Vec3,
        u_mm: Vec3,
        v_mm: Vec3,
        radiance: Rgb,
        two_sided: bool,
    ) -> Result<RectangleLight, RectangleError> {
        let cross = u_mm.cross(v_mm);
        let area_mm2 = cross.length();
        if !(corner_mm.is_finite() && area_mm2.is_finite() && area_mm2 > 0.0) {
            return Err(RectangleError::NoArea);
        }
        if u_mm.dot(v_mm).abs() > 1e-3 * u_mm.length() * v_mm.length() {
            return Err(RectangleError::Skew);
        }
        Ok(RectangleLight {
            corner_mm,
            u_mm,
            v_mm,
            normal: cross / area_mm2,
            area_mm2,
            radiance,
            two_sided,
            search: LightSearch::Both,
            face: Face::new([corner_mm, u_mm, v_mm], cross / area_mm2),
        })
    }

    /// The same, found in another way.
    pub fn with_search(self, search: LightSearch) -> RectangleLight {
        RectangleLight { search, ..self }
    }

    /// The corner and the two edges.
    pub fn corner_and_edges_mm(&self) -> [Vec3; 3] {
        [self.corner_mm, self.u_mm, self.v_mm]
    }

    /// The least and the greatest corner of the box around it, mm.
    pub fn bounds_mm(&self) -> [Vec3; 2] {
        let [corner, u, v] = self.corner_and_edges_mm();
        let corners = [corner, corner + u, corner + v, corner + u + v];
        [
            corners.into_iter().fold(Vec3::INFINITY, Vec3::min),
            corners.into_iter().fold(Vec3::NEG_INFINITY, Vec3::max),
        ]
    }

    /// Radiance of the side that shines.
    pub fn radiance(&self) -> Rgb {
        self.radiance
    }

    /// Whether both sides shine.
    pub fn is_two_sided(&self) -> bool {
        self.two_sided
    }

    /// Radiance seen along a direction of sight.
    pub fn radiance_toward(&self, direction: Vec3) -> Rgb {
        if self.two_sided || direction.dot(self.normal) < 0.0 {
            self.radiance
        } else {
            Rgb::BLACK
        }
    }

    /// Where a ray crosses the rectangle, mm.
    pub fn distance_mm(&self, origin_mm: DVec3, direction: DVec3) -> Option<f64> {
        self.face.distance_mm(origin_mm, direction)
    }

    /// The same along a ray.
    pub fn distance_along(&self, ray: &Ray) -> Option<f64> {
        self.distance_mm(ray.origin, ray.direction.as_dvec3())
    }

    /// The rectangle as it is seen from a point; `None` when it is too small there for
    /// directions drawn evenly from its solid angle.
    fn seen_from(&self, from_mm: Vec3) -> Option<SphericalRectangle> {
        SphericalRectangle::new(from_mm, &self.face)
    }

    /// A direction drawn evenly from the solid angle, or, of a rectangle that is seen very
    /// small, toward an evenly drawn point, with its density.
    pub fn sample_toward(&self, from_mm: Vec3, rng: &mut PathRng) -> Option<(Vec3, f32)> {
        let s = rng.unit2();
        if let Some(seen) = self.seen_from(from_mm) {
            let w_in = seen.direction(s);
            let pdf = (1.0 / seen.solid_angle()) as f32;
            return (!self.radiance_toward(w_in).is_black()).then_some((w_in, pdf));
        }
        let to = self.corner_mm + s.x * self.u_mm + s.y * self.v_mm - from_mm;
        let w_in = to.try_normalize()?;
        let pdf = self.pdf_at(to.length_squared(), w_in);
        (pdf.is_finite() && !self.radiance_toward(w_in).is_black()).then_some((w_in, pdf))
    }

    /// Density with which shadow rays are drawn from a point, 1/sr.
    pub fn pdf_toward(&self, from_mm: Vec3, w_in: Vec3) -> f32 {
        if self.radiance_toward(w_in).is_black() {
            return 0.0;
        }
        match self.distance_along(&Ray::new(from_mm, w_in)) {
            Some(t) => match self.seen_from(from_mm) {
                Some(seen) => (1.0 / seen.solid_angle()) as f32,
                None => self.pdf_at((t * t) as f32, w_in),
            },
            None => 0.0,
        }
    }

    fn pdf_at(&self, distance_squared: f32, w_in: Vec3) -> f32 {
        distance_squared / (self.area_mm2 * w_in.dot(self.normal).abs())
    }
}

/// The `[[light]]` table of a rectangle.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RectangleTable {
    /// A corner.
    pub corner_mm: [f32; 3],
    /// One of the two edges that start at the corner; light goes to the side of
    /// their cross product.
    pub edge_u_mm: [f32; 3],
    /// The other edge, perpendicular to the first.
    pub edge_v_mm: [f32; 3],
    /// Radiance, linear RGB.
    pub radiance: [f32; 3],
    /// Whether both sides shine.
    #[serde(default)]
    pub two_sided: bool,
}

impl LightKind for RectangleTable {
    fn example() -> &'static str {
        "corner_mm = [-20.0, 20.0, 60.0]\nedge_u_mm = [0.0, -40.0, 0.0]\n\
        edge_v_mm = [40.0, 0.0, 0.0]\nradiance = [2.0, 2.0, 2.0]\ntwo_sided = true"
    }

    fn build(&self, _: &LoadPicture<'_>) -> Result<Light, LightError> {
        let radiance = brightness(self.radiance, "radiance")?;
        let keys = [
            ("corner_mm", self.corner_mm),
            ("edge_u_mm", self.edge_u_mm),
            ("edge_v_mm", self.edge_v_mm),
        ];
        if let Some((key, found)) = keys.iter().find(|(_, v)| v.iter().any(|x| !x.is_finite())) {
            let why = format!("expected three finite numbers, found {found:?}");
            return Err(LightError::of(key, why));
        }
        let [corner, u, v] = keys.map(|(_, v)| Vec3::from_array(v));
        RectangleLight::new(corner, u, v, radiance, self.two_sided)
            .map(Light::from)
            .map_err(|e| LightError::of("edge_u_mm, edge_v_mm", e.to_string()))
    }

    fn sides(&self, height_mm: f64) -> [bool; 2] {
        let (u, v) = (self.edge_u_mm[2], self.edge_v_mm[2]);
        let heights = [0.0, u, v, u + v].map(|h| f64::from(self.corner_mm[2] + h));
        [
            heights.iter().any(|&h| h > height_mm),
            heights.iter().any(|&h| h < height_mm),
        ]
    }
}

impl LightSource for RectangleLight {
    fn radiance_toward(&self, direction: Vec3) -> Rgb {
        RectangleLight::radiance_toward(self, direction)
    }

    fn search(&self) -> LightSearch {
        self.search
    }

    fn sample_toward(&self, from_mm: Vec3, rng: &mut PathRng) -> Option<LightSample> {
        if self.search == LightSearch::Walk {
            return None;
        }
        let (w_in, pdf) = RectangleLight::sample_toward(self, from_mm, rng)?;
        Some(LightSample {
            w_in,
            irradiance: RectangleLight::radiance_toward(self, w_in) / pdf,
            pdf,
        })
    }

    fn pdf_toward(&self, from_mm: Vec3, w_in: Vec3) -> f32 {
        RectangleLight::pdf_toward(self, from_mm, w_in)
    }

    fn distance_along(&self, ray: &Ray) -> Option<f64> {
        RectangleLight::distance_along(self, ray)
    }

    fn distance_mm(&self, origin_mm: DVec3, direction: DVec3) -> Option<f64> {
        RectangleLight::distance_mm(self, origin_mm, direction)
    }

    fn for_kernel(&self) -> KernelLight<'_> {
        KernelLight::Panel(self)
    }

    fn for_mitsuba(&self, _: usize) -> Result<MitsubaLight, String> {
        let [corner, u, v] = self.corner_and_edges_mm();
        let frame = [0.5 * u, 0.5 * v, corner + 0.5 * (u + v)];
        Ok(mitsuba::area_light(
            "rectangle",
            frame,
            self.radiance,
            self.two_sided,
        ))
    }
}
