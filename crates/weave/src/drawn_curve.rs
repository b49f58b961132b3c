//! Curves of a strand as segments: points with a size and a material.

use crate::strand::Strand;
use glam::{DVec2, DVec3};
use organza_basis::Segment;

/// Size and material of a curve at a point.
#[derive(Clone, Copy)]
pub(crate) struct Look {
    /// 0 where there is no fibre.
    pub radius_mm: f64,
    pub material: u16,
}

impl Strand<'_> {
    /// The centreline, with the mean radius of the cross-section.
    pub fn emit_yarn(&self, emit: &mut dyn FnMut(&Segment)) {
        let radius = self.yarn.radius_mm() * self.section.area().sqrt();
        let look = |s: f64, _| self.whole(self.scale(s) * radius);
        self.emit_period(0, |_| DVec2::ZERO, look, emit);
    }

    /// The centres of the plies.
    pub fn emit_plies(&self, emit: &mut dyn FnMut(&Segment)) {
        let radius = self.yarn.ply_radius_mm * self.section.area().sqrt();
        let turned = self.ply_phase();
        let look = |s: f64, _| self.whole(self.scale(s) * radius);
        for ply in 0..self.yarn.plies {
            let centre = |s| self.scale(s) * self.ply_centre(ply, turned, s);
            self.emit_period(ply, centre, look, emit);
        }
    }

    /// A whole yarn or ply.
    pub fn whole(&self, radius_mm: f64) -> Look {
        Look {
            radius_mm,
            material: self.template.material,
        }
    }

    /// One curve through the period: `offset` gives its place in the round cross-section at a
    /// share of the period, which may lie slightly outside 0 to 1, and `look` its size and
    /// material at a share of the period and this place. Returns the number after the last that
    /// the curve took.
    pub fn emit_period(
        &self,
        fibre: u32,
        offset: impl Fn(f64) -> DVec2,
        look: impl Fn(f64, DVec2) -> Look,
        emit: &mut dyn FnMut(&Segment),
    ) -> u32 {
        let length = self.path.length_mm();
        let point = |i: isize| {
            let share = self.path.arc_at(i) / length;
            let place = offset(share);
            let at = self.path.offset(i, self.section.at(share) * place);
            (at, (share, place))
        };
        let look = |_, (share, place)| look(share, place);
        let steps = self.path.steps() as isize;
        self.emit_curve(fibre, steps, point, look, emit)
    }

    /// A curve through given points; its ends are continued by reflection. Fewer than two points are
    /// no curve, and take no number. Returns the number after the last.
    pub fn emit_points(
        &self,
        fibre: u32,
        points: &[DVec3],
        look: impl Fn(isize) -> Look,
        emit: &mut dyn FnMut(&Segment),
    ) -> u32 {
        if points.len() < 2 {
            return fibre;
        }
        let last = points.len() - 1;
        let point = |i: isize| {
            let at = match usize::try_from(i) {
                Ok(i) if i <= last => points[i],
                Ok(_) => 2.0 * points[last] - points[last - 1],
                Err(_) => 2.0 * points[0] - points[1],
            };
            (at, ())
        };
        self.emit_curve(fibre, last as isize, point, |i, ()| look(i), emit)
    }

    /// A curve through the points 0 to `steps`; the points before and after give the tangents
    /// at its ends. A tangent is the direction of the chord over two steps, which needs no
    /// derivative of the frame and is continuous across the border of the tile. Where the
    /// radius is 0 the curve is cut, and its next piece has the next number. `look` gets what
    /// `point` gives beside a point. Returns the number after the last.
    pub fn emit_curve<T: Copy>(
        &self,
        fibre: u32,
        steps: isize,
        point: impl Fn(isize) -> (DVec3, T),
        look: impl Fn(isize, T) -> Look,
        emit: &mut dyn FnMut(&Segment),
    ) -> u32 {
        let mut segment = Segment {
            fibre,
            ..self.template
        };
        let mut window = [point(-1), point(0), point(1)];
        let tangent = |w: &[(DVec3, T); 3]| (w[2].0 - w[0].0).normalize_or(DVec3::X).as_vec3();
        let mut ahead = look(0, window[1].1);
        let mut is_cut = false;
        segment.end_mm = window[1].0.as_vec3();
        segment.end_tangent = tangent(&window);
        for i in 1..=steps {
            window = [window[1], window[2], point(i + 1)];
            let here = std::mem::replace(&mut ahead, look(i, window[1].1));
            segment.start_mm = segment.end_mm;
            segment.start_tangent = segment.end_tangent;
            segment.end_mm = window[1].0.as_vec3();
            segment.end_tangent = tangent(&window);
            if here.radius_mm > 0.0 && ahead.radius_mm > 0.0 {
                segment.fibre += u32::from(std::mem::take(&mut is_cut));
                segment.start_radius_mm = here.radius_mm as f32;
                segment.end_radius_mm = ahead.radius_mm as f32;
                segment.material = here.material;
                emit(&segment);
            } else {
                is_cut = true;
            }
        }
        segment.fibre + 1
    }
}
