//! Wavefront OBJ.

use crate::error::Error;
use crate::mesh::{Mesh, Vertex};
use glam::{Vec2, Vec3};
use organza_basis::Budget;

/// The units of the numbers in a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Millimetres per unit of length in the file.
    pub mm_per_unit: f32,
    /// Millimetres of cloth per unit of texture coordinate.
    pub mm_per_uv: f32,
}

/// Maximum number of triangles.
pub(crate) const MAX_FACES: usize = 1 << 28;

impl Placement {
    /// Refuses scales that are not positive numbers.
    pub(crate) fn check(&self) -> Result<(), Error> {
        for (key, value) in [
            ("mm_per_unit", self.mm_per_unit),
            ("mm_per_uv", self.mm_per_uv),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(Error::Scale { key, value });
            }
        }
        Ok(())
    }
}

/// Reads every object of an OBJ file as one mesh. Polygons are fanned into
/// triangles; materials are not read.
///
/// # Errors For text that is not OBJ, missing texture coordinates, numbers that are not finite,
/// more memory than the rest of the budget, and meshes without a face that has an area. Faces
/// without area and missing normals are repaired: see [`Mesh::repairs`].
pub fn read_obj(text: &[u8], placement: Placement, budget: &mut Budget) -> Result<Mesh, Error> {
    placement.check()?;
    let options = tobj::LoadOptions {
        triangulate: true,
        ignore_points: true,
        ignore_lines: true,
        ..Default::default()
    };
    let no_materials = |_: &std::path::Path| Ok(Default::default());
    check_lines(text)?.charge(budget)?;
    let mut reader = text;
    let (models, _) = tobj::load_obj_buf(&mut reader, &options, no_materials)
        .map_err(|e| Error::Syntax(e.to_string()))?;
    let faces: usize = models.iter().map(|m| m.mesh.indices.len() / 3).sum();
    if faces > MAX_FACES {
        return Err(Error::TooLarge {
            faces,
            limit: MAX_FACES,
        });
    }
    let mut triangles = Vec::with_capacity(faces);
    let mut corners = Vec::with_capacity(faces);
    let mut first_corner = 0u32;
    for model in &models {
        append(model, placement, first_corner, &mut triangles, &mut corners)?;
        first_corner += (model.mesh.positions.len() / 3) as u32;
    }
    Mesh::new(triangles, &corners)
}

/// The numbers of elements that the lines of a file give.
#[derive(Clone, Copy, Debug, Default)]
struct Sizes {
    /// Positions, texture coordinates and normals.
    vectors: u64,
    /// Corners of faces.
    corners: u64,
    /// Triangles that the faces are fanned into.
    triangles: u64,
}

impl Sizes {
    /// Charges the memory of reading: the lists of the library and those of this crate.
    fn charge(self, budget: &mut Budget) -> Result<(), Error> {
        budget.take_items::<[f32; 6]>(self.vectors, "vertices")?;
        budget.take_items::<[u64; 3]>(self.corners, "faces")?;
        budget.take_items::<([Vertex; 3], [u32; 12])>(self.triangles, "triangles")?;
        Ok(())
    }
}

/// Counts the elements of a file, and refuses relative indices that point before their list,
/// for which the library overflows.
fn check_lines(text: &[u8]) -> Result<Sizes, Error> {
    let mut counts = [0i64; 3];
    let mut sizes = Sizes::default();
    for (number, line) in text.split(|&b| b == b'\n').enumerate() {
        let Ok(line) = std::str::from_utf8(line) else {
            continue; // for the reader to complain of
        };
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => counts[0] += 1,
            Some("vt") => counts[1] += 1,
            Some("vn") => counts[2] += 1,
            Some("f" | "l" | "p") => {
                let mut corners = 0;
                let words = words.inspect(|_| corners += 1);
                for word in words.filter(|w| w.contains('-')) {
                    for (index, count) in word.split('/').zip(counts) {
                        if index.parse::<i64>().is_ok_and(|i| i < -count) {
                            return Err(Error::Syntax(format!(
                                "line {}: the index {index} points before the first of {count}",
                                number + 1
                            )));
                        }
                    }
                }
                sizes.corners += corners;
                sizes.triangles += corners.saturating_sub(2);
            }
            _ => {}
        }
    }
    sizes.vectors = counts.iter().sum::<i64>().unsigned_abs();
    Ok(sizes)
}

/// Adds one object; `first_corner` distinguishes its corners from those of other objects.
fn append(
    model: &tobj::Model,
    placement: Placement,
    first_corner: u32,
    triangles: &mut Vec<[Vertex; 3]>,
    corners: &mut Vec<[u32; 3]>,
) -> Result<(), Error> {
    let mesh = &model.mesh;
    let count = mesh.indices.len();
    // The reader omits missing values, so a short list means that some corners have none.
    if mesh.texcoord_indices.len() != count {
        return Err(Error::MissingUv {
            object: model.name.clone(),
            missing: count - mesh.texcoord_indices.len().min(count),
            corners: count,
        });
    }
    for (what, numbers, size) in [
        ("position", &mesh.positions, 3),
        ("normal", &mesh.normals, 3),
        ("texture coordinate", &mesh.texcoords, 2),
    ] {
        if let Some(i) = numbers.iter().position(|x| !x.is_finite()) {
            return Err(Error::NotFinite {
                object: model.name.clone(),
                what,
                index: i / size,
            });
        }
    }
    let outside = || Error::Syntax("an index points outside its list".into());
    let vector = |list: &[f32], i: u32| {
        let i = 3 * i as usize;
        list.get(i..i + 3).map(Vec3::from_slice).ok_or_else(outside)
    };
    let has_normals = mesh.normal_indices.len() == count;
    let vertex = |k: usize| -> Result<Vertex, Error> {
        let uv = 2 * mesh.texcoord_indices[k] as usize;
        let uv = mesh.texcoords.get(uv..uv + 2).ok_or_else(outside)?;
        Ok(Vertex {
            position_mm: vector(&mesh.positions, mesh.indices[k])? * placement.mm_per_unit,
            normal: if has_normals {
                vector(&mesh.normals, mesh.normal_indices[k])?
            } else {
                Vec3::ZERO
            },
            uv_mm: Vec2::from_slice(uv) * placement.mm_per_uv,
        })
    };
    for k in (0..count - count % 3).step_by(3) {
        triangles.push([vertex(k)?, vertex(k + 1)?, vertex(k + 2)?]);
        corners.push([0, 1, 2].map(|i| first_corner + mesh.indices[k + i]));
    }
    Ok(())
}
