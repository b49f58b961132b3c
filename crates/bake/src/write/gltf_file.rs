//! Binary glTF 2.0 [Khronos2021] with extensions of materials [Khronos2024]: a square of
//! cloth with the material and its textures inside.

use super::{Baked, PATCH_MM, WriteError, gltf_textures};
use crate::model::{GLTF, Surface};
use gltf::binary::{Glb, Header};
use serde_json::{Value, json};
use std::borrow::Cow;

/// A buffer that grows by aligned parts.
#[derive(Default)]
struct Parts {
    bytes: Vec<u8>,
    views: Vec<Value>,
}

impl Parts {
    /// Adds a part and gives the number of its view.
    fn add(&mut self, part: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({
            "buffer": 0,
            "byteOffset": self.bytes.len(),
            "byteLength": part.len(),
        });
        if let (Some(target), Some(view)) = (target, view.as_object_mut()) {
            view.insert("target".into(), json!(target));
        }
        self.bytes.extend_from_slice(part);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(view);
        self.views.len() - 1
    }
}

/// Bytes of floats, least significant first.
fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Vertex data of OpenGL's buffer targets.
const VERTICES: Option<u32> = Some(34962);
const INDICES: Option<u32> = Some(34963);

/// The whole file.
///
/// # Errors
/// A texture that cannot be encoded, or more than glTF's 4 GiB.
pub fn write_glb(baked: &Baked<'_>) -> Result<Vec<u8>, WriteError> {
    let p = baked.gltf;
    let surfaces: Vec<Surface> = baked
        .maps
        .texels
        .iter()
        .map(|t| GLTF.surface(p, t))
        .collect();
    let mut parts = Parts::default();
    let half = 0.0005 * PATCH_MM;
    let repeats = PATCH_MM / baked.maps.tile_mm;
    // A face that looks along z. Texture coordinates run down from the top, and begin at a
    // corner of a repeat there.
    let positions = [
        [-half, -half, 0.0],
        [half, -half, 0.0],
        [half, half, 0.0],
        [-half, half, 0.0],
    ];
    let uv = [
        [0.0, repeats.y],
        [repeats.x, repeats.y],
        [repeats.x, 0.0],
        [0.0, 0.0],
    ];
    let views = [
        parts.add(&floats(positions.as_flattened()), VERTICES),
        parts.add(&floats([[0.0, 0.0, 1.0]; 4].as_flattened()), VERTICES),
        parts.add(&floats([[1.0, 0.0, 0.0, 1.0]; 4].as_flattened()), VERTICES),
        parts.add(&floats(uv.as_flattened()), VERTICES),
    ];
    let corners: Vec<u8> = [0u16, 1, 2, 0, 2, 3]
        .iter()
        .flat_map(|i| i.to_le_bytes())
        .collect();
    let indices = parts.add(&corners, INDICES);
    let (mut images, mut textures) = (Vec::new(), Vec::new());
    for (name, bytes) in gltf_textures(baked.maps, &surfaces)? {
        let view = parts.add(&bytes, None);
        images.push(json!({ "name": name, "bufferView": view, "mimeType": "image/png" }));
        textures.push(json!({ "sampler": 0, "source": images.len() - 1, "name": name }));
    }
    let accessor = |view: usize, kind: &str| json!({ "bufferView": view, "componentType": 5126, "count": 4, "type": kind });
    let mut corners = accessor(views[0], "VEC3");
    if let Some(corners) = corners.as_object_mut() {
        corners.insert("min".into(), json!([-half, -half, 0.0]));
        corners.insert("max".into(), json!([half, half, 0.0]));
    }
    let is_open = baked.maps.texels.iter().any(|t| t.coverage < 0.998);
    let document = json!({
        "asset": { "version": "2.0", "generator": "organza" },
        "extensionsUsed": [
            "KHR_materials_anisotropy",
            "KHR_materials_diffuse_transmission",
            "KHR_materials_ior",
            "KHR_materials_sheen",
            "KHR_materials_specular",
        ],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "name": baked.name }],
        "meshes": [{ "name": baked.name, "primitives": [{
            "attributes": { "POSITION": 0, "NORMAL": 1, "TANGENT": 2, "TEXCOORD_0": 3 },
            "indices": 4,
            "material": 0,
        }]}],
        "accessors": [
            corners,
            accessor(views[1], "VEC3"),
            accessor(views[2], "VEC4"),
            accessor(views[3], "VEC2"),
            { "bufferView": indices, "componentType": 5123, "count": 6, "type": "SCALAR" },
        ],
        "samplers": [{ "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497 }],
        "images": images,
        "textures": textures,
        "materials": [{
            "name": baked.name,
            "doubleSided": true,
            "alphaMode": if is_open { "BLEND" } else { "OPAQUE" },
            "pbrMetallicRoughness": {
                "baseColorTexture": { "index": 0 },
                "metallicFactor": 0.0,
                "roughnessFactor": 1.0,
                "metallicRoughnessTexture": { "index": 2 },
            },
            "normalTexture": { "index": 1, "scale": p.relief },
            "extensions": {
                "KHR_materials_ior": { "ior": p.ior },
                "KHR_materials_specular": { "specularTexture": { "index": 6 } },
                "KHR_materials_anisotropy": {
                    "anisotropyStrength": 1.0,
                    "anisotropyTexture": { "index": 3 },
                },
                "KHR_materials_sheen": {
                    "sheenColorFactor": [p.sheen, p.sheen, p.sheen],
                    "sheenColorTexture": { "index": 4 },
                    "sheenRoughnessFactor": p.sheen_roughness,
                },
                "KHR_materials_diffuse_transmission": {
                    "diffuseTransmissionFactor": 1.0,
                    "diffuseTransmissionTexture": { "index": 5 },
                    "diffuseTransmissionColorTexture": { "index": 5 },
                },
            },
            "extras": {
                "tile_mm": baked.maps.tile_mm.to_array(),
                "height_range_mm": baked.maps.height_range_mm(),
            },
        }],
        "buffers": [{ "byteLength": parts.bytes.len() }],
        "bufferViews": parts.views,
    });
    let text = serde_json::to_vec(&document).map_err(|e| WriteError::Text(e.to_string()))?;
    if text.len() as u64 + parts.bytes.len() as u64 > u64::from(u32::MAX) - 1024 {
        return Err(WriteError::Text("glTF files end at 4 GiB".into()));
    }
    let glb = Glb {
        header: Header {
            magic: *b"glTF",
            version: 2,
            length: 0, // the writer counts
        },
        json: Cow::Owned(text),
        bin: Some(Cow::Owned(parts.bytes)),
    };
    glb.to_vec().map_err(|e| WriteError::Text(e.to_string()))
}
