//! Frames of Blosc 1, the usual compression of other programs, with LZ4 or zlib inside, as
//! OpenVDB writes them.

use flate2::read::ZlibDecoder;
use lz4_flex::block::decompress_into;
use std::io::Read;

/// Unpacks a frame that should hold `length` bytes; `None` when it is damaged
/// or packed in another way than the two supported.
pub fn unpack(frame: &[u8], length: usize) -> Option<Vec<u8>> {
    let word = |at: usize| {
        let bytes = frame.get(at..at + 4)?.try_into().ok()?;
        usize::try_from(i32::from_le_bytes(bytes)).ok()
    };
    let (flags, width) = (*frame.get(2)?, usize::from(*frame.get(3)?).max(1));
    let (shuffled, raw, bits_shuffled) = (flags & 1 != 0, flags & 2 != 0, flags & 4 != 0);
    if word(4)? != length || bits_shuffled {
        return None;
    }
    if raw {
        return Some(frame.get(16..16 + length)?.to_vec());
    }
    let block = word(8)?.max(1);
    let mut out = Vec::with_capacity(length);
    for k in 0..length.div_ceil(block) {
        let size = block.min(length - k * block);
        // Whole blocks are split into the bytes of equal position, each part compressed
        // separately.
        let cut = flags & 0x10 == 0 && width <= 16 && block / width >= 128 && size == block;
        let pieces = if cut { width } else { 1 };
        let mut at = word(16 + 4 * k)?;
        let mut planes = Vec::with_capacity(size);
        for _ in 0..pieces {
            let (packed, wanted) = (word(at)?, size / pieces);
            let bytes = frame.get(at + 4..at + 4 + packed)?;
            at += 4 + packed;
            let end = planes.len() + wanted;
            if packed == wanted {
                planes.extend(bytes);
            } else if flags >> 5 == 1 {
                let start = planes.len();
                planes.resize(end, 0);
                let count = decompress_into(bytes, &mut planes[start..]).ok()?;
                planes.truncate(start + count);
            } else if flags >> 5 == 3 {
                let mut inflated = ZlibDecoder::new(bytes).take(wanted as u64);
                inflated.read_to_end(&mut planes).ok()?;
            }
            if planes.len() != end {
                return None;
            }
        }
        let count = size / width;
        if shuffled && width > 1 {
            out.extend((0..count * width).map(|i| planes[i % width * count + i / width]));
            out.extend(&planes[count * width..]);
        } else {
            out.extend(planes);
        }
    }
    Some(out)
}
