//! Picture files.
//!
//! Each format is one file of this crate with one [`Format`] record: name,
//! endings, first bytes, reader, writer. A new format is such a file and a line
//! in [`FORMATS`]; `organza render`, environment maps, fits to pictures and the
//! messages that list the formats follow.
//!
//! Nothing here opens a file: readers take bytes, writers take a sink. A reader
//! is called only after the size that the file states was found to fit into the
//! allowed memory.
//!
//! ```
//! use glam::UVec2;
//! use organza_basis::Rgb;
//! use organza_picture::{Picture, decode, exr};
//!
//! let picture = Picture { size: UVec2::new(2, 1), pixels: vec![Rgb::splat(0.5); 2] };
//! let mut bytes = std::io::Cursor::new(Vec::new());
//! exr::write_colours(&picture, &mut bytes)?;
//! let (read, format) = decode(bytes.get_ref(), 1 << 20)?;
//! assert_eq!((read.pixels, format.name), (picture.pixels, "OpenEXR"));
//! # Ok::<(), organza_picture::PictureError>(())
//! ```

mod attributes;
pub mod contact_sheet;
mod decoder;
mod display;
mod error;
pub mod exr;
mod format;
mod hdr;
mod jpeg;
mod picture;
pub mod png;
mod tiff;
mod tone_mapping;
mod white_balance;

pub use attributes::Attributes;
pub use display::{Display, Exposure, PngBits};
pub use error::PictureError;
pub use format::{
    Format, Reader, WriteSeek, Writer, decode, format_of_bytes, format_of_ending, stated_size,
};
pub use picture::{Layers, Picture, Rendered};
pub use tone_mapping::ToneMapping;
pub use white_balance::WhiteBalance;

/// Every format, in the order in which messages list them.
pub const FORMATS: &[&Format] = &[
    &exr::FORMAT,
    &png::FORMAT,
    &hdr::FORMAT,
    &tiff::FORMAT,
    &jpeg::FORMAT,
];
