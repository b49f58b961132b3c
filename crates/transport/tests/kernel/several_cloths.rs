//! Several cloths of explicit fibres, cloths over meshes, and planes, in one walk of the
//! kernel against the general walk.

use crate::kernel::explicit_fibres::{
    assert_agreement, assert_rejected, assert_same_bits, fibres_of, segments,
};
use crate::kernel::pictures::picture;
use crate::kernel::virtual_fibres::{cotton_and_silk, silk_and_cotton};
use crate::kernel::{grid, lens, panels, parallel, scene, settings, sky, wide};
use crate::scenes::mesh;
use glam::{UVec2, Vec2, Vec3};
use organza_basis::{Aabb, Rgb, unwatched};
use organza_mesh::{DrapedMesh, Mesh, Shell};
use organza_scatter::Fibre;
use organza_testing::sized;
use organza_transport::*;

/// The cloth of the other tests, so much higher.
fn higher(repeats: bool, by_mm: f32, materials: Vec<Fibre>) -> AnyMedium {
    let mut source = segments(repeats);
    let by = Vec3::new(0.0, 0.0, by_mm);
    for s in &mut source.segments {
        (s.start_mm, s.end_mm) = (s.start_mm + by, s.end_mm + by);
    }
    let bounds = source.tile.bounds_mm;
    source.tile.bounds_mm = Aabb::new(bounds.min + by, bounds.max + by);
    let made = ExplicitFibres::new(&source, materials, None, &unwatched).unwrap();
    AnyMedium::ExplicitFibres(made)
}

fn table(z_mm: f32, radiance: f32) -> AnyMedium {
    let at = Vec3::new(0.0, 0.0, z_mm);
    let normal = Vec3::new(0.1, 0.0, 1.0);
    let plane = Plane::new(at, normal, Rgb::new(0.7, 0.5, 0.2), Rgb::splat(radiance));
    AnyMedium::Plane(plane.unwrap())
}

/// A square of cloth bent about an axis, stretched and sheared.
fn bent_mesh() -> Mesh {
    mesh(Vec2::splat(0.8), UVec2::splat(6), &|uv_mm| {
        let radius_mm = 0.6;
        let (sin, cos) = (1.2 * uv_mm.x / radius_mm).sin_cos();
        let normal = Vec3::new(sin, 0.0, cos);
        let aside = Vec3::new(0.15, 0.8 * uv_mm.y + 0.2 * uv_mm.x + 0.15, -radius_mm);
        (radius_mm * normal + aside, normal)
    })
}

/// The same with a hole in its middle, and flattened beside it.
fn pierced_mesh() -> Mesh {
    let mut mesh = bent_mesh();
    mesh.refine(|at| 0.4 * at.length().max(2e-3), 1 << 16)
        .unwrap();
    let push = |at: Vec2| 0.06 * (1.0 - at.length() / 0.3).max(0.0).powi(2) / at.length();
    mesh.shift(|at| (at.length() > 2e-3).then(|| push(at) * at))
        .unwrap();
    mesh.flatten(|at| 0.5 * (1.0 - (at.y - 0.1).abs() / 0.2).max(0.0));
    mesh
}

pub(crate) fn draped(materials: Vec<Fibre>) -> AnyMedium {
    over(bent_mesh(), materials)
}

fn over(mesh: Mesh, materials: Vec<Fibre>) -> AnyMedium {
    let shell = Shell::new(&mesh, 0.0, 0.2).unwrap();
    let draping = Draping::new(DrapedMesh::new(mesh), Some(shell));
    let volumes = vec![fibres_of(true, materials)];
    let cloth = LevelledCloth::draped(volumes, None, LevelSteps::default(), draping);
    AnyMedium::Levelled(Box::new(cloth.unwrap()))
}

fn with(first: AnyMedium, others: Vec<AnyMedium>, lights: Vec<Light>) -> Scene {
    let mut scene = scene(first, lights, wide(0.5));
    scene.media.extend(others);
    scene
}

fn pierced() -> Scene {
    let cloth = over(pierced_mesh(), silk_and_cotton());
    with(cloth, Vec::new(), over_mesh())
}

/// Light on a mesh alone; by default without lamps, whose noise would take more samples.
pub(crate) fn over_mesh() -> Vec<Light> {
    sized(sky(), parallel())
}

pub(crate) fn scenes() -> Vec<(&'static str, Scene)> {
    let cloth = |repeats| fibres_of(repeats, silk_and_cotton());
    let other = |repeats, z| higher(repeats, z, cotton_and_silk());
    let mut mixed = parallel();
    mixed.push(picture());
    let of_glass = scene(draped(silk_and_cotton()), sky(), lens());
    let others = vec![cloth(false), table(-0.05, 0.1)];
    let through = with(other(true, 0.1), others, panels());
    let below = vec![other(true, -0.8), table(-0.9, 0.2)];
    let above = with(draped(silk_and_cotton()), below, parallel());
    vec![
        (
            "a table",
            with(cloth(true), vec![table(-0.05, 0.0)], parallel()),
        ),
        ("light", with(cloth(false), vec![table(-0.2, 0.8)], sky())),
        ("two", with(cloth(true), vec![other(false, 0.25)], mixed)),
        ("through each other", through),
        ("bent", of_glass),
        ("bent, above a cloth and a table", above),
    ]
}

#[test]
fn several_cloths_agree_with_the_general_walk() {
    // Known-bad twins: a darker table, other fibres over the mesh, and whole cloth.
    let cloth = || fibres_of(true, silk_and_cotton());
    let darker = with(cloth(), vec![table(-0.05, 0.2)], parallel());
    let others = scene(draped(cotton_and_silk()), sky(), lens());
    for (name, right) in scenes().into_iter().step_by(sized(2, 1)) {
        let [_, (oracle, _)] = assert_agreement(name, &right);
        match name {
            "a table" => assert_rejected(name, &darker, &oracle),
            "bent" => assert_rejected(name, &others, &oracle),
            _ => {}
        }
    }
    let name = "pierced and flattened";
    let [_, (oracle, _)] = assert_agreement(name, &pierced());
    let whole = with(draped(silk_and_cotton()), Vec::new(), over_mesh());
    assert_rejected(name, &whole, &oracle);
}

#[test]
fn back_ends_walk_several_cloths_alike() {
    for (name, scene) in scenes() {
        assert_same_bits(name, &scene);
    }
    assert_same_bits("pierced and flattened", &pierced());
}

#[test]
fn voxels_beside_fibres_are_left_to_the_general_walk() {
    let cloth = fibres_of(true, silk_and_cotton());
    let scene = with(cloth, vec![AnyMedium::Grid(grid(false))], parallel());
    let refused = engine(&scene, &settings(0..1, 1), EngineChoice::Fastest, u64::MAX).err();
    assert_eq!(refused, Some(KernelRefusal::MixedMedia));
}
