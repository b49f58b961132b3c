//! Light from infinity, from a picture of all directions.

use crate::light::{KernelLight, LightSample, LightSearch, LightSource};
use crate::mitsuba::{self, MitsubaLight};
use crate::picture_map::PictureMap;
use glam::{UVec2, Vec3};
use organza_basis::{AliasTable, PathRng, Rgb};
use organza_lanes::V3;
use std::f32::consts::TAU;
use std::sync::Arc;

/// An equirectangular picture around the scene, linear between pixel centres.
///
/// Rows go from the direction `up` down to its opposite, columns turn about
/// it: the picture's middle is seen toward `centre`, its left edge is reached
/// by turning to the left (about `up`, counter-clockwise from above).
///
/// Directions are drawn by luminance: a pixel in proportion to the integral of
/// the interpolated luminance over it, then uniformly in its solid angle, so
/// that the density is known exactly and is zero nowhere where there is light.
#[derive(Clone, Debug)]
pub struct ImageEnvironment {
    map: PictureMap,
    pixels: Vec<Rgb>,
    /// None of a black picture.
    table: Option<AliasTable>,
    /// Cosines of the polar angles between rows, from 1 to -1.
    row_cosines: Vec<f32>,
}

/// A picture or directions that make no environment.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImageEnvironmentError {
    /// Pixels do not fill the picture.
    #[error("{size} pixels expected, {count} given")]
    Size {
        /// Columns and rows.
        size: UVec2,
        /// How many there are.
        count: usize,
    },
    /// No number.
    #[error("pixel ({x}, {y}) is {value:?}; expected finite numbers of at least 0", x = .at.x, y = .at.y)]
    Pixel {
        /// Column and row.
        at: UVec2,
        /// What is there.
        value: Rgb,
    },
    /// No frame.
    #[error("up and centre must be finite and not parallel")]
    Frame,
}

impl ImageEnvironment {
    /// An environment from pixels in rows from the top. `centre` is turned
    /// until it is perpendicular to `up`.
    ///
    /// # Errors
    /// A wrong number of pixels, a pixel that is negative or not finite, or
    /// directions that give no frame.
    pub fn new(
        size: UVec2,
        pixels: Vec<Rgb>,
        up: Vec3,
        centre: Vec3,
    ) -> Result<ImageEnvironment, ImageEnvironmentError> {
        let count = u64::from(size.x) * u64::from(size.y);
        if count == 0 || pixels.len() as u64 != count {
            let count = pixels.len();
            return Err(ImageEnvironmentError::Size { size, count });
        }
        if let Some(i) = pixels.iter().position(|p| !p.is_valid()) {
            let i_u32 = i as u32;
            return Err(ImageEnvironmentError::Pixel {
                at: UVec2::new(i_u32 % size.x, i_u32 / size.x),
                value: pixels[i],
            });
        }
        let frame = || {
            let up = up.try_normalize()?;
            let centre = (centre - centre.dot(up) * up).try_normalize()?;
            Some((up, centre, up.cross(centre)))
        };
        let (up, centre, left) = frame().ok_or(ImageEnvironmentError::Frame)?;
        let row_cosines = (0..=size.y)
            .map(|y| (std::f64::consts::PI * f64::from(y) / f64::from(size.y)).cos() as f32)
            .collect();
        let mut made = ImageEnvironment {
            map: PictureMap {
                size,
                up,
                centre,
                left,
            },
            pixels,
            table: None,
            row_cosines,
        };
        made.table = AliasTable::new(&made.weights());
        Ok(made)
    }

    /// Columns and rows.
    pub fn size(&self) -> UVec2 {
        self.map.size
    }

    /// Radiance per pixel, in rows from the top.
    pub fn pixels(&self) -> &[Rgb] {
        &self.pixels
    }

    /// Where directions lie in it.
    pub fn map(&self) -> &PictureMap {
        &self.map
    }

    /// Integral of the interpolated luminance over every pixel, but for what
    /// the solid angle varies within it.
    fn weights(&self) -> Vec<f64> {
        let (width, height) = (self.map.size.x as usize, self.map.size.y as usize);
        let luminance = |x: usize, y: usize| f64::from(self.pixels[y * width + x].luminance());
        // A tent about each centre gives 3/4 to its own pixel, 1/8 to each neighbour.
        let along_row = |x: usize, y: usize| {
            let (before, after) = ((x + width - 1) % width, (x + 1) % width);
            0.75 * luminance(x, y) + 0.125 * (luminance(before, y) + luminance(after, y))
        };
        let mut weights = Vec::with_capacity(width * height);
        for y in 0..height {
            let solid_angle = f64::from(self.row_cosines[y] - self.row_cosines[y + 1]);
            let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
            weights.extend((0..width).map(|x| {
                let column =
                    0.75 * along_row(x, y) + 0.125 * (along_row(x, above) + along_row(x, below));
                column * solid_angle
            }));
        }
        weights
    }

    /// Radiance seen along a direction of sight.
    pub fn radiance_toward(&self, w: Vec3) -> Rgb {
        let corners = self.map.corners::<f32>(V3::splat(w));
        let [a, b, c, d] = corners.pixels.map(|i| self.pixels[i.0 as usize].0);
        let of = |axis: usize| corners.between([a[axis], b[axis], c[axis], d[axis]]);
        Rgb::new(of(0), of(1), of(2))
    }

    /// A direction by luminance, with its density.
    pub fn sample(&self, rng: &mut PathRng) -> Option<(Vec3, f32)> {
        let index = self.table.as_ref()?.sample(rng);
        let (column, row) = (
            index % self.map.size.x as usize,
            index / self.map.size.x as usize,
        );
        let s = rng.unit2();
        let (top, bottom) = (self.row_cosines[row], self.row_cosines[row + 1]);
        let z = top + s.y * (bottom - top);
        let r = (1.0 - z * z).max(0.0).sqrt();
        let phi = TAU * (0.5 - (column as f32 + s.x) / self.map.size.x as f32);
        let (sin, cos) = phi.sin_cos();
        let map = &self.map;
        let w = r * cos * map.centre + r * sin * map.left + z * map.up;
        let w = w.normalize();
        Some((w, self.pdf(w)))
    }

    /// Density of [`ImageEnvironment::sample`], 1/sr.
    pub fn pdf(&self, w: Vec3) -> f32 {
        let Some(table) = &self.table else {
            return 0.0;
        };
        let [x, y] = self.map.place::<f32>(V3::splat(w));
        let column = (x as usize).min(self.map.size.x as usize - 1);
        let row = (y as usize).min(self.map.size.y as usize - 1);
        let cosines = self.row_cosines[row] - self.row_cosines[row + 1];
        let solid_angle = cosines * TAU / self.map.size.x as f32;
        table.probability(row * self.map.size.x as usize + column) / solid_angle
    }
}

/// A picture of all directions as a light.
#[derive(Clone, Debug)]
pub struct ImageLight {
    /// The picture.
    pub image: Arc<ImageEnvironment>,
    /// How it is found.
    pub search: LightSearch,
}

impl LightSource for ImageLight {
    fn radiance_toward(&self, direction: Vec3) -> Rgb {
        self.image.radiance_toward(direction)
    }

    fn search(&self) -> LightSearch {
        self.search
    }

    fn sample_toward(&self, _: Vec3, rng: &mut PathRng) -> Option<LightSample> {
        if self.search == LightSearch::Walk {
            return None;
        }
        let (w_in, pdf) = self.image.sample(rng)?;
        Some(LightSample {
            w_in,
            irradiance: self.image.radiance_toward(w_in) / pdf,
            pdf,
        })
    }

    fn pdf_toward(&self, _: Vec3, w_in: Vec3) -> f32 {
        self.image.pdf(w_in)
    }

    fn for_kernel(&self) -> KernelLight<'_> {
        KernelLight::Picture(&self.image)
    }

    fn for_mitsuba(&self, index: usize) -> Result<MitsubaLight, String> {
        Ok(self.image.for_mitsuba(index))
    }
}

impl ImageEnvironment {
    /// The picture as Mitsuba's environment, of twice the rows: its first and last
    /// row lie at the poles.
    pub(crate) fn for_mitsuba(&self, index: usize) -> MitsubaLight {
        let name = format!("light{index}.exr");
        let (size, pixels) = rows_from_pole_to_pole(self);
        let PictureMap {
            up, centre, left, ..
        } = self.map;
        let xml = format!(
            r#"    <emitter type="envmap">
        <string name="filename" value="{name}"/>
        {}
    </emitter>
"#,
            mitsuba::matrix([left, up, centre], Vec3::ZERO)
        );
        MitsubaLight {
            xml,
            pictures: vec![(name, size, pixels)],
            notes: Vec::new(),
            is_environment: true,
        }
    }
}

/// The picture as Mitsuba looks it up: rows from pole to pole, ends included.
/// At twice the rows, less one shared, both interpolations are the same.
fn rows_from_pole_to_pole(image: &ImageEnvironment) -> (UVec2, Vec<Rgb>) {
    let (width, height) = (image.size().x as usize, image.size().y as usize);
    let row = |y: usize| &image.pixels()[y * width..(y + 1) * width];
    let mut pixels = Vec::with_capacity(width * (2 * height + 1));
    for y in 0..=2 * height {
        // Odd rows are centres of pixels, even ones lie between two.
        let (above, below) = ((y.max(1) - 1) / 2, (y / 2).min(height - 1));
        let between = row(above).iter().zip(row(below));
        pixels.extend(between.map(|(&a, &b)| 0.5 * (a + b)));
    }
    (UVec2::new(width as u32, 2 * height as u32 + 1), pixels)
}
