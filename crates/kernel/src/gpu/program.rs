//! Shaders put together for a scene from the parts that it needs.

use super::device::Device;
use super::numbers::{NumberBuffer, Numbers};
use super::tables::{Split, Tables};
use crate::engine::Lost;
use organza_film::Brightness;
use std::fmt::Write;
use wgpu::{
    BindGroupLayout, BindGroupLayoutDescriptor, BindGroupLayoutEntry, BindingType,
    BufferBindingType, ComputePipeline, ComputePipelineDescriptor, PipelineLayoutDescriptor,
    ShaderModuleDescriptor, ShaderSource, ShaderStages,
};

/// Bindings of group 0.
pub const SCENE_NUMBERS: u32 = 0;
pub const PASS_NUMBERS: u32 = 1;
pub const LANES: u32 = 2;
pub const SUMS: u32 = 3;
pub const CONTROL: u32 = 4;
pub const BRIGHT: u32 = 5;
pub const TABLES: u32 = 6;

/// Parts that every program has.
const COMMON: [&str; 4] = [
    include_str!("math.wgsl"),
    include_str!("random.wgsl"),
    include_str!("film_sums.wgsl"),
    include_str!("lanes.wgsl"),
];

/// A scene for a program: what it is made of, and what it reads.
pub struct ProgramScene<'a> {
    /// Constants of the source, one a line: whether, and which, parts are needed.
    pub constants: String,
    /// Parts of the source beside the common ones.
    pub parts: Vec<&'static str>,
    pub numbers: Numbers,
    pub tables: Tables<'a>,
    /// Words that a lane keeps between dispatches.
    pub lane_words: u32,
    pub film_width: u32,
    pub brightness: Brightness,
}

impl ProgramScene<'_> {
    /// Adds a constant that a part asks for.
    pub fn constant(constants: &mut String, name: &str, value: bool) {
        // Writing to a string cannot fail.
        let _ = writeln!(constants, "const {name}: bool = {value};");
    }

    /// The source of the program for tables that are split so, and numbers of the scene in a
    /// buffer of that kind.
    pub fn source(&self, split: &Split, numbers: NumberBuffer) -> String {
        let storage = |binding: u32, name: &str, of: &str| {
            format!("@group(0) @binding({binding}) var<storage, read_write> {name}: array<{of}>;\n")
        };
        let mut text = self.constants.clone();
        text += &self.numbers.source(SCENE_NUMBERS, numbers);
        let of_pass = PassNumbers::default().numbers();
        text += &of_pass.source(PASS_NUMBERS, NumberBuffer::Uniform);
        text += &storage(LANES, "lane_states", "u32");
        text += &storage(SUMS, "sums", "u32");
        text += &storage(CONTROL, "control", "atomic<u32>");
        text += &storage(BRIGHT, "bright", "u32");
        text += &split.source(TABLES);
        text += include_str!("lane_states.wgsl");
        for part in COMMON.iter().chain(&self.parts) {
            text += part;
        }
        text
    }
}

/// Numbers of a pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PassNumbers {
    pub lanes: u32,
    pub steps: u32,
    pub slots: u32,
    pub slots_per_pixel: u32,
    pub pixels: u32,
    /// The block's first column and row in the whole picture, its columns and rows.
    pub left: u32,
    pub top: u32,
    pub width: u32,
    pub rows: u32,
    /// Samples of every pixel: the first, and the one behind the last.
    pub samples: [u32; 2],
    /// Samples that the list of bright ones has room for.
    pub bright_room: u32,
}

impl PassNumbers {
    /// With their names in shaders.
    pub fn numbers(&self) -> Numbers {
        let mut numbers = Numbers::new("pass_numbers");
        for (name, x) in [
            ("lane_count", self.lanes),
            ("steps_per_dispatch", self.steps),
            ("slot_count", self.slots),
            ("slots_per_pixel", self.slots_per_pixel),
            ("pixel_count", self.pixels),
            ("block_left", self.left),
            ("block_top", self.top),
            ("block_width", self.width),
            ("block_rows", self.rows),
            ("samples_start", self.samples[0]),
            ("samples_end", self.samples[1]),
            ("bright_room", self.bright_room),
        ] {
            numbers.whole(name, x);
        }
        numbers
    }
}

/// A program on a device.
pub struct Program {
    pub pipeline: ComputePipeline,
    pub layout: BindGroupLayout,
}

impl Program {
    /// Compiles a source that reads so many buffers of tables.
    ///
    /// # Errors
    /// The device does not take it.
    pub fn new(device: &Device, source: String, table_buffers: u32) -> Result<Program, Lost> {
        let entry = |binding: u32| BindGroupLayoutEntry {
            binding,
            visibility: ShaderStages::COMPUTE,
            ty: BindingType::Buffer {
                ty: match binding {
                    PASS_NUMBERS => BufferBindingType::Uniform,
                    SCENE_NUMBERS if device.scene_numbers() == NumberBuffer::Uniform => {
                        BufferBindingType::Uniform
                    }
                    _ => BufferBindingType::Storage {
                        read_only: binding >= TABLES || binding == SCENE_NUMBERS,
                    },
                },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let entries: Vec<_> = (0..TABLES + table_buffers).map(entry).collect();
        let of = &device.device;
        let layout = of.create_bind_group_layout(&BindGroupLayoutDescriptor {
            label: Some("organza"),
            entries: &entries,
        });
        let pipeline_layout = of.create_pipeline_layout(&PipelineLayoutDescriptor {
            label: Some("organza"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let module = of.create_shader_module(ShaderModuleDescriptor {
            label: Some("organza"),
            source: ShaderSource::Wgsl(source.into()),
        });
        let pipeline = of.create_compute_pipeline(&ComputePipelineDescriptor {
            label: Some("organza"),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some("main"),
            compilation_options: Default::default(),
            cache: None,
        });
        device.check()?;
        Ok(Program { pipeline, layout })
    }
}

/// Whether a source is valid for every adapter: without numbers of 64 bits, atomic numbers
/// with a point, or operations of subgroups.
///
/// # Errors
/// Where it is not.
pub fn check_source(source: &str) -> Result<(), String> {
    use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};
    let module = wgpu::naga::front::wgsl::parse_str(source);
    let module = module.map_err(|e| e.emit_to_string(source))?;
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    let valid = validator.validate(&module);
    valid.map_err(|e| e.emit_to_string(source)).map(|_| ())
}
