//! PNG files: one slice of 8 or 16 bits.

use super::{ReadSeek, SampleType, Shape, Slices, checked_dims};
use crate::ScanError;
use organza_basis::Budget;
use png::{BitDepth, ColorType, Decoder, DecodingError, Limits};
use std::io::{BufRead, ErrorKind};

const FORMAT: &str = "PNG";

/// Bytes that rows and the unpacker take beside the slice.
const OVERHEAD: u64 = 1 << 20;

/// The slice of a file.
pub struct PngSlices {
    shape: Shape,
    bytes: Vec<u8>,
}

impl PngSlices {
    /// Reads a file. Grey values are those of the file; its gamma does not matter.
    ///
    /// # Errors
    /// Files that are no PNG or end too early, pixels that are not one grey value of 8 or 16
    /// bits, slices larger than the budget.
    pub fn new(file: impl ReadSeek + BufRead, budget: &mut Budget) -> Result<PngSlices, ScanError> {
        let mut decoder = Decoder::new(file);
        let header = decoder.read_header_info().map_err(failed)?;
        let sample = match (header.color_type, header.bit_depth) {
            (ColorType::Grayscale, BitDepth::Eight) => SampleType::U8,
            (ColorType::Grayscale, BitDepth::Sixteen) => SampleType::U16,
            (colour, depth) => {
                return Err(ScanError::format(
                    FORMAT,
                    format!(
                        "it holds {colour:?} of {} bits; expected one grey value of 8 or 16 bits \
                         per pixel",
                        depth as u8
                    ),
                ));
            }
        };
        let dims = checked_dims(FORMAT, [header.width.into(), header.height.into(), 1])?;
        let shape = Shape {
            dims,
            sample,
            spacing: None,
        };
        let size = dims.as_u64vec3().element_product() * sample.bytes() as u64;
        budget.take(size + OVERHEAD, "bytes of a slice")?;
        decoder.set_limits(Limits {
            bytes: usize::try_from(OVERHEAD + size).unwrap_or(usize::MAX),
        });
        let mut reader = decoder.read_info().map_err(failed)?;
        let mut bytes = vec![0; size as usize];
        reader.next_frame(&mut bytes).map_err(failed)?;
        Ok(PngSlices { shape, bytes })
    }
}

impl Slices for PngSlices {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn read(&mut self, _slice: u32, out: &mut [f32]) -> Result<(), ScanError> {
        self.shape.sample.decode(true, &self.bytes, out);
        Ok(())
    }
}

fn failed(e: DecodingError) -> ScanError {
    match e {
        DecodingError::IoError(e) if e.kind() != ErrorKind::UnexpectedEof => ScanError::Io(e),
        DecodingError::IoError(_) => ScanError::format(FORMAT, "it ends too early"),
        e => ScanError::format(FORMAT, e.to_string()),
    }
}
