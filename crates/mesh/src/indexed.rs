//! Meshes in the form of most files: lists of vertices, and triangles of indices.

use crate::error::Error;
use crate::mesh::{Mesh, Vertex};
use crate::obj::{MAX_FACES, Placement};
use glam::{Vec2, Vec3};
use std::collections::HashMap;

/// A mesh under construction, in the units of its file.
pub(crate) struct Indexed {
    name: String,
    pub positions: Vec<Vec3>,
    /// One per position, or none.
    pub normals: Vec<Vec3>,
    /// One per position; texture coordinates beyond the list are missing.
    pub uvs: Vec<Vec2>,
    triangles: Vec<([u32; 3], Option<[Vec2; 3]>)>,
}

impl Indexed {
    pub fn new(name: &str) -> Indexed {
        Indexed {
            name: name.into(),
            positions: Vec::new(),
            normals: Vec::new(),
            uvs: Vec::new(),
            triangles: Vec::new(),
        }
    }

    /// Adds a polygon, which may have its own texture coordinates.
    pub fn fan(&mut self, corners: &[u32], own_uv: Option<&[Vec2]>) -> Result<(), Error> {
        for k in 2..corners.len() {
            let at = [0, k - 1, k];
            let uv = own_uv.and_then(|uv| {
                let [a, b, c] = at.map(|i| uv.get(i).copied());
                Some([a?, b?, c?])
            });
            self.triangles.push((at.map(|i| corners[i]), uv));
            if self.triangles.len() > MAX_FACES {
                return Err(Error::TooLarge {
                    faces: self.triangles.len(),
                    limit: MAX_FACES,
                });
            }
        }
        Ok(())
    }

    /// Checks everything and builds the mesh. Corners at exactly the same position count as one
    /// point, because files split vertices where texture or normal jumps.
    pub fn into_mesh(self, placement: Placement) -> Result<Mesh, Error> {
        let (triangles, corners) = self.triangles(placement, 0)?;
        Mesh::new(triangles, &corners)
    }

    /// Faces, with points numbered from `first_point` on.
    #[allow(clippy::type_complexity)]
    pub fn triangles(
        &self,
        placement: Placement,
        first_point: u32,
    ) -> Result<(Vec<[Vertex; 3]>, Vec<[u32; 3]>), Error> {
        self.check()?;
        let mut points: HashMap<[u32; 3], u32> = HashMap::new();
        let point_of: Vec<u32> = self
            .positions
            .iter()
            .map(|p| {
                // Adding zero turns minus zero into zero.
                let bits = (*p + 0.0).to_array().map(f32::to_bits);
                let next = first_point + points.len() as u32;
                *points.entry(bits).or_insert(next)
            })
            .collect();
        let vertex = |corner: u32, own: Option<Vec2>| -> Result<Vertex, Error> {
            let i = corner as usize;
            let outside = || {
                let count = self.positions.len();
                Error::Syntax(format!("a face has corner {corner} of {count} (from 0)"))
            };
            let uv = own.or(self.uvs.get(i).copied()).unwrap_or_default();
            Ok(Vertex {
                position_mm: *self.positions.get(i).ok_or_else(outside)? * placement.mm_per_unit,
                normal: self.normals.get(i).copied().unwrap_or_default(),
                uv_mm: uv * placement.mm_per_uv,
            })
        };
        let mut faces = Vec::with_capacity(self.triangles.len());
        let mut corners = Vec::with_capacity(self.triangles.len());
        for (ids, uv) in &self.triangles {
            let own = |k: usize| uv.map(|uv| uv[k]);
            faces.push([
                vertex(ids[0], own(0))?,
                vertex(ids[1], own(1))?,
                vertex(ids[2], own(2))?,
            ]);
            corners.push(ids.map(|i| point_of[i as usize]));
        }
        Ok((faces, corners))
    }

    fn check(&self) -> Result<(), Error> {
        let bad = |list: &[Vec3]| list.iter().position(|p| !p.is_finite());
        let lists = [
            ("position", bad(&self.positions)),
            ("normal", bad(&self.normals)),
            (
                "texture coordinate",
                self.uvs.iter().position(|uv| !uv.is_finite()),
            ),
        ];
        if let Some((what, Some(index))) = lists.into_iter().find(|l| l.1.is_some()) {
            return Err(Error::NotFinite {
                object: self.name.clone(),
                what,
                index,
            });
        }
        let without = |(ids, own): &&([u32; 3], Option<[Vec2; 3]>)| {
            own.is_none() && ids.iter().any(|&i| i as usize >= self.uvs.len())
        };
        let missing = self.triangles.iter().filter(without).count();
        if missing > 0 {
            return Err(Error::MissingUv {
                object: self.name.clone(),
                missing: 3 * missing,
                corners: 3 * self.triangles.len(),
            });
        }
        Ok(())
    }
}
