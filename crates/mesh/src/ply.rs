//! Stanford PLY, text and binary.

use crate::error::Error;
use crate::indexed::Indexed;
use crate::mesh::{Mesh, Vertex};
use crate::obj::Placement;
use glam::{Vec2, Vec3};
use organza_basis::Budget;
use ply_rs_bw::parser::Parser;
use ply_rs_bw::ply::{DefaultElement, Header, Property, PropertyType};

/// Names that programs use for texture coordinates of vertices.
const UV_NAMES: [[&str; 2]; 4] = [
    ["s", "t"],
    ["u", "v"],
    ["texture_u", "texture_v"],
    ["texture_s", "texture_t"],
];

/// Reads a PLY file. Texture coordinates may belong to vertices or, in a list
/// `texcoord`, to the corners of faces; polygons are fanned into triangles.
///
/// # Errors
/// As [`read_obj`](crate::read_obj).
pub fn read_ply(bytes: &[u8], placement: Placement, budget: &mut Budget) -> Result<Mesh, Error> {
    placement.check()?;
    let syntax = |what: String| Error::Syntax(format!("PLY: {what}"));
    let parser = Parser::<DefaultElement>::new();
    let header = parser
        .read_ply_header(&mut &bytes[..])
        .map_err(|e| syntax(e.to_string()))?;
    charge(&header, bytes.len() as u64, budget)?;
    let ply = parser
        .read_ply(&mut &bytes[..])
        .map_err(|e| syntax(e.to_string()))?;
    let elements = |name: &str| {
        let list = ply.payload.get(name);
        list.ok_or_else(|| syntax(format!("has no element `{name}`")))
    };
    let vertices = elements("vertex")?;
    let number = |e: &DefaultElement, key: &str| e.get(key).and_then(scalar);
    let first = vertices.first();
    let has = |key: &str| first.is_some_and(|v| v.contains_key(key));
    let uv_names = UV_NAMES.into_iter().find(|n| n.iter().all(|k| has(k)));
    let has_normals = ["nx", "ny", "nz"].iter().all(|k| has(k));
    let mut mesh = Indexed::new("ply");
    for v in vertices {
        let vector = |keys: [&str; 3]| -> Result<Vec3, Error> {
            let axis = |k: &str| {
                number(v, k).ok_or_else(|| syntax(format!("a vertex has no number `{k}`")))
            };
            Ok(Vec3::new(axis(keys[0])?, axis(keys[1])?, axis(keys[2])?))
        };
        mesh.positions.push(vector(["x", "y", "z"])?);
        if has_normals {
            mesh.normals.push(vector(["nx", "ny", "nz"])?);
        }
        if let Some([u, v_name]) = uv_names {
            let uv = number(v, u).zip(number(v, v_name));
            mesh.uvs.extend(uv.map(|(x, y)| Vec2::new(x, y)));
        }
    }
    for face in elements("face")? {
        let corners = face.get("vertex_indices").or(face.get("vertex_index"));
        let corners = corners
            .and_then(indices)
            .ok_or_else(|| syntax("a face has no list `vertex_indices` of whole numbers".into()))?;
        let own_uv = face.get("texcoord").and_then(floats);
        let own_uv: Option<Vec<Vec2>> = own_uv.map(|list| {
            let (pairs, _) = list.as_chunks::<2>();
            pairs.iter().map(|&p| Vec2::from(p)).collect()
        });
        mesh.fan(&corners, own_uv.as_deref())?;
    }
    mesh.into_mesh(placement)
}

/// Charges the memory of the elements that a header announces before any of them is read: the
/// library keeps a table of properties for each element.
///
/// # Errors For elements without properties and more elements than the file has bytes, which
/// would be read without end, and for more memory than the rest of the budget.
fn charge(header: &Header, file_bytes: u64, budget: &mut Budget) -> Result<(), Error> {
    /// A property in the table of the library: its name, value and place.
    const PROPERTY: u64 = (size_of::<(String, Property)>() + 48) as u64;
    let mut has_lists = false;
    for (name, element) in &header.elements {
        let (count, properties) = (element.count as u64, element.properties.len() as u64);
        if count > 0 && properties == 0 || count > file_bytes {
            return Err(Error::Syntax(format!(
                "PLY: its header announces {count} elements `{name}` of {properties} properties \
                 in a file of {file_bytes} bytes"
            )));
        }
        let is_list = |p: &PropertyType| matches!(p, PropertyType::List(..));
        has_lists |= element.properties.values().any(|p| is_list(&p.data_type));
        let names: u64 = element.properties.keys().map(|k| k.len() as u64).sum();
        let table = size_of::<DefaultElement>() as u64 + names + properties * PROPERTY;
        budget.take(count.saturating_mul(table), "elements")?;
    }
    if has_lists {
        // A number of a list takes a byte at least and eight in memory, and is a
        // corner of one triangle at most.
        let triangle = size_of::<([Vertex; 3], [u32; 12])>() as u64;
        budget.take(file_bytes.saturating_mul(8), "lists")?;
        let faces = header.elements.get("face").map_or(0, |e| e.count as u64);
        budget.take(faces.saturating_mul(2 * triangle), "faces")?;
    }
    Ok(())
}

fn scalar(p: &Property) -> Option<f32> {
    match *p {
        Property::Float(x) => Some(x),
        Property::Double(x) => Some(x as f32),
        Property::Char(x) => Some(x.into()),
        Property::UChar(x) => Some(x.into()),
        Property::Short(x) => Some(x.into()),
        Property::UShort(x) => Some(x.into()),
        Property::Int(x) => Some(x as f32),
        Property::UInt(x) => Some(x as f32),
        _ => None,
    }
}

/// A list of indices; a negative index becomes one beyond every list.
fn indices(p: &Property) -> Option<Vec<u32>> {
    let wide = |list: Vec<i64>| {
        let index = |i: i64| u32::try_from(i).unwrap_or(u32::MAX);
        list.into_iter().map(index).collect()
    };
    Some(match p {
        Property::ListUInt(l) => l.clone(),
        Property::ListInt(l) => wide(l.iter().map(|&i| i.into()).collect()),
        Property::ListUShort(l) => wide(l.iter().map(|&i| i.into()).collect()),
        Property::ListShort(l) => wide(l.iter().map(|&i| i.into()).collect()),
        Property::ListUChar(l) => wide(l.iter().map(|&i| i.into()).collect()),
        Property::ListChar(l) => wide(l.iter().map(|&i| i.into()).collect()),
        _ => return None,
    })
}

fn floats(p: &Property) -> Option<Vec<f32>> {
    match p {
        Property::ListFloat(l) => Some(l.clone()),
        Property::ListDouble(l) => Some(l.iter().map(|&x| x as f32).collect()),
        _ => None,
    }
}
