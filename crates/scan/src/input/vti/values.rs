//! The values of an array: numbers in memory, or bytes, plain or packed in blocks.

use super::{FORMAT, ReadSeek};
use crate::ScanError;
use flate2::read::ZlibDecoder;
use organza_basis::Budget;
use std::io::{Read, SeekFrom};

/// Largest block of packed values, bytes.
const MAX_BLOCK: u64 = 64 << 20;

/// How the bytes of an array begin.
pub struct Header {
    pub wide: bool,
    pub big_endian: bool,
    pub packed: bool,
    /// Bytes that the array has.
    pub total: u64,
}

impl Header {
    /// Bytes of a word of the header.
    pub fn word_bytes(&self) -> u64 {
        if self.wide { 8 } else { 4 }
    }

    /// The first word of some bytes.
    pub fn word(&self, bytes: &[u8]) -> Option<u64> {
        let wide = || <[u8; 8]>::try_from(bytes.get(..8)?).ok();
        let narrow = || <[u8; 4]>::try_from(bytes.get(..4)?).ok();
        match (self.wide, self.big_endian) {
            (true, false) => wide().map(u64::from_le_bytes),
            (true, true) => wide().map(u64::from_be_bytes),
            (false, false) => narrow().map(|b| u32::from_le_bytes(b).into()),
            (false, true) => narrow().map(|b| u32::from_be_bytes(b).into()),
        }
    }
}

/// Where bytes are read from: the file, or memory.
type Source = Box<dyn ReadSeek>;

/// The values of an array, read from anywhere in it.
pub enum Values {
    /// As numbers.
    Floats(Vec<f32>),
    /// As bytes, from this place on.
    Plain(Source, u64),
    /// In blocks.
    Packed(Source, Blocks),
}

/// Blocks of packed values.
pub struct Blocks {
    /// Bytes of an unpacked block; the last may have fewer.
    size: u64,
    /// Bytes of the whole array.
    total: u64,
    /// Where each stored block begins, and where the last ends.
    starts: Vec<u64>,
    /// The block that is unpacked, and its bytes.
    present: Option<u64>,
    unpacked: Vec<u8>,
    stored: Vec<u8>,
}

impl Values {
    /// Numbers as text.
    pub fn ascii(text: &[u8], count: usize) -> Result<Values, ScanError> {
        let text = std::str::from_utf8(text)
            .map_err(|e| ScanError::format(FORMAT, format!("its values: {e}")))?;
        let mut values = Vec::with_capacity(count);
        for word in text.split_ascii_whitespace() {
            let value = word.parse::<f32>().map_err(|_| {
                let at = values.len() + 1;
                ScanError::format(FORMAT, format!("value {at}: `{word}` is not a number"))
            })?;
            if values.len() == count {
                break;
            }
            values.push(value);
        }
        if values.len() < count {
            let problem = format!("holds {} values; expected {count}", values.len());
            return Err(ScanError::format(FORMAT, problem));
        }
        Ok(Values::Floats(values))
    }

    /// Bytes of which the header is at `start`.
    pub fn bytes(
        mut source: Source,
        start: u64,
        header: &Header,
        budget: &mut Budget,
    ) -> Result<Values, ScanError> {
        let ends = |e| ScanError::read(FORMAT, "the header of its values", e);
        let end = source.seek(SeekFrom::End(0))?;
        source.seek(SeekFrom::Start(start))?;
        let word = |source: &mut Source| -> Result<u64, ScanError> {
            let mut bytes = [0u8; 8];
            let own = &mut bytes[..header.word_bytes() as usize];
            source.read_exact(own).map_err(ends)?;
            Ok(header.word(own).unwrap_or(0))
        };
        let first = word(&mut source)?;
        if !header.packed {
            if first != header.total {
                let problem = format!("holds {first} bytes of values; expected {}", header.total);
                return Err(ScanError::format(FORMAT, problem));
            }
            let begin = start + header.word_bytes();
            if begin.saturating_add(first) > end {
                let problem = format!(
                    "its values end after {} bytes; expected {first}",
                    end.saturating_sub(begin)
                );
                return Err(ScanError::format(FORMAT, problem));
            }
            return Ok(Values::Plain(source, begin));
        }
        let (size, last) = (word(&mut source)?, word(&mut source)?);
        let tail = if last == 0 { size } else { last };
        let whole = first.saturating_sub(1).checked_mul(size);
        let sum = whole.and_then(|w| w.checked_add(tail));
        if first == 0 || size == 0 || size > MAX_BLOCK || tail > size || sum != Some(header.total) {
            let problem = format!(
                "{first} blocks of {size} bytes, the last of {last}, do not make {} bytes of values",
                header.total
            );
            return Err(ScanError::format(FORMAT, problem));
        }
        budget.take_items::<u64>(first + 1, "blocks")?;
        budget.take(2 * size + (1 << 16), "bytes of a block")?;
        let mut at = start + (first + 3) * header.word_bytes();
        let mut starts = vec![at];
        for _ in 0..first {
            let stored = word(&mut source)?;
            at = at.saturating_add(stored);
            // zlib never makes bytes more than a little longer.
            if stored > size + size / 1000 + 1024 || at > end {
                let block = starts.len();
                let problem = format!("block {block} is {stored} bytes long; the file ends before");
                return Err(ScanError::format(FORMAT, problem));
            }
            starts.push(at);
        }
        let blocks = Blocks {
            size,
            total: header.total,
            starts,
            present: None,
            unpacked: Vec::new(),
            stored: Vec::new(),
        };
        Ok(Values::Packed(source, blocks))
    }

    /// Bytes from `at` on, which belong to a slice; nothing of numbers.
    pub fn read(&mut self, at: u64, out: &mut [u8], slice: u32) -> Result<(), ScanError> {
        match self {
            Values::Floats(_) => Ok(()),
            Values::Plain(source, start) => {
                source.seek(SeekFrom::Start(*start + at))?;
                let place = format!("slice {}", slice + 1);
                let read = source.read_exact(out);
                read.map_err(|e| ScanError::read(FORMAT, &place, e))
            }
            Values::Packed(source, blocks) => {
                let mut done = 0;
                while done < out.len() {
                    let place = at + done as u64;
                    blocks.unpack(source, place / blocks.size)?;
                    let from = (place % blocks.size) as usize;
                    let here = &blocks.unpacked[from..];
                    let count = here.len().min(out.len() - done);
                    out[done..done + count].copy_from_slice(&here[..count]);
                    done += count;
                }
                Ok(())
            }
        }
    }
}

impl Blocks {
    /// Unpacks a block unless it is present.
    fn unpack(&mut self, source: &mut Source, block: u64) -> Result<(), ScanError> {
        if self.present == Some(block) {
            return Ok(());
        }
        self.present = None;
        let place = format!("block {}", block + 1);
        let i = block as usize;
        let (from, to) = (self.starts[i], self.starts[i + 1]);
        self.stored.resize((to - from) as usize, 0);
        source.seek(SeekFrom::Start(from))?;
        let read = source.read_exact(&mut self.stored);
        read.map_err(|e| ScanError::read(FORMAT, &place, e))?;
        let wanted = self.size.min(self.total - block * self.size);
        self.unpacked.clear();
        // One byte more, so that a block that is too long is noticed.
        let mut unpacking = ZlibDecoder::new(&self.stored[..]).take(wanted + 1);
        let unpacked = unpacking.read_to_end(&mut self.unpacked);
        unpacked.map_err(|e| ScanError::format(FORMAT, format!("{place}: {e}")))?;
        if self.unpacked.len() as u64 != wanted {
            let problem = format!(
                "{place} holds {} bytes; expected {wanted}",
                self.unpacked.len()
            );
            return Err(ScanError::format(FORMAT, problem));
        }
        self.present = Some(block);
        Ok(())
    }
}
