//! Volume files through the program: what they keep, and what is refused.

use crate::cli::write_grid_scene;
use crate::in_process::{mistake, picture};
use crate::program::{complaint, folder, succeed, write_vol};
use organza_basis::{Budget, PathRng, Rgb, warp};
use organza_scatter::{FlakeMaterials, FlakeOptics};
use organza_testing::{assert_contains, table_rows};
use organza_transport::{Film, Pixel};
use organza_volume::{GridSet, VolGrid, ovox, vdb};
use std::path::Path;

fn plenty() -> Budget {
    Budget::new(1 << 30)
}

/// A cloth whose voxels hold several yarns, with rough fibres.
fn write_fabric(folder: &Path) {
    let fabric = "[draft]\nweave = \"plain\"\n\
        [warp]\nper_cm = 30.0\n[weft]\nper_cm = 24.0\nyarn = \"thick\"\n\
        [yarn.default]\npreset = \"cotton\"\n[yarn.thick]\npreset = \"cotton\"\n\
        [optics.\"*\"]\nalbedo = [0.9, 0.7, 0.4]\nend_on_ratio = 0.3\n\
        [optics.thick]\nalbedo = [0.2, 0.7, 0.8]\n\
        [voxel]\nsize_um = 40.0\n";
    std::fs::write(folder.join("cloth.toml"), fabric).unwrap();
}

/// `.vol`, `.vdb`, the export to Mitsuba and the renderer's own flakes make the same
/// of a mixture: files to the last digit, flakes to that of their matrix.
#[test]
fn a_mixture_is_seen_in_one_way() {
    let folder = folder("one_mixture");
    write_fabric(&folder);
    for name in ["tile.vol", "tile.vdb", "tile.ovox"] {
        succeed(&folder, &format!("voxelize cloth.toml -o {name} --quiet"));
    }
    let scene = "[camera]\norigin_mm = [0.5, 0.5, 5.0]\ntarget_mm = [0.5, 0.5, 0.0]\n\
        width_mm = 1.0\n[[light]]\nkind = \"environment\"\nradiance = [1.0, 1.0, 1.0]\n\
        [[object]]\nkind = \"cloth\"\nfabric = \"cloth.toml\"\nlod = 0\n";
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    let export = "export mitsuba scene.toml -o out --quiet";
    succeed(&folder, &format!("{export} --repeats 1,1"));
    let vol = |name: &str| {
        let bytes = std::fs::read(folder.join(name)).unwrap();
        VolGrid::read(&mut &bytes[..], &mut plenty()).unwrap()
    };
    let own = ["sigma_t", "sggx", "albedo"].map(|part| vol(&format!("tile.{part}.vol")));
    let mitsuba: Vec<VolGrid> = {
        let files = std::fs::read_dir(folder.join("out")).unwrap();
        let mut names: Vec<String> = files
            .map(|f| f.unwrap().file_name().to_str().unwrap().to_owned())
            .filter(|n| n.ends_with(".vol"))
            .collect();
        names.sort();
        names.iter().map(|n| vol(&format!("out/{n}"))).collect()
    };
    assert_eq!(mitsuba.len(), 3);
    for grid in &own {
        let same = mitsuba
            .iter()
            .find(|g| g.channels == grid.channels)
            .unwrap();
        assert!(same.data == grid.data, "{} channels", grid.channels);
    }
    let bytes = std::fs::read(folder.join("tile.vdb")).unwrap();
    let file = vdb::read(&bytes, &mut plenty()).unwrap();
    let set = file.grid_set(&mut plenty()).unwrap();
    assert!(set.sigma_t.data == own[0].data);
    assert!(set.sggx.unwrap().data == own[1].data);
    assert!(set.albedo.unwrap().data == own[2].data);

    // The renderer: the same optics over the same octree.
    let bytes = std::fs::read(folder.join("tile.ovox")).unwrap();
    let octree = ovox::read(&mut &bytes[..], &mut plenty()).unwrap().octree;
    let optics = |r, g, b| FlakeOptics::new(Rgb::new(r, g, b), 0.3);
    let materials = FlakeMaterials::new(vec![optics(0.9, 0.7, 0.4), optics(0.2, 0.7, 0.8)]);
    let merged = GridSet::from_octree(&octree, 0, &|m| materials.merged(m));
    assert!(merged.sigma_t.data == own[0].data);
    assert!(merged.sggx.unwrap().data == own[1].data);
    assert!(merged.albedo.unwrap().data == own[2].data);
    let own_optics = vec![optics(0.9, 0.7, 0.4), optics(0.2, 0.7, 0.8)];
    let flakes = organza_transport::FlakeFamily::SGGX_SPECULAR.of_materials(own_optics);
    let mut rng = PathRng::from_seed(4);
    let (mut alone, mut several) = (0, 0);
    octree.for_each_occupied(0, |cell| {
        let mixture = octree.mixture(0, cell);
        if mixture.len() > 1 {
            several += 1;
            return;
        }
        alone += 1;
        let w = warp::uniform_sphere(rng.unit2());
        let s = organza_basis::Sym3::from_array(own[1].cell(cell).try_into().unwrap());
        let of_file = own[0].cell(cell)[0] * s.quadratic(w).sqrt();
        let of_renderer = flakes.sigma_t_per_mm(&mixture, w);
        let broadside = mixture.broadside_per_mm();
        assert!(
            (of_file - of_renderer).abs() < 8.0 * f32::EPSILON * broadside,
            "seed 4"
        );
    });
    assert!(alone > 1000 && several > 100, "{alone} {several}");
}

/// What a grid says that no medium is, is refused with the cell; it was rendered, or
/// never came to an end. So are grids that take more memory than is allowed.
#[test]
fn grids_that_no_walk_gets_through_are_refused() {
    let folder = folder("grid_limits");
    let bounds = [-0.2, -0.2, -0.2, 0.2, 0.2, 0.2];
    write_grid_scene(&folder);
    let refused = |name: &str, dims, channels, data: &[f32], expected: &str| {
        write_grid_scene(&folder);
        write_vol(&folder.join(name), dims, channels, bounds, data);
        assert_contains(&complaint(&folder, "render scene.toml -o a.exr"), expected);
    };
    let isotropic = [1.0, 1.0, 1.0, 0.0, 0.0, 0.0];
    let indefinite = [1.0, 1.0, 1.0, 5.0, 5.0, 5.0];
    let two = [isotropic, indefinite].concat();
    let words = "sggx: sample (1, 0, 0) has the eigenvalue -4; expected none below zero";
    refused("sggx.vol", [2, 1, 1], 6, &two, words);
    let words = "sample (0, 1, 0) blocks up to 1";
    refused("sigma_t.vol", [1, 2, 1], 1, &[1.0, 1e38], words);
    let huge = [1e20, 1e20, 1e20, 0.0, 0.0, 0.0];
    let words = "sample (0, 0, 0) blocks up to 1";
    refused("sggx.vol", [1, 1, 1], 6, &huge, words);
    // Of three files, all together may take what is allowed: the first has 128,000 bytes of
    // values, the second 768,000.
    write_grid_scene(&folder);
    let cells = vec![1.0; 32_000];
    write_vol(&folder.join("sigma_t.vol"), [40, 40, 20], 1, bounds, &cells);
    let matrices = isotropic.repeat(32_000);
    write_vol(&folder.join("sggx.vol"), [40, 40, 20], 6, bounds, &matrices);
    for (allowed, name) in [("100KiB", "sigma_t.vol"), ("800KiB", "sggx.vol")] {
        let render = "render scene.toml -o a.exr --max-memory";
        let said = complaint(&folder, &format!("{render} {allowed}"));
        assert!(said.starts_with(&format!("organza: {name}: ")), "{said}");
        assert_contains(&said, " are allowed");
    }
}

/// A camera, lights and one object.
fn scene(object: &str) -> String {
    let head = "[render]\nspp = 4\nseed = 3\n\
        [camera]\nkind = \"perspective\"\norigin_mm = [1.0, -2.0, 6.0]\n\
        target_mm = [0.8, 0.5, 0.0]\nfov_deg = 14.0\nresolution = [24, 18]\n\
        [[light]]\nkind = \"directional\"\ndirection = [0.3, 0.2, -0.9]\n\
        irradiance = [2.0, 2.0, 2.0]\n\
        [[light]]\nkind = \"environment\"\nradiance = [0.5, 0.5, 0.5]\n\
        [[object]]\n";
    format!("{head}{object}")
}

/// A tile voxelized to `.ovox` gives the picture of its fabric, whatever shows it.
#[test]
fn a_volume_is_the_picture_of_its_fabric() {
    let folder = folder("volume_picture");
    write_fabric(&folder);
    let surface = std::fs::read_to_string(folder.join("cloth.toml")).unwrap()
        + "[surface]\npreset = \"denim\"\n";
    std::fs::write(folder.join("cloth.toml"), surface).unwrap();
    let voxelize = "voxelize cloth.toml --quiet -o";
    succeed(&folder, &format!("{voxelize} covered.ovox"));
    // Of fine voxels the packing takes longer to measure.
    let axis = format!("{voxelize} axis.ovox --footprint axis --voxel-um 160");
    succeed(&folder, &axis);
    let optics = "[object.optics.thick]\nend_on_ratio = 0.5\ncolour = [0.2, 0.4, 0.6]\n";
    for (file, keys) in [
        ("covered.ovox", "lod = \"volume\"\n"),
        ("covered.ovox", "lod = 1\n"),
        ("covered.ovox", "lod = \"auto\"\n"),
        ("covered.ovox", "flake = \"gaussian\"\nlod = \"auto\"\n"),
        ("covered.ovox", "model = \"plain\"\nlod = 0\n"),
        (
            "axis.ovox",
            "model = \"packed\"\nextent_mm = [0.1, 0.1, 1.2, 0.9]\n",
        ),
    ] {
        let voxel_um = if file == "axis.ovox" { 160.0 } else { 40.0 };
        let cloth = format!(
            "kind = \"cloth\"\nfabric = \"cloth.toml\"\nvoxel_um = {voxel_um:?}\n{keys}{optics}"
        );
        let volume =
            format!("kind = \"volume\"\nfile = \"{file}\"\nalbedo = [1, 1, 1]\n{keys}{optics}");
        let volume = volume.replace("[1, 1, 1]", "[1.0, 1.0, 1.0]");
        let of_cloth = picture(&folder, &scene(&cloth), &[]).film;
        let of_volume = picture(&folder, &scene(&volume), &[]);
        assert!(
            of_volume.warnings.is_empty(),
            "{keys}: {:?}",
            of_volume.warnings
        );
        let words = |film: &Film| -> Vec<_> { film.pixels().iter().map(Pixel::to_words).collect() };
        let (a, b) = (words(&of_cloth), words(&of_volume.film));
        let off = a.iter().zip(&b).filter(|(a, b)| a != b).count();
        assert_eq!((a.len(), off), (b.len(), 0), "{keys}");
        assert!(
            of_cloth.pixels().iter().any(|p| p.mean().0.x > 0.0),
            "{keys}"
        );
    }
    // The wrong footprint is said, not refused.
    let volume = "kind = \"volume\"\nfile = \"covered.ovox\"\nmodel = \"packed\"\n";
    let warnings = picture(&folder, &scene(volume), &[]).warnings.concat();
    assert_contains(&warnings, "--footprint covered");
    std::fs::write(folder.join("volume_scene.toml"), scene(volume)).unwrap();
    assert_contains(&succeed(&folder, "info volume_scene.toml"), "packed");
    let printed = succeed(&folder, "info axis.ovox");
    assert!(
        printed.contains("footprint: axis") && printed.contains("cloth.toml"),
        "{printed}"
    );
    let walks = "source: measured\n  walks: 10000";
    assert_contains(&printed, walks);
    assert_contains(&succeed(&folder, "info covered.ovox"), "source: derived");
}

/// Through `.vdb`, which merges the populations of a voxel, the mean of a picture
/// stays what it is; a tenth more density does not.
#[test]
fn a_merged_volume_keeps_the_mean_of_the_picture() {
    let folder = folder("volume_merged");
    write_fabric(&folder);
    succeed(&folder, "voxelize cloth.toml -o tile.vdb --quiet");
    let values = |object: &str| {
        let film = picture(&folder, &scene(object), &["render.spp=256".to_owned()]).film;
        let green = film.pixels().iter().map(|p| p.mean().0.y);
        green.collect::<Vec<f32>>()
    };
    let cloth = values("kind = \"cloth\"\nfabric = \"cloth.toml\"\nlod = 0\n");
    let vdb = "kind = \"volume\"\nfile = \"tile.vdb\"\nrepeat_xy = true\n";
    let mean = cloth.iter().map(|v| f64::from(*v)).sum::<f64>() / cloth.len() as f64;
    // Pixels are independent, and so is their difference.
    let off = |values: &[f32]| {
        let mut moments = organza_basis::Moments::default();
        for (a, b) in values.iter().zip(&cloth) {
            moments.add(f64::from(a - b) / mean);
        }
        (moments.mean, moments.standard_error())
    };
    let (loss, error) = off(&values(vdb));
    assert!(error < 0.01, "seed 3: {error}");
    // 0.5 % for what merging costs.
    let limit = 0.005 + 4.0 * error;
    assert!(loss.abs() < limit, "seed 3: {loss} +- {error}");
    let (twin, _) = off(&values(&format!("{vdb}density_scale = 0.7\n")));
    assert!(twin.abs() > limit, "seed 3: {twin} +- {error}");
}

/// Keys of a volume object, and a part of the message.
const MISTAKES: &str = r#"
file = "tile.png" | object[0].file:
file = "none.ovox" | none.ovox: no such file
file = "none.vol" | none.vol:
file = "tile.vol" | object[0].albedo: is missing
file = "tile.ovox"; lod = 9 | object[0].lod:
file = "tile.ovox"; lod = "surface" | object[0].lod:
file = "tile.ovox"; model = "fibres" | object[0].model:
file = "tile.ovox"; scale = 0.0 | object[0].scale:
file = "tile.ovox"; density_scale = 0.0 | object[0].density_scale:
file = "tile.ovox"; repeat_xy = false; extent_mm = [0.0, 0.0, 1.0, 1.0] | extent_mm belongs to repeat_xy
file = "tile.vol"; albedo = [0.5, 0.5, 0.5]; model = "packed" | object[0].model: expected
file = "tile.vol"; albedo = [0.5, 0.5, 2.0] | object[0].albedo: expected
file = "tile.ovox"; [object.optics.thik]; albedo = [0.5, 0.5, 0.5] | object[0].optics.thik: no yarn
"#;

/// What a volume object cannot be is refused with its key.
#[test]
fn mistakes_in_volume_objects_are_reported_with_their_key() {
    let folder = folder("volume_mistakes");
    write_fabric(&folder);
    for name in ["tile.vol", "tile.ovox"] {
        succeed(&folder, &format!("voxelize cloth.toml -o {name} --quiet"));
    }
    std::fs::remove_file(folder.join("tile.albedo.vol")).unwrap();
    for [object, expected] in table_rows(MISTAKES) {
        let object = object.replace("; ", "\n") + "\n";
        let message = mistake(&folder, &scene(&format!("kind = \"volume\"\n{object}")));
        assert!(message.contains(expected), "{object}: {message}");
    }
}
