//! Volumes of every format, whole and damaged.
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use glam::UVec3;
use organza_basis::Budget;
use organza_scan::ScanError;
use organza_scan::input::png::PngSlices;
use organza_scan::input::raw::{RawLayout, RawSlices};
use organza_scan::input::stack::Stack;
use organza_scan::input::tiff::TiffSlices;
use organza_scan::input::vti::VtiSlices;
use organza_scan::input::{SampleType, Slices};
use std::io::{Cursor, Write};
use tiff::encoder::colortype::{Gray8, Gray16, Gray32Float, RGB8};
use tiff::encoder::{Compression as Packing, TiffEncoder};

const DIMS: [u32; 3] = [5, 4, 3];

/// The value of a voxel: all differ.
fn value(i: usize) -> u16 {
    300 + 7 * i as u16
}

fn values() -> Vec<u16> {
    (0..60).map(value).collect()
}

fn budget() -> Budget {
    Budget::new(64 << 20)
}

/// All slices, read backwards.
fn all(slices: &mut dyn Slices) -> Result<Vec<f32>, ScanError> {
    let shape = slices.shape();
    let mut out = vec![0.0; 60];
    for z in (0..shape.dims.z).rev() {
        slices.read(z, &mut out[20 * z as usize..][..20])?;
    }
    Ok(out)
}

fn assert_is_volume(slices: &mut dyn Slices, sample: SampleType) {
    let shape = slices.shape();
    assert_eq!((shape.dims, shape.sample), (UVec3::from(DIMS), sample));
    let got = all(slices).unwrap();
    for (i, v) in got.iter().enumerate() {
        let want = match sample {
            SampleType::U8 => f32::from(value(i) as u8),
            _ => f32::from(value(i)),
        };
        assert_eq!(*v, want, "{i}");
    }
}

fn tiff(sample: SampleType, packing: Packing) -> Vec<u8> {
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file)
        .unwrap()
        .with_compression(packing);
    for z in 0..3 {
        let v = &values()[20 * z..][..20];
        match sample {
            SampleType::U8 => {
                let v: Vec<u8> = v.iter().map(|x| *x as u8).collect();
                encoder.write_image::<Gray8>(5, 4, &v).unwrap();
            }
            SampleType::F32 => {
                let v: Vec<f32> = v.iter().map(|x| f32::from(*x)).collect();
                encoder.write_image::<Gray32Float>(5, 4, &v).unwrap();
            }
            _ => encoder.write_image::<Gray16>(5, 4, v).unwrap(),
        }
    }
    file.into_inner()
}

#[test]
fn tiff_pages_of_every_depth_are_slices() {
    for sample in [SampleType::U8, SampleType::U16, SampleType::F32] {
        for packing in [Packing::Uncompressed, Packing::Lzw, Packing::Packbits] {
            let file = Cursor::new(tiff(sample, packing));
            let mut slices = TiffSlices::new(file, &mut budget()).unwrap();
            assert_is_volume(&mut slices, sample);
        }
    }
}

fn tiff_error(bytes: Vec<u8>) -> String {
    let opened = TiffSlices::new(Cursor::new(bytes), &mut budget());
    match opened.and_then(|mut s| all(&mut s)) {
        Ok(_) => "none".into(),
        Err(e) => e.to_string(),
    }
}

#[test]
fn wrong_pages_are_named() {
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).unwrap();
    encoder.write_image::<Gray8>(5, 4, &[0; 20]).unwrap();
    encoder.write_image::<Gray8>(4, 4, &[0; 16]).unwrap();
    let words = tiff_error(file.into_inner());
    assert!(
        words.contains("page 2 is 4 x 4 of u8; the pages before are 5 x 4"),
        "{words}"
    );
    let mut file = Cursor::new(Vec::new());
    let mut encoder = TiffEncoder::new(&mut file).unwrap();
    encoder.write_image::<RGB8>(2, 1, &[0; 6]).unwrap();
    let words = tiff_error(file.into_inner());
    assert!(
        words.contains("page 1 holds colours of 3 x 8 bits; expected one value"),
        "{words}"
    );
    // Cut anywhere it is an error or the whole volume, and never a panic.
    let whole = tiff(SampleType::U16, Packing::Uncompressed);
    for cut in 0..whole.len() {
        let words = tiff_error(whole[..cut].to_vec());
        assert!(
            words.starts_with("not a usable TIFF file: "),
            "cut at {cut}: {words}"
        );
    }
    let small = TiffSlices::new(Cursor::new(whole), &mut Budget::new(1000));
    assert!(matches!(small.map(|_| ()), Err(ScanError::Budget(_))));
}

#[test]
fn raw_values_are_read_with_their_layout_and_other_lengths_are_refused() {
    for big_endian in [false, true] {
        let mut bytes = vec![9u8; 7];
        for v in values() {
            bytes.extend(if big_endian {
                v.to_be_bytes()
            } else {
                v.to_le_bytes()
            });
        }
        let layout = RawLayout {
            dims: DIMS.map(u64::from),
            sample: SampleType::U16,
            header_bytes: 7,
            big_endian,
        };
        let open =
            |bytes: &[u8]| RawSlices::new(Cursor::new(bytes.to_vec()), layout, &mut budget());
        assert_is_volume(&mut open(&bytes).unwrap(), SampleType::U16);
        let words = open(&bytes[1..]).map(|_| ()).unwrap_err().to_string();
        assert!(words.contains("make 127 bytes; it has 126"), "{words}");
    }
}

#[test]
fn stacks_take_one_slice_of_each_file_and_name_the_one_at_fault() {
    let page = |x: u32, z: usize| {
        let mut file = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut file).unwrap();
        let v: Vec<u16> = values()[20 * z..][..4 * x as usize].to_vec();
        encoder.write_image::<Gray16>(x, 4, &v).unwrap();
        file.into_inner()
    };
    let stack = |files: Vec<Vec<u8>>| {
        let names = (0..files.len()).map(|i| format!("s{i}.tif")).collect();
        let open = move |i: usize, budget: &mut Budget| {
            let opened = TiffSlices::new(Cursor::new(files[i].clone()), budget)?;
            Ok(Box::new(opened) as Box<dyn Slices>)
        };
        Stack::new(names, Box::new(open), &mut budget())
    };
    let mut good = stack(vec![page(5, 0), page(5, 1), page(5, 2)]).unwrap();
    assert_is_volume(&mut good, SampleType::U16);
    let mut mixed = stack(vec![page(5, 0), page(4, 1), page(5, 2)]).unwrap();
    let words = all(&mut mixed).unwrap_err().to_string();
    assert!(
        words.starts_with("s1.tif: is 4 x 4 x 1 of u16; the first slice, s0.tif, is 5 x 4"),
        "{words}"
    );
    let mut cut = stack(vec![page(5, 0), page(5, 1)[..60].to_vec()]).unwrap();
    let words = cut.read(1, &mut [0.0; 20]).unwrap_err().to_string();
    assert!(words.starts_with("s1.tif: not a usable TIFF"), "{words}");
}

/// The head and the tail of a file with this array.
fn vti(attributes: &str, array: &str, inside: &str, after: &[u8]) -> Vec<u8> {
    let mut file = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" {attributes}>\n\
         <ImageData WholeExtent=\"0 4 0 3 10 12\" Origin=\"0 0 0\" Spacing=\"0.5 0.5 0.25\">\n\
         <Piece Extent=\"0 4 0 3 10 12\">\n<PointData Scalars=\"grey\">\n\
         <DataArray type=\"Float32\" Name=\"other\" format=\"ascii\">0</DataArray>\n\
         <DataArray type=\"UInt16\" Name=\"grey\" {array}>{inside}</DataArray>\n\
         </PointData>\n</Piece>\n</ImageData>\n"
    )
    .into_bytes();
    file.extend(after);
    file.extend(b"\n</VTKFile>\n");
    file
}

fn little() -> Vec<u8> {
    values().iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Header and blocks of packed values, 50 bytes a block.
fn packed() -> (Vec<u8>, Vec<u8>) {
    let raw = little();
    let blocks: Vec<Vec<u8>> = raw
        .chunks(50)
        .map(|part| {
            let mut packing = ZlibEncoder::new(Vec::new(), Compression::default());
            packing.write_all(part).unwrap();
            packing.finish().unwrap()
        })
        .collect();
    let mut header: Vec<u64> = vec![blocks.len() as u64, 50, 20];
    header.extend(blocks.iter().map(|b| b.len() as u64));
    let header = header.iter().flat_map(|w| w.to_le_bytes()).collect();
    (header, blocks.concat())
}

/// Files of every encoding.
fn every_vti() -> Vec<(&'static str, Vec<u8>)> {
    let text: Vec<String> = values().iter().map(u16::to_string).collect();
    let mut plain = 120u32.to_le_bytes().to_vec();
    plain.extend(little());
    let mut wide = 120u64.to_be_bytes().to_vec();
    wide.extend(values().iter().flat_map(|v| v.to_be_bytes()));
    let (header, blocks) = packed();
    let appended = |attributes: &str, encoding: &str, before: &[u8], bytes: &[u8]| {
        let open = format!("<AppendedData encoding=\"{encoding}\">\n   _");
        let after = [open.as_bytes(), before, bytes, b"\n</AppendedData>"].concat();
        let place = format!("format=\"appended\" offset=\"{}\"", before.len());
        vti(attributes, &place, "", &after)
    };
    let zlib = "byte_order=\"LittleEndian\" header_type=\"UInt64\" \
                compressor=\"vtkZLibDataCompressor\"";
    let big = "byte_order=\"BigEndian\" header_type=\"UInt64\"";
    let encoded = STANDARD.encode(&header) + &STANDARD.encode(&blocks);
    let inline = format!("\n  {}\n", STANDARD.encode(&plain));
    vec![
        ("ascii", vti("", "format=\"ascii\"", &text.join(" "), b"")),
        ("inline", vti("", "format=\"binary\"", &inline, b"")),
        (
            "inline packed",
            vti(zlib, "format=\"binary\"", &encoded, b""),
        ),
        ("raw", appended("", "raw", b"abcd", &plain)),
        ("raw, wide and big", appended(big, "raw", b"", &wide)),
        (
            "raw packed",
            appended(zlib, "raw", b"", &[header, blocks].concat()),
        ),
        (
            "appended base64",
            appended("", "base64", b"", STANDARD.encode(&plain).as_bytes()),
        ),
        (
            "appended base64, packed",
            appended(zlib, "base64", b"", encoded.as_bytes()),
        ),
    ]
}

#[test]
fn vti_files_of_every_encoding_hold_the_same_volume() {
    for (name, file) in every_vti() {
        let opened = VtiSlices::new(Cursor::new(file.clone()), None, &mut budget());
        let mut slices = opened.unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_is_volume(&mut slices, SampleType::U16);
        let spacing = slices.shape().spacing.unwrap();
        assert_eq!(spacing.to_array(), [0.5, 0.5, 0.25]);
        // Cut anywhere before its values end it is an error.
        let end = file.len() - "\n</AppendedData>\n</VTKFile>\n".len() - 4;
        for cut in (0..end.min(file.len() - 120)).step_by(7) {
            let cut_file = Cursor::new(file[..cut].to_vec());
            let opened = VtiSlices::new(cut_file, None, &mut budget());
            let read = opened.and_then(|mut s| all(&mut s));
            assert!(read.is_err(), "{name} cut at {cut}");
        }
    }
}

#[test]
fn vti_files_that_cannot_be_used_say_why() {
    let error = |file: Vec<u8>, array: Option<&str>| {
        let opened = VtiSlices::new(Cursor::new(file), array, &mut budget());
        opened
            .and_then(|mut s| all(&mut s))
            .unwrap_err()
            .to_string()
    };
    let (_, good) = every_vti().remove(0);
    let text = String::from_utf8(good.clone()).unwrap();
    for (from, to, words) in [
        (
            "\"UInt16\"",
            "\"Float64\"",
            "`grey`: has values of Float64; expected UInt8",
        ),
        (
            "Spacing=\"0.5",
            "Spacing=\"-0.5",
            "Spacing: expected three positive numbers",
        ),
        (
            "WholeExtent=\"0 4",
            "WholeExtent=\"0 9",
            "is in several pieces",
        ),
        (
            "type=\"ImageData\"",
            "type=\"PolyData\"",
            "type: expected ImageData, found `PolyData`",
        ),
        ("300 ", "three ", "value 1: `three` is not a number"),
        ("300 ", "", "holds 59 values; expected 60"),
        (
            "Scalars=\"grey\"",
            "Scalars=\"gray\"",
            "has no array `gray`; did you mean `grey`?",
        ),
        ("Scalars=\"grey\"", "", "has several arrays: other, grey"),
        (
            "<VTKFile ",
            "<VTKFile byte_order=\"Middle\" ",
            "byte_order: expected LittleEndian",
        ),
    ] {
        let words_found = error(text.replacen(from, to, 1).into_bytes(), None);
        assert!(words_found.contains(words), "{words_found}");
    }
    let words = error(good, Some("other"));
    assert!(words.contains("holds 1 values; expected 60"), "{words}");
    // Headers that lie about blocks.
    let (_, file) = every_vti().remove(5);
    let at = file.windows(4).position(|w| w == b"   _").unwrap() + 4;
    for (word, value) in [(0, u64::MAX), (1, 1 << 40), (1, 0), (2, 70), (3, 1 << 50)] {
        let mut lie = file.clone();
        lie[at + 8 * word..][..8].copy_from_slice(&u64::to_le_bytes(value));
        assert!(
            error(lie, None).starts_with("not a usable .vti file: "),
            "{word} {value}"
        );
    }
}

/// A slice as PNG.
fn png(slice: usize, sample: SampleType, colour: png::ColorType, size: (u32, u32)) -> Vec<u8> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, size.0, size.1);
    encoder.set_color(colour);
    let v = &values()[20 * slice..][..20];
    let bytes: Vec<u8> = match sample {
        SampleType::U8 => v.iter().map(|x| *x as u8).collect(),
        _ => v.iter().flat_map(|x| x.to_be_bytes()).collect(),
    };
    encoder.set_depth(match sample {
        SampleType::U8 => png::BitDepth::Eight,
        _ => png::BitDepth::Sixteen,
    });
    let channels = colour.samples() * (size.0 * size.1) as usize * sample.bytes();
    let bytes: Vec<u8> = bytes.into_iter().cycle().take(channels).collect();
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&bytes).unwrap();
    writer.finish().unwrap();
    file
}

fn png_stack(files: Vec<Vec<u8>>) -> Result<Stack<'static>, ScanError> {
    let names = (0..files.len()).map(|i| format!("s{i}.png")).collect();
    let open = move |i: usize, budget: &mut Budget| {
        let slices = PngSlices::new(Cursor::new(files[i].clone()), budget)?;
        Ok(Box::new(slices) as Box<dyn Slices>)
    };
    Stack::new(names, Box::new(open), &mut budget())
}

#[test]
fn slices_of_png_keep_their_values() {
    let grey = png::ColorType::Grayscale;
    for sample in [SampleType::U8, SampleType::U16] {
        let files = (0..3).map(|z| png(z, sample, grey, (5, 4))).collect();
        assert_is_volume(&mut png_stack(files).unwrap(), sample);
    }
}

#[test]
fn slices_of_png_that_do_not_fit_are_refused() {
    let grey = png::ColorType::Grayscale;
    let good = || png(0, SampleType::U16, grey, (5, 4));
    let cut = good()[..good().len() - 20].to_vec();
    for (bad, words) in [
        (cut, "s2.png: not a usable PNG file"),
        (png(0, SampleType::U8, grey, (5, 4)), "is 5 x 4 x 1 of u8"),
        (png(0, SampleType::U16, grey, (4, 5)), "is 4 x 5 x 1 of u16"),
        (
            png(0, SampleType::U8, png::ColorType::Rgb, (5, 4)),
            "it holds Rgb of 8 bits; expected one grey value",
        ),
        (b"no picture".to_vec(), "s2.png: not a usable PNG file"),
    ] {
        let read = png_stack(vec![good(), good(), bad]).and_then(|mut s| all(&mut s));
        let why = read.unwrap_err().to_string();
        assert!(why.contains(words), "{why}");
    }
}
