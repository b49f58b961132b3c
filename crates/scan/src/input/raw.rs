//! Raw volumes: values one after another, described by the caller.

use super::{ReadSeek, SampleType, Shape, Slices, checked_dims};
use crate::ScanError;
use organza_basis::Budget;
use std::io::SeekFrom;

const FORMAT: &str = "raw";

/// The layout of a raw file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RawLayout {
    /// Values along x, y and z; x changes fastest.
    pub dims: [u64; 3],
    /// Type of the values.
    pub sample: SampleType,
    /// Bytes before the first value.
    pub header_bytes: u64,
    /// Most significant byte first.
    pub big_endian: bool,
}

/// A raw volume.
pub struct RawSlices<R> {
    file: R,
    shape: Shape,
    layout: RawLayout,
    bytes: Vec<u8>,
}

impl<R: ReadSeek> RawSlices<R> {
    /// A volume of the layout.
    ///
    /// # Errors
    /// A file of another length, or slices larger than the budget.
    pub fn new(
        mut file: R,
        layout: RawLayout,
        budget: &mut Budget,
    ) -> Result<RawSlices<R>, ScanError> {
        let dims = checked_dims(FORMAT, layout.dims)?;
        let values = dims.as_u64vec3().element_product();
        let want = values
            .saturating_mul(layout.sample.bytes() as u64)
            .saturating_add(layout.header_bytes);
        let found = file.seek(SeekFrom::End(0))?;
        if want != found {
            return Err(ScanError::format(
                FORMAT,
                format!(
                    "{} x {} x {} values of {} after {} bytes of header make {want} bytes; it has \
                     {found}",
                    dims.x,
                    dims.y,
                    dims.z,
                    layout.sample.name(),
                    layout.header_bytes
                ),
            ));
        }
        let shape = Shape {
            dims,
            sample: layout.sample,
            spacing: None,
        };
        let slice_bytes = shape.slice_len() * layout.sample.bytes();
        budget.take(slice_bytes as u64, "bytes of a slice")?;
        Ok(RawSlices {
            file,
            shape,
            layout,
            bytes: vec![0; slice_bytes],
        })
    }
}

impl<R: ReadSeek> Slices for RawSlices<R> {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn read(&mut self, slice: u32, out: &mut [f32]) -> Result<(), ScanError> {
        let at = self.layout.header_bytes + u64::from(slice) * self.bytes.len() as u64;
        self.file.seek(SeekFrom::Start(at))?;
        self.file
            .read_exact(&mut self.bytes)
            .map_err(|e| ScanError::read(FORMAT, &format!("slice {}", slice + 1), e))?;
        self.layout
            .sample
            .decode(self.layout.big_endian, &self.bytes, out);
        Ok(())
    }
}
