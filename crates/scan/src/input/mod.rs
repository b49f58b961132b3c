//! Grey volumes as stacks of slices: one file per format.
//!
//! Every reader gives one slice at a time, in any order, so that a volume need not fit into
//! memory. Buffers are charged to a budget before they are allocated.

pub mod png;
pub mod raw;
pub mod stack;
pub mod tiff;
pub mod vti;

use crate::ScanError;
use glam::{DVec3, UVec3};
use std::io::{Read, Seek};

/// What readers need of a file.
pub trait ReadSeek: Read + Seek + Send {}
impl<T: Read + Seek + Send> ReadSeek for T {}

/// The type of a grey value in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleType {
    /// Unsigned, 8 bit.
    U8,
    /// Signed, 8 bit.
    I8,
    /// Unsigned, 16 bit.
    U16,
    /// Signed, 16 bit.
    I16,
    /// IEEE 754, 32 bit.
    F32,
}

impl SampleType {
    /// Bytes of a value.
    pub fn bytes(self) -> usize {
        match self {
            SampleType::U8 | SampleType::I8 => 1,
            SampleType::U16 | SampleType::I16 => 2,
            SampleType::F32 => 4,
        }
    }

    /// Its name in messages and flags.
    pub fn name(self) -> &'static str {
        match self {
            SampleType::U8 => "u8",
            SampleType::I8 => "i8",
            SampleType::U16 => "u16",
            SampleType::I16 => "i16",
            SampleType::F32 => "f32",
        }
    }

    /// Decodes values; `bytes` has as many as `out` needs.
    pub(crate) fn decode(self, big_endian: bool, bytes: &[u8], out: &mut [f32]) {
        fn each<const N: usize>(bytes: &[u8], out: &mut [f32], f: impl Fn([u8; N]) -> f32) {
            let (parts, _) = bytes.as_chunks::<N>();
            for (o, part) in out.iter_mut().zip(parts) {
                *o = f(*part);
            }
        }
        match (self, big_endian) {
            (SampleType::U8, _) => each(bytes, out, |[b]| f32::from(b)),
            (SampleType::I8, _) => each(bytes, out, |[b]| f32::from(b as i8)),
            (SampleType::U16, false) => each(bytes, out, |b| f32::from(u16::from_le_bytes(b))),
            (SampleType::U16, true) => each(bytes, out, |b| f32::from(u16::from_be_bytes(b))),
            (SampleType::I16, false) => each(bytes, out, |b| f32::from(i16::from_le_bytes(b))),
            (SampleType::I16, true) => each(bytes, out, |b| f32::from(i16::from_be_bytes(b))),
            (SampleType::F32, false) => each(bytes, out, f32::from_le_bytes),
            (SampleType::F32, true) => each(bytes, out, f32::from_be_bytes),
        }
    }
}

/// The shape of a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Values along a row, rows of a slice, slices.
    pub dims: UVec3,
    /// Type of the values in the file.
    pub sample: SampleType,
    /// Edges of a voxel in the file's own unit of length, where the file names them.
    pub spacing: Option<DVec3>,
}

impl Shape {
    /// Values of a slice.
    pub fn slice_len(&self) -> usize {
        self.dims.x as usize * self.dims.y as usize
    }
}

/// A volume of grey values, read slice by slice in any order.
pub trait Slices: Send {
    /// Its shape, known before any slice is read.
    fn shape(&self) -> Shape;

    /// Reads a slice below `shape().dims.z`, row by row, into [`Shape::slice_len`] values.
    ///
    /// # Errors
    /// Files that end too early or cannot be decoded.
    fn read(&mut self, slice: u32, out: &mut [f32]) -> Result<(), ScanError>;
}

/// Most voxels along an axis: what a lattice of an octree can have.
pub(crate) const MAX_DIM: u64 = 1 << 20;

/// Checks dimensions from a file.
pub(crate) fn checked_dims(format: &'static str, dims: [u64; 3]) -> Result<UVec3, ScanError> {
    if dims.iter().any(|&n| n == 0 || n > MAX_DIM) {
        return Err(ScanError::format(
            format,
            format!(
                "its size is {} x {} x {}; expected 1 to {MAX_DIM} voxels along each axis",
                dims[0], dims[1], dims[2]
            ),
        ));
    }
    Ok(UVec3::from(dims.map(|n| n as u32)))
}
