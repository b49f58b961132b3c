//! Plots of measurements as inline SVG. Text takes the page's colour.

use glam::{Vec2, Vec3};
use organza_basis::{Rgb, warp};
use organza_measure::{Angles, PairValue, irawan_exitant};
use organza_scene::representation::Representation;
use std::fmt::Write;

/// A model's name and colour in plots, readable on light and dark.
pub fn colour(model: &str) -> String {
    let [r, g, b] = Representation::named(model).map_or(OTHER, |r| r.colour);
    format!("#{r:02x}{g:02x}{b:02x}")
}

/// Colour of what is no representation.
const OTHER: [u8; 3] = [0x8a; 3];

/// Incident directions along each side of the thesis' layout.
const SIDE: usize = 15;

/// Pixels between hemispheres 30 degrees of view apart, and their radius.
const SPACING: f32 = 108.0;
const RADIUS: f32 = 42.0;

/// Hemispheres of incident directions, arranged by where they are seen from,
/// the warp upward [Irawan2008] (figure 5.3). `values` are those of the
/// layout, `gain` brings them to the brightness of a picture.
pub fn hemispheres(values: &[PairValue], gain: f32) -> String {
    // Views lie from 135 degrees on the left to 0 on the right, none below.
    let centre = Vec2::new(1.42 * SPACING + RADIUS + 12.0, 2.0 * SPACING + RADIUS + 4.0);
    let (width, height) = (
        centre.x + 2.0 * SPACING + RADIUS + 12.0,
        centre.y + RADIUS + 20.0,
    );
    let mut svg = format!(
        "<svg viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\" shape-rendering=\"crispEdges\" aria-label=\"BSDF over incident directions\">"
    );
    for (view, chunk) in irawan_exitant().iter().zip(values.chunks(SIDE * SIDE)) {
        let turn = view.phi_deg.to_radians() as f32;
        let away = view.theta_deg as f32 / 30.0 * SPACING;
        let middle = centre + away * Vec2::new(turn.cos(), -turn.sin());
        for (k, value) in chunk.iter().enumerate() {
            let [r, g, b] = pixel(value.bsdf.mean, gain);
            let _ = write!(svg, "<path fill=\"#{r:02x}{g:02x}{b:02x}\" d=\"M");
            let at = Vec2::new((k % SIDE) as f32, (k / SIDE) as f32);
            for corner in [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]] {
                let p = middle + RADIUS * on_hemisphere(at + Vec2::from(corner));
                let _ = write!(svg, "{:.1} {:.1} ", p.x, p.y);
            }
            svg += "z\"/>";
        }
        let _ = write!(
            svg,
            "<text x=\"{:.0}\" y=\"{:.0}\" text-anchor=\"middle\">{:.0}&deg;, {:.0}&deg;</text>",
            middle.x,
            middle.y + RADIUS + 12.0,
            view.theta_deg,
            view.phi_deg
        );
    }
    svg + "</svg>"
}

/// Place of a grid point of the layout in the unit disk, y down.
fn on_hemisphere(at: Vec2) -> Vec2 {
    let square = (at / (SIDE - 1) as f32).clamp(Vec2::ZERO, Vec2::ONE);
    let disk = warp::concentric_disk(square);
    let cos = 1.0 - disk.length_squared().min(1.0) * (1.0 - 75f32.to_radians().cos());
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let p = disk.normalize_or_zero() * sin;
    Vec2::new(p.x, -p.y)
}

/// Display values of a linear colour.
pub fn pixel(value: [f64; 3], gain: f32) -> [u8; 3] {
    value.map(|v| Rgb::srgb8((v as f32 * gain).clamp(0.0, 1.0)))
}

/// One curve: angles, values and standard errors.
pub struct Curve {
    /// Whose it is.
    pub model: String,
    /// Points in order.
    pub points: Vec<[f64; 3]>,
}

/// Curves over the exitant angle with bands of two standard errors.
pub fn curves(title: &str, list: &[Curve]) -> String {
    let (width, height, left, bottom) = (340.0, 200.0, 44.0, 30.0);
    let points = || list.iter().flat_map(|c| &c.points);
    let most = points().map(|p| p[1] + 2.0 * p[2]).fold(1e-6, f64::max) * 1.05;
    let x = |angle: f64| left + (angle + 90.0) / 180.0 * (width - left - 8.0);
    let y = |value: f64| (height - bottom) - value.max(0.0) / most * (height - bottom - 20.0);
    let mut svg = format!(
        "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{title}\"><text x=\"{left}\" y=\"12\" class=\"t\">{title}</text>"
    );
    for k in 0..=2 {
        let value = most * f64::from(k) / 2.0;
        let _ = write!(
            svg,
            "<path class=\"g\" d=\"M{left} {0:.1}H{width}\"/><text x=\"{1}\" y=\"{2:.1}\" text-anchor=\"end\">{value:.3}</text>",
            y(value),
            left - 4.0,
            y(value) + 4.0
        );
    }
    for angle in [-60.0, -30.0, 0.0, 30.0, 60.0] {
        let _ = write!(
            svg,
            "<path class=\"g\" d=\"M{0:.1} {1}V{2}\"/><text x=\"{0:.1}\" y=\"{3}\" text-anchor=\"middle\">{angle}&deg;</text>",
            x(angle),
            y(most),
            height - bottom,
            height - bottom + 14.0
        );
    }
    for curve in list {
        let paint = colour(&curve.model);
        let mut band = String::new();
        for (k, p) in curve.points.iter().enumerate() {
            let _ = write!(
                band,
                "{}{:.1} {:.1}",
                if k == 0 { "M" } else { "L" },
                x(p[0]),
                y(p[1] + 2.0 * p[2])
            );
        }
        for p in curve.points.iter().rev() {
            let _ = write!(band, "L{:.1} {:.1}", x(p[0]), y(p[1] - 2.0 * p[2]));
        }
        let line: Vec<String> = curve
            .points
            .iter()
            .map(|p| format!("{:.1} {:.1}", x(p[0]), y(p[1])))
            .collect();
        let _ = write!(
            svg,
            "<path d=\"{band}z\" fill=\"{paint}\" fill-opacity=\"0.22\"/><path d=\"M{}\" fill=\"none\" stroke=\"{paint}\" stroke-width=\"1.8\"/>",
            line.join("L")
        );
    }
    svg + "</svg>"
}

/// Stacked shares of light: reflected, transmitted, straight through,
/// absorbed, one bar per direction.
pub fn shares(bars: &[(String, [f64; 4])]) -> String {
    let row = 19.0;
    let height = row * bars.len() as f64 + 4.0;
    let mut svg = format!(
        "<svg viewBox=\"0 0 560 {height}\" role=\"img\" aria-label=\"Where the light goes\">"
    );
    for (k, (label, shares)) in bars.iter().enumerate() {
        let y = row * k as f64 + 2.0;
        let _ = write!(
            svg,
            "<text x=\"196\" y=\"{}\" text-anchor=\"end\">{label}</text>",
            y + 12.0
        );
        let mut from = 202.0;
        for (share, paint) in shares
            .iter()
            .zip(["#e0a03a", "#4f9fbf", "#b9d7e4", "#57504a"])
        {
            let wide = share.clamp(0.0, 1.0) * 350.0;
            let _ = write!(
                svg,
                "<rect x=\"{from:.1}\" y=\"{y}\" width=\"{wide:.1}\" height=\"15\" fill=\"{paint}\"/>"
            );
            if wide > 26.0 {
                let ink = if paint == "#57504a" { "#fff" } else { "#111" };
                let _ = write!(
                    svg,
                    "<text x=\"{:.1}\" y=\"{}\" style=\"fill:{ink}\" text-anchor=\"middle\">{:.2}</text>",
                    from + 0.5 * wide,
                    y + 12.0,
                    share
                );
            }
            from += wide;
        }
    }
    svg + "</svg>"
}

/// The signed angle of an exitant direction in the plane of a pair's light.
pub fn signed_angle(exitant: &Angles, phi_deg: f64) -> f64 {
    let w = exitant.direction();
    let (sin, cos) = phi_deg.to_radians().sin_cos();
    let along = w.dot(Vec3::new(cos as f32, sin as f32, 0.0));
    f64::from(along.atan2(w.z.abs())).to_degrees()
}
