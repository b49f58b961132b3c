//! Plain numbers for shaders: the words of a buffer, and the functions of the
//! shading language that read them. One list makes both, so they cannot disagree.

use glam::{UVec3, Vec2, Vec3};
use std::fmt::Write;

/// Named numbers, each in a slot of four words.
pub struct Numbers {
    buffer: &'static str,
    words: Vec<[u32; 4]>,
    accessors: String,
}

/// Kinds of buffers that shaders read numbers from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NumberBuffer {
    Uniform,
    /// For drivers on processors: these compile uniform numbers that end loops into the program,
    /// and so optimise it anew for every dispatch.
    Storage,
}

impl Numbers {
    /// No numbers, of the buffer with that name in the shader.
    pub fn new(buffer: &'static str) -> Numbers {
        Numbers {
            buffer,
            words: Vec::new(),
            accessors: String::new(),
        }
    }

    fn add(&mut self, name: &str, kind: &str, value: &str, words: [u32; 4]) {
        let (buffer, slot) = (self.buffer, self.words.len());
        let value = value.replace('$', &format!("{buffer}[{slot}]"));
        // Writing to a string cannot fail.
        let _ = writeln!(
            self.accessors,
            "fn {name}() -> {kind} {{ return {value}; }}"
        );
        self.words.push(words);
    }

    /// A whole number.
    pub fn whole(&mut self, name: &str, x: u32) {
        self.add(name, "u32", "$.x", [x, 0, 0, 0]);
    }

    /// A whole number with a sign.
    pub fn signed(&mut self, name: &str, x: i32) {
        self.add(name, "i32", "bitcast<i32>($.x)", [x as u32, 0, 0, 0]);
    }

    /// A number.
    pub fn number(&mut self, name: &str, x: f32) {
        self.add(name, "f32", "bitcast<f32>($.x)", [x.to_bits(), 0, 0, 0]);
    }

    /// Two numbers.
    pub fn two(&mut self, name: &str, v: Vec2) {
        let words = [v.x.to_bits(), v.y.to_bits(), 0, 0];
        self.add(name, "vec2<f32>", "bitcast<vec2<f32>>($.xy)", words);
    }

    /// Three numbers.
    pub fn three(&mut self, name: &str, v: Vec3) {
        let words = [v.x.to_bits(), v.y.to_bits(), v.z.to_bits(), 0];
        self.add(name, "vec3<f32>", "bitcast<vec3<f32>>($.xyz)", words);
    }

    /// Three whole numbers.
    pub fn three_whole(&mut self, name: &str, v: UVec3) {
        self.add(name, "vec3<u32>", "$.xyz", [v.x, v.y, v.z, 0]);
    }

    /// The words of the buffer.
    pub fn words(&self) -> &[u32] {
        self.words.as_flattened()
    }

    /// The buffer of a kind, bound at that number of group 0, and the functions that read it.
    pub fn source(&self, binding: u32, kind: NumberBuffer) -> String {
        let (buffer, count) = (self.buffer, self.words.len());
        let space = match kind {
            NumberBuffer::Uniform => "uniform",
            NumberBuffer::Storage => "storage, read",
        };
        format!(
            "@group(0) @binding({binding}) var<{space}> {buffer}: array<vec4<u32>, {count}>;\n{}",
            self.accessors
        )
    }
}
