//! What the scenes of several tests are made of, and how they are rendered.

use glam::{DVec3, UVec2, Vec2, Vec3};
use organza_basis::curve::SegmentSource;
use organza_basis::{Rgb, unwatched, warp};
use organza_mesh::{Mesh, Vertex};
use organza_transport::*;
use organza_volume::{FibreFootprint, Octree, VoxelizeOptions, voxelize};
use std::ops::ControlFlow;

/// A camera that looks from one point at another, without perspective.
pub fn orthographic(origin_mm: DVec3, target_mm: DVec3, width_mm: f64, pixels: u32) -> Camera {
    let pose = CameraPose::new(origin_mm, target_mm, DVec3::Y);
    let projection = Projection::Orthographic { width_mm };
    Camera::new(projection, pose, UVec2::splat(pixels), PixelFilter::Box).unwrap()
}

/// Even white light from a half of the sphere, or from all of it.
pub fn white_sky(hemisphere: Hemisphere) -> Light {
    Light::from(EnvironmentLight::new(Rgb::WHITE, hemisphere))
}

/// Parallel grey light.
pub fn sun(direction: Vec3, irradiance: f32) -> Light {
    Light::from(DirectionalLight::new(
        direction.normalize(),
        Rgb::splat(irradiance),
    ))
}

pub fn direction(theta_deg: f32, phi_deg: f32) -> Vec3 {
    warp::direction_from_angles(theta_deg.to_radians(), phi_deg.to_radians())
}

/// Fibres in voxels that their axes pass.
pub fn octree(source: &dyn SegmentSource, voxel_mm: f32, levels: u8) -> Octree {
    let options = VoxelizeOptions {
        voxel_mm,
        levels: Some(levels),
        footprint: FibreFootprint::Axis,
        max_memory_bytes: None,
    };
    voxelize(source, &options, &unwatched).unwrap()
}

/// A rectangle of cloth about the origin of the cloth, `bend` taking its places to the world:
/// position and normal.
pub fn mesh(size_mm: Vec2, cells: UVec2, bend: &dyn Fn(Vec2) -> (Vec3, Vec3)) -> Mesh {
    let vertex = |i: u32, j: u32| {
        let uv_mm = (UVec2::new(i, j).as_vec2() / cells.as_vec2() - 0.5) * size_mm;
        let (position_mm, normal) = bend(uv_mm);
        let vertex = Vertex {
            position_mm,
            normal,
            uv_mm,
        };
        (vertex, j * (cells.x + 1) + i)
    };
    let (mut triangles, mut corners) = (Vec::new(), Vec::new());
    for (i, j) in (0..cells.y).flat_map(|j| (0..cells.x).map(move |i| (i, j))) {
        let quad = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(|(i, j)| vertex(i, j));
        for face in [[quad[0], quad[1], quad[2]], [quad[0], quad[2], quad[3]]] {
            triangles.push(face.map(|v| v.0));
            corners.push(face.map(|v| v.1));
        }
    }
    Mesh::new(triangles, &corners).unwrap()
}

/// The film of the general walk, and its counts.
pub fn rendered(
    scene: &Scene,
    integrator: Integrator,
    samples: u64,
    max_bounces: u32,
    seed: u64,
) -> (Film, Stats) {
    let settings = RenderSettings {
        integrator,
        samples: 0..samples,
        max_bounces,
        seed,
        crop: None,
    };
    let (film, stats) = render(scene, &settings, &|_| ControlFlow::Continue(())).unwrap();
    assert_eq!((stats.rejected, stats.majorant_violations), (0, 0));
    (film, stats)
}
