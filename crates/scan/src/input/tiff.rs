//! TIFF files: one slice per page, of 8 or 16 bits or 32-bit floats.

use super::{ReadSeek, SampleType, Shape, Slices, checked_dims};
use crate::ScanError;
use organza_basis::Budget;
use tiff::decoder::{Decoder, DecodingResult, Limits};
use tiff::tags::{SampleFormat, Tag};
use tiff::{ColorType, TiffError};

const FORMAT: &str = "TIFF";

/// Bytes that a directory may take for one of its entries: a million offsets of strips.
const MAX_ENTRY_BYTES: usize = 8 << 20;

/// Compressed bytes that a strip may have beyond twice what it holds.
const STRIP_OVERHEAD: u64 = 1 << 16;

/// The pages of a file.
pub struct TiffSlices<R: ReadSeek> {
    decoder: Decoder<R>,
    shape: Shape,
}

impl<R: ReadSeek> TiffSlices<R> {
    /// Opens a file and looks at every page of it.
    ///
    /// # Errors
    /// Files that are no TIFF, pages of different size or type, pages that are not one grey
    /// value per pixel of a type that is read, pages larger than the budget.
    pub fn new(file: R, budget: &mut Budget) -> Result<TiffSlices<R>, ScanError> {
        let whole = |e| failed("its first page", e);
        let mut decoder = Decoder::new(file).map_err(whole)?;
        let (x, y) = decoder.dimensions().map_err(whole)?;
        let sample = sample_of(&mut decoder, 1)?;
        let pixels = u64::from(x) * u64::from(y);
        let page_bytes = pixels.saturating_mul(sample.bytes() as u64);
        // The values of a page, and the bytes of a strip before they are unpacked.
        budget.take(
            page_bytes
                .saturating_mul(3)
                .saturating_add(STRIP_OVERHEAD + MAX_ENTRY_BYTES as u64),
            "bytes of a page",
        )?;
        let as_size = |bytes: u64| usize::try_from(bytes).unwrap_or(usize::MAX);
        let mut limits = Limits::default();
        limits.decoding_buffer_size = as_size(page_bytes + STRIP_OVERHEAD);
        limits.intermediate_buffer_size = as_size(2 * page_bytes + STRIP_OVERHEAD);
        limits.ifd_value_size = MAX_ENTRY_BYTES;
        let mut decoder = decoder.with_limits(limits);
        let named = images_named(&mut decoder);
        let mut pages = 1u64;
        while decoder.more_images() {
            // The decoder keeps the place of every page.
            budget.take(32, "pages")?;
            let place = format!("page {}", pages + 1);
            decoder.next_image().map_err(|e| failed(&place, e))?;
            pages += 1;
            let size = decoder.dimensions().map_err(|e| failed(&place, e))?;
            let own = sample_of(&mut decoder, pages)?;
            if size != (x, y) || own != sample {
                return Err(ScanError::format(
                    FORMAT,
                    format!(
                        "{place} is {} x {} of {}; the pages before are {x} x {y} of {}",
                        size.0,
                        size.1,
                        own.name(),
                        sample.name()
                    ),
                ));
            }
        }
        if pages == 1 && named > 1 {
            return Err(ScanError::format(
                FORMAT,
                format!(
                    "it is an ImageJ stack of {named} slices with one directory, as ImageJ writes \
                     from 4 GiB on; save it as raw data and give --raw-size"
                ),
            ));
        }
        Ok(TiffSlices {
            decoder,
            shape: Shape {
                dims: checked_dims(FORMAT, [x.into(), y.into(), pages])?,
                sample,
                spacing: None,
            },
        })
    }
}

impl<R: ReadSeek> Slices for TiffSlices<R> {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn read(&mut self, slice: u32, out: &mut [f32]) -> Result<(), ScanError> {
        let place = format!("page {}", slice + 1);
        self.decoder
            .seek_to_image(slice as usize)
            .map_err(|e| failed(&place, e))?;
        let values = self.decoder.read_image().map_err(|e| failed(&place, e))?;
        let found = match &values {
            DecodingResult::U8(v) => put(v, out, |&x| f32::from(x)),
            DecodingResult::I8(v) => put(v, out, |&x| f32::from(x)),
            DecodingResult::U16(v) => put(v, out, |&x| f32::from(x)),
            DecodingResult::I16(v) => put(v, out, |&x| f32::from(x)),
            DecodingResult::F32(v) => put(v, out, |&x| x),
            _ => 0,
        };
        if found < out.len() {
            let problem = format!("{place} holds {found} values; expected {}", out.len());
            return Err(ScanError::format(FORMAT, problem));
        }
        Ok(())
    }
}

/// Copies values and says how many there were.
fn put<T>(values: &[T], out: &mut [f32], number: impl Fn(&T) -> f32) -> usize {
    for (o, v) in out.iter_mut().zip(values) {
        *o = number(v);
    }
    values.len()
}

/// The type of the present page's values.
fn sample_of<R: ReadSeek>(decoder: &mut Decoder<R>, page: u64) -> Result<SampleType, ScanError> {
    let place = format!("page {page}");
    let colour = decoder.colortype().map_err(|e| failed(&place, e))?;
    let formats = decoder.find_tag_unsigned_vec::<u16>(Tag::SampleFormat);
    let formats = formats.map_err(|e| failed(&place, e))?;
    let format = formats.and_then(|f| f.first().copied()).unwrap_or(1);
    let format = SampleFormat::from_u16_exhaustive(format);
    match (colour, format) {
        (ColorType::Gray(8), SampleFormat::Uint) => Ok(SampleType::U8),
        (ColorType::Gray(8), SampleFormat::Int) => Ok(SampleType::I8),
        (ColorType::Gray(16), SampleFormat::Uint) => Ok(SampleType::U16),
        (ColorType::Gray(16), SampleFormat::Int) => Ok(SampleType::I16),
        (ColorType::Gray(32), SampleFormat::IEEEFP) => Ok(SampleType::F32),
        _ => Err(ScanError::format(
            FORMAT,
            format!(
                "{place} holds {}; expected one value of 8 or 16 bits, or a 32-bit float, per \
                 pixel",
                described(colour, &format)
            ),
        )),
    }
}

/// A type of pixels in words.
fn described(colour: ColorType, format: &SampleFormat) -> String {
    let kind = match format {
        SampleFormat::Uint => "unsigned",
        SampleFormat::Int => "signed",
        SampleFormat::IEEEFP => "float",
        _ => "unknown",
    };
    match colour {
        ColorType::Gray(bits) => format!("{kind} values of {bits} bits"),
        ColorType::RGB(bits) => format!("colours of 3 x {bits} bits"),
        ColorType::RGBA(bits) => format!("colours of 4 x {bits} bits"),
        ColorType::Palette(bits) => format!("a palette of {bits} bits"),
        other => format!("{other:?}"),
    }
}

/// Slices that the description of an ImageJ stack names.
fn images_named<R: ReadSeek>(decoder: &mut Decoder<R>) -> u64 {
    let text = decoder.get_tag_ascii_string(Tag::ImageDescription);
    let text = text.unwrap_or_default();
    let count = text
        .strip_prefix("ImageJ=")
        .and_then(|t| t.lines().find_map(|l| l.strip_prefix("images=")));
    count.and_then(|c| c.trim().parse().ok()).unwrap_or(1)
}

fn failed(place: &str, e: TiffError) -> ScanError {
    match e {
        TiffError::IoError(e) => ScanError::read(FORMAT, place, e),
        TiffError::LimitsExceeded => ScanError::format(
            FORMAT,
            format!("{place}: a strip or an entry is larger than a page of its size can need"),
        ),
        e => ScanError::format(FORMAT, format!("{place}: {e}")),
    }
}
