//! Packets of the protocol of tev [Mueller2025]. All numbers are little-endian. A packet begins
//! with its whole length in bytes (u32) and its operation (u8); text ends with a zero byte.

use glam::UVec2;

/// The operation that begins a picture.
const CREATE_IMAGE: u8 = 4;

/// The operation that replaces a rectangle of a picture, with offsets and strides of channels
/// (the third version, of tev 1.17 and later).
const UPDATE_IMAGE: u8 = 6;

/// The channels of a picture.
const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Begins a picture: whether to select it (u8), name, width and height (i32), number of
/// channels (i32) and their names.
pub fn create_image(name: &str, size: UVec2) -> Vec<u8> {
    let mut packet = Vec::new();
    begin(&mut packet, CREATE_IMAGE, true, name);
    numbers(&mut packet, &[size.x, size.y, CHANNELS.len() as u32]);
    names(&mut packet);
    end(&mut packet);
    packet
}

/// Makes `packet` replace whole rows of a picture, from `first_row` on: whether to select it
/// (u8), name, number of channels (i32) and their names, left, top, width and height (i32), for
/// each channel the offset of its first value and the stride (i64, in values), and the values
/// (f32), pixel by pixel.
pub fn update_image(
    name: &str,
    first_row: u32,
    width: u32,
    pixels: &[[f32; 3]],
    packet: &mut Vec<u8>,
) {
    packet.clear();
    begin(packet, UPDATE_IMAGE, false, name);
    numbers(packet, &[CHANNELS.len() as u32]);
    names(packet);
    let rows = (pixels.len() / width.max(1) as usize) as u32;
    numbers(packet, &[0, first_row, width, rows]);
    let stride = CHANNELS.len() as i64;
    for offset in (0..stride).chain([stride; CHANNELS.len()]) {
        packet.extend(offset.to_le_bytes());
    }
    for value in pixels.as_flattened() {
        packet.extend(value.to_le_bytes());
    }
    end(packet);
}

fn begin(packet: &mut Vec<u8>, operation: u8, selects: bool, name: &str) {
    packet.extend([0, 0, 0, 0, operation, u8::from(selects)]);
    text(packet, name);
}

/// A text up to a zero byte, which would end it.
fn text(packet: &mut Vec<u8>, text: &str) {
    packet.extend(text.bytes().take_while(|&byte| byte != 0).chain([0]));
}

fn names(packet: &mut Vec<u8>) {
    CHANNELS.iter().for_each(|name| text(packet, name));
}

fn numbers(packet: &mut Vec<u8>, numbers: &[u32]) {
    for number in numbers {
        packet.extend(number.to_le_bytes());
    }
}

/// Fills in the length.
fn end(packet: &mut [u8]) {
    let length = packet.len() as u32;
    packet[..4].copy_from_slice(&length.to_le_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn packets_have_the_bytes_of_the_protocol() {
        let created = create_image("a.exr", UVec2::new(2, 0x0103));
        let expected = [
            &[30, 0, 0, 0, 4, 1][..],
            b"a.exr\0",
            &[2, 0, 0, 0, 3, 1, 0, 0, 3, 0, 0, 0],
            b"R\0G\0B\0",
        ];
        assert_eq!(created, expected.concat());

        let mut updated = vec![9; 3]; // what was there is gone
        let pixels = [[1.0, 2.0, -0.5], [0.0, f32::INFINITY, 3.0]];
        update_image("b", 7, 2, &pixels, &mut updated);
        let expected = [
            &[106, 0, 0, 0, 6, 0][..],
            b"b\0",
            &[3, 0, 0, 0],
            b"R\0G\0B\0",
            &[0, 0, 0, 0, 7, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0],
            &[0, 0, 0, 0, 0, 0, 0, 0],
            &[1, 0, 0, 0, 0, 0, 0, 0],
            &[2, 0, 0, 0, 0, 0, 0, 0],
            &[3, 0, 0, 0, 0, 0, 0, 0],
            &[3, 0, 0, 0, 0, 0, 0, 0],
            &[3, 0, 0, 0, 0, 0, 0, 0],
            &[0, 0, 0x80, 0x3f, 0, 0, 0, 0x40, 0, 0, 0, 0xbf],
            &[0, 0, 0, 0, 0, 0, 0x80, 0x7f, 0, 0, 0x40, 0x40],
        ];
        assert_eq!(updated, expected.concat());
    }
}
