//! The XML of a `.vti` file.

use super::FORMAT;
use crate::ScanError;
use glam::DVec3;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::ops::Range;

/// Where an array's values are.
pub enum Place {
    /// Text of numbers: these bytes of the head.
    Ascii(Range<usize>),
    /// Base64: these bytes of the head.
    Inline(Range<usize>),
    /// Appended data, from this byte of it.
    Appended(u64),
}

/// A `DataArray`.
pub struct Array {
    pub name: String,
    /// As the file has it, such as `UInt8`.
    pub sample: String,
    pub components: u32,
    pub on_points: bool,
    pub place: Place,
}

/// What the XML says.
pub struct Head {
    pub big_endian: bool,
    /// Headers of arrays are words of 64 bits, else of 32.
    pub wide_header: bool,
    /// Values are packed with zlib.
    pub packed: bool,
    /// Least and greatest index along x, y, z.
    pub extent: [i64; 6],
    pub spacing: DVec3,
    /// The array that the file marks as its scalars.
    pub scalars: Option<String>,
    pub arrays: Vec<Array>,
}

/// Most arrays of a file.
const MAX_ARRAYS: usize = 1000;

/// The attribute of an element.
fn attribute(element: &BytesStart<'_>, key: &str) -> Result<Option<String>, ScanError> {
    let wrong = |e: &dyn std::fmt::Display| ScanError::format(FORMAT, e.to_string());
    for a in element.attributes() {
        let a = a.map_err(|e| wrong(&e))?;
        if a.key.as_ref() == key {
            return Ok(Some(a.value.trim().to_owned()));
        }
    }
    Ok(None)
}

/// Numbers of an attribute.
fn numbers<T: std::str::FromStr, const N: usize>(
    key: &str,
    text: &str,
) -> Result<[T; N], ScanError> {
    let list: Option<Vec<T>> = text.split_whitespace().map(|t| t.parse().ok()).collect();
    let list = list.and_then(|l| <[T; N]>::try_from(l).ok());
    list.ok_or_else(|| {
        ScanError::format(
            FORMAT,
            format!("{key}: expected {N} numbers, found `{text}`"),
        )
    })
}

impl Head {
    /// Reads the XML up to the appended data, which begins at `appended`.
    pub fn parse(xml: &[u8], appended: Option<u64>) -> Result<Head, ScanError> {
        let mut head = Head {
            big_endian: false,
            wide_header: false,
            packed: false,
            extent: [0, -1, 0, -1, 0, -1],
            spacing: DVec3::ONE,
            scalars: None,
            arrays: Vec::new(),
        };
        let mut reader = Reader::from_reader(xml);
        let failed = |reader: &Reader<&[u8]>, e: &dyn std::fmt::Display| {
            let at = reader.error_position();
            ScanError::format(FORMAT, format!("byte {at}: {e}"))
        };
        let (mut is_vtk, mut pieces, mut on_points) = (false, 0, None);
        loop {
            let event = reader.read_event();
            let event = event.map_err(|e| failed(&reader, &e))?;
            match event {
                Event::Start(e) | Event::Empty(e) => match e.name().as_ref() {
                    "VTKFile" => {
                        is_vtk = true;
                        head.file(&e)?;
                    }
                    "ImageData" => head.image(&e)?,
                    "Piece" => {
                        pieces += 1;
                        head.piece(&e, pieces)?;
                    }
                    "PointData" | "CellData" => {
                        on_points = Some(e.name().as_ref() == "PointData");
                        let marked = attribute(&e, "Scalars")?;
                        head.scalars = head.scalars.take().or(marked);
                    }
                    "DataArray" => {
                        if let Some(on_points) = on_points {
                            let start = reader.buffer_position() as usize;
                            head.array(&e, on_points, start, xml)?;
                        }
                    }
                    _ => {}
                },
                Event::End(e) if matches!(e.name().as_ref(), "PointData" | "CellData") => {
                    on_points = None;
                }
                Event::Eof => break,
                _ => {}
            }
        }
        if !is_vtk {
            return Err(ScanError::format(FORMAT, "has no element `VTKFile`"));
        }
        if appended.is_none()
            && head
                .arrays
                .iter()
                .any(|a| matches!(a.place, Place::Appended(_)))
        {
            return Err(ScanError::format(FORMAT, "its appended data is missing"));
        }
        Ok(head)
    }

    fn file(&mut self, e: &BytesStart<'_>) -> Result<(), ScanError> {
        let wrong = |key: &str, found: &str, expected: &str| {
            let problem = format!("{key}: expected {expected}, found `{found}`");
            Err(ScanError::format(FORMAT, problem))
        };
        match attribute(e, "type")?.as_deref() {
            Some("ImageData") => {}
            other => return wrong("type", other.unwrap_or(""), "ImageData"),
        }
        self.big_endian = match attribute(e, "byte_order")?.as_deref() {
            None | Some("LittleEndian") => false,
            Some("BigEndian") => true,
            Some(other) => return wrong("byte_order", other, "LittleEndian or BigEndian"),
        };
        self.wide_header = match attribute(e, "header_type")?.as_deref() {
            None | Some("UInt32") => false,
            Some("UInt64") => true,
            Some(other) => return wrong("header_type", other, "UInt32 or UInt64"),
        };
        self.packed = match attribute(e, "compressor")?.as_deref() {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => return wrong("compressor", other, "vtkZLibDataCompressor or none"),
        };
        Ok(())
    }

    fn image(&mut self, e: &BytesStart<'_>) -> Result<(), ScanError> {
        if let Some(extent) = attribute(e, "WholeExtent")? {
            self.extent = numbers("WholeExtent", &extent)?;
        }
        if let Some(text) = attribute(e, "Spacing")? {
            self.spacing = DVec3::from(numbers::<f64, 3>("Spacing", &text)?);
            if !(self.spacing.is_finite() && self.spacing.min_element() > 0.0) {
                let problem = format!("Spacing: expected three positive numbers, found `{text}`");
                return Err(ScanError::format(FORMAT, problem));
            }
        }
        if let Some(text) = attribute(e, "Direction")? {
            let unit = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];
            if numbers::<f64, 9>("Direction", &text)? != unit {
                let problem = format!("Direction: only the unit matrix is read, found `{text}`");
                return Err(ScanError::format(FORMAT, problem));
            }
        }
        Ok(())
    }

    fn piece(&mut self, e: &BytesStart<'_>, pieces: u32) -> Result<(), ScanError> {
        let own = match attribute(e, "Extent")? {
            Some(text) => numbers("Extent", &text)?,
            None => self.extent,
        };
        if pieces > 1 || own != self.extent {
            return Err(ScanError::format(
                FORMAT,
                "is in several pieces; expected one piece that is the whole",
            ));
        }
        Ok(())
    }

    fn array(
        &mut self,
        e: &BytesStart<'_>,
        on_points: bool,
        start: usize,
        xml: &[u8],
    ) -> Result<(), ScanError> {
        let name = attribute(e, "Name")?.unwrap_or_default();
        let wrong = |problem: String| ScanError::format(FORMAT, format!("`{name}`: {problem}"));
        if self.arrays.len() == MAX_ARRAYS {
            return Err(ScanError::format(FORMAT, "has more than 1000 arrays"));
        }
        let text = || {
            let length = xml[start..].iter().position(|&b| b == b'<');
            start..start + length.unwrap_or(xml.len() - start)
        };
        let place = match attribute(e, "format")?.as_deref() {
            Some("ascii") => Place::Ascii(text()),
            Some("binary") => Place::Inline(text()),
            Some("appended") => {
                let offset = attribute(e, "offset")?.unwrap_or_default();
                let offset = offset.parse();
                Place::Appended(offset.map_err(|_| wrong("has no offset".into()))?)
            }
            other => {
                let found = other.unwrap_or("");
                return Err(wrong(format!(
                    "format: expected ascii, binary or appended, found `{found}`"
                )));
            }
        };
        let components = match attribute(e, "NumberOfComponents")? {
            Some(text) => text
                .parse()
                .map_err(|_| wrong(format!("NumberOfComponents is `{text}`")))?,
            None => 1,
        };
        let sample = attribute(e, "type")?.unwrap_or_default();
        self.arrays.push(Array {
            name,
            sample,
            components,
            on_points,
            place,
        });
        Ok(())
    }
}
