//! Binary glTF 2.0 [Khronos2021] with extensions of materials [Khronos2024]: a square of
//! cloth with its materials and their textures inside; colourways are variants.

use super::{Baked, GltfTexture, PATCH_MM, WriteError, gltf_textures};
use crate::model::{GLTF, Surface};
use crate::texel::Texel;
use glam::Vec2;
use gltf::binary::{Glb, Header};
use organza_basis::Rgb;
use serde_json::{Value, json};
use std::borrow::Cow;
use std::collections::BTreeSet;

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

/// Cloth that is less open than this is opaque: less than the errors of a material.
const CLOSED: f32 = 0.005;

/// Cloth with so few texels that are partly covered is cut out. What lies behind the others must
/// be drawn first, which programs in real time get wrong.
const PARTLY: f32 = 0.02;

fn alpha_mode(texels: &[Texel]) -> &'static str {
    let count = texels.len().max(1) as f32;
    let open: f32 = texels.iter().map(|t| 1.0 - t.coverage).sum();
    let is_partly = |t: &&Texel| (0.1..0.9).contains(&t.coverage);
    let partly = texels.iter().filter(is_partly).count() as f32;
    if open < CLOSED * count {
        "OPAQUE"
    } else if partly < PARTLY * count {
        "MASK"
    } else {
        "BLEND"
    }
}

/// The textures of a material by their names: places among those of the file, or constants; and how
/// often they repeat where texture coordinates run from 0 to 1.
struct Slots {
    list: Vec<(&'static str, Slot)>,
    repeats: Vec2,
}

enum Slot {
    Index(usize),
    Constant([f64; 4]),
}

impl Slots {
    /// A reference to a texture, or what stands for it where it is constant: shares of 255 of
    /// its channels.
    fn either<T>(
        &self,
        name: &str,
        texture: impl FnOnce(Value) -> T,
        constant: impl FnOnce([f64; 4]) -> T,
    ) -> T {
        let scale = self.repeats.to_array();
        match self.list.iter().find(|(n, _)| *n == name) {
            Some((_, Slot::Index(index))) => texture(json!({
                "index": index,
                "extensions": { "KHR_texture_transform": { "scale": scale } },
            })),
            Some((_, Slot::Constant(value))) => constant(*value),
            None => constant([1.0; 4]),
        }
    }
}

/// A colour that was encoded as sRGB, times a factor.
fn linear([r, g, b, _]: [f64; 4], factor: f64) -> [f64; 3] {
    [r, g, b].map(|c| factor * f64::from(Rgb::linear_from_srgb(c as f32)))
}

/// The images and textures of the file.
#[derive(Default)]
struct Pictures {
    images: Vec<Value>,
    textures: Vec<Value>,
}

/// The material of a cloth, whose pictures are added to the file.
///
/// # Errors
/// A texture that cannot be encoded.
fn material(
    baked: &Baked<'_>,
    parts: &mut Parts,
    pictures: &mut Pictures,
) -> Result<Value, WriteError> {
    let p = baked.gltf;
    let surfaces: Vec<Surface> = baked
        .maps
        .texels
        .iter()
        .map(|t| GLTF.surface(p, t))
        .collect();
    let repeats = PATCH_MM / baked.maps.tile_mm;
    let mut slots = Slots {
        list: Vec::new(),
        repeats,
    };
    for (name, texture) in gltf_textures(baked.maps, &surfaces)? {
        let slot = match texture {
            GltfTexture::Constant(value) => Slot::Constant(value.map(|v| f64::from(v) / 255.0)),
            GltfTexture::Picture(bytes) => {
                let view = parts.add(&bytes, None);
                let (images, textures) = (&mut pictures.images, &mut pictures.textures);
                images.push(json!({ "name": name, "bufferView": view, "mimeType": "image/png" }));
                textures.push(json!({ "sampler": 0, "source": images.len() - 1, "name": name }));
                Slot::Index(textures.len() - 1)
            }
        };
        slots.list.push((name, slot));
    }
    let (roughness, roughness_map) = slots.either(
        "roughness",
        |map| (1.0, map),
        |value| (value[1], Value::Null),
    );
    let mut surface = json!({
        "baseColorTexture": slots.either("base_color", |map| map, |_| Value::Null),
        "metallicFactor": 0.0,
        "roughnessFactor": roughness,
        "metallicRoughnessTexture": roughness_map,
    });
    if let Some(surface) = surface.as_object_mut() {
        surface.retain(|_, value| !value.is_null());
    }
    let sheen = slots.either(
        "sheen",
        |map| json!({ "sheenColorFactor": [p.sheen, p.sheen, p.sheen], "sheenColorTexture": map }),
        |value| json!({ "sheenColorFactor": linear(value, p.sheen) }),
    );
    let mut extensions = json!({
        "KHR_materials_ior": { "ior": p.ior },
        "KHR_materials_specular": slots.either(
            "specular",
            |map| json!({ "specularFactor": p.specular, "specularTexture": map }),
            |value| json!({ "specularFactor": p.specular * value[3] }),
        ),
        "KHR_materials_anisotropy": slots.either(
            "anisotropy",
            |map| json!({ "anisotropyStrength": 1.0, "anisotropyTexture": map }),
            |[cos, sin, strength, _]| json!({
                "anisotropyStrength": strength,
                "anisotropyRotation": (sin - 0.5).atan2(cos - 0.5),
            }),
        ),
        "KHR_materials_sheen": sheen,
        "KHR_materials_transmission": slots.either(
            "roughness",
            |map| json!({ "transmissionFactor": 1.0, "transmissionTexture": map }),
            |value| json!({ "transmissionFactor": value[0] }),
        ),
        "KHR_materials_diffuse_transmission": slots.either(
            "diffuse_transmission",
            |map| json!({
                "diffuseTransmissionFactor": 1.0,
                "diffuseTransmissionTexture": map,
                "diffuseTransmissionColorTexture": map,
            }),
            |value| json!({
                "diffuseTransmissionFactor": value[3],
                "diffuseTransmissionColorFactor": linear(value, 1.0),
            }),
        ),
    });
    extensions["KHR_materials_sheen"]["sheenRoughnessFactor"] = json!(p.sheen_roughness);
    let forward = surfaces.iter().map(|s| s.forward).fold(0.0, f32::max);
    if let Some(extensions) = extensions.as_object_mut()
        && forward < CLOSED
    {
        // Programs in real time render what lies behind first, which takes time.
        extensions.remove("KHR_materials_transmission");
    }
    let normal = |mut map: Value| {
        map["scale"] = json!(p.relief);
        map
    };
    Ok(json!({
        "name": baked.name,
        "doubleSided": true,
        "alphaMode": alpha_mode(&baked.maps.texels),
        "pbrMetallicRoughness": surface,
        "normalTexture": slots.either("normal", normal, |_| Value::Null),
        "extensions": extensions,
        "extras": {
            "tile_mm": baked.maps.tile_mm.to_array(),
            "height_range_mm": baked.maps.height_range_mm(),
        },
    }))
}

/// The whole file.
///
/// # Errors
/// No colourway, a texture that cannot be encoded, or more than glTF's 4 GiB.
pub fn write_glb(colourways: &[Baked<'_>]) -> Result<Vec<u8>, WriteError> {
    let Some(first) = colourways.first() else {
        return Err(WriteError::Text("there is no cloth".into()));
    };
    let mut parts = Parts::default();
    let half = 0.0005 * PATCH_MM;
    // A face that looks along z. Texture coordinates run down from the top, over the square; each
    // texture says how often it repeats there.
    let positions = [
        [-half, -half, 0.0],
        [half, -half, 0.0],
        [half, half, 0.0],
        [-half, half, 0.0],
    ];
    let uv = [[0.0f32, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
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
    let mut pictures = Pictures::default();
    let mut materials = Vec::new();
    for baked in colourways {
        materials.push(material(baked, &mut parts, &mut pictures)?);
    }
    let accessor = |view: usize, kind: &str| json!({ "bufferView": view, "componentType": 5126, "count": 4, "type": kind });
    let mut corners = accessor(views[0], "VEC3");
    corners["min"] = json!([-half, -half, 0.0]);
    corners["max"] = json!([half, half, 0.0]);
    let mut primitive = json!({
        "attributes": { "POSITION": 0, "NORMAL": 1, "TANGENT": 2, "TEXCOORD_0": 3 },
        "indices": 4,
        "material": 0,
    });
    let mut used: BTreeSet<String> = ["KHR_texture_transform".to_owned()].into();
    for material in &materials {
        let extensions = material["extensions"].as_object();
        used.extend(extensions.into_iter().flat_map(|e| e.keys().cloned()));
    }
    let mut document = json!({
        "asset": { "version": "2.0", "generator": "organza" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "name": first.name }],
        "accessors": [
            corners,
            accessor(views[1], "VEC3"),
            accessor(views[2], "VEC4"),
            accessor(views[3], "VEC2"),
            { "bufferView": indices, "componentType": 5123, "count": 6, "type": "SCALAR" },
        ],
        "samplers": [{ "magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497 }],
        "images": pictures.images,
        "textures": pictures.textures,
        "materials": materials,
        "buffers": [{ "byteLength": parts.bytes.len() }],
        "bufferViews": parts.views,
    });
    if colourways.len() > 1 {
        let variant = |baked: &Baked<'_>| json!({ "name": baked.name });
        let variants: Vec<Value> = colourways.iter().map(variant).collect();
        document["extensions"] = json!({ "KHR_materials_variants": { "variants": variants } });
        let mapping = |k: usize| json!({ "material": k, "variants": [k] });
        let mappings: Vec<Value> = (0..colourways.len()).map(mapping).collect();
        primitive["extensions"] = json!({ "KHR_materials_variants": { "mappings": mappings } });
        used.insert("KHR_materials_variants".to_owned());
    }
    document["meshes"] = json!([{ "name": first.name, "primitives": [primitive] }]);
    document["extensionsUsed"] = json!(used);
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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn cloth_is_blended_only_where_it_is_sheer() {
        let of = |coverage: &[f32]| {
            let texel = |&coverage| Texel {
                coverage,
                ..Texel::flat(Vec3::ONE)
            };
            alpha_mode(&coverage.iter().map(texel).collect::<Vec<_>>())
        };
        let mut cloth = [1.0; 1000];
        assert_eq!(of(&cloth), "OPAQUE");
        cloth[..4].fill(0.0);
        assert_eq!(of(&cloth), "OPAQUE");
        cloth[..100].fill(0.0);
        assert_eq!(of(&cloth), "MASK");
        cloth[..100].fill(0.5);
        assert_eq!(of(&cloth), "BLEND");
    }
}
