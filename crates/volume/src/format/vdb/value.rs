//! The kinds of values in grids.

use half::f16;

/// A value that a grid can hold.
pub trait Value: Copy + PartialEq + Send + Sync {
    /// OpenVDB's name of it.
    const NAME: &'static str;
    /// Bytes in full width.
    const WIDTH: usize;
    /// Bytes when stored half; `None` where there is no half form.
    const HALF_WIDTH: Option<usize>;
    /// The value of an empty grid.
    const ZERO: Self;
    /// Appends it in full width.
    fn put(self, out: &mut Vec<u8>);
    /// From [`Value::WIDTH`] bytes.
    fn get(bytes: &[u8]) -> Self;
    /// Appends it as 16-bit floats, where that exists, else in full.
    fn put_half(self, out: &mut Vec<u8>);
    /// From half the bytes.
    fn get_half(bytes: &[u8]) -> Self;
    /// Its negative.
    fn negative(self) -> Self;
}

fn word(b: &[u8]) -> [u8; 4] {
    [b[0], b[1], b[2], b[3]]
}

impl Value for f32 {
    const NAME: &'static str = "float";
    const WIDTH: usize = 4;
    const HALF_WIDTH: Option<usize> = Some(2);
    const ZERO: f32 = 0.0;

    fn put(self, out: &mut Vec<u8>) {
        out.extend(self.to_le_bytes());
    }

    fn get(bytes: &[u8]) -> f32 {
        f32::from_le_bytes(word(bytes))
    }

    fn put_half(self, out: &mut Vec<u8>) {
        out.extend(f16::from_f32(self).to_le_bytes());
    }

    fn get_half(bytes: &[u8]) -> f32 {
        f16::from_le_bytes([bytes[0], bytes[1]]).to_f32()
    }

    fn negative(self) -> f32 {
        -self
    }
}

impl Value for i32 {
    const NAME: &'static str = "int32";
    const WIDTH: usize = 4;
    const HALF_WIDTH: Option<usize> = None;
    const ZERO: i32 = 0;

    fn put(self, out: &mut Vec<u8>) {
        out.extend(self.to_le_bytes());
    }

    fn get(bytes: &[u8]) -> i32 {
        i32::from_le_bytes(word(bytes))
    }

    fn put_half(self, out: &mut Vec<u8>) {
        self.put(out);
    }

    fn get_half(bytes: &[u8]) -> i32 {
        i32::get(bytes)
    }

    fn negative(self) -> i32 {
        self.wrapping_neg()
    }
}

impl Value for [f32; 3] {
    const NAME: &'static str = "vec3s";
    const WIDTH: usize = 12;
    const HALF_WIDTH: Option<usize> = Some(6);
    const ZERO: [f32; 3] = [0.0; 3];

    fn put(self, out: &mut Vec<u8>) {
        self.into_iter().for_each(|x| x.put(out));
    }

    fn get(bytes: &[u8]) -> [f32; 3] {
        [0, 4, 8].map(|at| f32::get(&bytes[at..]))
    }

    fn put_half(self, out: &mut Vec<u8>) {
        self.into_iter().for_each(|x| x.put_half(out));
    }

    fn get_half(bytes: &[u8]) -> [f32; 3] {
        [0, 2, 4].map(|at| f32::get_half(&bytes[at..]))
    }

    fn negative(self) -> [f32; 3] {
        self.map(|x| -x)
    }
}
