//! A scan whose slices are files of PNG, through the program.

use crate::program::{complaint, folder, succeed};
use crate::scan::{GAUZE, gauze_slices};
use organza_basis::Budget;
use organza_volume::{Octree, ovox};
use std::path::Path;

/// Writes a slice of 8 bits, or of 16 with the same values.
fn write_slice(path: &Path, values: &[u8], width: usize, depth: png::BitDepth) {
    let file = std::fs::File::create(path).unwrap();
    let mut encoder = png::Encoder::new(file, width as u32, (values.len() / width) as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(depth);
    let bytes = match depth {
        png::BitDepth::Sixteen => values.iter().flat_map(|v| [0, *v]).collect(),
        _ => values.to_vec(),
    };
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&bytes).unwrap();
    writer.finish().unwrap();
}

/// What is scanned of the gauze. There are more than nine slices, so that their names show whether
/// they come by their numbers or by their letters.
const SIZE: [usize; 3] = [56, 48, 16];

/// Writes slices of the gauze as `slices/s1.png`, `slices/s2.png` and so on, and all of them as
/// the values of `slices.raw`. Returns the last one.
fn write_gauze(folder: &Path, depth: png::BitDepth) -> Vec<u8> {
    let slices = gauze_slices(SIZE);
    std::fs::create_dir_all(folder.join("slices")).unwrap();
    for (z, values) in slices.iter().enumerate() {
        let path = folder.join(format!("slices/s{}.png", z + 1));
        write_slice(&path, values, SIZE[0], depth);
    }
    std::fs::write(folder.join("slices.raw"), slices.concat()).unwrap();
    slices.last().unwrap().clone()
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
    write_gauze(&folder, png::BitDepth::Eight);
    let [x, y, z] = SIZE;
    let raw = format!("slices.raw --raw-type u8 --raw-size {x},{y},{z}");
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
    let last = write_gauze(&folder, png::BitDepth::Eight);
    let [width, height, _] = SIZE;
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
    refused(&format!("is {width} x {} x 1 of u8", height - 1));
    write_slice(&slice, &last, width, png::BitDepth::Sixteen);
    refused("of u16");
    std::fs::write(&slice, &good[..good.len() / 2]).unwrap();
    refused("not a usable PNG file");
    // Nothing but this slice was wrong.
    std::fs::write(&slice, &good).unwrap();
    scan(&folder, "slices", "x.ovox");
}
