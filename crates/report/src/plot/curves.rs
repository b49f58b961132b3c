//! Curves over the exitant angle.

use super::axis::LinearAxis;
use super::{DrawError, Plot, draw_mesh, draw_title, fine, line, paint};
use plotters::chart::ChartBuilder;
use plotters::element::{PathElement, Polygon};
use plotters::style::Color;

/// One curve: angles in degrees, values and their standard errors.
pub(crate) struct Curve {
    /// 8-bit sRGB.
    pub colour: [u8; 3],
    /// Points in order of their angles.
    pub points: Vec<[f64; 3]>,
}

/// Pixels: the size of the plot, and the margins beside, above and below the axes.
const SIZE: [f64; 2] = [340.0, 200.0];
const LEFT: f64 = 44.0;
const RIGHT: f64 = 8.0;
const TOP: f64 = 20.0;
const BELOW: f64 = 24.0;

/// Angles with a line and a number, degrees.
const ANGLES_DEG: [f64; 5] = [-60.0, -30.0, 0.0, 30.0, 60.0];

/// Standard errors on each side of a curve that its band covers.
const BAND: f64 = 2.0;

/// Curves from -90 to 90 degrees with bands of two standard errors.
pub(crate) fn curves(title: &str, list: &[Curve]) -> Result<Plot, DrawError> {
    let values = list.iter().flat_map(|c| &c.points);
    let highest = values.map(|p| p[1] + BAND * p[2]).fold(1e-6, f64::max);
    let most = 1.05 * highest;
    let place = |angle: f64, value: f64| (angle, value.clamp(0.0, most));
    Plot::new(SIZE, title, |canvas| {
        draw_title(canvas, LEFT, title)?;
        let mut chart = ChartBuilder::on(canvas)
            .margin_top(fine(TOP))
            .margin_right(fine(RIGHT))
            .y_label_area_size(fine(LEFT))
            .x_label_area_size(fine(BELOW))
            .build_cartesian_2d(
                LinearAxis::new(-90.0..90.0, &ANGLES_DEG),
                LinearAxis::new(0.0..most, &[0.0, 0.5 * most, most]),
            )?;
        draw_mesh(&mut chart, &|angle| format!("{angle}\u{b0}"), &|value| {
            format!("{value:.3}")
        })?;
        for curve in list.iter().filter(|c| c.points.len() > 1) {
            let side = |sign: f64| move |p: &[f64; 3]| place(p[0], p[1] + sign * BAND * p[2]);
            let above = curve.points.iter().map(side(1.0));
            let below = curve.points.iter().rev().map(side(-1.0));
            let band: Vec<_> = above.chain(below).collect();
            let colour = paint(curve.colour);
            chart.draw_series([Polygon::new(band, colour.mix(0.22))])?;
            let middle: Vec<_> = curve.points.iter().map(|p| place(p[0], p[1])).collect();
            chart.draw_series([PathElement::new(middle, line(colour, 1.8))])?;
        }
        Ok(Vec::new())
    })
}
