//! Cloths of blocks from fabric files.

use glam::UVec2;
use organza_scene::fabric_file::{self, Fabric};
use organza_scene::loader::Loader;
use organza_volume::{FibreFootprint, Octree, ovox};
use std::path::{Path, PathBuf};

const YARNS: &str = r#"
[warp]
yarn = "warp"
per_cm = 28.0
WARP
[weft]
yarn = "weft"
per_cm = 24.0
[yarn.warp]
preset = "cotton"
tex = 30.0
[yarn.weft]
preset = "cotton"
tex = 36.0
[voxel]
size_um = 60.0
"#;

/// A fabric of a satin with a rectangle of its other face.
fn written(name: &str, synthesis: &str, colours: &str) -> PathBuf {
    let row = |p: usize| -> String {
        let cell = |e: usize| (e * 2 + p).is_multiple_of(5) == (e < 20);
        (0..40).map(|e| if cell(e) { 'X' } else { '.' }).collect()
    };
    let rows: Vec<String> = (0..30).rev().map(|p| format!("\"{}\"", row(p))).collect();
    let text = format!(
        "[draft]\ndrawdown = [{}]\n{}{synthesis}",
        rows.join(", "),
        YARNS.replace("WARP", colours)
    );
    let folder = std::env::temp_dir().join(format!("organza-blocks-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path
}

fn fabric(path: &Path) -> Result<Fabric, String> {
    fabric_file::load(path, &[], &Loader::new()).map_err(|e| e.to_string())
}

fn octree(path: &Path, fabric: &Fabric) -> Octree {
    let loader = Loader::new();
    fabric
        .voxelize(path, FibreFootprint::Covered, None, None, None, &loader)
        .unwrap()
}

#[test]
fn a_design_becomes_a_cloth_of_blocks() {
    let path = written("plain.toml", "[synthesis]\nvariants = 2\n", "");
    let fabric = fabric(&path).unwrap();
    let synthesis = fabric.synthesis.as_ref().unwrap();
    // The smallest repeat of the design: 40 x 5.
    assert_eq!(synthesis.figures().crossings, [40, 5]);
    let cloth = octree(&path, &fabric);
    cloth.assert_well_formed();
    let blocks = cloth.blocks().unwrap();
    assert_eq!(blocks.crossings(), UVec2::new(40, 5));
    assert_eq!(blocks.count() as usize, synthesis.blocks.len());
    let size = cloth.bounds_mm().size().truncate();
    assert!(
        (size - fabric.tile_mm()).abs().max_element() < 4.0 * f32::EPSILON,
        "{size}"
    );
    let gaps = fabric.cloth.border_gaps(synthesis);
    assert_eq!(synthesis.figures().replaced_crossings, 0);
    assert_eq!(gaps.borders, 400);
    assert!(
        gaps.position_max_mm < 1e-9 && gaps.tangent_max_rad < 1e-9,
        "{gaps:?}"
    );
    for what in [
        fabric
            .explicit_fibres(&path, None, &Loader::new())
            .map(|_| ()),
        fabric
            .plan(&path, FibreFootprint::Axis, None, None, None)
            .map(|_| ()),
    ] {
        let why = what.unwrap_err().to_string();
        assert!(
            why.contains("it is made of blocks, as [synthesis]"),
            "{why}"
        );
    }
}

#[test]
fn blocks_have_the_colours_of_the_design() {
    let colours = "colours = [[0.1, 0.1, 0.6], [0.6, 0.1, 0.1]]";
    let path = written("striped.toml", "[synthesis]\nvariants = 1\n", colours);
    let fabric = fabric(&path).unwrap();
    let cloth = octree(&path, &fabric);
    let block = cloth.blocks().unwrap().block_cells(0);
    let materials = fabric.cloth.materials();
    let colour_at = |end: u32| {
        let low = UVec2::new(end, 1) * block.truncate();
        let mut found = [0.0f32; 2];
        for z in 0..block.z {
            for y in 0..block.y {
                let cell = (low + UVec2::new(block.x / 2, y)).extend(z);
                for c in cloth.mixture(0, cell).iter() {
                    let material = &materials[usize::from(c.material)];
                    if material.yarn == "warp" {
                        let red = material.colour.unwrap().0.x > 0.3;
                        found[usize::from(red)] += c.length_density_per_mm2;
                    }
                }
            }
        }
        found
    };
    for end in 0..40 {
        let [blue, red] = colour_at(end);
        let (own, other) = if end % 2 == 0 {
            (blue, red)
        } else {
            (red, blue)
        };
        assert!(own > 20.0 * other, "end {end}: {blue} blue, {red} red");
    }
}

#[test]
fn what_blocks_cannot_show_is_refused() {
    let exemplars = "[synthesis]\nexemplars = [\"plain\"]\n";
    let why = fabric(&written("exemplars.toml", exemplars, ""))
        .err()
        .unwrap();
    assert!(
        why.contains("exemplars.toml: synthesis.exemplars: no exemplar has"),
        "{why}"
    );
    assert!(why.contains("X..") || why.contains("..X"), "{why}");
    for (name, keys, expected) in [
        (
            "uneven.toml",
            "spacing_cv_percent = 3.0",
            "warp.spacing_cv_percent: [synthesis] needs",
        ),
        (
            "window.toml",
            "",
            "synthesis.window: expected 3 or 5, found 7",
        ),
    ] {
        let synthesis = match name {
            "window.toml" => "[synthesis]\nwindow = 7\n",
            _ => "[synthesis]\n",
        };
        let why = fabric(&written(name, synthesis, keys)).err().unwrap();
        assert!(why.contains(expected), "{why}");
    }
}

/// A fabric of a named weave; `tile` is its tables [tile] and [synthesis].
fn woven(name: &str, weave: &str, tile: &str) -> PathBuf {
    let colours = "colours = [[0.8, 0.1, 0.1]]";
    let yarns = YARNS.replace("WARP", colours);
    let path = written(name, "", colours);
    std::fs::write(
        &path,
        format!("[draft]\nweave = \"{weave}\"\n{yarns}{tile}"),
    )
    .unwrap();
    path
}

/// Fibre of each material over the area of a cloth, mm / mm^2.
fn fibre_per_area(octree: &Octree) -> [f32; 2] {
    let mut found = [0.0f64; 2];
    octree.for_each_occupied(0, |cell| {
        for c in octree.mixture(0, cell).iter() {
            found[usize::from(c.material)] += f64::from(c.length_density_per_mm2);
        }
    });
    let cells = octree.dims(0).truncate().as_dvec2().element_product();
    found.map(|sum| (sum * f64::from(octree.voxel_mm(0).z) / cells) as f32)
}

#[test]
fn volumes_are_exemplars() {
    let tile = woven("tile.toml", "twill-3-1-z", "[tile]\nrepeats = [2, 1]\n");
    let exact = octree(&tile, &fabric(&tile).unwrap());
    let file = tile.with_file_name("tile.ovox");
    let mut bytes = Vec::new();
    ovox::write(&exact, &[], &mut bytes).unwrap();
    std::fs::write(&file, &bytes).unwrap();
    for exemplars in ["\"tile.ovox\"", "\"plain\", \"tile.ovox\""] {
        let keys = format!("[tile]\nrepeats = [3, 5]\n[synthesis]\nexemplars = [{exemplars}]\n");
        let path = woven("from_volume.toml", "twill-3-1-z", &keys);
        let made = fabric(&path).unwrap();
        let synthesis = made.synthesis.as_ref().unwrap();
        let figures = synthesis.figures();
        assert_eq!(figures.crossings, [12, 20]);
        assert_eq!(figures.replaced_crossings, 0);
        assert_eq!(figures.volume_blocks, figures.blocks);
        let cloth = octree(&path, &made);
        cloth.assert_well_formed();
        let [own, expected] = [&cloth, &exact].map(fibre_per_area);
        for (own, expected) in own.into_iter().zip(expected) {
            // Voxels are sampled anew, and some places of the tile are shown more often.
            assert!((own / expected - 1.0).abs() < 0.03, "{own}, {expected}");
        }
        let gaps = made.cloth.border_gaps(synthesis);
        assert!(
            gaps.borders == 480 && gaps.position_rms_mm < 0.01,
            "{gaps:?}"
        );
    }
    // Woven blocks beside those of a volume.
    let keys = "[synthesis]\nexemplars = [\"twill-3-1-z\", \"tile.ovox\"]\nvariants = 64\n";
    let path = woven(
        "mixed.toml",
        "twill-3-1-z",
        &format!("[tile]\nrepeats = [3, 5]\n{keys}"),
    );
    let made = fabric(&path).unwrap();
    let figures = made.synthesis.as_ref().unwrap().figures();
    assert!(
        (1..figures.blocks).contains(&figures.volume_blocks),
        "{figures:?}"
    );
    let [own, expected] = [&octree(&path, &made), &exact].map(fibre_per_area);
    assert!(
        (own[0] / expected[0] - 1.0).abs() < 0.03,
        "{own:?}, {expected:?}"
    );
    let gaps = made.cloth.border_gaps(made.synthesis.as_ref().unwrap());
    assert!(gaps.position_rms_mm < 0.02, "{gaps:?}");

    let refused = |weave: &str, tile: &str| {
        let path = woven("refused.toml", weave, tile);
        fabric(&path).err().unwrap()
    };
    let why = refused("plain", "[synthesis]\nexemplars = [\"tile.ovox\"]\n");
    assert!(
        why.contains("no exemplar has 2 of the design's") && why.contains("X.X"),
        "{why}"
    );
    std::fs::write(file.with_file_name("cut.ovox"), &bytes[..bytes.len() / 2]).unwrap();
    let why = refused("twill-3-1-z", "[synthesis]\nexemplars = [\"cut.ovox\"]\n");
    assert!(
        why.contains("refused.toml: synthesis.exemplars: cut.ovox: "),
        "{why}"
    );
    let once = exact.clone().with_repeats(false);
    let mut bytes = Vec::new();
    ovox::write(&once, &[], &mut bytes).unwrap();
    std::fs::write(file.with_file_name("once.ovox"), &bytes).unwrap();
    let why = refused("twill-3-1-z", "[synthesis]\nexemplars = [\"once.ovox\"]\n");
    assert!(why.contains("once.ovox: it does not repeat"), "{why}");
    let keys = "[synthesis]\nexemplars = [\"tile.ovox\"]\n";
    let path = woven("refused.toml", "twill-3-1-z", keys);
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replace("per_cm = 24.0", "per_cm = 30.0")).unwrap();
    let why = fabric(&path).err().unwrap();
    assert!(
        why.contains("its threads of the weft are 0.41") && why.contains("weft.per_cm = 24.00"),
        "{why}"
    );
}

#[test]
fn a_small_exemplar_is_told_how_much_more_it_needs() {
    let few = written("few.toml", "[synthesis]\nexemplar_crossings = 256\n", "");
    let why = fabric(&few).err().unwrap();
    assert!(
        why.contains("set exemplar_crossings to 512 or more"),
        "{why}"
    );
}
