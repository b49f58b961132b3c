//! Marks with intervals, and lines, over two logarithmic axes.

use super::axis::{LogAxis, LogSpan};
use super::{DrawError, Hint, INK, Plot, draw_mesh, draw_text, draw_title, fine, line, paint};
use plotters::chart::ChartBuilder;
use plotters::coord::combinators::{BindKeyPoints, IntoLogRange};
use plotters::element::{Circle, DashedPathElement, PathElement};
use plotters::style::text_anchor::HPos;
use plotters::style::{Color, RGBColor};

/// A point with an interval upward and downward.
pub(crate) struct Mark {
    pub x: f64,
    pub y: f64,
    pub low: f64,
    pub high: f64,
    /// 8-bit sRGB.
    pub colour: [u8; 3],
    /// Filled, and on the line of the front.
    pub on_front: bool,
    /// Appears when the pointer rests on it.
    pub hint: String,
}

/// A line through points.
pub(crate) struct Line {
    pub points: Vec<[f64; 2]>,
    /// 8-bit sRGB.
    pub colour: [u8; 3],
}

/// Pixels: the size of the plot, and the margins beside and above the axes.
const SIZE: [f64; 2] = [340.0, 250.0];
const LEFT: f64 = 46.0;
const RIGHT: f64 = 12.0;
const TOP: f64 = 22.0;
/// Margins for the numbers and, below them, for the title of the axis.
const NUMBERS: f64 = 20.0;
const BELOW: f64 = 18.0;

const RADIUS: f64 = 4.0;
const DASH: f64 = 3.0;

/// Marks, the staircase through those on the front, and lines.
pub(crate) fn log_log(
    title: &str,
    x_axis: &LogAxis,
    y_axis: &LogAxis,
    marks: &[Mark],
    lines: &[Line],
) -> Result<Plot, DrawError> {
    let along = || lines.iter().flat_map(|l| &l.points);
    let xs = marks.iter().map(|m| m.x).chain(along().map(|p| p[0]));
    let ys = marks.iter().flat_map(|m| [m.y, m.high]);
    let xs = LogSpan::over(xs, x_axis.least);
    let ys = LogSpan::over(ys.chain(along().map(|p| p[1])), y_axis.least);
    let place = |x: f64, y: f64| (xs.place(x), ys.place(y));
    Plot::new(SIZE, title, |canvas| {
        draw_title(canvas, LEFT, title)?;
        let end = (fine(SIZE[0] - RIGHT), fine(SIZE[1] - 0.5 * BELOW));
        draw_text(canvas, x_axis.title, end, HPos::Right, INK)?;
        let mut chart = ChartBuilder::on(canvas)
            .margin_top(fine(TOP))
            .margin_right(fine(RIGHT))
            .margin_bottom(fine(BELOW))
            .y_label_area_size(fine(LEFT))
            .x_label_area_size(fine(NUMBERS))
            .build_cartesian_2d(
                xs.range().log_scale().with_key_points(xs.ticks()),
                ys.range().log_scale().with_key_points(ys.ticks()),
            )?;
        draw_mesh(&mut chart, &|v| (x_axis.number)(*v), &|v| {
            (y_axis.number)(*v)
        })?;
        chart.draw_series(lines.iter().map(|l| {
            let points: Vec<_> = l.points.iter().map(|p| place(p[0], p[1])).collect();
            PathElement::new(points, line(paint(l.colour), 2.0))
        }))?;
        let steps: Vec<_> = staircase(marks).map(|[x, y]| place(x, y)).collect();
        if steps.len() > 1 {
            let dash = fine(DASH);
            chart.draw_series([DashedPathElement::new(
                steps,
                dash,
                dash,
                INK.mix(0.5).stroke_width(line(INK, 1.0).stroke_width),
            )])?;
        }
        chart.draw_series(marks.iter().map(|m| {
            let interval = vec![place(m.x, m.low), place(m.x, m.high)];
            let style = paint(m.colour).mix(0.6);
            PathElement::new(interval, style.stroke_width(line(INK, 1.0).stroke_width))
        }))?;
        chart.draw_series(marks.iter().map(|m| {
            let colour: RGBColor = paint(m.colour);
            let style = if m.on_front {
                colour.filled()
            } else {
                line(colour, 1.5)
            };
            Circle::new(place(m.x, m.y), fine(RADIUS), style)
        }))?;
        let hint = |m: &Mark| {
            let (x, y) = chart.backend_coord(&place(m.x, m.y));
            Hint {
                x,
                y,
                radius: fine(1.5 * RADIUS).unsigned_abs(),
                text: m.hint.clone(),
            }
        };
        Ok(marks.iter().map(hint).collect())
    })
}

/// Corners of the line along the front: level to the right of each mark, then down
/// to the next.
fn staircase(marks: &[Mark]) -> impl Iterator<Item = [f64; 2]> {
    let mut front: Vec<[f64; 2]> = marks
        .iter()
        .filter(|m| m.on_front)
        .map(|m| [m.x, m.y])
        .collect();
    front.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let corners: Vec<[f64; 2]> = front
        .windows(2)
        .filter_map(|pair| match pair {
            [before, after] => Some([after[0], before[1]]),
            _ => None,
        })
        .collect();
    let mut line = Vec::with_capacity(2 * front.len());
    for (i, mark) in front.into_iter().enumerate() {
        if let Some(corner) = i.checked_sub(1).and_then(|k| corners.get(k)) {
            line.push(*corner);
        }
        line.push(mark);
    }
    line.into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;
    use askama::Template;

    fn mark(x: f64, y: f64, on_front: bool) -> Mark {
        Mark {
            x,
            y,
            low: 0.5 * y,
            high: 2.0 * y,
            colour: [1, 2, 3],
            on_front,
            hint: format!("at {x}"),
        }
    }

    #[test]
    fn the_front_is_a_staircase() {
        let marks = [
            mark(3.0, 1.0, true),
            mark(2.0, 9.0, false),
            mark(1.0, 4.0, true),
        ];
        let steps: Vec<_> = staircase(&marks).collect();
        assert_eq!(steps, [[1.0, 4.0], [3.0, 4.0], [3.0, 1.0]]);
    }

    #[test]
    fn every_mark_is_drawn_and_has_a_hint() {
        let axis = || LogAxis {
            title: "seconds",
            number: |v| format!("{v}"),
            least: 1e-3,
        };
        let marks = [mark(1.0, 0.1, true), mark(10.0, 0.0, false)];
        let lines = [Line {
            points: vec![[1.0, 0.1], [20.0, 0.01]],
            colour: [9, 9, 9],
        }];
        let svg = log_log("error", &axis(), &axis(), &marks, &lines).unwrap();
        let svg = svg.render().unwrap();
        // Two marks, each drawn once and covered by an area that shows its hint.
        assert_eq!(svg.matches("<circle").count(), 4, "{svg}");
        assert!(svg.contains("<title>at 10</title>") && svg.contains("seconds"));
        assert!(!svg.contains("NaN"), "{svg}");
    }
}
