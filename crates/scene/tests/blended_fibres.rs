//! A yarn of wool and nylon: voxels and explicit fibres have the same shares and radii, each
//! material has its optics, and plies are refused.

use organza_basis::SegmentSource;
use organza_scatter::Fibre;
use organza_scene::fabric_file;
use organza_scene::loader::Loader;
use organza_scene::representation::{PLIES, Representation};
use organza_volume::FibreFootprint;
use std::path::PathBuf;

const FABRIC: &str = r#"
[draft]
weave = "plain"
[warp]
yarn = "sock"
per_cm = 10.0
[weft]
yarn = "sock"
per_cm = 9.0
[yarn.sock]
preset = "wool"
tex = 60.0
blend = [
    { mass_share = 70.0, fibre = "wool" },
    { mass_share = 30.0, fibre = "nylon", fibre_radius_um = 7.5 },
]
[[optics.sock]]
azimuthal_deg = 20.0
[[optics.sock]]
fibre = "nylon"
section = "trilobal"
azimuthal_deg = 4.0
[voxel]
size_um = 40.0
"#;

fn written(name: &str, text: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("organza-blends-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn voxels_have_the_materials_of_the_fibres() {
    let path = written("sock.toml", FABRIC);
    let loader = Loader::new();
    let fabric = fabric_file::load(&path, &[], &loader).unwrap();
    let mut explicit = [0.0f64; 2];
    let cloth = &fabric.cloth;
    for batch in 0..cloth.batch_count() {
        cloth.for_each_in_batch(batch, &mut |s| {
            explicit[usize::from(s.material)] += f64::from(s.length_mm());
        });
    }
    let radii = [0.012f32, 0.0075];
    let of_cloth = fabric.cloth.materials().iter().map(|m| m.fibre_radius_mm);
    assert_eq!(of_cloth.collect::<Vec<_>>(), radii);
    for footprint in [FibreFootprint::Covered, FibreFootprint::Axis] {
        let octree = fabric
            .voxelize(&path, footprint, Some(40.0), None, None, &loader)
            .unwrap();
        let mut voxels = [0.0f64; 2];
        octree.for_each_occupied(0, |cell| {
            for p in octree.mixture(0, cell).iter() {
                let material = usize::from(p.material);
                voxels[material] += f64::from(p.length_density_per_mm2);
                assert!((p.radius_mm / radii[material] - 1.0).abs() < 4.0 * f32::EPSILON);
            }
        });
        let share = |of: [f64; 2]| of[1] / (of[0] + of[1]);
        let (own, expected) = (share(voxels), share(explicit));
        // Densities of voxels are rounded to some per cent, at random.
        assert!(
            (own / expected - 1.0).abs() < 4.0 * f64::from(f32::EPSILON),
            "{own} for {expected}"
        );
        // The twin: equal shares of wool and nylon.
        assert!(
            (share([1.0, 1.0]) / expected - 1.0).abs() > 0.03,
            "{expected}"
        );
    }
}

#[test]
fn each_material_has_its_optics() {
    let path = written("optics.toml", FABRIC);
    let fabric = fabric_file::load(&path, &[], &Loader::new()).unwrap();
    let fibres = fabric.fibre_models(&path).unwrap();
    let lobed = |fibre: &Fibre| fibre.near_parts().section.is_some();
    assert_eq!(fibres.iter().map(lobed).collect::<Vec<_>>(), [false, true]);
    let wrong = FABRIC.replace("fibre = \"nylon\"\nsection", "fibre = \"nilon\"\nsection");
    let path = written("wrong.toml", &wrong);
    let why = fabric_file::load(&path, &[], &Loader::new());
    let why = why.err().unwrap().to_string();
    assert!(
        why.contains(
            "optics.sock.fibre: no `blend` has a fibre `nilon`; did you mean `nylon`?; there are \
             nylon, wool"
        ),
        "{why}"
    );
}

#[test]
fn plies_refuse_blends_of_materials() {
    let path = written("plies.toml", FABRIC);
    let fabric = fabric_file::load(&path, &[], &Loader::new()).unwrap();
    let plies: &Representation = &PLIES;
    let why = (plies.check)(&fabric, &path, &Loader::new())
        .unwrap_err()
        .to_string();
    assert!(
        why.contains("model = \"plies\" shows no blends of fibre materials; choose \"fibres\""),
        "{why}"
    );
}
