//! Cloth without thickness.

use crate::SiteInfo;
use glam::{Vec2, Vec3};
use organza_basis::{Frame, PathRng, Rgb};
use organza_scatter::LobeSample;

/// The piece of a sheet that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SheetPoint {
    /// Place in the fabric plane, mm: x along the weft, y along the warp.
    pub position_mm: Vec2,
    /// Width of what the pixel sees there, mm; zero for a point.
    pub footprint_mm: f32,
}

/// How a sheet scatters light: the waist between surface models and the walk.
///
/// Directions are unit vectors away from the sheet in the fabric frame, z its
/// face; `w_out` points back along the walk. A ray passes with probability
/// [`Sheet::gap`]; everything else is given that it does not.
pub trait Sheet: Send + Sync {
    /// Share of a ray along `w` that meets nothing.
    fn gap(&self, w: Vec3) -> f32;

    /// The BSDF times `|cos theta_in|` over the share `1 - gap(w_out)` that
    /// meets the sheet, 1/sr.
    fn eval(&self, w_out: Vec3, w_in: Vec3, at: SheetPoint) -> Rgb;

    /// Draws `w_in`; `None` when the light is absorbed.
    fn sample(&self, w_out: Vec3, at: SheetPoint, rng: &mut PathRng) -> Option<LobeSample>;

    /// Density with which [`Sheet::sample`] draws `w_in`, 1/sr.
    fn pdf(&self, w_out: Vec3, w_in: Vec3, at: SheetPoint) -> f32;

    /// Unit direction of the yarn at the point, in the fabric frame, or zero.
    fn axis(&self, at: SheetPoint) -> Vec3;
}

/// A collision with a sheet.
#[derive(Clone, Copy)]
pub(crate) struct SheetSite<'a> {
    pub sheet: &'a dyn Sheet,
    pub point: SheetPoint,
    /// Fabric frame in the world.
    pub frame: Frame,
    /// Unit normal of the face itself, on the side of `frame.n`.
    pub face_normal: Vec3,
    /// From where the ray's own arithmetic puts the collision to the sheet, mm.
    pub to_sheet_mm: Vec3,
    /// Room for rounding between the sheet and where a ray leaves it, mm.
    pub margin_mm: f32,
}

impl SheetSite<'_> {
    /// The two directions in the fabric frame; `None` when interpolated and
    /// true normal disagree on which side `w_in` is, where light would leak.
    fn local(&self, w_out: Vec3, w_in: Vec3) -> Option<(Vec3, Vec3)> {
        let (o, i) = (
            self.frame.frame_from_world(w_out),
            self.frame.frame_from_world(w_in),
        );
        let is_front = |w: Vec3| self.face_normal.dot(w) > 0.0;
        (is_front(w_in) == (i.z > 0.0)).then_some((o, i))
    }

    pub fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        self.local(w_out, w_in)
            .map_or(Rgb::BLACK, |(o, i)| self.sheet.eval(o, i, self.point))
    }

    pub fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let o = self.frame.frame_from_world(w_out);
        let drawn = self.sheet.sample(o, self.point, rng)?;
        let w_in = self.frame.world_from_frame(drawn.w_in).normalize();
        self.local(w_out, w_in)
            .map(|_| LobeSample { w_in, ..drawn })
    }

    pub fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        self.local(w_out, w_in)
            .map_or(0.0, |(o, i)| self.sheet.pdf(o, i, self.point))
    }

    /// Onto the sheet and a hair off it, on the side of `w_in`.
    pub fn exit_mm(&self, w_in: Vec3) -> Vec3 {
        let side = 1.0f32.copysign(self.face_normal.dot(w_in));
        self.to_sheet_mm + self.face_normal * (side * self.margin_mm)
    }

    pub fn info(&self) -> SiteInfo {
        SiteInfo {
            axis: self.frame.world_from_frame(self.sheet.axis(self.point)),
            yarn: None,
        }
    }
}
