//! Patterns printed on a cloth: an image that dyes the fibres near its faces.

use super::{Cloth, CurveLevel, Material};
use crate::Error;
use crate::palette::{nearest, palette, seen};
use glam::{DVec2, Vec2, Vec3};
use organza_basis::{Rgb, Segment, SegmentSource, Tile};
use serde::Deserialize;

/// Most pixels along an edge of an image.
const MAX_EDGE: u32 = 8192;
/// Most materials of a printed cloth: each has tables of its own.
const MAX_MATERIALS: usize = 4096;
/// How far the size of an image may be from one that fits, as a share: it is stretched.
const MAX_STRETCH: f64 = 0.01;
/// Share of the cloth's thickness that ink enters where no depth is given (estimated).
const DEPTH: f32 = 1.0 / 3.0;
/// Most cells of the map of heights along an edge.
const MAX_HEIGHTS: usize = 2048;
/// Most parts into which a segment is divided.
const MAX_PARTS: usize = 64;
/// Colour of undyed thread.
const UNDYED: Rgb = Rgb::new(0.8, 0.8, 0.8);

/// `[print]`: an image on the cloth.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct PrintSpec {
    /// Picture file, beside the fabric's.
    pub image: String,
    /// Width and height of one copy; those of the tile if none. The tile must hold a whole
    /// number of copies.
    pub size_mm: Option<[f64; 2]>,
    /// Which faces carry it.
    #[serde(default)]
    pub side: PrintSide,
    /// How deep below the surface it reaches; a third of the thickness if none.
    pub depth_um: Option<f64>,
    /// What becomes of the colour of the fibres.
    #[serde(default)]
    pub mode: PrintMode,
    /// Colours to which the image is reduced, 2 to 256.
    #[serde(default = "colours")]
    pub colours: u32,
}

fn colours() -> u32 {
    24
}

/// Printed faces.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum PrintSide {
    /// The face, which is up.
    #[default]
    Face,
    /// The back.
    Back,
    /// Both, with the same image: seen from the back it is mirrored.
    Both,
}

/// What becomes of the colour of the fibres.
#[derive(Clone, Copy, Debug, Default, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum PrintMode {
    /// It is multiplied by that of the image, as by a dye.
    #[default]
    Multiply,
    /// That of the image takes its place, as with a discharge print.
    Replace,
}

/// A picture to print: colours in linear RGB, rows from the top.
#[derive(Clone, Debug)]
pub struct PrintImage {
    /// Pixels along a row, and rows.
    pub size: [u32; 2],
    /// Colours, row by row.
    pub pixels: Vec<Rgb>,
}

/// The print of a cloth.
#[derive(Clone, Debug)]
pub(super) struct Print {
    spec: PrintSpec,
    size: [usize; 2],
    /// Number of the colour of every pixel.
    pixels: Vec<u8>,
    /// Corner of the tile, and size of one copy of the image.
    corner_mm: Vec2,
    copy_mm: Vec2,
    depth_mm: f32,
    heights: Heights,
    /// Material of every colour on every material of the plain cloth.
    materials: Vec<u16>,
    colours: usize,
}

impl Cloth {
    /// Prints an image on the cloth: from now on its segments have the materials of the print.
    ///
    /// # Errors
    /// The key of `[print]` at fault.
    pub fn print(&mut self, spec: &PrintSpec, image: &PrintImage) -> Result<(), Error> {
        let copy_mm = copy_size(spec, self.tile)?;
        check(spec, image)?;
        let palette = palette(&image.pixels, spec.colours as usize);
        let plain = self.materials.len();
        if plain * (1 + palette.len()) > MAX_MATERIALS {
            let message = format!(
                "expected at most {}, as the cloth has {plain} colours of its own, found {}",
                (MAX_MATERIALS / plain).saturating_sub(1),
                spec.colours
            );
            return Err(Error::spec("print.colours", message));
        }
        let mut materials = Vec::with_capacity(plain * palette.len());
        for own in 0..plain {
            for ink in &palette {
                let before = &self.materials[own];
                let base = before.colour.unwrap_or(UNDYED);
                let colour = match spec.mode {
                    PrintMode::Multiply => Rgb(base.0 * ink.0),
                    PrintMode::Replace => *ink,
                };
                let new = Material {
                    colour: Some(colour),
                    ..before.clone()
                };
                let known = self.materials.iter().position(|m| *m == new);
                let index = known.unwrap_or_else(|| {
                    self.materials.push(new);
                    self.materials.len() - 1
                });
                materials.push(index as u16);
            }
        }
        let inks: Vec<Vec3> = palette.iter().map(|ink| seen(*ink)).collect();
        let nearest = |pixel: &Rgb| nearest(&inks, seen(*pixel)) as u8;
        let heights = Heights::of(self);
        let thickness = heights.thickness_mm();
        self.print = Some(std::sync::Arc::new(Print {
            spec: spec.clone(),
            size: image.size.map(|n| n as usize),
            pixels: image.pixels.iter().map(nearest).collect(),
            corner_mm: self.tile.bounds_mm.min.truncate(),
            copy_mm,
            depth_mm: spec
                .depth_um
                .map_or(DEPTH * thickness, |um| um as f32 * 1e-3),
            heights,
            materials,
            colours: palette.len(),
        }));
        Ok(())
    }

    /// Half the width and half the height of a thread over the radius of its segments.
    fn half_size(&self, thread: u32) -> Vec2 {
        let Some(thread) = self.threads.get(thread as usize) else {
            // A tuft.
            return Vec2::ONE;
        };
        let flatten = thread.section.flatten;
        let ratio = (flatten.x / flatten.y).sqrt() as f32;
        Vec2::new(ratio, 1.0 / ratio)
    }
}

fn check(spec: &PrintSpec, image: &PrintImage) -> Result<(), Error> {
    let fail = |key: &str, message: String| Err(Error::spec(format!("print.{key}"), message));
    let [width, height] = image.size;
    let edges = 1..=MAX_EDGE;
    if !edges.contains(&width) || !edges.contains(&height) {
        return fail(
            "image",
            format!("expected 1 to {MAX_EDGE} pixels along an edge, found {width} x {height}"),
        );
    }
    if let Some(bad) = image.pixels.iter().find(|p| !p.is_valid()) {
        return fail("image", format!("expected finite colours, found {bad:?}"));
    }
    if !(2..=256).contains(&spec.colours) {
        return fail(
            "colours",
            format!("expected 2 to 256, found {}", spec.colours),
        );
    }
    match spec.depth_um {
        Some(um) if !(0.0..=1e6).contains(&um) => fail(
            "depth_um",
            format!("expected a number from 0 to 1e6, found {um}"),
        ),
        _ => Ok(()),
    }
}

/// The size of one copy, of which the tile holds a whole number.
fn copy_size(spec: &PrintSpec, tile: Tile) -> Result<Vec2, Error> {
    let period = tile.period_mm();
    let Some(size) = spec.size_mm else {
        return Ok(period);
    };
    let mut copies = [1.0; 2];
    for (i, copies) in copies.iter_mut().enumerate() {
        let (size, period) = (size[i], f64::from(period[i]));
        let some = (1e-3..=1e6).contains(&size);
        *copies = if some {
            (period / size).round().max(1.0)
        } else {
            1.0
        };
        if !some || (*copies * size / period - 1.0).abs() > MAX_STRETCH {
            let fitting = |n: f64| format!("{:.3}", period / n);
            let (axis, other) = [("width", "1e6"), ("height", "1e6")][i];
            let near = *copies;
            let near = match near {
                n if n <= 1.0 => fitting(1.0),
                n => format!("{} or {}", fitting(n), fitting(n - 1.0)),
            };
            return Err(Error::spec(
                "print.size_mm",
                format!(
                    "expected a {axis} from 0.001 to {other} mm that the tile of {period:.3} mm holds \
                     a whole number of times, found {size}; near are {near}"
                ),
            ));
        }
    }
    Ok(period / DVec2::from(copies).as_vec2())
}

impl Print {
    /// Gives a segment the materials of the print, in as many parts as it has colours.
    pub fn dye(&self, segment: &Segment, emit: &mut dyn FnMut(&Segment)) {
        let pixel = self.copy_mm.x / self.size[0] as f32;
        let part = pixel.max(2.0 * segment.start_radius_mm.max(segment.end_radius_mm));
        let parts = (segment.length_mm() / part).ceil() as usize;
        let parts = parts.clamp(1, MAX_PARTS);
        let of = |i: usize| {
            let share = (i as f32 + 0.5) / parts as f32;
            self.material(
                segment.material,
                segment.start_mm.lerp(segment.end_mm, share),
            )
        };
        let (mut from, mut material) = (0, of(0));
        for i in 1..=parts {
            let next = if i < parts { of(i) } else { material };
            if i < parts && next == material {
                continue;
            }
            let printed = match (from, i) {
                (0, all) if all == parts => Segment {
                    material,
                    ..*segment
                },
                _ => Segment {
                    material,
                    ..cut(segment, [from, i].map(|k| k as f32 / parts as f32))
                },
            };
            emit(&printed);
            (from, material) = (i, next);
        }
    }

    /// The material of a place whose fibre has another one on the plain cloth.
    fn material(&self, plain: u16, at_mm: Vec3) -> u16 {
        let [low, high] = self.heights.at(at_mm.truncate());
        let on_face = at_mm.z >= high - self.depth_mm;
        let on_back = at_mm.z <= low + self.depth_mm;
        let is_printed = match self.spec.side {
            PrintSide::Face => on_face,
            PrintSide::Back => on_back,
            PrintSide::Both => on_face || on_back,
        };
        if !is_printed {
            return plain;
        }
        let place = (at_mm.truncate() - self.corner_mm) / self.copy_mm;
        let pixel = |share: f32, count: usize| {
            ((share.rem_euclid(1.0) * count as f32) as usize).min(count - 1)
        };
        // Rows run from the top.
        let [column, row] = [
            pixel(place.x, self.size[0]),
            self.size[1] - 1 - pixel(place.y, self.size[1]),
        ];
        let colour = usize::from(self.pixels[row * self.size[0] + column]);
        self.materials[usize::from(plain) * self.colours + colour]
    }
}

/// The piece of a segment between two shares of it.
fn cut(s: &Segment, shares: [f32; 2]) -> Segment {
    let point = |t: f32| s.start_mm.lerp(s.end_mm, t);
    let radius = |t: f32| s.start_radius_mm + (s.end_radius_mm - s.start_radius_mm) * t;
    let tangent = |t: f32| {
        let between = s.start_tangent.lerp(s.end_tangent, t);
        between.try_normalize().unwrap_or(s.start_tangent)
    };
    let [a, b] = shares;
    Segment {
        start_mm: point(a),
        end_mm: point(b),
        start_radius_mm: radius(a),
        end_radius_mm: radius(b),
        start_tangent: tangent(a),
        end_tangent: tangent(b),
        ..*s
    }
}

/// Where the lowest and the highest yarn lies, by place.
#[derive(Clone, Debug)]
struct Heights {
    corner_mm: Vec2,
    cell_mm: Vec2,
    counts: [usize; 2],
    low_high_mm: Vec<[f32; 2]>,
    repeats: bool,
}

impl Heights {
    fn of(cloth: &Cloth) -> Heights {
        let tile = cloth.tile;
        let period = tile.period_mm();
        let yarns = cloth.curves(CurveLevel::Yarn);
        let mut thinnest = f32::INFINITY;
        let each = |visit: &mut dyn FnMut(&Segment)| {
            for batch in 0..yarns.batch_count() {
                yarns.for_each_in_batch(batch, visit);
            }
        };
        each(&mut |s| thinnest = thinnest.min(s.start_radius_mm.max(1e-6)));
        let counts = [period.x, period.y].map(|mm| {
            let cells = (4.0 * mm / thinnest).ceil();
            (cells as usize).clamp(1, MAX_HEIGHTS)
        });
        let cell_mm = period / Vec2::new(counts[0] as f32, counts[1] as f32);
        let mut heights = Heights {
            corner_mm: tile.bounds_mm.min.truncate(),
            cell_mm,
            counts,
            low_high_mm: vec![[f32::INFINITY, f32::NEG_INFINITY]; counts[0] * counts[1]],
            repeats: tile.repeats,
        };
        each(&mut |s| {
            let half = cloth.half_size(s.yarn) * s.start_radius_mm.max(s.end_radius_mm);
            let steps = (2.0 * s.length_mm() / cell_mm.min_element()).ceil();
            let steps = steps.clamp(1.0, 4096.0) as usize;
            for i in 0..=steps {
                heights.raise(s.start_mm.lerp(s.end_mm, i as f32 / steps as f32), half);
            }
        });
        heights
    }

    /// Takes a round spot of a yarn into account.
    fn raise(&mut self, centre_mm: Vec3, half_mm: Vec2) {
        let reach = (half_mm.x / self.cell_mm).ceil().min(Vec2::splat(64.0));
        let middle = ((centre_mm.truncate() - self.corner_mm) / self.cell_mm).floor();
        let [rx, ry] = [reach.x as i64, reach.y as i64];
        for dy in -ry..=ry {
            for dx in -rx..=rx {
                let steps = Vec2::new(dx as f32, dy as f32);
                let aside = (steps * self.cell_mm).length() / half_mm.x;
                if aside > 1.0 {
                    continue;
                }
                if let Some(cell) = self.cell(middle + steps) {
                    let half = half_mm.y * (1.0 - aside * aside).sqrt();
                    let [low, high] = &mut self.low_high_mm[cell];
                    *low = low.min(centre_mm.z - half);
                    *high = high.max(centre_mm.z + half);
                }
            }
        }
    }

    fn cell(&self, cell: Vec2) -> Option<usize> {
        let [x, y] = [cell.x as i64, cell.y as i64];
        let [nx, ny] = self.counts.map(|n| n as i64);
        let inside = (0..nx).contains(&x) && (0..ny).contains(&y);
        if !inside && !self.repeats {
            return None;
        }
        Some((y.rem_euclid(ny) * nx + x.rem_euclid(nx)) as usize)
    }

    /// Lowest and highest place of yarns; all of space where there are none.
    fn at(&self, place_mm: Vec2) -> [f32; 2] {
        let cell = ((place_mm - self.corner_mm) / self.cell_mm).floor();
        let found = self.cell(cell).map(|cell| self.low_high_mm[cell]);
        match found {
            Some([low, high]) if low <= high => [low, high],
            // What hangs in a gap is reached from both faces.
            _ => [f32::INFINITY, f32::NEG_INFINITY],
        }
    }

    fn thickness_mm(&self) -> f32 {
        let low = self.low_high_mm.iter().map(|h| h[0]);
        let high = self.low_high_mm.iter().map(|h| h[1]);
        let thickness = high.fold(f32::NEG_INFINITY, f32::max) - low.fold(f32::INFINITY, f32::min);
        if thickness.is_finite() {
            thickness
        } else {
            0.0
        }
    }
}
