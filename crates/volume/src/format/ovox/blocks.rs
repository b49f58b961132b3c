//! Arrays in checked, compressed blocks.

use super::{BLOCK, ENDING};
use crate::Error;
use bytemuck::Pod;
use flate2::Crc;
use lz4_flex::block::{compress, decompress_into};
use rayon::prelude::*;
use std::io::{Read, Write};

/// Writes an array.
pub fn write_array<T: Pod + Send + Sync>(array: &[T], out: &mut dyn Write) -> Result<(), Error> {
    let per_block = BLOCK / size_of::<T>();
    // A few blocks at a time keep memory small and all threads busy.
    for part in array.chunks(per_block * 4 * rayon::current_num_threads()) {
        let packed: Vec<Vec<u8>> = part
            .par_chunks(per_block)
            .map(|block| {
                let raw: &[u8] = bytemuck::cast_slice(block);
                let stored = compress(&planes_from_records(raw, size_of::<T>()));
                let mut bytes = Vec::with_capacity(12 + stored.len());
                for n in [stored.len() as u32, raw.len() as u32, crc(&stored)] {
                    bytes.extend(n.to_le_bytes());
                }
                bytes.extend(stored);
                bytes
            })
            .collect();
        for block in packed {
            out.write_all(&block)?;
        }
    }
    Ok(())
}

/// Reads an array of `count` items, which were charged to a budget.
///
/// # Errors Blocks that are cut off or altered, or hold more than `count` items.
pub fn read_array<T: Pod + Send + Sync>(input: &mut dyn Read, count: u64) -> Result<Vec<T>, Error> {
    let mut array: Vec<T> = Vec::new();
    while (array.len() as u64) < count {
        // Read enough blocks to occupy the threads, then unpack them in parallel.
        let mut packed = Vec::new();
        let mut coming = array.len() as u64;
        while coming < count && packed.len() < 4 * rayon::current_num_threads() {
            let mut head = [0u8; 12];
            read_exactly(input, &mut head, "blocks")?;
            let (stored, raw) = (word(&head, 0) as usize, word(&head, 4) as usize);
            if stored > 2 * BLOCK || raw > BLOCK || raw == 0 || !raw.is_multiple_of(size_of::<T>())
            {
                return Err(wrong("a block has an impossible size"));
            }
            let mut bytes = vec![0u8; stored];
            read_exactly(input, &mut bytes, "blocks")?;
            coming += (raw / size_of::<T>()) as u64;
            packed.push((bytes, raw, word(&head, 8)));
        }
        if coming > count {
            return Err(wrong("its blocks hold more than its header says"));
        }
        let unpacked: Vec<Option<Vec<T>>> = packed
            .par_iter()
            .map(|(bytes, raw, sum)| {
                if crc(bytes) != *sum {
                    return None;
                }
                let planes = unpack(bytes, *raw)?;
                let mut records = vec![T::zeroed(); raw / size_of::<T>()];
                let bytes = bytemuck::cast_slice_mut(&mut records);
                records_from_planes(&planes, size_of::<T>(), bytes);
                Some(records)
            })
            .collect();
        for block in unpacked {
            array.extend(block.ok_or_else(|| wrong("a block was altered (checksum)"))?);
        }
    }
    Ok(array)
}

/// The raw bytes of a block, if their number is the one declared.
fn unpack(stored: &[u8], raw: usize) -> Option<Vec<u8>> {
    let mut bytes = vec![0u8; raw];
    let length = decompress_into(stored, &mut bytes).ok()?;
    (length == raw).then_some(bytes)
}

/// Stores the first bytes of all records, then the second bytes, and so on: similar bytes
/// compress better together.
fn planes_from_records(records: &[u8], size: usize) -> Vec<u8> {
    let count = records.len() / size;
    let mut planes = vec![0u8; records.len()];
    for (k, plane) in planes.chunks_exact_mut(count.max(1)).enumerate() {
        for (i, byte) in plane.iter_mut().enumerate() {
            *byte = records[i * size + k];
        }
    }
    planes
}

fn records_from_planes(planes: &[u8], size: usize, records: &mut [u8]) {
    let count = planes.len() / size;
    for (i, record) in records.chunks_exact_mut(size).enumerate() {
        for (k, byte) in record.iter_mut().enumerate() {
            *byte = planes[k * count + i];
        }
    }
}

/// The checksum of bytes.
pub fn crc(bytes: &[u8]) -> u32 {
    let mut crc = Crc::new();
    crc.update(bytes);
    crc.sum()
}

/// The number that begins at a place.
pub fn word(bytes: &[u8], at: usize) -> u32 {
    let mut b = [0u8; 4];
    b.copy_from_slice(&bytes[at..at + 4]);
    u32::from_le_bytes(b)
}

/// A format error.
pub fn wrong(problem: impl Into<String>) -> Error {
    Error::format(ENDING, problem)
}

/// Fills a buffer with the next bytes.
///
/// # Errors When the file ends too early.
pub fn read_exactly(input: &mut dyn Read, into: &mut [u8], what: &str) -> Result<(), Error> {
    input.read_exact(into).map_err(|e| match e.kind() {
        std::io::ErrorKind::UnexpectedEof => wrong(format!("it is cut off within its {what}")),
        _ => Error::Io(e),
    })
}
