//! A scan whose slices are files of PNG, through the program.

use crate::program::{complaint, folder, succeed};
use crate::scan::{GAUZE, gauze};
use organza_basis::Budget;
use organza_scan::input::Slices;
use organza_scan::input::tiff::TiffSlices;
use organza_volume::{Octree, ovox};
use std::io::Cursor;
use std::path::Path;

/// Writes grey values of 0 to 255 as a slice of 8 bits, or of 16 with the same values.
fn write_slice(path: &Path, values: &[f32], width: usize, depth: png::BitDepth) {
    let file = std::fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, width as u32, (values.len() / width) as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(depth);
    let bytes: Vec<u8> = match depth {
        png::BitDepth::Sixteen => values
            .iter()
            .flat_map(|v| (*v as u16).to_be_bytes())
            .collect(),
        _ => values.iter().map(|v| *v as u8).collect(),
    };
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&bytes).unwrap();
    writer.finish().unwrap();
}

/// Slices of the gauze that are scanned, from this one on. There are more than nine, so that their
/// names show whether they come by their numbers or by their letters.
const FIRST: u32 = 8;
const COUNT: u32 = 24;

/// Writes some slices of the gauze as `slices/s1.png`, `slices/s2.png` and so on, and all of them
/// as the values of `slices.raw`. Returns the last one, and its width.
fn write_gauze(folder: &Path, depth: png::BitDepth) -> (Vec<f32>, usize) {
    let file = Cursor::new(std::fs::read(gauze()).unwrap());
    let mut slices = TiffSlices::new(file, &mut Budget::new(1 << 30)).unwrap();
    let shape = slices.shape();
    let width = shape.dims.x as usize;
    let mut values = vec![0.0; shape.slice_len()];
    let mut raw = Vec::new();
    std::fs::create_dir_all(folder.join("slices")).unwrap();
    for z in 0..COUNT {
        slices.read(FIRST + z, &mut values).unwrap();
        let path = folder.join(format!("slices/s{}.png", z + 1));
        write_slice(&path, &values, width, depth);
        raw.extend(values.iter().map(|v| *v as u8));
    }
    std::fs::write(folder.join("slices.raw"), raw).unwrap();
    (values, width)
}

fn scan(folder: &Path, input: &str, outfile: &str) -> Octree {
    succeed(folder, &format!("{GAUZE} {input} -o {outfile}"));
    let bytes = std::fs::read(folder.join(outfile)).unwrap();
    let file = ovox::read(&mut &bytes[..], &mut Budget::new(1 << 30));
    file.unwrap().octree
}

/// Whether all finest voxels of two volumes hold the same.
fn are_same(a: &Octree, b: &Octree) -> bool {
    let mut same = a.dims(0) == b.dims(0) && a.occupied_voxels() == b.occupied_voxels();
    a.for_each_occupied(0, |cell| {
        same &= a.mixture(0, cell).as_slice() == b.mixture(0, cell).as_slice();
    });
    same
}

#[test]
fn a_folder_of_png_gives_the_volume_of_the_values() {
    let folder = folder("scan-png");
    let (last, width) = write_gauze(&folder, png::BitDepth::Eight);
    let size = format!("{width},{},{COUNT}", last.len() / width);
    let raw = format!("slices.raw --raw-type u8 --raw-size {size}");
    let values = scan(&folder, &raw, "values.ovox");
    assert!(values.occupied_voxels() > 10_000);
    assert!(are_same(&values, &scan(&folder, "slices", "eight.ovox")));
    write_gauze(&folder, png::BitDepth::Sixteen);
    assert!(are_same(&values, &scan(&folder, "slices", "sixteen.ovox")));
    // Known bad: two slices exchanged.
    let slices = folder.join("slices");
    std::fs::rename(slices.join("s9.png"), slices.join("kept")).unwrap();
    std::fs::rename(slices.join("s15.png"), slices.join("s9.png")).unwrap();
    std::fs::rename(slices.join("kept"), slices.join("s15.png")).unwrap();
    assert!(!are_same(
        &values,
        &scan(&folder, "slices", "exchanged.ovox")
    ));
}

#[test]
fn png_slices_of_mixed_sizes_or_depths_are_refused_by_name() {
    let folder = folder("scan-png-refused");
    let (last, width) = write_gauze(&folder, png::BitDepth::Eight);
    let slice = folder.join("slices/s12.png");
    let good = std::fs::read(&slice).unwrap();
    let command = format!("{GAUZE} slices -o x.ovox");
    let refused = |words: &str| {
        let said = complaint(&folder, &command);
        let named = said.contains("s12.png: ") && said.contains(words);
        assert!(named, "{words}: {said}");
        assert!(!folder.join("x.ovox").exists());
    };
    write_slice(&slice, &last[width..], width, png::BitDepth::Eight);
    refused(&format!(
        "is {width} x {} x 1 of u8",
        last.len() / width - 1
    ));
    write_slice(&slice, &last, width, png::BitDepth::Sixteen);
    refused("of u16");
    std::fs::write(&slice, &good[..good.len() / 2]).unwrap();
    refused("not a usable PNG file");
    // Nothing but this slice was wrong.
    std::fs::write(&slice, &good).unwrap();
    scan(&folder, "slices", "x.ovox");
}
