//! The segment under one point of a face, and the cone of its fibres.

use crate::cone::Fibres;
use crate::real::Direction;
use crate::segment::{Pair, YarnSegment};
use crate::weave::{PlacedSegment, Spot, Yarn};
use glam::Vec3;
use organza_basis::PathRng;

/// A segment under a point, with the inclination at this place.
pub(crate) struct Local<'a> {
    pub segment: &'a YarnSegment<f32>,
    pub yarn: Yarn,
    pub spot: Spot,
    pub placed: &'a PlacedSegment,
}

impl Local<'_> {
    /// The same with the fibres that may mirror light to `w_out`.
    #[inline]
    pub fn with_fibres(self, w_out: Vec3) -> (Self, Fibres) {
        let seen = segment_from_face(self.yarn, w_out);
        let spot = &self.spot;
        let fibres = self.segment.fibres(seen, spot.across_mm, spot.along_mm);
        (self, fibres)
    }

    /// Draws a direction from the cone of one of them.
    #[inline]
    pub fn sample_cone(&self, fibres: &Fibres, w_out: Vec3, rng: &mut PathRng) -> Option<Vec3> {
        let seen = segment_from_face(self.yarn, w_out);
        let drawn = self.segment.sample_cone(seen, fibres, rng)?;
        Some(face_from_segment(self.yarn, drawn))
    }

    /// Density of [`sample_cone`](Self::sample_cone), 1/sr.
    #[inline]
    pub fn cone_pdf(&self, fibres: &Fibres, w_in: Vec3, w_out: Vec3) -> f32 {
        if w_in.z <= 0.0 {
            return 0.0;
        }
        let pair = Pair::new(
            segment_from_face(self.yarn, w_in),
            segment_from_face(self.yarn, w_out),
        );
        self.segment.cone_pdf(&pair, fibres)
    }
}

/// Sine and cosine of the quarter turn from the face to the segments of a yarn. They are
/// numbers instead of a branch, because the yarn is unpredictable.
#[inline(always)]
fn turn(yarn: Yarn) -> (f32, f32) {
    let sin = f32::from(yarn as u8);
    (sin, 1.0 - sin)
}

/// A direction of the face in the frame of a yarn's segments.
#[inline(always)]
pub(crate) fn segment_from_face(yarn: Yarn, w: Vec3) -> Direction<f32> {
    let (sin, cos) = turn(yarn);
    Direction::new(cos * w.x - sin * w.y, sin * w.x + cos * w.y, w.z)
}

/// The way back.
#[inline(always)]
fn face_from_segment(yarn: Yarn, w: Direction<f32>) -> Vec3 {
    let (sin, cos) = turn(yarn);
    Vec3::new(cos * w.x + sin * w.y, cos * w.y - sin * w.x, w.z)
}
