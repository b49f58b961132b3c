//! Scans through the program: a phantom that the repository holds, what becomes of it, and what
//! is refused.

use crate::program::{argv, complaint, exr_channels, folder, organza, succeed};
use organza_basis::{Aabb, Budget, SegmentSource};
use organza_scan::input::Slices;
use organza_scan::input::tiff::TiffSlices;
use organza_scan::phantom::{Phantom, PhantomLook, write_tiff};
use organza_scene::fabric_file;
use organza_scene::loader::Loader;
use organza_testing::{assert_contains, table_rows};
use std::io::Cursor;
use std::path::{Path, PathBuf};

/// Gauze as a micro-CT scanner would see it, with its radius and grey value given.
pub const GAUZE: &str = "scan --voxel-um 3.5 --fibre-radius-um 9 --fibre 170";

pub fn gauze() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("volumes/gauze_ct.tif")
}

#[test]
fn a_scan_is_shown_described_and_measured_like_a_volume() {
    let folder = folder("scan-use");
    let ct = gauze();
    let mut arguments = argv(GAUZE);
    arguments.extend([ct.to_str().unwrap(), "-o", "red.ovox", "--quiet"]);
    arguments.extend(["--colour", "0.7,0.1,0.1"]);
    succeed(&folder, &arguments);
    let info = succeed(&folder, "info red.ovox --json");
    let info: serde_json::Value = serde_json::from_str(&info).unwrap();
    assert_eq!(info["kind"], "scan");
    assert_eq!(info["scan"]["scan"]["fibre_radius_um"].as_f64(), Some(9.0));
    // The box is that of the voxels of the scan, of which the octree has more.
    let (voxels, scanned) = (&info["levels"][0]["dims"], &info["scan"]["scan"]["size"]);
    assert_ne!(voxels, scanned);
    for axis in 0..3 {
        let edge = |key: &str| info["box"][key][axis].as_f64().unwrap();
        let size_mm = 3.5e-3 * scanned[axis].as_f64().unwrap();
        let found = edge("max_mm") - edge("min_mm");
        assert!((found - size_mm).abs() < 1e-5, "{axis}: {found}, {size_mm}");
    }
    let scene = "[camera]\nkind = \"orthographic\"\norigin_mm = [0.16, 0.16, 2.0]\n\
        target_mm = [0.16, 0.16, 0.0]\nup = [0.0, 1.0, 0.0]\nwidth_mm = 0.3\n\
        resolution = [16, 16]\n[[light]]\nkind = \"directional\"\ndirection = [0.2, 0.1, -0.97]\n\
        irradiance = [3.0, 3.0, 3.0]\n[[object]]\nkind = \"volume\"\nfile = \"red.ovox\"\n";
    std::fs::write(folder.join("scene.toml"), scene).unwrap();
    succeed(&folder, "render scene.toml -o out.exr --spp 8 --quiet");
    let channels = exr_channels(&folder.join("out.exr"));
    let mean = |name: &str| {
        let list = &channels[name];
        list.iter().sum::<f32>() / list.len() as f32
    };
    assert!(mean("R") > 2.0 * mean("G"), "{} {}", mean("R"), mean("G"));
    let wrong = scene.to_owned() + "[object.optics.fibbre]\nend_on_ratio = 0.2\n";
    std::fs::write(folder.join("wrong.toml"), wrong).unwrap();
    let said = complaint(&folder, "render wrong.toml -o x.exr");
    assert_contains(&said, "did you mean `fibre`?");
}

/// What is scanned, and a part of the message.
const REFUSED: &str = "
cut.tif --voxel-um 2 | cut.tif: not a usable TIFF file:
flat.raw --raw-type u8 --voxel-um 2 --raw-size 10,10,10 | flat.raw: every voxel has the grey value 7
noise.raw --raw-type u8 --voxel-um 2 --raw-size 40,40,40 | noise.raw: no fibre was found
flat.raw --raw-type u8 --voxel-um 2 --raw-size 10,10,9 | make 900 bytes; it has 1000
none --voxel-um 2 | the folder holds no .tif
whole.tif | the file names no size of voxels: give --voxel-um
wole.tif --voxel-um 2 | whole.tif
whole.tif cut.tif --voxel-um 2 | whole.tif: holds
whole.tif --voxel-um 2 --threshold 300 | no voxel is above the threshold of 300
whole.tif --voxel-um 2 --max-memory 1MiB | bytes are allowed
";

#[test]
fn volumes_that_hold_no_cloth_are_refused_and_nothing_is_written() {
    let folder = folder("scan-refused");
    let ct = std::fs::read(gauze()).unwrap();
    std::fs::write(folder.join("cut.tif"), &ct[..ct.len() / 2]).unwrap();
    std::fs::write(folder.join("flat.raw"), [7u8; 1000]).unwrap();
    let noise: Vec<u8> = (0..64_000u64)
        .map(|i| (organza_basis::rng::mix64(i) >> 56) as u8)
        .collect();
    std::fs::write(folder.join("noise.raw"), noise).unwrap();
    std::fs::create_dir(folder.join("none")).unwrap();
    std::fs::write(folder.join("whole.tif"), &ct).unwrap();
    for [arguments, words] in table_rows(REFUSED) {
        let said = complaint(&folder, &format!("scan -o x.ovox {arguments}"));
        assert!(said.contains(words), "{arguments}: {said}");
        assert!(!folder.join("x.ovox").exists());
    }
}

/// The first voxels of some slices of the gauze from its middle.
pub fn gauze_slices([width, height, count]: [usize; 3]) -> Vec<Vec<u8>> {
    let file = Cursor::new(std::fs::read(gauze()).unwrap());
    let mut slices = TiffSlices::new(file, &mut Budget::new(1 << 30)).unwrap();
    let shape = slices.shape();
    let mut values = vec![0.0; shape.slice_len()];
    let mut slice = |z| {
        slices.read(8 + z, &mut values).unwrap();
        let rows = values.chunks(shape.dims.x as usize).take(height);
        rows.flat_map(|row| row[..width].iter().map(|v| *v as u8))
            .collect()
    };
    (0..count as u32).map(&mut slice).collect()
}

/// The same bytes come of one thread and of two, with a journal, and from it.
#[test]
fn a_journal_gives_the_volume_of_an_unbroken_scan() {
    let folder = folder("scan-journal");
    // More than one block of 64 x 64 along each side.
    let slices = gauze_slices([80, 72, 16]).concat();
    std::fs::write(folder.join("ct.raw"), slices).unwrap();
    let command = format!("{GAUZE} ct.raw --raw-type u8 --raw-size 80,72,16");
    let scan = |more: &str| succeed(&folder, &format!("{command} {more}"));
    scan("-o a.ovox --threads 1");
    scan("-o b.ovox --threads 2 --journal journal");
    let said = scan("-o c.ovox --journal journal");
    assert_contains(&said, "slabs are finished");
    let bytes = |name: &str| std::fs::read(folder.join(name)).unwrap();
    assert!(bytes("a.ovox") == bytes("b.ovox") && bytes("b.ovox") == bytes("c.ovox"));
    // Another threshold is another scan.
    let other = format!("{command} -o d.ovox --threshold 100 --journal journal");
    let out = organza(&folder, &other);
    assert_eq!(out.status.code(), Some(2));
    assert!(!folder.join("d.ovox").exists());
}

/// What `volumes/gauze_ct.tif` is drawn from: fibres of 9 um in voxels of 3.5 um.
const GAUZE_FABRIC: &str = "[draft]\nweave = \"plain\"\n[warp]\nper_cm = 62.0\n[weft]\n\
    per_cm = 62.0\n[yarn.default]\npreset = \"silk\"\ntex = 3.0\nfibre_radius_um = 9.0\n\
    [tile]\nrepeats = [1, 1]\n";

/// A tile of a fabric with some air above and below, in voxels of this edge.
fn phantom(folder: &Path, fabric: &str, voxel_mm: f32, look: &PhantomLook) -> Phantom {
    let path = folder.join("fabric.toml");
    std::fs::write(&path, fabric).unwrap();
    let cloth = fabric_file::load(&path, &[], &Loader::new()).unwrap().cloth;
    let tile = cloth.tile().bounds_mm;
    let height = 17.0 * voxel_mm;
    let height = height.max(((tile.max.z / voxel_mm).ceil() + 3.0) * voxel_mm);
    let bounds = Aabb::new(tile.min.with_z(-height), tile.max.with_z(height));
    let mut phantom = Phantom::draw(&cloth, bounds, voxel_mm, &mut Budget::new(1 << 30)).unwrap();
    phantom.look(look);
    phantom
}

fn look(noise: f32) -> PhantomLook {
    PhantomLook {
        air: 70.0,
        fibre: 170.0,
        blur: 0.7,
        noise,
        seed: 21,
    }
}

/// Deviation of the noise of the gauze, grey values.
const NOISE: f32 = 8.0;

fn values(slices: &mut dyn Slices) -> Vec<f32> {
    let shape = slices.shape();
    let mut all = vec![0.0; shape.slice_len() * shape.dims.z as usize];
    for (z, slice) in all.chunks_mut(shape.slice_len()).enumerate() {
        slices.read(z as u32, slice).unwrap();
    }
    all
}

/// The file less the phantom without noise is noise of the stated deviation.
///
/// With `ORGANZA_WRITE_PHANTOM` set, the file is written again.
#[test]
fn the_phantom_of_the_repository_is_drawn_from_a_fabric() {
    let folder = folder("scan-phantom");
    if std::env::var_os("ORGANZA_WRITE_PHANTOM").is_some() {
        let mut bytes = Cursor::new(Vec::new());
        let mut drawn = phantom(&folder, GAUZE_FABRIC, 0.0035, &look(NOISE / 100.0));
        write_tiff(&mut drawn, &mut bytes).unwrap();
        std::fs::write(gauze(), bytes.into_inner()).unwrap();
    }
    let file = Cursor::new(std::fs::read(gauze()).unwrap());
    let mut kept = TiffSlices::new(file, &mut Budget::new(1 << 30)).unwrap();
    let mut drawn = phantom(&folder, GAUZE_FABRIC, 0.0035, &look(0.0));
    assert_eq!(kept.shape().dims, drawn.dims());
    let (kept, drawn) = (values(&mut kept), values(&mut drawn));
    let noise = |shift: usize| {
        let pairs = kept.iter().zip(&drawn[shift..]);
        let all: Vec<f64> = pairs.map(|(k, d)| f64::from(k - d)).collect();
        let n = all.len() as f64;
        let mean = all.iter().sum::<f64>() / n;
        let square = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
        (mean, square.sqrt())
    };
    let n = kept.len() as f64;
    let (mean, deviation) = noise(0);
    // With the variance of rounding to whole numbers; five standard errors.
    let wanted = (f64::from(NOISE).powi(2) + 1.0 / 12.0).sqrt();
    assert!(mean.abs() < 5.0 * wanted / n.sqrt(), "mean {mean}");
    let error = (deviation - wanted).abs();
    assert!(
        error < 5.0 * wanted / (2.0 * n).sqrt(),
        "deviation {deviation}"
    );
    // Known bad: drawn one voxel aside.
    assert!(noise(1).1 > 1.2 * wanted);
}
