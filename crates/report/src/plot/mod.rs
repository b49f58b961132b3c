//! Plots as SVG inside a page.
//!
//! `plotters` draws them on whole pixels, so the canvas is [`FINE`] times as fine as the plot
//! is shown. Text, axes and grid have two colours, [`INK`] and [`GRID`], that the style sheet
//! of the pages replaces by the colours of the reader's colour scheme.

mod axis;
mod curves;
mod hemispheres;
mod log_log;
mod shares;

pub(crate) use axis::LogAxis;
pub(crate) use curves::{Curve, curves};
pub(crate) use hemispheres::hemispheres;
pub(crate) use log_log::{Line, Mark, log_log};
pub(crate) use shares::{SHARES, Shares, shares};

use askama::Template;
use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::{
    Color, DrawingArea, DrawingAreaErrorKind, IntoDrawingArea, RGBColor, SVGBackend, ShapeStyle,
    TRANSPARENT, Text,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{FontStyle, IntoFont, TextStyle};

/// Pixels of the canvas along one pixel of the plot.
const FINE: u32 = 10;

/// Text and axes; the style sheet names it too.
const INK: RGBColor = RGBColor(0x22, 0x26, 0x2b);
/// Lines of the grid; the style sheet names it too.
const GRID: RGBColor = RGBColor(0xd9, 0xd5, 0xcc);

/// Height of letters, pixels of the plot.
const LETTERS: f64 = 11.0;
const TITLE_LETTERS: f64 = 12.0;

/// A plot could not be drawn. Plots are drawn into strings, so no error is expected.
pub(crate) type DrawError = DrawingAreaErrorKind<std::io::Error>;

type Canvas<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// A colour of 8-bit sRGB in the form of `plotters`.
fn paint([r, g, b]: [u8; 3]) -> RGBColor {
    RGBColor(r, g, b)
}

/// Pixels of the plot as pixels of the canvas.
fn fine(pixels: f64) -> i32 {
    (pixels * f64::from(FINE)).round() as i32
}

/// The same for widths and radii.
fn fine_width(pixels: f64) -> u32 {
    fine(pixels).unsigned_abs()
}

fn letters(height: f64) -> TextStyle<'static> {
    // `plotters` writes 1/1.24 of a font's size into the SVG.
    ("sans-serif", 1.24 * height * f64::from(FINE))
        .into_font()
        .color(&INK)
}

fn title_letters() -> TextStyle<'static> {
    ("sans-serif", 1.24 * TITLE_LETTERS * f64::from(FINE))
        .into_font()
        .style(FontStyle::Bold)
        .color(&INK)
}

fn line(colour: RGBColor, width: f64) -> ShapeStyle {
    colour.stroke_width(fine_width(width))
}

/// Text that appears when the pointer rests on a place of a plot.
struct Hint {
    x: i32,
    y: i32,
    radius: u32,
    text: String,
}

/// A plot that a page includes unchanged.
#[derive(Template)]
#[template(path = "plot.svg")]
pub(crate) struct Plot {
    width: u32,
    height: u32,
    /// Alternative text.
    label: String,
    body: String,
    hints: Vec<Hint>,
    /// Whether it consists of adjacent areas, whose borders must not be smoothed.
    is_mosaic: bool,
}

impl Plot {
    /// A plot of `size` pixels that `draw` fills.
    fn new(
        size: [f64; 2],
        label: &str,
        draw: impl FnOnce(&Canvas) -> Result<Vec<Hint>, DrawError>,
    ) -> Result<Plot, DrawError> {
        let [width, height] = size.map(fine_width);
        let mut svg = String::new();
        let canvas = SVGBackend::with_string(&mut svg, (width, height)).into_drawing_area();
        let hints = draw(&canvas)?;
        canvas.present()?;
        drop(canvas);
        // The template writes the outer element, which needs attributes that `plotters` does
        // not support.
        let inside = svg.split_once('>').map_or("", |(_, rest)| rest).trim();
        let body = inside.strip_suffix("</svg>").unwrap_or(inside).to_owned();
        Ok(Plot {
            width,
            height,
            label: label.to_owned(),
            body,
            hints,
            is_mosaic: false,
        })
    }
}

/// The title at the top of a plot whose axis begins `left` pixels from its edge.
fn draw_title(canvas: &Canvas, left: f64, title: &str) -> Result<(), DrawError> {
    let at = (fine(left), fine(3.0));
    canvas.draw(&Text::new(title, at, title_letters()))
}

/// Text beside a point of the canvas: left of it, right of it or centred.
fn draw_text(
    canvas: &Canvas,
    words: &str,
    at: (i32, i32),
    side: HPos,
    colour: RGBColor,
) -> Result<(), DrawError> {
    let style = letters(LETTERS)
        .color(&colour)
        .pos(Pos::new(side, VPos::Center));
    canvas.draw(&Text::new(words, at, style))
}

/// Lines at the key points of both axes, and their numbers.
fn draw_mesh<X, Y>(
    chart: &mut ChartContext<'_, SVGBackend<'_>, Cartesian2d<X, Y>>,
    x_number: &dyn Fn(&f64) -> String,
    y_number: &dyn Fn(&f64) -> String,
) -> Result<(), DrawError>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    chart
        .configure_mesh()
        .axis_style(TRANSPARENT)
        .light_line_style(TRANSPARENT)
        .bold_line_style(line(GRID, 1.0))
        .label_style(letters(LETTERS))
        .set_all_tick_mark_size(fine(3.0))
        .x_label_formatter(x_number)
        .y_label_formatter(y_number)
        .draw()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_style_sheet_names_the_colours_that_follow_the_scheme() {
        let sheet = include_str!("../../templates/style.css");
        for (colour, attribute) in [(INK, "fill"), (INK, "stroke"), (GRID, "stroke")] {
            let RGBColor(r, g, b) = colour;
            let selector = format!("[{attribute}=\"#{r:02X}{g:02X}{b:02X}\"]");
            assert!(sheet.contains(&selector), "{selector}");
        }
    }

    #[test]
    fn a_plot_is_one_element_and_escapes_its_words() {
        let plot = Plot::new([30.0, 20.0], "a \"<b>\"", |canvas| {
            draw_title(canvas, 2.0, "1 < 2")?;
            Ok(vec![Hint {
                x: 1,
                y: 2,
                radius: 3,
                text: "x & y".into(),
            }])
        });
        let svg = plot.unwrap().render().unwrap();
        assert!(
            svg.starts_with("<svg viewBox=\"0 0 300 200\" role=\"img\""),
            "{svg}"
        );
        assert!(
            svg.ends_with("</svg>") || svg.ends_with("</svg>\n"),
            "{svg}"
        );
        assert_eq!(svg.matches("<svg").count(), 1, "{svg}");
        assert!(svg.contains("1 &lt; 2") && !svg.contains("<b>"), "{svg}");
        assert!(svg.contains("<title>x &#38; y</title>"), "{svg}");
        assert!(!svg.contains("http"), "{svg}");
    }
}
