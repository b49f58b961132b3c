//! glTF 2.0, as text with separate buffers or as one binary file.

use crate::error::Error;
use crate::indexed::Indexed;
use crate::mesh::Mesh;
use crate::obj::Placement;
use base64::Engine;
use glam::{Mat4, Vec2, Vec3};
use gltf::accessor::{DataType, Dimensions};
use gltf::buffer::Source;
use gltf::json::validation::Checked;
use gltf::mesh::Mode;
use gltf::{Accessor, Node, Primitive, Semantic};
use organza_basis::Budget;
use std::borrow::Cow;

/// Maximum depth of nested nodes.
const MAX_DEPTH: usize = 64;

/// Reads all triangles of the default scene, or of the first, with the transforms of their
/// nodes. `open` reads a buffer in the folder of the file. Texture coordinates are those of set
/// 0, flipped so that y points up.
///
/// # Errors As [`read_obj`](crate::read_obj); also on anything but plain triangle meshes
/// (strips, sparse accessors, compressed or quantised positions), and on nodes that do not form
/// a tree.
pub fn read_gltf(
    bytes: &[u8],
    placement: Placement,
    open: &dyn Fn(&str) -> std::io::Result<Vec<u8>>,
    budget: &mut Budget,
) -> Result<Mesh, Error> {
    placement.check()?;
    let gltf = parse(bytes)?;
    let mut buffers = Vec::new();
    for buffer in gltf.buffers() {
        let buffer: Cow<'_, [u8]> = match buffer.source() {
            Source::Bin => {
                let part = gltf.blob.as_deref();
                part.ok_or_else(|| syntax("has no binary part"))?.into()
            }
            Source::Uri(uri) => resolve(uri, open)?.into(),
        };
        if let Cow::Owned(read) = &buffer {
            budget.take(read.len() as u64, "buffers")?;
        }
        buffers.push(buffer);
    }
    let scene = gltf.default_scene().or_else(|| gltf.scenes().next());
    let scene = scene.ok_or_else(|| syntax("has no scene"))?;
    let mut reader = Reader {
        buffers,
        placement,
        triangles: Vec::new(),
        corners: Vec::new(),
        seen: vec![false; gltf.nodes().len()],
        budget,
    };
    for node in scene.nodes() {
        reader.node(&node, Mat4::IDENTITY, 0)?;
    }
    Mesh::new(reader.triangles, &reader.corners)
}

fn syntax(what: &str) -> Error {
    Error::Syntax(format!("glTF: {what}"))
}

/// Bytes of the header of a binary file, which its length includes.
const BINARY_HEADER: u32 = 12;

/// The length that a binary file says it has; `None` of a text.
fn binary_length(bytes: &[u8]) -> Option<u32> {
    let header = bytes.first_chunk::<{ BINARY_HEADER as usize }>()?;
    let [b'g', b'l', b'T', b'F', _, _, _, _, length @ ..] = *header else {
        return None;
    };
    Some(u32::from_le_bytes(length))
}

/// Parses and checks the text of the file. Indices of positions are checked first, because the
/// checks of the library index accessors without a bounds check; so is the length of a binary
/// file, from which the library subtracts that of the header.
fn parse(bytes: &[u8]) -> Result<gltf::Gltf, Error> {
    if let Some(length) = binary_length(bytes).filter(|length| *length < BINARY_HEADER) {
        return Err(syntax(&format!(
            "the header says that the file has {length} bytes, fewer than the header itself"
        )));
    }
    let unchecked = gltf::Gltf::from_slice_without_validation(bytes);
    let unchecked = unchecked.map_err(|e| syntax(&e.to_string()))?;
    let json = unchecked.document.as_json();
    let positions = Checked::Valid(Semantic::Positions);
    for (i, mesh) in json.meshes.iter().enumerate() {
        for primitive in &mesh.primitives {
            let accessor = primitive.attributes.get(&positions).map(|a| a.value());
            if let Some(accessor) = accessor.filter(|&a| a >= json.accessors.len()) {
                return Err(syntax(&format!(
                    "meshes[{i}]: POSITION names accessor {accessor} of {}",
                    json.accessors.len()
                )));
            }
        }
    }
    gltf::Gltf::from_slice(bytes).map_err(|e| syntax(&e.to_string()))
}

fn resolve(uri: &str, open: &dyn Fn(&str) -> std::io::Result<Vec<u8>>) -> Result<Vec<u8>, Error> {
    let Some(data) = uri.strip_prefix("data:") else {
        return open(uri).map_err(|e| syntax(&format!("buffer `{uri}`: {e}")));
    };
    let (_, text) = data
        .split_once(";base64,")
        .ok_or_else(|| syntax("a data: buffer is not in base64"))?;
    base64::engine::general_purpose::STANDARD
        .decode(text)
        .map_err(|e| syntax(&format!("a data: buffer: {e}")))
}

struct Reader<'a> {
    buffers: Vec<Cow<'a, [u8]>>,
    placement: Placement,
    triangles: Vec<[crate::Vertex; 3]>,
    corners: Vec<[u32; 3]>,
    /// Visited nodes: each has at most one parent.
    seen: Vec<bool>,
    budget: &'a mut Budget,
}

impl Reader<'_> {
    fn node(&mut self, node: &Node<'_>, parent: Mat4, depth: usize) -> Result<(), Error> {
        if std::mem::replace(&mut self.seen[node.index()], true) {
            let index = node.index();
            return Err(syntax(&format!("nodes[{index}] has more than one parent")));
        }
        if depth > MAX_DEPTH {
            return Err(syntax(&format!("nodes nest deeper than {MAX_DEPTH}")));
        }
        let world = parent * Mat4::from_cols_array_2d(&node.transform().matrix());
        if let Some(mesh) = node.mesh() {
            let name = mesh.name().or(node.name()).unwrap_or("gltf");
            for primitive in mesh.primitives() {
                self.primitive(&primitive, name, world)?;
            }
        }
        for child in node.children() {
            self.node(&child, world, depth + 1)?;
        }
        Ok(())
    }

    fn primitive(&mut self, p: &Primitive<'_>, name: &str, world: Mat4) -> Result<(), Error> {
        match p.mode() {
            Mode::Triangles => {}
            Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => return Ok(()),
            _ => {
                return Err(syntax(&format!(
                    "mesh `{name}` is made of strips or fans; export it as triangles"
                )));
            }
        }
        let positions = p
            .get(&Semantic::Positions)
            .ok_or_else(|| syntax(&format!("mesh `{name}` has no positions")))?;
        let corners = p.indices().map_or(positions.count(), |a| a.count()) as u64;
        self.budget
            .take_items::<[Vec3; 6]>(positions.count() as u64, "vertices")?;
        self.budget
            .take_items::<([crate::Vertex; 3], [u32; 16])>(corners / 3, "triangles")?;
        let mut mesh = Indexed::new(name);
        for [x, y, z] in self.floats::<3>(&positions, Dimensions::Vec3)? {
            mesh.positions
                .push(world.transform_point3(Vec3::new(x, y, z)));
        }
        if let Some(accessor) = p.get(&Semantic::Normals) {
            let turn = world.inverse().transpose();
            for [x, y, z] in self.floats::<3>(&accessor, Dimensions::Vec3)? {
                mesh.normals
                    .push(turn.transform_vector3(Vec3::new(x, y, z)));
            }
        }
        if let Some(accessor) = p.get(&Semantic::TexCoords(0)) {
            for [u, v] in self.floats::<2>(&accessor, Dimensions::Vec2)? {
                mesh.uvs.push(Vec2::new(u, 1.0 - v));
            }
        }
        let indices = match p.indices() {
            Some(accessor) => self.indices(&accessor)?,
            None => (0..mesh.positions.len() as u32).collect(),
        };
        for triangle in indices.chunks_exact(3) {
            mesh.fan(triangle, None)?;
        }
        let first_point = self.corners.iter().flatten().max().map_or(0, |m| m + 1);
        let (triangles, corners) = mesh.triangles(self.placement, first_point)?;
        self.triangles.extend(triangles);
        self.corners.extend(corners);
        Ok(())
    }

    fn indices(&self, accessor: &Accessor<'_>) -> Result<Vec<u32>, Error> {
        let items = self.items(accessor)?;
        Ok(match (accessor.dimensions(), accessor.data_type()) {
            (Dimensions::Scalar, DataType::U8) => items.map(|b| b[0].into()).collect(),
            (Dimensions::Scalar, DataType::U16) => items
                .map(|b| u16::from_le_bytes([b[0], b[1]]).into())
                .collect(),
            (Dimensions::Scalar, DataType::U32) => items
                .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect(),
            _ => return Err(syntax("indices are not whole numbers")),
        })
    }

    /// Vectors of floats, or of normalised integers where the format allows them (texture
    /// coordinates).
    fn floats<const N: usize>(
        &self,
        accessor: &Accessor<'_>,
        dimensions: Dimensions,
    ) -> Result<Vec<[f32; N]>, Error> {
        let item = |b: &[u8], i: usize| match accessor.data_type() {
            DataType::U8 if N == 2 => Some(f32::from(b[i]) / 255.0),
            DataType::U16 if N == 2 => {
                Some(f32::from(u16::from_le_bytes([b[2 * i], b[2 * i + 1]])) / 65_535.0)
            }
            DataType::F32 => {
                let b = &b[4 * i..];
                Some(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            }
            _ => None,
        };
        let is_float = |b: &[u8]| item(b, 0).is_some();
        let wrong = || syntax("an accessor has another type than vectors of floats");
        if accessor.dimensions() != dimensions {
            return Err(wrong());
        }
        self.items(accessor)?
            .map(|b| {
                let vector = std::array::from_fn(|i| item(b, i).unwrap_or(0.0));
                is_float(b).then_some(vector).ok_or_else(wrong)
            })
            .collect()
    }

    /// The bytes of every item of an accessor, each with the length of its type.
    fn items(&self, accessor: &Accessor<'_>) -> Result<impl Iterator<Item = &[u8]>, Error> {
        let view = match accessor.view() {
            Some(view) if accessor.sparse().is_none() => view,
            _ => return Err(syntax("sparse accessors are not read")),
        };
        let size = accessor.size();
        let stride = view.stride().unwrap_or(size);
        let bytes = || -> Option<&[u8]> {
            let buffer = self.buffers.get(view.buffer().index())?;
            let end = view.offset().checked_add(view.length())?;
            let bytes = buffer.get(view.offset()..end)?.get(accessor.offset()..)?;
            let last = accessor.count().checked_sub(1)?.checked_mul(stride)?;
            bytes.get(..last.checked_add(size)?)
        };
        let bytes = match bytes() {
            Some(bytes) if stride >= size => bytes,
            _ => return Err(syntax("an accessor reaches beyond its buffer or is empty")),
        };
        Ok(bytes.chunks(stride).filter_map(move |b| b.get(..size)))
    }
}
