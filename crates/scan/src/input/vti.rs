//! `.vti`: image data of VTK, as XML with values in ASCII, base64 or raw bytes after the XML,
//! plain or in blocks packed with zlib. One piece, one value per point or cell.
//!
//! Raw bytes are read slice by slice. Values in the XML itself are held in memory.

mod head;
mod values;

use super::{ReadSeek, SampleType, Shape, Slices, checked_dims};
use crate::ScanError;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use head::{Head, Place};
use organza_basis::{Budget, nearest_name};
use std::io::{Cursor, Read, SeekFrom};
use values::{Header, Values};

pub(crate) const FORMAT: &str = ".vti";

/// An image of VTK.
pub struct VtiSlices {
    shape: Shape,
    big_endian: bool,
    values: Values,
    bytes: Vec<u8>,
}

impl VtiSlices {
    /// Opens a file; `array` names the values to read, if they are not those that the file
    /// marks or its only ones.
    ///
    /// # Errors
    /// Files that are no such XML, several pieces, arrays of another kind or size, an unknown
    /// array, more memory than the budget.
    pub fn new(
        mut file: impl ReadSeek + 'static,
        array: Option<&str>,
        budget: &mut Budget,
    ) -> Result<VtiSlices, ScanError> {
        let (bytes, appended) = read_head(&mut file, budget)?;
        let mut head = Head::parse(&bytes, appended)?;
        let index = chosen(&head, array)?;
        let (name, sample, components) = {
            let a = &head.arrays[index];
            (a.name.clone(), a.sample.clone(), a.components)
        };
        let wrong = |problem: String| ScanError::format(FORMAT, format!("`{name}`: {problem}"));
        let sample = match sample.as_str() {
            "UInt8" => SampleType::U8,
            "Int8" => SampleType::I8,
            "UInt16" => SampleType::U16,
            "Int16" => SampleType::I16,
            "Float32" => SampleType::F32,
            other => {
                return Err(wrong(format!(
                    "has values of {other}; expected UInt8, Int8, UInt16, Int16 or Float32"
                )));
            }
        };
        if components != 1 {
            return Err(wrong(format!(
                "has {components} components; expected one value per voxel"
            )));
        }
        let points = u64::from(head.arrays[index].on_points);
        let extent = head.extent;
        let along = |i: usize| {
            let cells = extent[2 * i + 1].checked_sub(extent[2 * i]);
            let cells = cells.and_then(|n| u64::try_from(n).ok());
            cells.map_or(0, |n| n + points)
        };
        let shape = Shape {
            dims: checked_dims(FORMAT, [along(0), along(1), along(2)])?,
            sample,
            spacing: Some(head.spacing),
        };
        let count = shape.dims.as_u64vec3().element_product();
        let total = count.saturating_mul(sample.bytes() as u64);
        let slice_bytes = shape.slice_len() * sample.bytes();
        budget.take(slice_bytes as u64, "bytes of a slice")?;
        let header = Header {
            wide: head.wide_header,
            big_endian: head.big_endian,
            packed: head.packed,
            total,
        };
        let place = std::mem::replace(&mut head.arrays[index].place, Place::Inline(0..0));
        let values = match place {
            Place::Ascii(text) => {
                budget.take(count.saturating_mul(4), "values")?;
                Values::ascii(&bytes[text], count as usize)?
            }
            Place::Inline(text) => {
                let decoded = decode_base64(&bytes[text], head.packed, &header, budget)?;
                Values::bytes(Box::new(Cursor::new(decoded)), 0, &header, budget)?
            }
            Place::Appended(offset) => {
                let (start, is_base64) = find_appended(&mut file, appended, offset)?;
                if is_base64 {
                    let mut text = Vec::new();
                    let at = file.seek(SeekFrom::Start(start))?;
                    let end = file.seek(SeekFrom::End(0))?;
                    budget.take(end.saturating_sub(at), "encoded values")?;
                    file.seek(SeekFrom::Start(at))?;
                    file.by_ref().read_to_end(&mut text)?;
                    let decoded = decode_base64(&text, head.packed, &header, budget)?;
                    Values::bytes(Box::new(Cursor::new(decoded)), 0, &header, budget)?
                } else {
                    Values::bytes(Box::new(file), start, &header, budget)?
                }
            }
        };
        Ok(VtiSlices {
            shape,
            big_endian: head.big_endian,
            values,
            bytes: vec![0; slice_bytes],
        })
    }
}

impl Slices for VtiSlices {
    fn shape(&self) -> Shape {
        self.shape
    }

    fn read(&mut self, slice: u32, out: &mut [f32]) -> Result<(), ScanError> {
        let first = slice as usize * out.len();
        if let Values::Floats(values) = &self.values {
            out.copy_from_slice(&values[first..first + out.len()]);
            return Ok(());
        }
        let at = u64::from(slice) * self.bytes.len() as u64;
        self.values.read(at, &mut self.bytes, slice)?;
        self.shape.sample.decode(self.big_endian, &self.bytes, out);
        Ok(())
    }
}

/// The bytes before the appended data, or all, and where the element of that data begins.
fn read_head<R: ReadSeek>(
    file: &mut R,
    budget: &mut Budget,
) -> Result<(Vec<u8>, Option<u64>), ScanError> {
    const MARK: &[u8] = b"<AppendedData";
    const STEP: usize = 1 << 16;
    let mut head = Vec::new();
    file.seek(SeekFrom::Start(0))?;
    loop {
        // Twice, because a vector that grows is copied.
        budget.take(2 * STEP as u64, "bytes of XML")?;
        let before = head.len();
        let read = file.by_ref().take(STEP as u64).read_to_end(&mut head)?;
        let from = before.saturating_sub(MARK.len());
        let found = head[from..].windows(MARK.len()).position(|w| w == MARK);
        if let Some(at) = found {
            head.truncate(from + at);
            return Ok((head, Some((from + at) as u64)));
        }
        if read == 0 {
            return Ok((head, None));
        }
    }
}

/// Place in the file of an offset into the appended data, which begins after an underscore, and
/// whether the data is base64.
fn find_appended<R: ReadSeek>(
    file: &mut R,
    element: Option<u64>,
    offset: u64,
) -> Result<(u64, bool), ScanError> {
    let missing = || ScanError::format(FORMAT, "its appended data is missing");
    let at = element.ok_or_else(missing)?;
    file.seek(SeekFrom::Start(at))?;
    let mut near = Vec::new();
    file.by_ref().take(4096).read_to_end(&mut near)?;
    let end = near.iter().position(|&b| b == b'>').ok_or_else(missing)?;
    let mark = near[end..].iter().position(|&b| b == b'_');
    let mark = mark.ok_or_else(missing)?;
    let start = at + (end + mark) as u64 + 1;
    let element = String::from_utf8_lossy(&near[..end]);
    let is_base64 = element.contains("\"base64\"") || element.contains("'base64'");
    Ok((start.checked_add(offset).ok_or_else(missing)?, is_base64))
}

/// The array of this name; else the one that the file marks; else the only one.
fn chosen(head: &Head, name: Option<&str>) -> Result<usize, ScanError> {
    let names: Vec<&str> = head.arrays.iter().map(|a| a.name.as_str()).collect();
    let wanted = name.or(head.scalars.as_deref());
    if let Some(wanted) = wanted {
        if let Some(i) = names.iter().position(|n| *n == wanted) {
            return Ok(i);
        }
        let near = nearest_name(wanted, names.iter().copied())
            .map_or(String::new(), |n| format!("; did you mean `{n}`?"));
        let problem = format!("has no array `{wanted}`{near}");
        return Err(ScanError::format(FORMAT, problem));
    }
    match names[..] {
        [_] => Ok(0),
        [] => Err(ScanError::format(FORMAT, "has no array of values")),
        _ => Err(ScanError::format(
            FORMAT,
            format!("has several arrays: {}; name one of them", names.join(", ")),
        )),
    }
}

/// Bytes from base64. Packed values have an encoded header of their own, with padding, before
/// the encoded blocks.
fn decode_base64(
    text: &[u8],
    packed: bool,
    header: &Header,
    budget: &mut Budget,
) -> Result<Vec<u8>, ScanError> {
    let wrong = |e: base64::DecodeError| ScanError::format(FORMAT, format!("its base64: {e}"));
    budget.take(2 * text.len() as u64, "decoded values")?;
    let is_text = |b: &u8| b.is_ascii_alphanumeric() || matches!(b, b'+' | b'/' | b'=');
    let start = text.iter().position(is_text).unwrap_or(text.len());
    // The text of other arrays, or the end of the element, may follow.
    let clean: Vec<u8> = text[start..]
        .iter()
        .filter(|b| !b.is_ascii_whitespace())
        .take_while(|b| is_text(b))
        .copied()
        .collect();
    let short = || ScanError::format(FORMAT, "its base64 ends too early");
    let parts = |bytes: u64| (bytes as usize).div_ceil(3).saturating_mul(4);
    let word = header.word_bytes();
    if !packed {
        let wanted = parts(word.saturating_add(header.total));
        let own = clean.get(..wanted).ok_or_else(short)?;
        return STANDARD.decode(own).map_err(wrong);
    }
    let first = clean.get(..parts(word)).ok_or_else(short)?;
    let first = STANDARD.decode(first).map_err(wrong)?;
    let blocks = header.word(&first).ok_or_else(short)?;
    let table = parts(blocks.saturating_add(3).saturating_mul(word));
    let table_text = clean.get(..table).ok_or_else(short)?;
    let mut bytes = STANDARD.decode(table_text).map_err(wrong)?;
    let words = bytes.chunks_exact(word as usize).skip(3);
    let words = words.filter_map(|w| header.word(w));
    let stored = words.fold(0u64, u64::saturating_add);
    let rest = clean.get(table..table.saturating_add(parts(stored)));
    bytes.extend(STANDARD.decode(rest.ok_or_else(short)?).map_err(wrong)?);
    Ok(bytes)
}
