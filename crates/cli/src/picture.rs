//! Pictures: films to linear EXR with everything a pixel knows, or to
//! tone-mapped PNG.

use crate::error::input;
use crate::output;
use anyhow::{Context, Result};
use exr::meta::{MetaData, header::Header};
use exr::prelude::{
    AnyChannel, AnyChannels, ChannelDescription, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, ReadChannels, ReadLayers, SampleType, Text, WritableImage,
};
use glam::UVec2;
use organza_basis::Rgb;
use organza_scene::read;
use organza_transport::{Film, Pixel};
use std::collections::BTreeMap;
use std::path::Path;

/// The kinds of picture files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureKind {
    /// Linear `f32` with variance and AOVs.
    Exr,
    /// Tone-mapped 8-bit sRGB.
    Png,
}

impl PictureKind {
    /// By the ending of the file's name.
    ///
    /// # Errors
    /// Another ending.
    pub fn of(path: &Path) -> Result<PictureKind> {
        let ending = path.extension().map(|e| e.to_ascii_lowercase());
        match ending.as_ref().and_then(|e| e.to_str()) {
            Some("exr") => Ok(PictureKind::Exr),
            Some("png") => Ok(PictureKind::Png),
            _ => Err(input(format!(
                "{}: expected a name that ends in .exr or .png",
                path.display()
            ))),
        }
    }
}

/// A name and a value in the comment of an EXR file: what made the picture.
pub type Attribute = (&'static str, String);

/// Writes a film.
///
/// `exposure` in stops applies to PNG alone.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, film: &Film, exposure: f32, attributes: &[Attribute]) -> Result<()> {
    match PictureKind::of(path)? {
        PictureKind::Exr => write_exr(path, film, attributes),
        PictureKind::Png => write_png(path, film, exposure),
    }
}

/// Channel name and how to compute it. Depth, yarn and tangent are of the
/// first event; `through` is the fraction of samples seen straight through,
/// `variance.*` that of the estimated pixel value.
type Channel = (&'static str, fn(&Pixel) -> f32);

const CHANNELS: [Channel; 13] = [
    ("R", |p| p.mean().0.x),
    ("G", |p| p.mean().0.y),
    ("B", |p| p.mean().0.z),
    ("variance.R", |p| p.variance_of_mean().0.x),
    ("variance.G", |p| p.variance_of_mean().0.y),
    ("variance.B", |p| p.variance_of_mean().0.z),
    ("tangent.X", |p| p.tangent().x),
    ("tangent.Y", |p| p.tangent().y),
    ("tangent.Z", |p| p.tangent().z),
    ("yarn", |p| p.yarn().map_or(-1.0, |y| y as f32)),
    ("depth_mm", |p| {
        p.depth_mm().map_or(f32::INFINITY, |d| d as f32)
    }),
    ("bounces", |p| p.mean_bounces() as f32),
    ("through", |p| p.straight_through()),
];

/// Channel of one word of [`Pixel::to_words`]. They hold the exact sums that
/// all other channels were computed from, so that pictures can be merged.
fn sum_channel(word: usize) -> String {
    format!("sums.{word:02}")
}

fn write_exr(path: &Path, film: &Film, attributes: &[Attribute]) -> Result<()> {
    let size = (film.size().x as usize, film.size().y as usize);
    let pixels = film.pixels();
    let values = CHANNELS.iter().map(|(name, value)| {
        let samples = pixels.iter().map(value).collect();
        AnyChannel::new(*name, FlatSamples::F32(samples))
    });
    let mut words: [Vec<u32>; Pixel::WORDS] =
        std::array::from_fn(|_| Vec::with_capacity(pixels.len()));
    for pixel in pixels {
        for (samples, word) in words.iter_mut().zip(pixel.to_words()) {
            samples.push(word);
        }
    }
    let sums = words.into_iter().enumerate().map(|(word, samples)| {
        AnyChannel::new(sum_channel(word).as_str(), FlatSamples::U32(samples))
    });
    let channels = values.chain(sums).collect();
    let mut layer_attributes = LayerAttributes::named("organza");
    layer_attributes.software_name = Text::new_or_none("organza");
    // One text in the standard field for it: custom attributes come out of a
    // hash table in another order at every run, and equal pictures should be
    // equal files.
    let words: Vec<String> = attributes.iter().map(|(k, v)| format!("{k}={v}")).collect();
    layer_attributes.comments = Text::new_or_none(words.join("\n"));
    let layer = Layer::new(
        size,
        layer_attributes,
        Encoding {
            line_order: LineOrder::Increasing,
            ..Encoding::SMALL_LOSSLESS
        },
        AnyChannels::sort(channels),
    );
    let image = Image::from_layer(layer);
    output::write_file(path, |out| {
        image
            .write()
            .to_buffered(out)
            .context("encoding the EXR failed")
    })
}

/// Writes colours alone, in rows from the top, as a linear EXR.
///
/// # Errors
/// The file cannot be written.
pub fn write_plain(path: &Path, size: UVec2, pixels: &[Rgb]) -> Result<()> {
    let channel = |name: &str, of: fn(&Rgb) -> f32| {
        AnyChannel::new(name, FlatSamples::F32(pixels.iter().map(of).collect()))
    };
    let channels = [
        channel("B", |p| p.0.z),
        channel("G", |p| p.0.y),
        channel("R", |p| p.0.x),
    ];
    let layer = Layer::new(
        (size.x as usize, size.y as usize),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.into_iter().collect()),
    );
    let image = Image::from_layer(layer);
    output::write_file(path, |out| {
        image
            .write()
            .to_buffered(out)
            .context("encoding the EXR failed")
    })
}

/// The film of an EXR file that [`write`] made, and its comment's attributes.
///
/// # Errors
/// The file cannot be read, is no EXR, or was not written by this program; the
/// film would take more than `max_memory_bytes`.
pub fn read_exr(path: &Path, max_memory_bytes: u64) -> Result<(Film, BTreeMap<String, String>)> {
    let fail = |why: &str| input(format!("{}: {why}", path.display()));
    let broken = |e: exr::error::Error| fail(&format!("cannot be read as EXR: {e}"));
    let bytes = read::bytes(path)?;
    let meta = MetaData::read_from_buffered(&bytes[..], false).map_err(broken)?;
    let header = meta.headers.first();
    let comment = header.and_then(|h| h.own_attributes.comments.as_ref());
    let sums = |h: &Header| {
        (0..Pixel::WORDS).all(|w| {
            let has = |c: &ChannelDescription| {
                c.name == *sum_channel(w) && c.sample_type == SampleType::U32
            };
            h.channels.list.iter().any(has)
        })
    };
    let (Some(header), Some(comment)) = (header.filter(|h| sums(h)), comment) else {
        return Err(fail(
            "holds no exact sums; expected a picture of `organza render`",
        ));
    };
    let attributes = comment
        .to_string()
        .lines()
        .filter_map(|l| l.split_once('='))
        .map(|(k, v)| (k.to_owned(), v.to_owned()))
        .collect();
    let size = UVec2::new(
        header.layer_size.width() as u32,
        header.layer_size.height() as u32,
    );
    // The decoded channels, one more copy of the sums, and the film.
    let needed = 3 * Film::memory_bytes(size);
    if needed > max_memory_bytes {
        return Err(fail(&format!(
            "takes {needed} bytes of memory; {max_memory_bytes} are allowed"
        )));
    }
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(&bytes))
        .map_err(broken)?;
    let mut words = vec![[0; Pixel::WORDS]; size.x as usize * size.y as usize];
    for word in 0..Pixel::WORDS {
        let name = sum_channel(word);
        let channels = &image.layer_data.channel_data.list;
        let channel = channels.iter().find(|c| c.name == *name);
        let Some(FlatSamples::U32(samples)) = channel.map(|c| &c.sample_data) else {
            return Err(fail("holds no exact sums in its first layer"));
        };
        for (pixel, &sample) in words.iter_mut().zip(samples) {
            pixel[word] = sample;
        }
    }
    let mut film = Film::new(size);
    for (pixel, words) in film.pixels_mut().iter_mut().zip(&words) {
        *pixel = Pixel::from_words(words);
    }
    Ok((film, attributes))
}

fn write_png(path: &Path, film: &Film, exposure: f32) -> Result<()> {
    let gain = exposure.exp2();
    let bytes: Vec<u8> = film
        .pixels()
        .iter()
        .flat_map(|p| tone_map(p.mean() * gain).map(Rgb::srgb8))
        .collect();
    write_rgb_png(path, film.size().x, film.size().y, &bytes)
}

/// Writes 8-bit RGB rows as PNG.
///
/// # Errors
/// The file cannot be written.
pub fn write_rgb_png(path: &Path, width: u32, height: u32, rgb: &[u8]) -> Result<()> {
    use image::ImageEncoder;
    output::write_file(path, |out| {
        image::codecs::png::PngEncoder::new(out)
            .write_image(rgb, width, height, image::ExtendedColorType::Rgb8)
            .context("encoding the PNG failed")
    })
}

/// Highlights above this luminance are compressed; all below keeps its value.
const SHOULDER: f32 = 0.8;

/// Linear below the shoulder, then bent so that any brightness stays below
/// one; scaled by luminance, so that hues keep.
fn tone_map(c: Rgb) -> [f32; 3] {
    let y = c.max_component();
    if y <= SHOULDER {
        return c.into();
    }
    let over = (y - SHOULDER) / (1.0 - SHOULDER);
    let bent = SHOULDER + (1.0 - SHOULDER) * over / (1.0 + over);
    (c * (bent / y)).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tone_mapping_keeps_the_dark_and_bounds_the_bright() {
        assert_eq!(tone_map(Rgb::new(0.1, 0.5, 0.8)), [0.1, 0.5, 0.8]);
        let mut last = 0.8;
        for i in 1..200 {
            let [r, g, _] = tone_map(Rgb::new(0.8 + i as f32, 0.4 + 0.5 * i as f32, 0.0));
            assert!(r > last && r < 1.0, "monotone and below one");
            assert!((g / r - 0.5).abs() < 1e-5, "hue kept");
            last = r;
        }
    }
}
