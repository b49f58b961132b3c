//! Cloths of blocks through the program: files in every format, and levels of detail.

use crate::program::{bytes, complaint, ended, folder, organza, succeed};
use glam::UVec3;
use organza_basis::Budget;
use organza_scatter::{FlakeMaterials, FlakeOptics};
use organza_testing::assert_contains;
use organza_volume::format::{self, Source, Volume};
use organza_volume::{GridSet, Octree, ovox};
use std::path::Path;

const CLOTH: &str = "[draft]\nweave = \"WEAVE\"\n[tile]\nrepeats = [REPEATS]\n\
    [warp]\nyarn = \"warp\"\nper_cm = 28.0\n[weft]\nyarn = \"weft\"\nper_cm = 24.0\n\
    [yarn.warp]\npreset = \"cotton\"\ntex = 30.0\nfibres_per_ply = 30\n\
    [yarn.weft]\npreset = \"cotton\"\ntex = 36.0\nfibres_per_ply = 30\n\
    [optics.warp]\nalbedo = [0.9, 0.7, 0.4]\nend_on_ratio = 0.3\n\
    [optics.weft]\nalbedo = [0.2, 0.7, 0.8]\nend_on_ratio = 0.3\n\
    [voxel]\nsize_um = 60.0\n[synthesis]\nvariants = 2\n";

fn write_cloth(folder: &Path, weave: &str, repeats: &str) {
    let cloth = CLOTH.replace("WEAVE", weave).replace("REPEATS", repeats);
    std::fs::write(folder.join("cloth.toml"), cloth).unwrap();
}

fn read(folder: &Path, name: &str) -> Volume {
    let open = |name: &str, _: u64| Ok(std::fs::read(folder.join(name)).ok());
    let source = Source { name, open: &open };
    let format = format::by_name(name).unwrap();
    (format.read)(&source, &mut Budget::new(1 << 30)).unwrap()
}

/// The first cell and grid in which a file differs from the octree, of which every cell of the
/// cloth is looked up; `shift` moves the cells of the octree by so many along x.
fn difference(file: &GridSet, octree: &Octree, shift: u32) -> Option<String> {
    let optics =
        |red, green, blue| FlakeOptics::new(organza_basis::Rgb::new(red, green, blue), 0.3);
    let materials = FlakeMaterials::new(vec![optics(0.9, 0.7, 0.4), optics(0.2, 0.7, 0.8)]);
    let dims = octree.dims(0);
    if file.sigma_t.dims != dims {
        return Some(format!("{} cells, expected {dims}", file.sigma_t.dims));
    }
    let (sggx, albedo) = (file.sggx.as_ref()?, file.albedo.as_ref()?);
    for i in 0..dims.element_product() {
        let cell = UVec3::new(i % dims.x, i / dims.x % dims.y, i / (dims.x * dims.y));
        let there = cell.with_x((cell.x + shift) % dims.x);
        let expected = materials.merged(&octree.mixture(0, there));
        let density = file.sigma_t.cell(cell)[0];
        let is_same = density == expected.density_per_mm
            && (density == 0.0
                || sggx.cell(cell) == expected.sggx.to_array()
                    && albedo.cell(cell) == expected.albedo.0.to_array());
        if !is_same {
            return Some(format!("{cell}: {density}, expected {expected:?}"));
        }
    }
    None
}

/// Every voxel of the cloth, not only of its blocks, is in the files of dense and sparse grids.
#[test]
fn every_format_holds_the_voxels_of_all_blocks() {
    let folder = folder("block-files");
    write_cloth(&folder, "satin-5", "2, 3");
    for name in ["a.ovox", "a.vol", "a.vdb", "a.nrrd"] {
        succeed(&folder, &format!("voxelize cloth.toml -o {name} --quiet"));
    }
    let octree = ovox::read(
        &mut &bytes(&folder, "a.ovox")[..],
        &mut Budget::new(1 << 30),
    );
    let octree = octree.unwrap().octree;
    let blocks = octree.blocks().unwrap();
    assert!(u64::from(blocks.count()) < blocks.crossings().as_u64vec2().element_product());
    for name in ["a.vol", "a.vdb", "a.nrrd"] {
        let Volume::Grids(grids) = read(&folder, name) else {
            panic!("{name}: no grids");
        };
        assert_eq!(difference(&grids, &octree, 0), None, "{name}");
        // Known bad: one voxel off.
        assert!(difference(&grids, &octree, 1).is_some(), "{name}");
    }
}

/// Grids of a large cloth of blocks are refused by their size before they are made.
#[test]
fn grids_of_a_large_cloth_are_refused() {
    let folder = folder("block-files-large");
    write_cloth(&folder, "satin-5", "100, 100");
    for name in ["a.vol", "a.vdb"] {
        let arguments = format!("voxelize cloth.toml -o {name} --quiet");
        let said = complaint(&folder, &format!("{arguments} --max-memory 400MiB"));
        let expected = "bytes of memory, 419430400 are allowed: use larger voxels";
        assert_contains(&said, &format!("organza: {name}: "));
        assert_contains(&said, expected);
        assert_eq!(organza_testing::file_names(&folder), ["cloth.toml"]);
    }
}

/// An interrupt ends the writing of a large file, which leaves nothing.
#[cfg(unix)]
#[test]
fn an_interrupted_file_leaves_nothing() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let folder = folder("block-files-interrupted");
    // About 1e9 voxels: 60 GB in all.
    write_cloth(&folder, "satin-5", "400, 400");
    let child = Command::new(env!("CARGO_BIN_EXE_organza"))
        .current_dir(&folder)
        .args(["voxelize", "cloth.toml", "-o", "a.nrrd", "--quiet"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let is_writing = || {
        let names = organza_testing::file_names(&folder);
        let part = names.iter().find(|name| name.ends_with(".tmp"));
        let part = part.and_then(|name| std::fs::metadata(folder.join(name)).ok());
        part.is_some_and(|part| part.len() > 10_000)
    };
    let started = Instant::now();
    while !is_writing() && started.elapsed() < Duration::from_secs(120) {
        std::thread::sleep(Duration::from_millis(10));
    }
    crate::program::signal(&child, "-INT");
    let out = child.wait_with_output().unwrap();
    let said = ended(&out, 1);
    assert!(
        said.contains("cannot write a.nrrd") && said.contains("interrupted"),
        "{said}"
    );
    assert_eq!(organza_testing::file_names(&folder), ["cloth.toml"]);
}

/// `lod = "auto"` chooses among the voxels of blocks as it does among others: while twelve or
/// more lie between two threads, by the width of a pixel.
#[test]
fn levels_of_blocks_follow_the_width_of_a_pixel() {
    let folder = folder("block-levels");
    write_cloth(&folder, "plain", "10, 10");
    let picture = |width_mm: &str, voxel_um: &str, lod: &str| {
        let scene = format!(
            "[camera]\nkind = \"orthographic\"\norigin_mm = [3.0, 3.0, 50.0]\n\
             target_mm = [3.0, 3.0, 0.0]\nwidth_mm = {width_mm}\nresolution = [24, 24]\n\
             [[light]]\nkind = \"environment\"\nradiance = [1.0, 1.0, 1.0]\n\
             [[object]]\nkind = \"cloth\"\nfabric = \"cloth.toml\"\nvoxel_um = {voxel_um}\n\
             lod = {lod}\n"
        );
        std::fs::write(folder.join("scene.toml"), scene).unwrap();
        let out = organza(&folder, "render scene.toml -o a.exr --spp 1");
        assert!(
            out.status.success(),
            "{}",
            String::from_utf8_lossy(&out.stderr)
        );
        crate::program::exr_channels(&folder.join("a.exr"))["R"].clone()
    };
    let [near, far] = ["0.2", "6.0"].map(|width| [width, "14.0"]);
    let shown = |at: [&str; 2], lod| picture(at[0], at[1], lod);
    assert!(shown(near, "\"auto\"") == shown(near, "0"));
    let coarser = shown(far, "1");
    assert!(shown(far, "\"auto\"") == coarser);
    // Known bad: the levels differ.
    assert!(shown(far, "0") != coarser);
    // Voxels of 20 um are 18 between two threads: the next would be 9.
    let coarse = ["6.0", "20.0"];
    assert!(shown(coarse, "\"auto\"") == shown(coarse, "0"));
}
