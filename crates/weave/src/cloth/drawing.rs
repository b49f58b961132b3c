//! Drawings of curves: a quick look at yarns, plies and fibres without light
//! transport.

use super::{Cloth, CurveLevel};
use crate::Picture;
use glam::{Vec2, Vec3};
use organza_basis::{Rgb, Segment, SegmentSource};

/// Width of a drawing, pixels.
const WIDTH: usize = 900;

/// A picture with the nearest surface in each pixel.
struct Canvas {
    size: (usize, usize),
    depth: Vec<f32>,
    rgb: Vec<Vec3>,
}

impl Canvas {
    fn new(width: usize, height: usize) -> Canvas {
        Canvas {
            size: (width, height),
            depth: vec![f32::NEG_INFINITY; width * height],
            rgb: vec![Vec3::splat(0.9); width * height],
        }
    }

    /// A lit capsule between points in pixels, z towards the eye.
    fn capsule(&mut self, a: Vec3, b: Vec3, radius: f32, colour: Vec3) {
        let light = Vec3::new(-0.4, 0.3, 0.85).normalize();
        let low = a.min(b).truncate() - radius;
        let high = a.max(b).truncate() + radius;
        let range = |low: f32, high: f32, n: usize| {
            (low.max(0.0) as usize).min(n)..((high + 1.0).max(0.0) as usize).min(n)
        };
        let axis = (b - a).truncate();
        let along = (b - a).normalize_or(Vec3::X);
        for y in range(low.y, high.y, self.size.1) {
            for x in range(low.x, high.x, self.size.0) {
                let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                let t = ((p - a.truncate()).dot(axis) / axis.length_squared().max(1e-9))
                    .clamp(0.0, 1.0);
                let centre = a + t * (b - a);
                let off = p - centre.truncate();
                let rise = radius * radius - off.length_squared();
                if rise < 0.0 {
                    continue;
                }
                let z = centre.z + rise.sqrt();
                let i = y * self.size.0 + x;
                if z > self.depth[i] {
                    let mut n = off.extend(rise.sqrt()) / radius;
                    n = (n - n.dot(along) * along).normalize_or(Vec3::Z);
                    let sheen = (n.dot((light + Vec3::Z).normalize()).max(0.0)).powi(30);
                    self.depth[i] = z;
                    self.rgb[i] = colour * (0.2 + 0.7 * n.dot(light).max(0.0)) + 0.15 * sheen;
                }
            }
        }
    }

    /// The picture with y upwards.
    fn picture(&self) -> Picture {
        let (w, h) = self.size;
        let rows = self.rgb.chunks_exact(w).rev().flatten();
        Picture {
            width: w as u32,
            height: h as u32,
            rgb: rows.flat_map(|c| c.to_array().map(Rgb::srgb8)).collect(),
        }
    }
}

impl Cloth {
    /// How much cloth a drawing shows by default: a tile, but at least 2 and at most 6 mm.
    pub fn default_picture_mm(&self) -> Vec2 {
        Vec2::splat(self.tile().period_mm().min_element().clamp(2.0, 6.0))
    }

    /// The face of the cloth seen from above, every curve a lit tube in the
    /// colour of its thread.
    pub fn picture(&self, level: CurveLevel, shown_mm: Vec2) -> Picture {
        let scale = WIDTH as f32 / shown_mm.x;
        let mut canvas = Canvas::new(WIDTH, (shown_mm.y * scale) as usize);
        self.for_each_copy(level, shown_mm, |s| {
            let radius = s.start_radius_mm.max(s.end_radius_mm) * scale;
            canvas.capsule(s.start_mm * scale, s.end_mm * scale, radius, self.tint(s));
        });
        canvas.picture()
    }

    fn tint(&self, s: &Segment) -> Vec3 {
        let warp = s.start_tangent.y.abs() > s.start_tangent.x.abs();
        let plain = if warp {
            Rgb::new(0.15, 0.25, 0.6)
        } else {
            Rgb::new(0.75, 0.65, 0.45)
        };
        let material = &self.materials()[usize::from(s.material)];
        material.colour.unwrap_or(plain).0
    }

    /// Every segment of every copy of the tile that may be visible in `[0, shown_mm)^2`.
    fn for_each_copy(&self, level: CurveLevel, shown_mm: Vec2, mut draw: impl FnMut(&Segment)) {
        let source = self.curves(level);
        let tile = source.tile();
        let period = tile.period_mm();
        let (first, copies) = if tile.repeats {
            (-1, (shown_mm / period).ceil())
        } else {
            (0, Vec2::ZERO)
        };
        for batch in 0..source.batch_count() {
            source.for_each_in_batch(batch, &mut |s| {
                for i in first..=copies.x as i32 {
                    for j in first..=copies.y as i32 {
                        let shift = Vec3::new(i as f32 * period.x, j as f32 * period.y, 0.0);
                        let mut s = *s;
                        s.start_mm += shift;
                        s.end_mm += shift;
                        draw(&s);
                    }
                }
            });
        }
    }
}
