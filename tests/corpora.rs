//! Every reader of files on every file of its corpus, whole and damaged: an
//! answer or an error, never a panic. The same entries run under a fuzzer, see
//! `fuzz/`.

#[path = "../fuzz/entries.rs"]
mod entries;

use organza_basis::PathRng;
use organza_testing::assert_contains;
use std::path::Path;

const SEED: u64 = 0x5eed;

/// Readers that answer within some ten microseconds.
const QUICK: &str =
    "curve_text bcc vol ovox nrrd ct_png ct_tiff vti obj ply gltf picture klems pairs wif vdb";

/// Damaged copies that a reader gets.
fn copies(reader: &str) -> u64 {
    match QUICK.split(' ').any(|quick| quick == reader) {
        true => organza_testing::sized(2_000, 100_000),
        false => organza_testing::sized(60, 20_000),
    }
}

/// A place in `0..n`.
fn below(n: usize, rng: &mut PathRng) -> usize {
    ((rng.unit() * n as f32) as usize).min(n.saturating_sub(1))
}

/// A copy with a few bytes changed, swapped about, repeated or cut.
fn damaged(bytes: &[u8], rng: &mut PathRng) -> Vec<u8> {
    const TELLING: [u8; 8] = [0, 1, 0x7f, 0x80, 0xff, b'-', b'9', b'\n'];
    let mut copy = bytes.to_vec();
    for _ in 0..=below(4, rng) {
        if copy.is_empty() {
            break;
        }
        let at = below(copy.len(), rng);
        let run = 1 + below(16.min(copy.len() - at), rng);
        match below(5, rng) {
            0 => copy[at] ^= 1 << below(8, rng),
            1 => copy[at] = TELLING[below(TELLING.len(), rng)],
            2 => copy.truncate(at),
            3 => drop(copy.drain(at..at + run)),
            _ => {
                let piece = copy[at..at + run].to_vec();
                let to = below(copy.len(), rng);
                copy.splice(to..to, piece);
            }
        }
    }
    copy
}

#[test]
fn no_file_of_any_corpus_panics_a_reader_whole_or_damaged() {
    let corpora = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus");
    for (stream, (name, read)) in entries::ALL.iter().enumerate() {
        let mut files: Vec<_> = std::fs::read_dir(corpora.join(name))
            .unwrap_or_else(|e| panic!("fuzz/corpus/{name}: {e}"))
            .map(|f| f.unwrap().path())
            .collect();
        files.sort();
        assert!(!files.is_empty(), "fuzz/corpus/{name} is empty");
        let each = copies(name) / files.len() as u64 + 1;
        for (i, file) in files.iter().enumerate() {
            let bytes = std::fs::read(file).unwrap();
            read(&bytes);
            for copy in 0..each {
                let index = copy + ((i as u64) << 32);
                let mut rng = PathRng::new(SEED, stream as u64, index);
                let bytes = damaged(&bytes, &mut rng);
                let read = std::panic::catch_unwind(|| read(&bytes));
                assert!(
                    read.is_ok(),
                    "{}: copy {copy} damaged with seed {SEED:#x}",
                    file.display()
                );
            }
        }
    }
}

/// Pictures of another program, as `organza bench --peer` reads them.
const PEER: &str = r#"{"pictures": [{"program": "other 1.0", "scene": "denim_30_front",
  "setup_s": 0.5, "render_s": 12.25, "memory_bytes": 1048576,
  "mean": [[0.25, 0.5, 0.125], [0.1, 0.2, 0.3]],
  "variance": [[1e-4, 2e-4, 0.0], [1e-5, 1e-5, 1e-5]]}]}"#;

/// What is read of another program has the pixels that were asked for, and no part of a file is read
/// as a whole one.
#[test]
fn pictures_of_another_program_are_whole() {
    let path = crate::program::folder("damaged-peers").join("peer.json");
    let read = |bytes: &[u8], pixels| {
        std::fs::write(&path, bytes).unwrap();
        organza_report::bench::Peer::read(&path, pixels).map(|pictures| pictures.len())
    };
    assert_eq!(read(PEER.as_bytes(), 2).unwrap(), 1);
    let message = read(PEER.as_bytes(), 3).unwrap_err().to_string();
    assert_contains(&message, "expected 3 pixels, found 2");
    for end in 0..PEER.len() {
        assert!(read(&PEER.as_bytes()[..end], 2).is_err(), "cut at {end}");
    }
}
