//! OpenEXR pictures: linear `f32` with variance and AOVs, and the exact sums
//! of a render, from which parts are merged.

use crate::decoder;
use crate::format::{Format, Reader, WriteSeek, check_memory};
use crate::picture::{Picture, Rendered};
use crate::{Attributes, PictureError};
use exr::meta::{MetaData, header::Header};
use exr::prelude::{
    AnyChannel, AnyChannels, ChannelDescription, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, ReadChannels, ReadLayers, SampleType, Text, WritableImage,
};
use glam::UVec2;
use image::ImageFormat;
use organza_basis::Rgb;
use organza_film::{Film, Pixel};

const NAME: &str = "OpenEXR";

/// The record of the format.
pub const FORMAT: Format = Format {
    name: NAME,
    endings: &["exr"],
    keeps: "linear radiance, its variance, and what the first events saw",
    starts: &[b"\x76\x2f\x31\x01"],
    is_linear: true,
    keeps_sums: true,
    reader: Some(Reader {
        size,
        shown_size: |bytes| decoder::size(NAME, bytes, ImageFormat::OpenExr),
        decode: |bytes| decoder::decode(NAME, bytes, ImageFormat::OpenExr),
        holds_radiance: |_| true,
    }),
    writer: Some(write),
};

/// Channel name and how to compute it. Depth, yarn and tangent are of the
/// first event; `through` is the fraction of samples seen straight through,
/// `variance.*` that of the estimated pixel value.
pub type Channel = (&'static str, fn(&Pixel) -> f32);

/// The channels of a render for people; beside them its file holds exact sums.
pub const CHANNELS: [Channel; 13] = [
    ("R", |p| p.mean().0.x),
    ("G", |p| p.mean().0.y),
    ("B", |p| p.mean().0.z),
    ("variance.R", |p| known_variance(p).0.x),
    ("variance.G", |p| known_variance(p).0.y),
    ("variance.B", |p| known_variance(p).0.z),
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

/// The variance of a pixel's value; NaN where fewer than two samples leave it
/// unknown, for 0 would claim that the value is exact.
fn known_variance(p: &Pixel) -> Rgb {
    match p.count() {
        0 | 1 => Rgb::splat(f32::NAN),
        _ => p.variance_of_mean(),
    }
}

/// Channel of one word of [`Pixel::to_words`]. They hold the exact sums that
/// all other channels were computed from.
fn sum_channel(word: usize) -> String {
    format!("sums.{word:02}")
}

/// The layer that holds the colours of the film where the main channels hold denoised ones.
const NOISY: &str = "noisy";

/// The attribute of files whose main channels are denoised; it says by what.
pub const DENOISED: &str = "denoised";

fn write(rendered: &Rendered<'_>, out: &mut dyn WriteSeek) -> Result<(), PictureError> {
    write_channels(rendered, None, out)
}

/// Writes a render with denoised colours, as many as pixels, in the channels R, G and B. Its own
/// colours are kept in `noisy.R`, `noisy.G` and `noisy.B`, and all other channels as they are.
///
/// # Errors
/// The sink fails; another number of colours.
pub fn write_denoised(
    rendered: &Rendered<'_>,
    colours: &[Rgb],
    out: &mut dyn WriteSeek,
) -> Result<(), PictureError> {
    if colours.len() != rendered.film.pixels().len() {
        return Err(PictureError::write("EXR", "another number of colours"));
    }
    write_channels(rendered, Some(colours), out)
}

fn write_channels(
    rendered: &Rendered<'_>,
    denoised: Option<&[Rgb]>,
    out: &mut dyn WriteSeek,
) -> Result<(), PictureError> {
    let film = rendered.film;
    let size = (film.size().x as usize, film.size().y as usize);
    let pixels = film.pixels();
    let own = CHANNELS.iter().map(|(name, value)| {
        let name = match denoised {
            Some(_) if ["R", "G", "B"].contains(name) => format!("{NOISY}.{name}"),
            _ => (*name).to_owned(),
        };
        let samples = pixels.iter().map(value).collect();
        AnyChannel::new(name.as_str(), FlatSamples::F32(samples))
    });
    let shown = denoised.into_iter().flat_map(|colours| {
        ["R", "G", "B"].into_iter().enumerate().map(|(axis, name)| {
            let samples = colours.iter().map(|c| c.0[axis]).collect();
            AnyChannel::new(name, FlatSamples::F32(samples))
        })
    });
    let values = own.chain(shown);
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
    layer_attributes.comments = Text::new_or_none(rendered.attributes.to_ascii());
    let layer = Layer::new(
        size,
        layer_attributes,
        Encoding {
            line_order: LineOrder::Increasing,
            ..Encoding::SMALL_LOSSLESS
        },
        AnyChannels::sort(channels),
    );
    let written = Image::from_layer(layer).write().to_buffered(out);
    written.map_err(|e| PictureError::write("EXR", e))
}

/// Writes colours alone.
///
/// # Errors
/// The sink fails.
pub fn write_colours(picture: &Picture, out: &mut dyn WriteSeek) -> Result<(), PictureError> {
    let channel = |name: &str, of: fn(&Rgb) -> f32| {
        let samples = picture.pixels.iter().map(of).collect();
        AnyChannel::new(name, FlatSamples::F32(samples))
    };
    let channels = [
        channel("B", |p| p.0.z),
        channel("G", |p| p.0.y),
        channel("R", |p| p.0.x),
    ];
    let layer = Layer::new(
        (picture.size.x as usize, picture.size.y as usize),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels.into_iter().collect()),
    );
    let written = Image::from_layer(layer).write().to_buffered(out);
    written.map_err(|e| PictureError::write("EXR", e))
}

/// The largest edges of all windows that the file states: memory is taken for
/// the whole display window, however small the data is, and the other way round.
fn size(bytes: &[u8]) -> Result<UVec2, PictureError> {
    let meta = MetaData::read_from_buffered(bytes, false);
    let meta = meta.map_err(|e| PictureError::broken(NAME, e))?;
    let mut largest = UVec2::ZERO;
    for header in &meta.headers {
        let shown = header.shared_attributes.display_window.size;
        for window in [header.layer_size, shown] {
            let edge = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
            largest = largest.max(UVec2::new(edge(window.width()), edge(window.height())));
        }
    }
    Ok(largest)
}

/// The size of the film in a file that `organza render` wrote, and its attributes, from the
/// header alone.
///
/// # Errors
/// No OpenEXR file, or not one of this program.
pub fn stated_film(bytes: &[u8]) -> Result<(UVec2, Attributes), PictureError> {
    let broken = |e: exr::error::Error| PictureError::broken("EXR", e);
    let meta = MetaData::read_from_buffered(bytes, false).map_err(broken)?;
    let header = meta.headers.first();
    let comment = header.and_then(|h| h.own_attributes.comments.as_ref());
    let has_sums = |h: &Header| {
        (0..Pixel::WORDS).all(|w| {
            let has = |c: &ChannelDescription| {
                c.name == *sum_channel(w) && c.sample_type == SampleType::U32
            };
            h.channels.list.iter().any(has)
        })
    };
    let (Some(header), Some(comment)) = (header.filter(|h| has_sums(h)), comment) else {
        return Err(PictureError::NoSums);
    };
    let attributes = Attributes::from_ascii(&comment.to_string());
    let edge = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
    let size = UVec2::new(
        edge(header.layer_size.width()),
        edge(header.layer_size.height()),
    );
    Ok((size, attributes))
}

/// The film of a file that `organza render` wrote, and its attributes.
///
/// # Errors
/// No OpenEXR file, or not one of this program; the film would take more than
/// `max_memory_bytes`.
pub fn read_film(bytes: &[u8], max_memory_bytes: u64) -> Result<(Film, Attributes), PictureError> {
    let broken = |e: exr::error::Error| PictureError::broken("EXR", e);
    let (size, attributes) = stated_film(bytes)?;
    // The decoded channels, one more copy of the sums, and the film.
    let of_pixel = 3 * Film::memory_bytes(UVec2::ONE);
    check_memory(size, of_pixel, max_memory_bytes)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(bytes))
        .map_err(broken)?;
    let mut words = vec![[0; Pixel::WORDS]; size.x as usize * size.y as usize];
    for word in 0..Pixel::WORDS {
        let name = sum_channel(word);
        let channels = &image.layer_data.channel_data.list;
        let channel = channels.iter().find(|c| c.name == *name);
        let Some(FlatSamples::U32(samples)) = channel.map(|c| &c.sample_data) else {
            return Err(PictureError::NoSums);
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

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{ImageAttributes, IntegerBounds};
    use std::io::Cursor;

    #[test]
    fn a_film_and_its_attributes_survive_whatever_the_scene_is_called() {
        let film = Film::new(UVec2::new(3, 2));
        let attributes: Attributes = [("scene", "шёлк.toml"), ("seed", "7")]
            .into_iter()
            .collect();
        let rendered = Rendered {
            film: &film,
            display: crate::Display::default(),
            attributes: &attributes,
        };
        let mut out = Cursor::new(Vec::new());
        write(&rendered, &mut out).unwrap();
        let (read, stored) = read_film(out.get_ref(), 1 << 20).unwrap();
        assert_eq!(stored, attributes);
        assert_eq!(read.pixels(), film.pixels());
        // Known bad: a picture of another program has no sums.
        let picture = rendered.colours();
        let mut out = Cursor::new(Vec::new());
        write_colours(&picture, &mut out).unwrap();
        let refused = read_film(out.get_ref(), 1 << 20).unwrap_err();
        assert!(matches!(refused, PictureError::NoSums), "{refused}");
    }

    #[test]
    fn a_small_file_with_a_large_display_window_is_refused() {
        let samples = AnyChannel::new("R", FlatSamples::F32(vec![0.0; 4]));
        let layer = Layer::new(
            (2, 2),
            LayerAttributes::default(),
            Encoding::SMALL_LOSSLESS,
            AnyChannels::sort([samples].into_iter().collect()),
        );
        let window = IntegerBounds::from_dimensions((15_000, 8000));
        let image = Image::from_layers(ImageAttributes::new(window), vec![layer]);
        let mut out = Cursor::new(Vec::new());
        image.write().to_buffered(&mut out).unwrap();
        let bytes = out.into_inner();
        assert!(bytes.len() < 2000, "{}", bytes.len());
        let refused = crate::decode(&bytes, 100 << 20).unwrap_err();
        assert!(
            matches!(
                refused,
                PictureError::Memory {
                    width: 15_000,
                    height: 8000,
                    ..
                }
            ),
            "{refused}"
        );
    }

    #[test]
    fn the_variance_of_one_sample_is_unknown_and_of_two_is_not() {
        use organza_film::PathSample;
        let mut pixel = Pixel::default();
        assert!(known_variance(&pixel).0.x.is_nan());
        let sample = |radiance| PathSample {
            radiance: Rgb::splat(radiance),
            bounces: 0,
            first: None,
            absorbed: Rgb::BLACK,
            escape: None,
        };
        pixel.add(&sample(1.0), 0);
        assert!(known_variance(&pixel).0.x.is_nan());
        pixel.add(&sample(3.0), 1);
        assert_eq!(known_variance(&pixel).0.x, 1.0);
    }
}
