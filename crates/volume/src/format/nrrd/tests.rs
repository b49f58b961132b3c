use super::*;

fn set(text: &str, data: &[u8]) -> Result<GridSet, Error> {
    let bytes = [text.as_bytes(), data].concat();
    let mut budget = Budget::new(1 << 20);
    read(&bytes, &mut budget)?.grid_set(&mut budget)
}

const OTHERS: &str = "NRRD0005\ntype: ushort\ndimension: 3\nsizes: 2 1 1\nendian: big\n\
    spacings: 0.5 1 2\nencoding: raw\n\n";

#[test]
fn arrays_of_others_are_read_and_damage_is_refused() {
    let read = set(OTHERS, &[0, 1, 1, 0]).unwrap();
    assert_eq!(read.sigma_t.data, [1.0, 256.0]);
    assert_eq!(read.sigma_t.bounds_mm.max, Vec3::new(1.0, 1.0, 2.0));
    assert!(read.sggx.is_none() && read.axes.is_none());
    let oriented = OTHERS.replace("sizes: 2 1 1", "sizes: 4 2 1 1").replace(
        "spacings: 0.5 1 2",
        "space directions: none (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)",
    );
    let read = set(&oriented, &[0; 16]).unwrap();
    assert_eq!(read.axes.unwrap().channels, 4);
    assert_eq!(read.sigma_t.bounds_mm.min, Vec3::splat(-0.5));
    for (from, to, words) in [
        ("NRRD0005", "NRDR0005", "begin"),
        ("ushort", "block", "type block"),
        ("sizes: 2 1 1", "sizes: 2 1", "axes"),
        ("sizes: 2 1 1", "sizes: 3 2 1 1", "3 values a cell"),
        ("sizes: 2 1 1", "sizes: 2 1 0", "cells"),
        (
            "sizes: 2 1 1",
            "sizes: 60000 60000 60000",
            "bytes are allowed",
        ),
        ("sizes: 2 1 1", "sizes: 20 1 1", "cut off"),
        ("raw", "bzip2", "encoding bzip2"),
        ("raw", "gzip", "cut off or damaged"),
        ("endian: big", "data file: x.raw", "another file"),
        ("spacings: 0.5 1 2", "spacings: 0.5 1 -2", "mirrored"),
    ] {
        let error = set(&OTHERS.replace(from, to), &[0, 1, 1, 0]);
        let error = error.err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains(words), "{to}: {error}");
    }
}
