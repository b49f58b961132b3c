//! Light from infinity as a picture, for lanes.
//!
//! The picture is split texel by texel into a sum of two: a sky, which is as
//! bright as a few times its own mean at the most and which walks find by
//! escaping, and what is brighter than that, the lamps, which shadow rays find.
//! Interpolation is linear, so both parts interpolated add up to the picture,
//! and neither is found twice: there is nothing to weigh.
//!
//! A lamp is what is bright within a cap. Directions are drawn from it by
//! luminance: a texel, then a place in the tent that interpolation spreads it
//! over, so that the light along a drawn direction is nearly the same for all
//! of them. A [`OpticalDepthTable`] toward the lamp's middle says how much comes
//! through, and an occasional exact ray along the drawn direction sets it right.

use super::flat_medium::FlatMedium;
use super::optical_depth_table::{Nodes, OpticalDepthTable, extinctions};
use glam::Vec3;
use organza_basis::{AliasTable, Rgb};
use organza_lanes::math::V3;
use organza_lanes::{Floats, Ints, vector_of, word_of};
use organza_light::{Corners, ImageEnvironment, PictureMap};
use std::f32::consts::{PI, TAU};

/// How many times as bright as its own mean the sky may be. Escaping walks
/// then spread at most about this much more than under a uniform sky.
const SKY_CONTRAST: f64 = 4.0;

/// Cosine of the angle between a lamp's middle and its rim, 20 degrees, within
/// which one table serves; and most lamps. What is left over goes to the
/// nearest: a table that fits badly costs exact rays and nothing else.
const RIM_COSINE: f32 = 0.94;
const MAX_LAMPS: usize = 4;

/// What is brighter than the sky may be is left in it when it is less than this
/// share of the picture's light.
const MIN_SHARE: f64 = 0.02;

/// Rounds in which the bound and the mean of what stays below it settle.
const ROUNDS: usize = 64;

/// Words of a texel in a picture, and of a place to draw in a lamp.
const TEXEL: u32 = 3;
const PLACE: u32 = 8;

/// A picture around the scene.
pub struct Sky {
    /// Where directions lie in it.
    pub map: PictureMap,
    /// Red, green and blue of the sky's texels as bits of `f32`, then the same
    /// of the whole picture, unless that is all there is.
    pub texels: Vec<u32>,
    /// Where the whole picture begins.
    pub whole: u32,
    /// What is brighter.
    pub lamps: Vec<Lamp>,
    /// The greatest texel.
    pub brightest: f32,
}

/// A part of a picture that shadow rays find.
pub struct Lamp {
    /// Depths toward its middle.
    pub table: OpticalDepthTable,
    /// For every place of an alias table [Walker1977] eight words: the share
    /// of its texel, where that begins which has the rest, column and row;
    /// then red, green and blue times the solid angle of a texel at the equator
    /// over the texel's probability, and two that are unused.
    pub places: Vec<u32>,
    /// Slots, a power of two, so that all are drawn alike.
    pub count: u32,
}

/// Directions drawn toward a lamp.
pub struct LampSample<F: Floats> {
    pub to_light: V3<F>,
    /// Radiance over density.
    pub irradiance: V3<F>,
}

impl Sky {
    /// Lays a picture out for lanes.
    pub fn new(medium: &FlatMedium, nodes: Nodes, image: &ImageEnvironment, parts: &Parts) -> Sky {
        let (texels, whole) = texel_words(image, parts);
        let lamps = parts.lamps.iter();
        let brightest = image.pixels().iter().map(|p| p.max_component());
        Sky {
            map: *image.map(),
            texels,
            whole,
            lamps: lamps
                .filter_map(|lamp| Lamp::new(medium, nodes, image, lamp))
                .collect(),
            brightest: brightest.fold(0.0, f32::max),
        }
    }

    /// Bytes in use.
    pub fn memory_bytes(&self) -> u64 {
        let places: usize = self.lamps.iter().map(|l| l.places.len()).sum();
        let tables: u64 = self.lamps.iter().map(|l| l.table.memory_bytes()).sum();
        4 * (self.texels.len() + places) as u64 + tables
    }

    /// A twin that is wrong: walks find the lamps once more.
    pub fn show_lamps_to_all(&mut self) {
        let whole = self.texels.split_off(self.whole as usize);
        self.texels = whole;
        self.whole = 0;
    }

    /// Radiance along directions of sight: the sky's, or the whole picture's
    /// where nothing looked for the lamps.
    #[inline(always)]
    pub fn radiance_toward<F: Floats>(&self, w: V3<F>, whole: F::Mask) -> V3<F> {
        let corners = self.map.corners(w);
        let base = F::Ints::splat(self.whole).or_where_not(whole, F::Ints::splat(0));
        V3 {
            x: self.between(&corners, base, 0),
            y: self.between(&corners, base, 1),
            z: self.between(&corners, base, 2),
        }
    }

    /// A channel between four texels behind a base.
    #[inline(always)]
    fn between<F: Floats>(&self, corners: &Corners<F>, base: F::Ints, channel: u32) -> F {
        let [a, b, c, d] = corners.pixels;
        let texel = F::Ints::splat(TEXEL);
        let a = word_of(&self.texels, base + a * texel, channel);
        let b = word_of(&self.texels, base + b * texel, channel);
        let c = word_of(&self.texels, base + c * texel, channel);
        let d = word_of(&self.texels, base + d * texel, channel);
        corners.between([a, b, c, d])
    }

    /// Draws directions toward a lamp.
    #[inline(always)]
    pub fn sample<F: Floats>(
        &self,
        lamp: &Lamp,
        [u_place, u_own, across, down]: [F; 4],
    ) -> LampSample<F> {
        let word = F::Ints::splat;
        let half = F::splat(0.5);
        let table = &lamp.places[..];
        let place = (u_place * F::splat(lamp.count as f32)).to_ints() * word(PLACE);
        let own = u_own.below(place.gather(table).as_floats());
        let place = place.or_where_not(own, (place + word(1)).gather(table));
        let at = (place + word(2)).gather(table);
        let x = (at & word(0xffff)).to_floats() + half + tent(across);
        // Beyond a pole the picture goes on as its last row: the tent folds.
        let y = (at.shr::<16>().to_floats() + half + tent(down)).abs();
        let height = F::splat(self.map.size.y as f32);
        let y = height - (height - y).abs();
        let (to_light, sin) = self.map.direction([x, y]);
        let irradiance = vector_of::<F>(table, place, 3);
        LampSample {
            to_light,
            irradiance: irradiance.scaled(sin),
        }
    }
}

/// A number between -1 and 1, the more seldom the farther from 0: linearly.
#[inline(always)]
fn tent<F: Floats>(u: F) -> F {
    let one = F::splat(1.0);
    let twice = u + u;
    let rising = twice.sqrt() - one;
    let falling = one - (one + one - twice).max(F::splat(0.0)).sqrt();
    rising.or_where_not(twice.below(one), falling)
}

impl Lamp {
    fn new(
        medium: &FlatMedium,
        nodes: Nodes,
        image: &ImageEnvironment,
        texels: &[Texel],
    ) -> Option<Lamp> {
        let (places, count) = lamp_places(image, texels)?;
        Some(Lamp {
            table: OpticalDepthTable::new(
                (medium.cell_grid, medium.blocks.clone()),
                nodes,
                -middle(texels),
                Rgb::BLACK,
                extinctions(medium, middle(texels)),
            ),
            places,
            count,
        })
    }
}

/// [`Sky::texels`] of a picture that was taken apart, and where the whole picture begins.
pub fn texel_words(image: &ImageEnvironment, parts: &Parts) -> (Vec<u32>, u32) {
    let mut texels: Vec<u32> = parts.sky.iter().flat_map(|&p| bits(p)).collect();
    let mut whole = 0;
    if !parts.lamps.is_empty() {
        whole = texels.len() as u32;
        texels.extend(image.pixels().iter().flat_map(|&p| bits(p)));
    }
    (texels, whole)
}

/// [`Lamp::places`] of some texels, and their number; `None` where they are dark.
pub fn lamp_places(image: &ImageEnvironment, texels: &[Texel]) -> Option<(Vec<u32>, u32)> {
    let count = texels.len().next_power_of_two();
    let mut weights: Vec<f64> = texels.iter().map(|t| t.flux).collect();
    weights.resize(count, 0.0);
    let table = AliasTable::new(&weights)?;
    let size = image.size();
    let unit = TAU / size.x as f32 * PI / size.y as f32;
    let mut places = Vec::with_capacity(PLACE as usize * count);
    for (i, &(own, other)) in table.slots().iter().enumerate() {
        let mut words = [own.to_bits(), other * PLACE, 0, 0, 0, 0, 0, 0];
        if let Some(t) = texels.get(i) {
            words[2] = (t.index % size.x) | ((t.index / size.x) << 16);
            let over = unit / table.probability(i);
            words[3..6].copy_from_slice(&bits(over * t.radiance));
        }
        places.extend(words);
    }
    Some((places, count as u32))
}

/// The middle of what texels shine.
fn middle(texels: &[Texel]) -> Vec3 {
    let flux: f64 = texels.iter().map(|t| t.flux).sum();
    let mean = texels.iter().map(|t| (t.flux / flux) as f32 * t.toward);
    // Within a cap there is one; the brightest lies in it.
    let any = texels.first().map_or(Vec3::Z, |t| t.toward);
    mean.sum::<Vec3>().try_normalize().unwrap_or(any)
}

fn bits(c: Rgb) -> [u32; 3] {
    c.0.to_array().map(f32::to_bits)
}

/// A texel of a lamp.
pub struct Texel {
    index: u32,
    toward: Vec3,
    /// What it is brighter than the sky.
    radiance: Rgb,
    /// Its luminance times the solid angle.
    flux: f64,
}

/// A picture taken apart.
pub struct Parts {
    pub sky: Vec<Rgb>,
    pub lamps: Vec<Vec<Texel>>,
}

impl Parts {
    /// Words of its longest table.
    pub fn words(&self) -> u64 {
        let places = self.lamps.iter().map(|l| l.len().next_power_of_two());
        let places = u64::from(PLACE) * places.max().unwrap_or(0) as u64;
        places.max(u64::from(2 * TEXEL) * self.sky.len() as u64)
    }

    /// Bytes that the picture takes in lanes at the most.
    pub fn bytes(&self, voxels: u64) -> u64 {
        let places: usize = self.lamps.iter().map(|l| l.len().next_power_of_two()).sum();
        4 * (u64::from(2 * TEXEL) * self.sky.len() as u64 + u64::from(PLACE) * places as u64)
            + OpticalDepthTable::max_bytes(voxels, self.lamps.len() as u64)
    }

    /// Takes a picture apart.
    pub fn of(image: &ImageEnvironment) -> Parts {
        let (size, pixels) = (image.size(), image.pixels());
        let map = image.map();
        let row_weight = |y: u32| {
            let polar = std::f64::consts::PI * (f64::from(y) + 0.5) / f64::from(size.y);
            polar.sin()
        };
        let rows = || pixels.chunks_exact(size.x as usize).zip(0..);
        let of_sphere = f64::from(size.x) * (0..size.y).map(row_weight).sum::<f64>();
        let mean_up_to = |most: f64| {
            let sums = rows().map(|(row, y)| {
                let sum: f64 = row.iter().map(|p| f64::from(p.luminance()).min(most)).sum();
                sum * row_weight(y)
            });
            sums.sum::<f64>() / of_sphere
        };
        let mean = mean_up_to(f64::INFINITY);
        let mut most = SKY_CONTRAST * mean;
        for _ in 0..ROUNDS {
            most = SKY_CONTRAST * mean_up_to(most);
        }
        let mut bright = Vec::new();
        if mean - mean_up_to(most) > MIN_SHARE * mean {
            for (row, y) in rows() {
                for (&p, x) in row.iter().zip(0..) {
                    let luminance = f64::from(p.luminance());
                    if luminance > most {
                        let middle = [x as f32 + 0.5, y as f32 + 0.5];
                        bright.push(Texel {
                            index: y * size.x + x,
                            toward: map.direction(middle).0.into(),
                            radiance: (1.0 - (most / luminance) as f32) * p,
                            flux: (luminance - most) * row_weight(y),
                        });
                    }
                }
            }
        }
        let mut sky = pixels.to_vec();
        for t in &bright {
            let sky = &mut sky[t.index as usize];
            *sky = *sky - t.radiance;
        }
        Parts {
            sky,
            lamps: gather_lamps(bright),
        }
    }
}

/// Texels in caps around the brightest.
fn gather_lamps(mut texels: Vec<Texel>) -> Vec<Vec<Texel>> {
    let mut lamps: Vec<(Vec3, Vec<Texel>)> = Vec::new();
    while lamps.len() < MAX_LAMPS {
        let brightest =
            |a: &&Texel, b: &&Texel| a.radiance.luminance().total_cmp(&b.radiance.luminance());
        let Some(middle) = texels.iter().max_by(brightest).map(|t| t.toward) else {
            break;
        };
        let (within, others) = texels
            .into_iter()
            .partition(|t| t.toward.dot(middle) >= RIM_COSINE);
        lamps.push((middle, within));
        texels = others;
    }
    for t in texels {
        let nearest = lamps
            .iter_mut()
            .max_by(|a, b| a.0.dot(t.toward).total_cmp(&b.0.dot(t.toward)));
        if let Some((_, lamp)) = nearest {
            lamp.push(t);
        }
    }
    lamps.into_iter().map(|(_, lamp)| lamp).collect()
}
