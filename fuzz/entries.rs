//! What every reader does with bytes that anybody may hand it: an answer or an
//! error, in bounded time and memory, and never a panic.

use organza_basis::Budget;
use organza_scan::ScanError;
use organza_scan::input::{Slices, png::PngSlices, tiff::TiffSlices, vti::VtiSlices};
use organza_view::{Answering, Document, Guard, Patience, Session};
use organza_volume::VolGrid;
use organza_weave::{Draft, curve_file::CurveSet};
use organza_work::journal::{Journal, Work};
use organza_work::number_journal::NumberJournal;
use std::io::Cursor;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};
use std::time::Duration;

/// Memory that a reader of a volume may take.
const MAX_BYTES: u64 = 64 << 20;

/// A reader by the name of its corpus.
pub type Entry = (&'static str, fn(&[u8]));

/// All of them.
pub const ALL: [Entry; 24] = [
    ("wif", wif),
    ("curve_text", curve_text),
    ("bcc", bcc),
    ("vol", vol),
    ("vdb", vdb),
    ("ovox", ovox),
    ("nrrd", nrrd),
    ("ct_png", ct_png),
    ("ct_tiff", ct_tiff),
    ("vti", vti),
    ("obj", obj),
    ("ply", ply),
    ("gltf", gltf),
    ("picture", picture),
    ("klems", klems),
    ("far_table", far_table),
    ("pairs", pairs),
    ("scene", scene),
    ("fabric", fabric),
    ("checkpoint", checkpoint),
    ("part", part),
    ("journal", journal),
    ("peer", peer),
    ("view", view),
];

/// A WIF draft.
fn wif(data: &[u8]) {
    if let Ok(draft) = Draft::from_wif(data) {
        assert!(draft.ends() > 0 && draft.picks() > 0);
        let _ = draft.smallest_repeat();
    }
}

/// Curves as text.
fn curve_text(data: &[u8]) {
    let _ = CurveSet::read_text(&String::from_utf8_lossy(data), 1.0);
}

/// A binary curve collection.
fn bcc(data: &[u8]) {
    let _ = CurveSet::read_bcc(data, 1.0, 0.01);
}

/// A Mitsuba grid.
fn vol(data: &[u8]) {
    if let Ok(grid) = VolGrid::read(&mut &data[..], &mut Budget::new(MAX_BYTES)) {
        let cells: u64 = grid.dims.to_array().iter().map(|&n| u64::from(n)).product();
        assert_eq!(grid.data.len() as u64, cells * u64::from(grid.channels));
    }
}

/// An OpenVDB file: every grid of it.
fn vdb(data: &[u8]) {
    let budget = &mut Budget::new(MAX_BYTES);
    if let Ok(file) = organza_volume::vdb::read(data, budget) {
        let _ = file.grid_set(budget);
    }
}

/// A native volume; also with checksums that are right, so that what they cover is tried. What is
/// read is well formed, and every voxel has materials that there are.
fn ovox(data: &[u8]) {
    for bytes in [data.to_vec(), sealed_ovox(data.to_vec())] {
        let read = organza_volume::ovox::read(&mut &bytes[..], &mut Budget::new(MAX_BYTES));
        let Ok(stored) = read else { continue };
        let octree = stored.octree;
        octree.assert_well_formed();
        let optics = organza_scatter::FlakeOptics {
            albedo: organza_basis::Rgb::WHITE,
            end_on_ratio: 0.5,
        };
        let materials = organza_scatter::FlakeMaterials::new(vec![optics; octree.material_count()]);
        octree.for_each_stored(0, |cell| {
            let _ = materials.merged(&octree.mixture(0, cell));
        });
    }
}

/// A native volume whose checksums are right: of its header, and of the blocks after it.
fn sealed_ovox(mut bytes: Vec<u8>) -> Vec<u8> {
    let word = |bytes: &[u8], at: usize| -> Option<usize> {
        let word = bytes.get(at..at + 4)?.try_into().ok()?;
        Some(u32::from_le_bytes(word) as usize)
    };
    // Puts the checksum of so many bytes to a place, and gives where they end.
    let seal = |bytes: &mut [u8], at: usize, from: usize, length: usize| -> Option<usize> {
        let end = from.checked_add(length)?;
        let sum = crc32(bytes.get(from..end)?);
        bytes
            .get_mut(at..at + 4)?
            .copy_from_slice(&sum.to_le_bytes());
        Some(end)
    };
    let header = word(&bytes, 12).and_then(|n| seal(&mut bytes, n.checked_add(16)?, 16, n));
    let mut next = header.map(|end| end + 4);
    while let Some(block) = next {
        let stored = word(&bytes, block);
        next = stored.and_then(|n| seal(&mut bytes, block + 8, block + 12, n));
    }
    bytes
}

/// The checksum of zlib.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |sum, &byte| {
        (0..8).fold(sum ^ u32::from(byte), |sum, _| {
            (sum >> 1) ^ (0xedb8_8320 & 0u32.wrapping_sub(sum & 1))
        })
    })
}

/// An array in NRRD, its data in the file itself.
fn nrrd(data: &[u8]) {
    let open = |name: &str, max_bytes: u64| match name {
        "array.nrrd" if data.len() as u64 > max_bytes => Err("too large".to_owned()),
        "array.nrrd" => Ok(Some(data.to_vec())),
        _ => Ok(None),
    };
    let source = organza_volume::format::Source {
        name: "array.nrrd",
        open: &open,
    };
    if let Some(format) = organza_volume::format::by_name(source.name) {
        let _ = (format.read)(&source, &mut Budget::new(MAX_BYTES));
        let _ = (format.describe)(&source, &mut Budget::new(MAX_BYTES));
    }
}

/// A grey volume: every slice that memory allows.
fn slices(opened: Result<impl Slices, ScanError>, budget: &mut Budget) {
    let Ok(mut slices) = opened else { return };
    let shape = slices.shape();
    let bytes = shape.slice_len() as u64 * 4;
    if budget.take(bytes, "values").is_err() {
        return;
    }
    let mut values = vec![0.0; shape.slice_len()];
    for slice in 0..shape.dims.z.min(16) {
        let _ = slices.read(slice, &mut values);
    }
}

/// A grey volume in the pages of a TIFF.
fn ct_tiff(data: &[u8]) {
    let budget = &mut Budget::new(MAX_BYTES);
    let opened = TiffSlices::new(Cursor::new(data.to_vec()), budget);
    slices(opened, budget);
}

/// A slice of a grey volume as PNG.
fn ct_png(data: &[u8]) {
    let budget = &mut Budget::new(MAX_BYTES);
    let opened = PngSlices::new(Cursor::new(data.to_vec()), budget);
    slices(opened, budget);
}

/// A grey volume as image data of VTK.
fn vti(data: &[u8]) {
    let budget = &mut Budget::new(MAX_BYTES);
    let opened = VtiSlices::new(Cursor::new(data.to_vec()), None, budget);
    slices(opened, budget);
}

const PLACEMENT: organza_mesh::Placement = organza_mesh::Placement {
    mm_per_unit: 1.0,
    mm_per_uv: 1.0,
};

/// A Wavefront OBJ.
fn obj(data: &[u8]) {
    let _ = organza_mesh::read_obj(data, PLACEMENT, &mut Budget::new(MAX_BYTES));
}

/// A Stanford PLY, text or binary.
fn ply(data: &[u8]) {
    let _ = organza_mesh::read_ply(data, PLACEMENT, &mut Budget::new(MAX_BYTES));
}

/// A glTF as text or binary; there are no files beside it.
fn gltf(data: &[u8]) {
    let none = |_: &str| Err(std::io::ErrorKind::NotFound.into());
    let _ = organza_mesh::read_gltf(data, PLACEMENT, &none, &mut Budget::new(MAX_BYTES));
}

/// A picture in any format.
fn picture(data: &[u8]) {
    if let Ok((picture, _)) = organza_picture::decode(data, MAX_BYTES) {
        let count = u64::from(picture.size.x) * u64::from(picture.size.y);
        assert_eq!(picture.pixels.len() as u64, count);
    }
}

/// A BSDF on the Klems basis, as XML.
fn klems(data: &[u8]) {
    if let Ok(bsdf) = organza_measure::read_klems(&String::from_utf8_lossy(data)) {
        let _ = bsdf.pairs();
    }
}

/// A far-field table; also with a checksum that is right, so that what follows it is tried.
fn far_table(data: &[u8]) {
    use organza_surface::table::{read_table, sealed};
    let content = &data[..data.len().saturating_sub(32)];
    for bytes in [data.to_vec(), sealed(content.to_vec())] {
        if let Ok((table, _)) = read_table(&bytes) {
            let share = table.albedo(glam::Vec3::Z).max_component();
            assert!((0.0..=1.01).contains(&share), "{share}");
            let at = organza_scatter::Footprint::point(glam::Vec2::new(0.3, -0.2));
            let (w_out, w_in) = (glam::Vec3::Z, glam::Vec3::new(0.6, 0.0, -0.8));
            let value = organza_scatter::Surface::eval(&table, w_out, w_in, at);
            assert!(value.is_valid(), "{value:?}");
            let gap = organza_scatter::Surface::gap(&table, w_in, at);
            assert!((0.0..=1.0).contains(&gap), "{gap}");
        }
    }
}

/// Pairs of directions, directions, or measured values.
fn pairs(data: &[u8]) {
    let text = String::from_utf8_lossy(data);
    let _ = organza_measure::parse_pairs(&text);
    let _ = organza_measure::parse_incident(&text);
    let _ = organza_measure::parse_values(&text);
}

/// A scene file, as `organza info` reads it.
fn scene(data: &[u8]) {
    run(data, "scene.toml", "info scene.toml --quiet");
}

/// A fabric file, as `organza info` reads it.
fn fabric(data: &[u8]) {
    run(data, "fabric.toml", "info fabric.toml --quiet");
}

/// A checkpoint from which a render resumes: as it is, and as the records of one under a head that
/// is right, a line each.
fn checkpoint(data: &[u8]) {
    let scene = "[camera]\norigin_mm=[0,0,1]\ntarget_mm=[0,0,0]\nwidth_mm=1\nresolution=[2,2]\n";
    let _ = std::fs::write(folder().join("blank.toml"), scene);
    let work = Work {
        command: "render",
        key: "",
    };
    let mut sealed = Vec::new();
    let records = data.split(|&byte| byte == b'\n').map(<[u8]>::to_vec);
    let _ = Journal::write(&mut sealed, &work, records);
    for state in [data, &sealed] {
        let render = "render blank.toml -o out.exr --spp 1 --quiet --checkpoint state --resume";
        run(state, "state", render);
    }
}

/// A part of a picture that is to be merged.
fn part(data: &[u8]) {
    run(data, "part.exr", "merge part.exr -o all.exr --quiet");
}

/// A journal of numbers: as it is, and as a record under a head that is right. What can be opened
/// is found again when it is opened once more.
fn journal(data: &[u8]) {
    let work = Work {
        command: "fit",
        key: "search",
    };
    let path = folder().join("journal");
    let sealed = |out: &mut Vec<u8>| Journal::write(out, &work, [data.to_vec()]);
    for is_sealed in [false, true] {
        let mut bytes = data.to_vec();
        if is_sealed {
            bytes.clear();
            let _ = sealed(&mut bytes);
        }
        if std::fs::write(&path, bytes).is_err() {
            return;
        }
        let Ok(mut first) = NumberJournal::open(Some(&path), &work) else {
            continue;
        };
        let place = [0.5, f64::NAN];
        if first.has(&place) || first.once(&place, 1, || Ok(vec![2.0])).is_err() {
            continue;
        }
        drop(first);
        let again = NumberJournal::open(Some(&path), &work).expect("it was opened before");
        assert!(again.has(&place));
    }
}

/// Pictures of another program, of two pixels each.
fn peer(data: &[u8]) {
    let path = folder().join("peer.json");
    if std::fs::write(&path, data).is_err() {
        return;
    }
    let _ = organza_report::bench::Peer::read(&path, 2);
}

/// A connection to the live page: the bytes of requests to a session of its own. They are
/// answered, none of them reaches a file outside the folder, and the document stays one that
/// can be read.
fn view(data: &[u8]) {
    static DOCUMENT: OnceLock<Option<Document>> = OnceLock::new();
    let document = DOCUMENT.get_or_init(|| {
        let folder = folder().join("served");
        let draft = "[draft]\nweave = 'plain'\n[warp]\nper_cm = 20.0\n[weft]\nper_cm = 20.0\n";
        let wif = "[WIF]\n[TEXT]\nTitle=outside\n[WARP]\nThreads=2\n[WEFT]\nThreads=2\n\
                   [THREADING]\n1=1\n2=2\n[LIFTPLAN]\n1=1\n2=2\n";
        std::fs::create_dir_all(&folder).ok()?;
        std::fs::write(folder.join("fabric.toml"), draft).ok()?;
        std::fs::write(folder.join("inside.wif"), wif).ok()?;
        std::fs::write(folder.with_file_name("outside.wif"), wif).ok()?;
        organza_view::open(&folder.join("fabric.toml"), &[]).ok()
    });
    let document = document.as_ref().expect("the folder can be written");
    let session = Arc::new(Session::new(document.clone()));
    let patience = Patience {
        body: Duration::from_secs(1),
        news: Duration::ZERO,
        picture: Duration::ZERO,
    };
    let guard = Guard::with_token(1, "token");
    let answering = Arc::new(Answering::new(Arc::clone(&session), guard, patience));
    let answer = organza_view::talk(&answering, data).expect("the system has resources");
    assert!(answer.is_empty() || answer.starts_with(b"HTTP/1."));
    let document = session.document().0;
    session.change(&[]).expect("the document can be read");
    let fabric = document.fabrics[0].text.to_string();
    assert!(!fabric.contains("outside"), "{fabric}");
}

/// A folder of this process.
fn folder() -> PathBuf {
    let path = std::env::temp_dir().join(format!("organza-fuzz-{}", std::process::id()));
    let _ = std::fs::create_dir_all(&path);
    path
}

/// Runs the program in this process on a file that holds `data`; a name among
/// the arguments that has a dot or is the file's is put in the folder.
fn run(data: &[u8], name: &str, line: &str) {
    let folder = folder();
    if std::fs::write(folder.join(name), data).is_err() {
        return;
    }
    let placed = line.split(' ').map(|a| {
        if a == name || a.contains('.') {
            folder.join(a).into_os_string()
        } else {
            a.into()
        }
    });
    let _ = organza_cli::run(std::iter::once("organza".into()).chain(placed));
}
