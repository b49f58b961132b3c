//! The BSDF over all incident directions, one disk for each direction of view.

use super::{DrawError, INK, Plot, draw_text, fine, paint};
use crate::picture::pixel;
use glam::Vec2;
use organza_basis::warp;
use organza_measure::{PairValue, irawan_exitant};
use plotters::element::Polygon;
use plotters::style::Color;
use plotters::style::text_anchor::HPos;

/// Incident directions along each side of the layout of [Irawan2008].
const SIDE: usize = 15;
/// The largest polar angle of these directions, degrees.
const STEEPEST_DEG: f32 = 75.0;

/// Pixels between disks 30 degrees of view apart, and their radius.
const SPACING: f32 = 108.0;
const RADIUS: f32 = 42.0;
const MARGIN: f32 = 12.0;

/// Disks of incident directions, arranged by the direction of view, with the warp upward
/// [Irawan2008] (figure 5.3). `values` are those of the layout; `gain` scales them to the
/// brightness of a picture.
pub(crate) fn hemispheres(values: &[PairValue], gain: f32) -> Result<Plot, DrawError> {
    // Views lie from 135 degrees on the left to 0 on the right, none below.
    let centre = Vec2::new(
        1.42 * SPACING + RADIUS + MARGIN,
        2.0 * SPACING + RADIUS + 4.0,
    );
    let size = [
        f64::from(centre.x + 2.0 * SPACING + RADIUS + MARGIN),
        f64::from(centre.y + RADIUS + 20.0),
    ];
    let plot = Plot::new(size, "BSDF over incident directions", |canvas| {
        for (view, chunk) in irawan_exitant().iter().zip(values.chunks(SIDE * SIDE)) {
            let turn = view.phi_deg.to_radians() as f32;
            let away = view.theta_deg as f32 / 30.0 * SPACING;
            let middle = centre + away * Vec2::new(turn.cos(), -turn.sin());
            for (k, value) in chunk.iter().enumerate() {
                let at = Vec2::new((k % SIDE) as f32, (k / SIDE) as f32);
                let corner = |offset: [f32; 2]| {
                    let p = middle + RADIUS * on_disk(at + Vec2::from(offset));
                    (fine(f64::from(p.x)), fine(f64::from(p.y)))
                };
                let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(corner);
                let colour = paint(pixel(value.bsdf.mean, gain));
                canvas.draw(&Polygon::new(corners.to_vec(), colour.filled()))?;
            }
            let below = f64::from(middle.y + RADIUS) + 8.0;
            let words = format!("{:.0}\u{b0}, {:.0}\u{b0}", view.theta_deg, view.phi_deg);
            let at = (fine(f64::from(middle.x)), fine(below));
            draw_text(canvas, &words, at, HPos::Center, INK)?;
        }
        Ok(Vec::new())
    })?;
    Ok(Plot {
        is_mosaic: true,
        ..plot
    })
}

/// Place of a grid point of the layout in the unit disk, y down.
fn on_disk(at: Vec2) -> Vec2 {
    let square = (at / (SIDE - 1) as f32).clamp(Vec2::ZERO, Vec2::ONE);
    let disk = warp::concentric_disk(square);
    let cos = 1.0 - disk.length_squared().min(1.0) * (1.0 - STEEPEST_DEG.to_radians().cos());
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    let p = disk.normalize_or_zero() * sin;
    Vec2::new(p.x, -p.y)
}
