//! Cloth without thickness.

use crate::SiteInfo;
use crate::matter::site::Site;
use glam::Vec3;
use organza_basis::{Frame, PathRng, Rgb};
use organza_scatter::{Footprint, LobeSample, Surface};

/// A collision with a sheet.
#[derive(Clone, Copy)]
pub(crate) struct SheetSite<'a> {
    pub surface: &'a dyn Surface,
    pub at: Footprint,
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

    /// Share of rays along a direction of the fabric frame that meet the sheet.
    fn met(&self, w_out: Vec3) -> f32 {
        1.0 - self.surface.gap(w_out, self.at)
    }
}

impl Site for SheetSite<'_> {
    /// The BSDF times `|cos theta_in|` over the share of rays along `w_out` that
    /// meet the sheet, 1/sr.
    fn eval(&self, w_out: Vec3, w_in: Vec3) -> Rgb {
        let Some((o, i)) = self.local(w_out, w_in) else {
            return Rgb::BLACK;
        };
        let met = self.met(o);
        if met <= 0.0 {
            return Rgb::BLACK;
        }
        self.surface.eval(o, i, self.at) * (i.z.abs() / met)
    }

    fn sample(&self, w_out: Vec3, rng: &mut PathRng) -> Option<LobeSample> {
        let o = self.frame.frame_from_world(w_out);
        let met = self.met(o);
        if met <= 0.0 {
            return None;
        }
        let drawn = self.surface.sample(o, self.at, rng)?;
        let w_in = self.frame.world_from_frame(drawn.w_in).normalize();
        self.local(w_out, w_in).map(|_| LobeSample {
            w_in,
            pdf: drawn.pdf / met,
            ..drawn
        })
    }

    fn pdf(&self, w_out: Vec3, w_in: Vec3) -> f32 {
        let Some((o, i)) = self.local(w_out, w_in) else {
            return 0.0;
        };
        let met = self.met(o);
        if met <= 0.0 {
            return 0.0;
        }
        self.surface.pdf(o, i, self.at) / met
    }

    /// Onto the sheet and a hair off it, on the side of `w_in`.
    fn exit_mm(&self, _w_out: Vec3, w_in: Vec3, _rng: &mut PathRng) -> Vec3 {
        let side = 1.0f32.copysign(self.face_normal.dot(w_in));
        self.to_sheet_mm + self.face_normal * (side * self.margin_mm)
    }

    fn info(&self) -> Option<SiteInfo> {
        Some(SiteInfo::new(
            self.frame.world_from_frame(self.surface.axis(self.at)),
            None,
        ))
    }
}
