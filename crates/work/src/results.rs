//! What requests found: named arrays, figures and files in memory.

use serde_json::Value;

/// What a request found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Results {
    /// Arrays by their names.
    pub arrays: Vec<(String, Array)>,
    /// Single figures and lists of other things by their names.
    pub figures: Vec<(String, Value)>,
    /// Files by the last part of their names, with their bytes.
    pub files: Vec<(String, Vec<u8>)>,
}

/// Numbers in rows of rows; the last index runs fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Length along every index.
    pub shape: Vec<usize>,
    /// The numbers, as many as the product of `shape`.
    pub numbers: Numbers,
}

/// Numbers of one type.
#[derive(Clone, Debug, PartialEq)]
pub enum Numbers {
    /// 32-bit floats.
    F32(Vec<f32>),
    /// 64-bit floats.
    F64(Vec<f64>),
    /// Whole numbers.
    I32(Vec<i32>),
    /// Bytes.
    U8(Vec<u8>),
}

impl Results {
    /// The results with one more array of floats.
    pub fn with_f32(mut self, name: &str, shape: &[usize], numbers: Vec<f32>) -> Results {
        self.push(name, shape, Numbers::F32(numbers));
        self
    }

    /// The results with one more array of doubles.
    pub fn with_f64(mut self, name: &str, shape: &[usize], numbers: Vec<f64>) -> Results {
        self.push(name, shape, Numbers::F64(numbers));
        self
    }

    /// The results with one more array of whole numbers.
    pub fn with_i32(mut self, name: &str, shape: &[usize], numbers: Vec<i32>) -> Results {
        self.push(name, shape, Numbers::I32(numbers));
        self
    }

    /// The results with one more figure.
    pub fn with_figure(mut self, name: &str, figure: impl Into<Value>) -> Results {
        self.figures.push((name.to_owned(), figure.into()));
        self
    }

    /// The array of a name.
    pub fn array(&self, name: &str) -> Option<&Array> {
        let found = self.arrays.iter().find(|(n, _)| n == name);
        found.map(|(_, array)| array)
    }

    /// Adds an array.
    pub fn push(&mut self, name: &str, shape: &[usize], numbers: Numbers) {
        let array = Array {
            shape: shape.to_vec(),
            numbers,
        };
        self.arrays.push((name.to_owned(), array));
    }
}
