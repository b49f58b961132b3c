//! OpenEXR pictures: linear `f32` with variance and AOVs, and the exact sums
//! of a render, from which parts are merged.

use crate::format::{Format, Reader, WriteSeek, check_memory};
use crate::picture::{Layers, Picture, Rendered};
use crate::{Attributes, PictureError, decoder};
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

/// What is written of direct light: what it is, its variance, and the light of all later events.
type DirectChannel = (&'static str, fn(&Pixel, &Pixel) -> f32);

/// Of the film of direct light and that of all light.
const DIRECT_CHANNELS: [DirectChannel; 9] = [
    ("direct.R", |d, _| d.mean().0.x),
    ("direct.G", |d, _| d.mean().0.y),
    ("direct.B", |d, _| d.mean().0.z),
    ("direct.variance.R", |d, _| known_variance(d).0.x),
    ("direct.variance.G", |d, _| known_variance(d).0.y),
    ("direct.variance.B", |d, _| known_variance(d).0.z),
    ("indirect.R", |d, all| (all.mean() - d.mean()).0.x),
    ("indirect.G", |d, all| (all.mean() - d.mean()).0.y),
    ("indirect.B", |d, all| (all.mean() - d.mean()).0.z),
];

/// Channels of the words of [`Pixel::to_words`], by what they begin with: of the film, and of the
/// film of direct light. They hold the exact sums that all other channels were computed from.
const SUMS: &str = "sums";
const DIRECT_SUMS: &str = "direct_sums";

fn sum_channel(sums: &str, word: usize) -> String {
    format!("{sums}.{word:02}")
}

/// The channel of [`Layers::cache_error`].
const CACHE_ERROR: &str = "cache_error";

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
    let mut channels: Vec<AnyChannel<FlatSamples>> = own.chain(shown).collect();
    channels.extend(sum_channels(SUMS, film));
    let Layers {
        direct,
        cache_error,
    } = rendered.layers;
    if let Some(direct) = direct.filter(|direct| direct.size() == film.size()) {
        let both = || direct.pixels().iter().zip(pixels);
        channels.extend(DIRECT_CHANNELS.iter().map(|(name, value)| {
            let samples = both().map(|(d, all)| value(d, all)).collect();
            AnyChannel::new(*name, FlatSamples::F32(samples))
        }));
        channels.extend(sum_channels(DIRECT_SUMS, direct));
    }
    if let Some(errors) = cache_error.filter(|errors| errors.len() == pixels.len()) {
        let samples = FlatSamples::F32(errors.to_vec());
        channels.push(AnyChannel::new(CACHE_ERROR, samples));
    }
    let channels = channels.into_iter().collect();
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

/// The exact sums of a film.
fn sum_channels(sums: &str, film: &Film) -> impl Iterator<Item = AnyChannel<FlatSamples>> {
    let pixels = film.pixels();
    let mut words: [Vec<u32>; Pixel::WORDS] =
        std::array::from_fn(|_| Vec::with_capacity(pixels.len()));
    for pixel in pixels {
        for (samples, word) in words.iter_mut().zip(pixel.to_words()) {
            samples.push(word);
        }
    }
    words.into_iter().enumerate().map(move |(word, samples)| {
        let name = sum_channel(sums, word);
        AnyChannel::new(name.as_str(), FlatSamples::U32(samples))
    })
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
    let (Some(header), Some(comment)) = (header.filter(|h| has_sums(h, SUMS)), comment) else {
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

fn has_sums(header: &Header, sums: &str) -> bool {
    (0..Pixel::WORDS).all(|w| {
        let has = |c: &ChannelDescription| {
            c.name == *sum_channel(sums, w) && c.sample_type == SampleType::U32
        };
        header.channels.list.iter().any(has)
    })
}

/// The film of a file that `organza render` wrote, and its attributes.
///
/// # Errors
/// No OpenEXR file, or not one of this program; the film would take more than
/// `max_memory_bytes`.
pub fn read_film(bytes: &[u8], max_memory_bytes: u64) -> Result<(Film, Attributes), PictureError> {
    let stored = read(bytes, max_memory_bytes, false)?;
    Ok((stored.film, stored.attributes))
}

/// What the file of a render holds.
#[derive(Clone, Debug)]
pub struct StoredRender {
    /// The film.
    pub film: Film,
    /// What made it.
    pub attributes: Attributes,
    /// See [`Layers::direct`].
    pub direct: Option<Film>,
    /// See [`Layers::cache_error`].
    pub cache_error: Option<Vec<f32>>,
}

impl StoredRender {
    /// Bytes of the films and layers.
    pub fn memory_bytes(&self) -> u64 {
        let film = Film::memory_bytes(self.film.size());
        let direct = self.direct.as_ref().map_or(0, |_| film);
        let errors = self.cache_error.as_ref().map_or(0, Vec::len);
        film + direct + (errors * size_of::<f32>()) as u64
    }

    /// What is known beside the film.
    pub fn layers(&self) -> Layers<'_> {
        Layers {
            direct: self.direct.as_ref(),
            cache_error: self.cache_error.as_deref(),
        }
    }
}

/// Everything that `organza render` wrote to a file.
///
/// # Errors
/// As [`read_film`].
pub fn read_render(bytes: &[u8], max_memory_bytes: u64) -> Result<StoredRender, PictureError> {
    read(bytes, max_memory_bytes, true)
}

/// Reads the film, and with `layers` what is known beside it.
fn read(bytes: &[u8], max_memory_bytes: u64, layers: bool) -> Result<StoredRender, PictureError> {
    let broken = |e: exr::error::Error| PictureError::broken("EXR", e);
    let (size, attributes) = stated_film(bytes)?;
    let meta = MetaData::read_from_buffered(bytes, false).map_err(broken)?;
    let header = meta.headers.first().filter(|_| layers);
    let has_direct = header.is_some_and(|h| has_sums(h, DIRECT_SUMS));
    // The decoded channels, one more copy of the sums, and the film.
    let films = if has_direct { 2 } else { 1 };
    let of_pixel = 3 * films * Film::memory_bytes(UVec2::ONE);
    check_memory(size, of_pixel, max_memory_bytes)?;
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(bytes))
        .map_err(broken)?;
    let samples = |name: &str| {
        let channels = &image.layer_data.channel_data.list;
        let channel = channels.iter().find(|c| c.name == *name);
        channel.map(|c| &c.sample_data)
    };
    let film = |sums: &str| {
        let mut words = vec![[0; Pixel::WORDS]; size.x as usize * size.y as usize];
        for word in 0..Pixel::WORDS {
            let Some(FlatSamples::U32(samples)) = samples(&sum_channel(sums, word)) else {
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
        Ok(film)
    };
    let cache_error = match samples(CACHE_ERROR) {
        Some(FlatSamples::F32(errors)) => Some(errors.clone()),
        _ => None,
    };
    Ok(StoredRender {
        film: film(SUMS)?,
        attributes,
        direct: has_direct.then(|| film(DIRECT_SUMS)).transpose()?,
        cache_error,
    })
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
        let rendered = Rendered::new(&film, crate::Display::default(), &attributes);
        let mut out = Cursor::new(Vec::new());
        write(&rendered, &mut out).unwrap();
        let read = read_render(out.get_ref(), 1 << 20).unwrap();
        assert_eq!(read.attributes, attributes);
        assert_eq!(read.film, film);
        assert!(read.direct.is_none() && read.cache_error.is_none());
        let mut direct = film.clone();
        for (index, pixel) in direct.pixels_mut().iter_mut().enumerate() {
            let sample = organza_film::PathSample {
                radiance: Rgb::splat(index as f32),
                ..Default::default()
            };
            pixel.add(&sample, 0);
        }
        let errors = [0.0, 0.5, f32::INFINITY, 0.25, 3.0, 1.0];
        let layers = Layers {
            direct: Some(&direct),
            cache_error: Some(&errors),
        };
        let mut out = Cursor::new(Vec::new());
        write(&Rendered { layers, ..rendered }, &mut out).unwrap();
        let read = read_render(out.get_ref(), 1 << 20).unwrap();
        assert_eq!(read.film, film);
        assert_eq!(read.direct.as_ref(), Some(&direct));
        assert_eq!(read.cache_error.as_deref(), Some(&errors[..]));
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
            ..PathSample::default()
        };
        pixel.add(&sample(1.0), 0);
        assert!(known_variance(&pixel).0.x.is_nan());
        pixel.add(&sample(3.0), 1);
        assert_eq!(known_variance(&pixel).0.x, 1.0);
    }
}
