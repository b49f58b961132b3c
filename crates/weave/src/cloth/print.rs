//! Patterns printed on a cloth, and dye of the whole piece: colours of the fibres near its faces.

use super::Cloth;
use super::heights::Heights;
use super::recolour::{MAX_MATERIALS, recoloured};
use super::wear::undyed;
use crate::Error;
use crate::palette::{nearest, palette, seen};
use glam::{DVec2, Vec2, Vec3};
use organza_basis::{Rgb, Segment, Tile};
use serde::Deserialize;

/// Most pixels along an edge of an image.
const MAX_EDGE: u32 = 8192;
/// How far the size of an image may be from one that fits, as a share: it is stretched.
const MAX_STRETCH: f64 = 0.01;
/// Share of the cloth's thickness that ink enters where no depth is given (estimated).
const DEPTH: f32 = 1.0 / 3.0;

/// `[print]`: an image on the cloth, or one colour.
#[derive(Clone, Debug, Deserialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct PrintSpec {
    /// Picture file, beside the fabric's.
    pub image: Option<String>,
    /// In place of an image: one colour everywhere, as of a dye bath, linear, 0 to 1.
    pub colour: Option<Rgb>,
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
    /// Colour of fibres that lost their dye, linear, 0 to 1; only for `discharge`. That of undyed
    /// cotton if none.
    pub undyed: Option<Rgb>,
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
    /// That of the image takes its place, as pigment does, or a discharge paste with dye in it.
    Replace,
    /// It fades towards `undyed`, as where a paste discharges the dye: fully where the image is
    /// white.
    Discharge,
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
    /// Prints an image on the cloth, which is one pixel where `spec` gives a colour instead: from now
    /// on its segments have the materials of the print.
    ///
    /// # Errors
    /// The key of `[print]` at fault.
    pub fn print(&mut self, spec: &PrintSpec, image: &PrintImage) -> Result<(), Error> {
        check(spec, image)?;
        let copy_mm = copy_size(spec, self.tile)?;
        let palette = match spec.colour {
            Some(colour) => vec![colour],
            None => palette(&image.pixels, spec.colours as usize),
        };
        let plain = self.materials.len();
        if plain * (1 + palette.len()) > MAX_MATERIALS {
            let message = format!(
                "expected at most {}, as the cloth has {plain} colours of its own, found {}",
                (MAX_MATERIALS / plain).saturating_sub(1),
                spec.colours
            );
            return Err(Error::spec("print.colours", message));
        }
        let materials = self.recolour(palette.len(), |own, ink| match spec.mode {
            PrintMode::Multiply => Rgb(own.0 * palette[ink].0),
            PrintMode::Replace => palette[ink],
            PrintMode::Discharge => {
                let undyed = spec.undyed.unwrap_or_else(undyed);
                Rgb(own
                    .0
                    .lerp(undyed.0, palette[ink].luminance().clamp(0.0, 1.0)))
            }
        });
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
}

fn check(spec: &PrintSpec, image: &PrintImage) -> Result<(), Error> {
    let fail = |key: &str, message: String| Err(Error::spec(format!("print.{key}"), message));
    if let Some(colour) = spec.colour {
        let channels = colour.0.to_array();
        if let Some(c) = channels.iter().find(|c| !(0.0..=1.0).contains(*c)) {
            return fail("colour", format!("expected numbers from 0 to 1, found {c}"));
        }
        if spec.size_mm.is_some() {
            return fail("size_mm", "only applies to an image".to_owned());
        }
    }
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
    match (spec.undyed, spec.mode) {
        (None, _) => {}
        (Some(_), PrintMode::Multiply | PrintMode::Replace) => {
            let message = "only applies to mode = \"discharge\"".to_owned();
            return fail("undyed", message);
        }
        (Some(undyed), PrintMode::Discharge) => {
            let channels = undyed.0.to_array();
            if let Some(c) = channels.iter().find(|c| !(0.0..=1.0).contains(*c)) {
                return fail("undyed", format!("expected numbers from 0 to 1, found {c}"));
            }
        }
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
        // One colour changes with depth alone.
        let pixel = match self.spec.colour {
            Some(_) => 0.0,
            None => self.copy_mm.x / self.size[0] as f32,
        };
        let part = pixel.max(2.0 * segment.start_radius_mm.max(segment.end_radius_mm));
        recoloured(
            segment,
            part,
            |plain, at_mm| self.material(plain, at_mm),
            emit,
        );
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
